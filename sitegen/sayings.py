"""What the steps of a run said about a video, as texts with the place where each stands."""

from collections import Counter
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

from pipeline.records import Exclusion, Kind, Prediction, Stage, StageOutput, TruthHazard
from sitegen.gathered import Records
from sitegen.language import N_, ngettext, whole
from sitegen.language import gettext as _
from sitegen.numerals import plural
from sitegen.words import shorten, visible

EXCLUSIONS: dict[Exclusion, str] = {
    Exclusion.TOO_NARROW: N_("too narrow"),
    Exclusion.TOO_LOW: N_("too low"),
    Exclusion.AREA_TOO_SMALL: N_("area too small"),
    Exclusion.OUTSIDE_FRAME: N_("outside the frame"),
}

_QUOTE_CHARS = 80
_LISTED = 3


class Step(StrEnum):
    """The steps at which a hazard can be lost, in their order; `ELEMENTS` (AES) is told, not counted."""

    SEEN = "seen"
    RANKED = "ranked"
    ELEMENTS = "elements"
    MERGED = "merged"
    ANOMALOUS = "anomalous"


_LISTS = {
    Step.RANKED: Stage.RHS,
    Step.ELEMENTS: Stage.AES,
    Step.MERGED: Stage.COS,
    Step.ANOMALOUS: Stage.AOS,
}


class Saying(NamedTuple):
    """A text, and a clause that quotes some of its words: "Frame 24 speaks of {words}"."""

    where: str
    text: str

    def quoting(self, words: str) -> str:
        """The clause with these words of the text in quotation marks."""
        return self.where.replace("{words}", quoted(words))


def exclusion(reason: Exclusion) -> str:
    """Why a snippet was left out, in words."""
    return _(EXCLUSIONS[reason])


def quoted(text: str, limit: int = _QUOTE_CHARS) -> str:
    """A text from outside in quotation marks, made visible and cut to `limit` characters."""
    return f"“{shorten(visible(text), limit)}”"


def of_caption(prediction: Prediction) -> Saying:
    """A caption with its label."""
    return Saying(
        _("Caption {n} names {words}").format(n=prediction.rank, words="{words}"),
        _both(prediction.label, prediction.description),
    )


def sayings(records: Records | None, step: Step) -> tuple[Saying, ...] | None:
    """What was said at a step, each text once; None when it is not recorded.

    A list that had to be repaired is what the last answer gave. The scene descriptions and the answers
    of Track 2 count as they were given, before anything is parsed.
    """
    outputs = records.stages if records else ()
    if step is Step.SEEN:
        seen = [output for output in outputs if output.stage in {Stage.SCENE, Stage.ANSWER}]
        texts: dict[str, str] = {}
        for output in sorted(seen, key=lambda output: (output.stage is Stage.ANSWER, output.call)):
            texts.setdefault(output.reply.text, _place(output))
        return tuple(Saying(where, text) for text, where in texts.items()) if seen else None
    final = _final(outputs, _LISTS[step])
    if final is None:
        return None
    name = _LISTS[step].upper()
    return tuple(
        Saying(
            _("The {list} names, at rank {n}, {words}").format(list=name, n=item.rank, words="{words}"),
            _both(item.label, item.description),
        )
        for item in final.items
    )


def is_recorded(records: Records | None, step: Step) -> bool:
    """Whether it is known what a step said."""
    stages = {Stage.SCENE, Stage.ANSWER} if step is Step.SEEN else {_LISTS[step]}
    return any(output.stage in stages for output in (records.stages if records else ()))


def counted(records: Records) -> str:
    """How much was said before the first list: "25 scene descriptions and 20 video answers"."""
    stages = Counter(output.stage for output in records.stages)
    scenes = plural(stages[Stage.SCENE], "{n} scene description", "{n} scene descriptions")
    answers = plural(stages[Stage.ANSWER], "{n} video answer", "{n} video answers")
    if stages[Stage.SCENE] and stages[Stage.ANSWER]:
        return _("{scenes} and {answers}").format(scenes=scenes, answers=answers)
    return scenes if stages[Stage.SCENE] else answers


def instead(records: Records, step: Step) -> str:
    """What the list of a step holds, for a sentence on what it does not: "the RHS names only “car”"."""
    final = _final(records.stages, _LISTS[step])
    name = _LISTS[step].upper()
    if final is None or not final.items:
        return _("the {list} is empty").format(list=name)
    names = [quoted(item.label or item.description, 40) for item in final.items]
    named = ", ".join(names[:_LISTED])
    if len(names) > _LISTED:
        named = _("{names} and {n} more").format(names=named, n=len(names) - _LISTED)
    return _("the {list} names only {names}").format(list=name, names=named)


def too_small(records: Records | None, hazard: TruthHazard, others: Sequence[TruthHazard]) -> str:
    """That all snippets of the hazard were left out for their size, as a clause; empty when it is not so.

    The hazard's snippets are those of the track that the truth names, else those of the challenge
    tracks that belong to no other hazard of the video. Snippets outside the frame show nothing and
    do not count.
    """
    taken = {other.track_id for other in others if other.hazard_id != hazard.hazard_id}
    mine = [
        snippet
        for snippet in (records.snippets if records else ())
        if snippet.excluded is not Exclusion.OUTSIDE_FRAME
        and (
            snippet.track_box.track_id == hazard.track_id
            if hazard.track_id is not None
            else snippet.track_box.kind is Kind.CHALLENGE and snippet.track_box.track_id not in taken
        )
    ]
    reasons = Counter(snippet.excluded for snippet in mine)
    if not mine or None in reasons:
        return ""
    tracks = sorted({snippet.track_box.track_id for snippet in mine})
    named = ", ".join(shorten(visible(track), 24) for track in tracks[:_LISTED])
    why = ", ".join(f"{whole(reasons[one])} {exclusion(one)}" for one in Exclusion if reasons[one])
    return ngettext(
        "the only snippet of track {tracks} was left out for the size: {reasons}",
        "all {n} snippets of track {tracks} were left out for the size: {reasons}",
        len(mine),
    ).format(n=whole(len(mine)), tracks=named, reasons=why)


def _both(label: str | None, description: str) -> str:
    return ". ".join(filter(None, (label, description if description != label else "")))


def _place(output: StageOutput) -> str:
    if output.stage is Stage.ANSWER:
        return _("Video answer {n} speaks of {words}").format(n=output.call + 1, words="{words}")
    text = _("The description of frame {n} speaks of {words}")
    return text.format(n=output.frame_index, words="{words}")


def _final(outputs: Sequence[StageOutput], stage: Stage) -> StageOutput | None:
    of_stage = [output for output in outputs if output.stage is stage]
    return max(of_stage, key=lambda output: output.call, default=None)
