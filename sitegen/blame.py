"""Where each hazard of the truth was lost, and which captions speak of none (paper, section on failures).

A hazard that no caption finds has exactly one failure, the first of these that holds:

1. near miss: its best similarity is at most 0.10 under the threshold;
2. it is named by a caption, or by the AOS, of which the captions are made:
   a. too small: no snippet of it was compared, since all of them are under the size limits. The paper's
      order puts this before the words: nothing ties the caption to the hazard's track. It is never the
      cause for what the AOS does not name, since no stage before the verification looks at snippets;
   b. other words: else;
3. nothing said: the stages are not recorded;
4. not seen, not ranked, lost in merging, not anomalous: the step after the last one that mentions it.
   Without Track 2 there is no merging: the AOS follows the RHS.

A hazard that one step drops and a later one brings back was not lost there: a hazard that is alive at a step
is alive at all before. Near misses and what a caption mentions are alive up to the AOS. So the funnel never
rises, and where every stage is recorded each of its drops is the number of hazards with those failures:
not seen, not ranked, lost in merging, not anomalous, and the three of 1 and 2.

A caption that neither passes nor is near and mentions no hazard of its video is a wrong object while a hazard
of the video is not found, else an extra; where there is no hazard every caption is an extra. "Mentions"
is the rule in `mentions.py`, which knows the kind of a thing, but not which of several it is.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter

from pipeline.interfaces import Embedder
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Evaluation, PairScore
from sitegen.failures import NEAR_MISS, Blame, Failure, FailureKind, FunnelStep
from sitegen.gathered import Records, System
from sitegen.language import fixed
from sitegen.language import gettext as _
from sitegen.mentions import Mentions, Question
from sitegen.sayings import (
    Saying,
    Step,
    counted,
    instead,
    is_recorded,
    of_caption,
    quoted,
    sayings,
    too_small,
)
from sitegen.score import TOLERANCE


@dataclass(frozen=True, slots=True, eq=False)
class BlameInput:
    """A scored submission and its records by video id; a `System` serves as well."""

    evaluation: Evaluation
    records: Mapping[str, Records] = field(default_factory=dict)


_EVIDENCE_CHARS = 120

_LOST_AT = {
    Step.SEEN: FailureKind.NOT_SEEN,
    Step.RANKED: FailureKind.NOT_RANKED,
    Step.MERGED: FailureKind.LOST_IN_MERGING,
    Step.ANOMALOUS: FailureKind.NOT_ANOMALOUS,
}
_STEPS = tuple(_LOST_AT)


@dataclass(slots=True, eq=False)
class _Lost:
    """A hazard that is not found, with the sentences' beginnings that say who names it.

    `caption` is the caption that names it best, `said` what each step has of it.
    """

    hazard: TruthHazard
    others: Sequence[TruthHazard]
    all_records: Mapping[str, Records]
    best: PairScore | None
    is_near: bool
    caption: tuple[PairScore, str] | None = None
    said: dict[Step, str] = field(default_factory=dict)
    _heard: dict[Step, tuple[Saying, ...] | None] = field(default_factory=dict)

    @property
    def records(self) -> Records | None:
        """The records of its video, which may have to be read from a file."""
        return self.all_records.get(self.hazard.video_id)

    @property
    def heard(self) -> dict[Step, tuple[Saying, ...] | None]:
        """What was said at each step; kept, since one step after the other is asked of all hazards."""
        if not self._heard:
            self._heard = {step: sayings(self.records, step) for step in Step}
        return self._heard

    @property
    def is_named(self) -> bool:
        """Whether it was still alive at the end."""
        return self.is_near or self.caption is not None or Step.ANOMALOUS in self.said

    @property
    def depth(self) -> int:
        """How many of the four steps it is known to have passed."""
        if self.is_named:
            return len(_STEPS)
        return max((place for place, step in enumerate(_STEPS, start=1) if step in self.said), default=0)


@dataclass(slots=True, eq=False)
class _Caption:
    """A caption with its pairs; `names` are the hazards that it mentions."""

    prediction: Prediction
    hazards: Sequence[TruthHazard]
    pairs: Mapping[str, PairScore]
    best: float
    names: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True, eq=False)
class _Sheet:
    """What is asked of one system: the hazards it did not find, and all its captions."""

    records: Mapping[str, Records]
    n_hazards: int
    lost: dict[tuple[str, str], _Lost]
    captions: tuple[_Caption, ...]


def blame_board(
    systems: Sequence[BlameInput | System], truth: Iterable[TruthHazard], embedder: Embedder, threshold: float
) -> list[Blame]:
    """The failures of every system, in the order of the systems; see the module for what they mean.

    `threshold` in [0, 1] is that of the detection. Everything that must be compared is embedded in a few
    calls for the whole board, and what a later step answers is not asked of an earlier one. Raises
    KeyError for a caption of a video that the truth does not know, OutsideError as `embed_all` does.
    """
    hazards: dict[str, list[TruthHazard]] = {}
    for row in sorted(truth, key=attrgetter("video_id", "hazard_id")):
        hazards.setdefault(row.video_id, []).extend([] if row.is_no_hazard else [row])
    sheets = [_sheet(system, hazards, threshold) for system in systems]
    mentions = Mentions(embedder)
    _ask_captions(mentions, sheets, threshold)
    lost = [one for sheet in sheets for one in sheet.lost.values()]
    for step in reversed(_STEPS):
        _ask(mentions, [one for one in lost if one.depth == 0], step)
    _ask(mentions, [one for one in lost if _lost_at(one) is Step.MERGED], Step.ELEMENTS)
    return [_blame(sheet, threshold) for sheet in sheets]


def _sheet(
    system: BlameInput | System, hazards: Mapping[str, Sequence[TruthHazard]], threshold: float
) -> _Sheet:
    pairs: dict[tuple[str, int], dict[str, PairScore]] = {}
    best: dict[tuple[str, str], PairScore] = {}
    for pair in sorted(system.evaluation.pairs, key=attrgetter("video_id", "prediction_rank")):
        pairs.setdefault((pair.video_id, pair.prediction_rank), {})[pair.hazard_id] = pair
        held = best.get((pair.video_id, pair.hazard_id))
        if held is None or pair.similarity > held.similarity:
            best[pair.video_id, pair.hazard_id] = pair
    lost = {}
    for rows in hazards.values():
        for row in rows:
            found = best.get((row.video_id, row.hazard_id))
            if not _passes(found, threshold):
                near = _passes(found, threshold - NEAR_MISS)
                lost[row.video_id, row.hazard_id] = _Lost(row, rows, system.records, found, near)
    captions = []
    for prediction in system.evaluation.submission.predictions:
        mine = pairs.get((prediction.video_id, prediction.rank), {})
        highest = max((pair.similarity for pair in mine.values()), default=0.0)
        captions.append(_Caption(prediction, hazards[prediction.video_id], mine, highest))
    return _Sheet(system.records, sum(map(len, hazards.values())), lost, tuple(captions))


def _ask_captions(mentions: Mentions, sheets: Sequence[_Sheet], threshold: float) -> None:
    """Which hazards the captions mention, where that matters: the hazard is lost, or the caption is off."""
    asked = []
    for sheet in sheets:
        for caption in sheet.captions:
            for hazard in caption.hazards:
                one = sheet.lost.get((hazard.video_id, hazard.hazard_id))
                if _is_off(caption, threshold) or (one and not one.is_near):
                    asked.append((caption, hazard, one, of_caption(caption.prediction)))
    questions = [Question((said.text,), h.label, h.description) for _, h, _, said in asked]
    for (caption, hazard, one, said), hit in zip(asked, mentions.first(questions), strict=True):
        if hit is None:
            continue
        caption.names.add(hazard.hazard_id)
        pair = caption.pairs[hazard.hazard_id]
        if one and (one.caption is None or _rank(pair) < _rank(one.caption[0])):
            one.caption = pair, said.quoting(hit.words)


def _ask(mentions: Mentions, lost: Iterable[_Lost], step: Step) -> None:
    """Which of the hazards a step mentions; its first likely words are noted."""
    asked = [(one, said) for one in lost if (said := one.heard[step])]
    questions = [
        Question(tuple(text for _, text in said), one.hazard.label, one.hazard.description)
        for one, said in asked
    ]
    for (one, said), hit in zip(asked, mentions.first(questions), strict=True):
        if hit is not None:
            one.said[step] = said[hit.text].quoting(hit.words)


def _lost_at(one: _Lost) -> Step | None:
    """The first recorded step after the last one that mentions a hazard; None when none is recorded."""
    return next((step for step in _STEPS[one.depth :] if one.heard[step] is not None), None)


def _blame(sheet: _Sheet, threshold: float) -> Blame:
    failures = [_of_hazard(one, threshold) for one in sheet.lost.values()]
    failures += [
        _of_caption(caption, sheet)
        for caption in sheet.captions
        if not caption.names and _is_off(caption, threshold)
    ]
    failures.sort(key=lambda f: (f.video_id, f.hazard_id is None, f.hazard_id or "", f.prediction_rank or 0))
    funnel = [FunnelStep("truth", sheet.n_hazards)]
    for place, step in enumerate(_STEPS):
        alive = sheet.n_hazards - sum(one.depth <= place for one in sheet.lost.values())
        known = any(is_recorded(records, step) for records in sheet.records.values())
        funnel.append(FunnelStep(str(step), alive if known else None))
    funnel.append(FunnelStep("matched", sheet.n_hazards - len(sheet.lost)))
    return Blame(tuple(failures), tuple(funnel))


def _of_hazard(one: _Lost, threshold: float) -> Failure:
    rank = None
    if one.is_near and one.best:
        kind, rank = FailureKind.NEAR_MISS, one.best.prediction_rank
        text = _("Caption {n} comes to {similarity}; more than {threshold} is needed.")
        evidence = text.format(
            n=rank, similarity=fixed(one.best.similarity, 4), threshold=fixed(threshold, 2)
        )
    elif one.is_named:
        rank = one.caption[0].prediction_rank if one.caption else None
        small = too_small(one.records, one.hazard, one.others)
        kind = FailureKind.TOO_SMALL if small else FailureKind.OTHER_WORDS
        evidence = _named_evidence(one, small, threshold)
    else:
        step = _lost_at(one)
        kind = _LOST_AT[step] if step else FailureKind.NOTHING_SAID
        evidence = _lost_evidence(one, step)
    similarity = one.best.similarity if one.best else 0.0
    known = bool(one.records and one.records.stages)
    hazard = one.hazard
    return Failure(kind, hazard.video_id, hazard.hazard_id, rank, similarity, evidence, known)


def _named_evidence(one: _Lost, small: str, threshold: float) -> str:
    if one.caption:
        pair, words = one.caption
        score = _("similarity {similarity}; more than {threshold} is needed").format(
            similarity=fixed(pair.similarity, 4), threshold=fixed(threshold, 2)
        )
    else:
        words, score = one.said[Step.ANOMALOUS], _("no caption does")
    text = _("{said}, but {snippets} ({score}).") if small else _("{said}: {score}.")
    return text.format(said=words, snippets=small, score=score)


def _lost_evidence(one: _Lost, step: Step | None) -> str:
    before = next((one.said[s] for s in reversed(_STEPS) if s in one.said), "")
    if one.records is None or step is None:
        error = one.records.outcome.error if one.records and one.records.outcome else ""
        reason = _("what became of it is not recorded")
        if error:
            reason = _("the run failed: {error}").format(error=quoted(error))
        before = before or _("No caption mentions it")
        return _("{said}; {more}.").format(said=before, more=reason)
    if step is Step.SEEN:
        return _("None of {counts} mentions it.").format(counts=counted(one.records))
    lists = instead(one.records, step)
    if not before:
        return _("Where the record begins it is not there: {lists}.").format(lists=lists)
    if step is Step.MERGED and is_recorded(one.records, Step.ELEMENTS):
        text = _("{said}; the AES does not name it")
        if Step.ELEMENTS in one.said:
            text = _("{said}; the AES names it too")
        before = text.format(said=before)
    return _("{said}; {more}.").format(said=before, more=lists)


def _of_caption(caption: _Caption, sheet: _Sheet) -> Failure:
    prediction = caption.prediction
    lost = [h for h in caption.hazards if (h.video_id, h.hazard_id) in sheet.lost]
    kind, names = FailureKind.EXTRA, ""
    if lost:
        kind = FailureKind.WRONG_OBJECT
        two = list(dict.fromkeys(quoted(h.label or h.description, 40) for h in lost[:2]))
        names = _("{one} or {other}").format(one=two[0], other=two[1]) if len(two) > 1 else two[0]
        text = _("Caption {n}, {words}, does not mention {names}, which is not found.")
    elif caption.hazards:
        text = _("Caption {n}, {words}, mentions no hazard of the video; all are found.")
    else:
        text = _("Caption {n}, {words}, speaks of a hazard where there is none.")
    words = quoted(prediction.description, _EVIDENCE_CHARS)
    evidence = text.format(n=prediction.rank, words=words, names=names)
    records = sheet.records.get(prediction.video_id)
    known = bool(records and records.stages)
    return Failure(kind, prediction.video_id, None, prediction.rank, caption.best, evidence, known)


def _passes(pair: PairScore | None, threshold: float) -> bool:
    """As `score.passes`, for one pair; a hazard without any caption does not pass."""
    return pair is not None and pair.similarity - threshold > TOLERANCE


def _is_off(caption: _Caption, threshold: float) -> bool:
    """Whether a caption is not even a near miss."""
    return not caption.best - (threshold - NEAR_MISS) > TOLERANCE


def _rank(pair: PairScore) -> tuple[float, int]:
    return -pair.similarity, pair.prediction_rank
