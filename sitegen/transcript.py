"""What every stage of a system said about a video, and how its verification went."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from pipeline.records import Exclusion, Kind, Match, Parse, Snippet, Stage, StageOutput, TrackBox
from sitegen.figure2 import Figure2, figure2
from sitegen.gathered import Records, System, VideoMedia
from sitegen.language import N_, whole
from sitegen.language import gettext as _
from sitegen.numerals import plural, score
from sitegen.sayings import exclusion
from sitegen.thumbnails import snippet_pictures
from sitegen.video_contexts import Saying, StageView, TrackCheck, Transcript
from sitegen.words import shorten, visible

STAGES: dict[Stage, tuple[str, str]] = {
    Stage.SCENE: (N_("Scene descriptions"), N_("Track 1: what the vision agent saw in each keyframe")),
    Stage.RHS: (N_("Ranked Hazards Set"), N_("Track 1: hazards in those descriptions, most hazardous first")),
    Stage.ANSWER: (N_("Video answers"), N_("Track 2: the objects on the road, asked again and again")),
    Stage.CHUNKS: (N_("Noun chunks"), N_("Track 2: the nouns in each answer")),
    Stage.AES: (N_("All Elements Set"), N_("Track 2: the best list of elements")),
    Stage.COS: (N_("Critical Object Set"), N_("Cross-reference: ranked hazards that both tracks know")),
    Stage.AOS: (N_("Anomalous Object Set"), N_("Anomaly: the hazards that are the final captions")),
}
PARSES: dict[Parse, str] = {
    Parse.JSON: N_("json"),
    Parse.LITERAL: N_("literal"),
    Parse.LINES: N_("lines"),
    Parse.COMMAS: N_("commas"),
    Parse.PROSE: N_("prose"),
    Parse.EMPTY: N_("empty"),
    Parse.FAILED: N_("failed"),
}
"""How an answer was turned into items, in a word."""

_MAX_REPLY = 4_000
_MAX_LABELS = 6


def transcript(
    system: System, video_id: str, boxes: Sequence[TrackBox], media: VideoMedia
) -> Transcript | None:
    """The records of a system on a video, or None when it left none."""
    records = system.records.get(video_id)
    if records is None:
        return None
    error = records.outcome.error if records.outcome else ""
    if not (records.stages or records.snippets or error):
        return None
    hazards = {box.track_id for box in boxes if box.kind is Kind.CHALLENGE}
    by_stage: dict[Stage, list[StageOutput]] = {}
    for output in records.stages:
        by_stage.setdefault(output.stage, []).append(output)
    stages = tuple(_stage(stage, by_stage[stage]) for stage in STAGES if stage in by_stage)
    proposed = {s.track_box.track_id for s in records.snippets if s.track_box.kind is Kind.PROPOSED}
    tracks = _tracks(records.snippets, records.matches, hazards, proposed)
    counted = sum(snippet.excluded is None for snippet in records.snippets)
    summary = _("{calls} in {stages}").format(
        calls=_calls(len(records.stages)), stages=plural(len(stages), "{n} stage", "{n} stages")
    )
    if records.snippets:
        verified = _("{n} of {snippets} verified")
        summary += ", " + verified.format(n=whole(counted), snippets=_snippets(len(records.snippets)))
    return Transcript(
        system.slug,
        visible(system.name),
        summary,
        stages,
        tracks,
        _tracks_summary(records.snippets),
        visible(error),
        _figure(records, media),
    )


def _figure(records: Records, media: VideoMedia) -> Figure2 | None:
    """The paper's figure 2; of the snippets that nothing was compared with, no picture is needed."""
    compared = {(match.track_id, match.frame_index) for match in records.matches}
    snippets = [
        snippet
        for snippet in records.snippets
        if (snippet.track_box.track_id, snippet.track_box.frame_index) in compared
    ]
    pictures = snippet_pictures(media, snippets)
    return figure2(records.stages, records.snippets, records.matches, pictures)


def _stage(stage: Stage, outputs: Sequence[StageOutput]) -> StageView:
    name, meaning = STAGES[stage]
    models = dict.fromkeys(output.reply.model for output in outputs)
    prompts = dict.fromkeys(output.prompt_id for output in outputs if output.prompt_id)
    return StageView(
        str(stage),
        _(name),
        _(meaning),
        visible(", ".join(models)),
        visible(", ".join(prompts)),
        _calls(len(outputs)),
        tuple(_saying(list(run)) for _, run in groupby(outputs, lambda o: (o.reply.text, o.items, o.parse))),
    )


def _saying(run: Sequence[StageOutput]) -> Saying:
    first, last = run[0], run[-1]
    if first.frame_index is not None:
        where = _("frame {n}").format(n=first.frame_index)
        if last.frame_index != first.frame_index:
            where = _("frames {first}–{last}").format(first=first.frame_index, last=last.frame_index)
    else:
        where = _("call {n}").format(n=first.call + 1)
        if last.call != first.call:
            where = _("calls {first}–{last}").format(first=first.call + 1, last=last.call + 1)
    reply = visible(shorten(first.reply.text, _MAX_REPLY))
    said = first.items
    if len(said) == 1:
        spoken = first.reply.text.strip()
        forms = (spoken, spoken.rstrip("."))
        if said[0].label in forms or said[0].description in forms:
            said = ()
    items = tuple(
        (visible(item.label), "" if item.description == item.label else visible(item.description))
        for item in said
    )
    return Saying(where, f"×{len(run)}" if len(run) > 1 else "", items, reply, _(PARSES[first.parse]))


def _tracks(
    snippets: Iterable[Snippet], matches: Iterable[Match], hazards: set[str], proposed: set[str]
) -> tuple[TrackCheck, ...]:
    by_track: dict[str, list[Snippet]] = {}
    for snippet in snippets:
        by_track.setdefault(snippet.track_box.track_id, []).append(snippet)
    found: dict[str, list[Match]] = {}
    for match in matches:
        found.setdefault(match.track_id, []).append(match)
    order = sorted(by_track, key=lambda track: (track not in hazards, track not in found, track))
    return tuple(
        _track(track, by_track[track], found.get(track, []), track in hazards, track in proposed)
        for track in order
    )


def _track(
    track: str, snippets: Sequence[Snippet], matches: Sequence[Match], hazard: bool, proposed: bool
) -> TrackCheck:
    reasons = Counter(snippet.excluded for snippet in snippets if snippet.excluded is not None)
    counted = len(snippets) - reasons.total()
    best = max(matches, key=lambda match: (match.cosine, match.label), default=None)
    detected = Counter(match.label for match in matches if match.detected)
    anomalous = dict.fromkeys(match.label for match in matches if match.detected and match.in_aos)
    return TrackCheck(
        shorten(visible(track), 24),
        hazard,
        _("{n} of {total}").format(n=counted, total=len(snippets)),
        _reasons(reasons),
        shorten(visible(best.label), 60) if best else "",
        score(best.cosine, digits=3) if best else None,
        ", ".join(f"{shorten(visible(n), 40)} ×{c}" for n, c in detected.most_common(_MAX_LABELS)),
        ", ".join(shorten(visible(label), 60) for label in anomalous),
        proposed and not hazard,
    )


def _tracks_summary(snippets: Sequence[Snippet]) -> str:
    if not snippets:
        return ""
    reasons = Counter(snippet.excluded for snippet in snippets if snippet.excluded is not None)
    text = _("{snippets} considered, {n} compared; none left out.")
    if reasons:
        text = _("{snippets} considered, {n} compared; left out: {reasons}.")
    compared = whole(len(snippets) - reasons.total())
    return text.format(snippets=_snippets(len(snippets)), n=compared, reasons=_reasons(reasons))


def _reasons(reasons: Mapping[Exclusion, int]) -> str:
    """How many snippets were left out for each reason."""
    return ", ".join(f"{whole(reasons[one])} {exclusion(one)}" for one in Exclusion if reasons.get(one))


def _calls(count: int) -> str:
    return plural(count, "{n} call", "{n} calls")


def _snippets(count: int) -> str:
    return plural(count, "{n} snippet", "{n} snippets")
