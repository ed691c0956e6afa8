"""The page of one video: its pictures, its truth, and every system's words against it."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from operator import attrgetter

from pipeline.records import Kind, TrackBox, TruthHazard
from pipeline.scores import VideoScore
from sitegen.contexts import Fact, Link, Shell
from sitegen.failures import Blame, Failure, FailureKind, meaning_of, name_of
from sitegen.gathered import SiteData, System, VideoMedia
from sitegen.language import fixed, said_again, whole
from sitegen.language import gettext as _
from sitegen.numerals import number, score, seconds
from sitegen.page_restoration import restored_href
from sitegen.verdicts import best_pairs, cosine_score, title_of, verdict
from sitegen.video_contexts import (
    CaptionView,
    CropView,
    FailureView,
    MatrixRow,
    Result,
    SystemView,
    Transcript,
    TruthView,
    VideoPage,
)
from sitegen.video_film import chips, film, label_px, named_track, proposer, track_labels, tracks_text
from sitegen.words import difference, shorten, visible


@dataclass(frozen=True, slots=True)
class Place:
    """Where a video stands among all: its neighbours, and "3 of 12"."""

    before: Link | None
    after: Link | None
    text: str


def video_page(
    data: SiteData,
    video_id: str,
    shell: Shell,
    transcripts: Sequence[Transcript],
    place: Place,
) -> VideoPage:
    """The context of a video's page."""
    truth = data.truth[video_id]
    media = data.media[video_id]
    boxes = data.boxes.get(video_id, ())
    hazards = [hazard for hazard in truth if not hazard.is_no_hazard]
    labels = track_labels(hazards)
    frames = film(media, boxes, labels, hidden=data.hidden)
    tracks = chips(boxes, labels)
    truth_views = tuple(_truth_view(hazard) for hazard in hazards)
    recorded = {made.slug for made in transcripts}
    unrecorded = [visible(system.name) for system in data.systems if system.slug not in recorded]
    return VideoPage(
        shell=shell,
        video_id=visible(video_id),
        hidden=data.hidden,
        heading=visible(video_id if data.hidden else title_of(truth)),
        facts=_facts(data, media, boxes),
        truth=truth_views,
        problem=visible(_(media.problem)),
        note=visible(media.note),
        width=media.width_px,
        height=media.height_px,
        frames=frames,
        cover=frames[media.cover] if frames else None,
        clip=media.clip,
        restored=restored_href(data, video_id),
        tracks=tracks if any(frame.boxes for frame in frames) else (),
        tracks_text=tracks_text(tracks, data.proposed_by),
        crops=_crops(data, video_id, media, labels),
        systems=tuple(_system_view(data, system, video_id, hazards, transcripts) for system in data.systems),
        matrix_columns=truth_views,
        matrix=_matrix(data, video_id, hazards),
        transcripts=tuple(transcripts),
        unrecorded=", ".join(unrecorded),
        threshold=fixed(data.settings.threshold, 2),
        threshold_share=round(data.settings.threshold * 100),
        label_px=number(label_px(media)),
        previous=place.before,
        following=place.after,
        place=place.text,
        proposed=_proposed(boxes, data.proposed_by),
    )


def _proposed(boxes: Sequence[TrackBox], proposed_by: str) -> str:
    """That tracks are proposals, as two sentences; empty where all are annotated."""
    if all(box.kind is not Kind.PROPOSED for box in boxes):
        return ""
    return _(
        "The tracks are proposals, found by {proposer}: nobody annotated them. "
        "Some are of nothing, and some things on the road have none."
    ).format(proposer=proposer(proposed_by))


def _facts(data: SiteData, media: VideoMedia, boxes: Sequence[TrackBox]) -> tuple[Fact, ...]:
    facts = []
    if media.frame_count:
        length = seconds(media.frame_count / media.fps_hz) if media.fps_hz else _("unknown")
        facts = [
            Fact(_("Length"), length),
            Fact(
                _("Frames"),
                _("{n} at {rate} per second").format(n=whole(media.frame_count), rate=f"{media.fps_hz:g}"),
            ),
            Fact(_("Size"), f"{media.width_px} × {media.height_px} px"),
        ]
    facts.append(Fact(_("Keyframes"), str(len(media.frames))))
    if not data.hidden:
        facts.append(Fact(_("Tracks on them"), tracks_text(chips(boxes, {}), data.proposed_by)))
    return tuple(facts)


def _truth_view(hazard: TruthHazard) -> TruthView:
    where = []
    if hazard.track_id:
        where.append(_("track {track}").format(track=visible(hazard.track_id)))
    if hazard.first_frame is not None and hazard.last_frame is not None:
        where.append(_("frames {first} to {last}").format(first=hazard.first_frame, last=hazard.last_frame))
    return TruthView(
        visible(hazard.hazard_id), visible(hazard.label), visible(hazard.description), ", ".join(where)
    )


def _crops(
    data: SiteData, video_id: str, media: VideoMedia, labels: Mapping[str, str]
) -> tuple[CropView, ...]:
    """Crops of hazard tracks, and of those that a system's verification took for its hazard."""
    seen: dict[str, list[str]] = {}
    blamed: set[str] = set()
    for system in data.systems:
        records = system.records.get(video_id)
        best: dict[str, tuple[float, str]] = {}
        for match in records.matches if records else ():
            best[match.track_id] = max(best.get(match.track_id, (-2.0, "")), (match.cosine, match.label))
            if match.detected and match.in_aos:
                blamed.add(match.track_id)
        for track_id, (cosine, label) in best.items():
            line = f"{visible(system.name)}: {shorten(visible(label), 40)} ({fixed(cosine, 2)})"
            seen.setdefault(track_id, []).append(line)
    views = []
    shown: set[str] = set()
    for crop in media.crops:
        hazard = crop.kind is Kind.CHALLENGE
        if not hazard and crop.track_id not in blamed:
            continue
        alt = _("Traffic track {track}, cut from frame {n}")
        if crop.kind is Kind.PROPOSED:
            alt = _("Proposed track {track}, cut from frame {n}")
        if hazard:
            alt = _("Hazard track {track}, cut from frame {n}")
        first = crop.track_id not in shown
        shown.add(crop.track_id)
        views.append(
            CropView(
                crop.path,
                crop.picture_width_px,
                crop.picture_height_px,
                alt.format(track=named_track(crop.track_id, labels), n=crop.frame_index),
                visible(crop.track_id),
                shorten(visible(crop.track_id), 24),
                hazard,
                crop.frame_index,
                f"{crop.width_px} × {crop.height_px} px",
                tuple(seen.get(crop.track_id, ())) if first else (),
                crop.kind is Kind.PROPOSED,
            )
        )
    return tuple(sorted(views, key=lambda view: not view.hazard))


def _system_view(
    data: SiteData,
    system: System,
    video_id: str,
    hazards: Sequence[TruthHazard],
    transcripts: Sequence[Transcript],
) -> SystemView:
    blame = None if data.hidden else system.blame
    failures = _failures(blame, video_id) if blame else []
    wrong = {f.prediction_rank: f for f in failures if f.hazard_id is None}
    best = best_pairs(system, video_id)
    words = {hazard.hazard_id: hazard.description for hazard in hazards}
    captions = []
    for row in system.predictions.get(video_id, []):
        pair = best.get(row.rank)
        text = visible(row.description)
        fault = wrong.get(row.rank)
        captions.append(
            CaptionView(
                row.rank,
                visible(row.label or ""),
                text,
                ", ".join(visible(track) for track in row.track_ids),
                visible(pair.hazard_id) if pair else "",
                cosine_score(pair, data.settings.threshold) if pair else None,
                "" if pair or data.hidden else _("The truth has no hazard here: a false alarm."),
                name_of(fault.kind) if fault else "",
                meaning_of(fault.kind) if fault else "",
                difference(visible(words[pair.hazard_id]), text) if pair else (),
            )
        )
    empty = _("This system said nothing here.")
    if not data.hidden:
        right = _("This system described no hazard here, which is right.")
        silent = _("This system described no hazard here; the video counts as 0 for it.")
        empty = silent if hazards else right
    return SystemView(
        system.slug,
        visible(system.name),
        visible(said_again(system.agents)),
        system.is_baseline,
        None if data.hidden else _result(system.scores[video_id]),
        tuple(captions),
        empty,
        _fates(system, video_id, hazards, failures, transcripts) if blame else (),
    )


def _failures(blame: Blame, video_id: str) -> list[Failure]:
    """The failures on this video; those of a system are sorted by video."""
    key = attrgetter("video_id")
    start = bisect_left(blame.failures, video_id, key=key)
    return list(takewhile(lambda failure: key(failure) == video_id, blame.failures[start:]))


def _fates(
    system: System,
    video_id: str,
    hazards: Sequence[TruthHazard],
    failures: Sequence[Failure],
    transcripts: Sequence[Transcript],
) -> tuple[FailureView, ...]:
    lost = {failure.hazard_id: failure for failure in failures if failure.hazard_id is not None}
    stages: dict[str, str] = {}
    for made in transcripts:
        if made.slug == system.slug:
            stages = {stage.code: stage.name for stage in made.stages}
            stages |= {"verify": _("Verification")} if made.tracks_summary else {}
    views = []
    for hazard in hazards:
        name = visible(hazard.label) or shorten(visible(hazard.description), 40)
        similar = [p.similarity for p in system.pairs.get(video_id, ()) if p.hazard_id == hazard.hazard_id]
        best = score(max(similar)).text if similar else ""
        failure = lost.get(hazard.hazard_id)
        if failure is None:
            views.append(FailureView(name, True, best, "", "", "", ""))
            continue
        place, title = _where_lost(system.slug, failure, stages)
        evidence = visible(failure.evidence)
        views.append(FailureView(name, False, best, name_of(failure.kind), evidence, place, title))
    return tuple(views)


_LOST_AT = {
    FailureKind.NOT_SEEN: "scene",
    FailureKind.NOT_RANKED: "rhs",
    FailureKind.LOST_IN_MERGING: "cos",
    FailureKind.NOT_ANOMALOUS: "aos",
    FailureKind.TOO_SMALL: "verify",
}
"""The stage, by the code that its place on the page has, that shows a failure."""


def _where_lost(slug: str, failure: Failure, stages: Mapping[str, str]) -> tuple[str, str]:
    """The id and the name of the place on the page where a failure shows, or empty texts."""
    code = _LOST_AT.get(failure.kind, "")
    if code in stages:
        return f"{slug}-{code}", stages[code]
    if failure.prediction_rank is not None:
        return f"{slug}-caption-{failure.prediction_rank}", _("Caption {n}").format(n=failure.prediction_rank)
    return "", ""


def _result(video: VideoScore) -> Result:
    kind, text = verdict(video)
    return Result(score(video.besm), score(video.sam), kind, text)


def _matrix(data: SiteData, video_id: str, hazards: Sequence[TruthHazard]) -> tuple[MatrixRow, ...]:
    rows = []
    order = [hazard.hazard_id for hazard in hazards]
    if not order:
        return ()
    for system in data.systems:
        pairs = {(p.prediction_rank, p.hazard_id): p for p in system.pairs.get(video_id, ())}
        best = best_pairs(system, video_id)
        predictions = system.predictions.get(video_id, [])
        for place, row in enumerate(predictions):
            cells = [cosine_score(pairs[row.rank, hazard], data.settings.threshold) for hazard in order]
            rows.append(
                MatrixRow(
                    visible(system.name),
                    place == 0,
                    len(predictions),
                    row.rank,
                    shorten(visible(row.description), 160),
                    tuple(cells),
                    order.index(best[row.rank].hazard_id),
                )
            )
    return tuple(rows)
