"""Probes against gaming: numbers beside the scores, never in them."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from pipeline.records import TruthHazard
from pipeline.scores import Submission
from sitegen import probe_words
from sitegen.copies import (
    Copy,
    NumberedCaptions,
    nearest_copies,
    number_captions,
    number_forms,
    over_runs,
    whole_blocks,
)
from sitegen.evaluate import TextVectors
from sitegen.language import N_
from sitegen.score import Index, Real, passes
from sitegen.words import shorten, visible

CONSTANT, WORD_BAG, SHUFFLED, STUFFING, NEAR_COPY, TRUTH_COPY = 0.5, 0.5, 0.9, 5.0, 0.8, 0.1
"""From where on each probe is remarkable; for stuffing: above which (ours)."""

EXCHANGED = 2_000
"""Videos up to which each has the captions of every other one in turn (ours)."""

_LEAST = 3  # videos or captions, from which on a share says something
_LEAST_SHUFFLED = 5
_LEAST_COPIES = 2
_BAG_WORDS = 4
_COPIED_WORDS = 4
_COMMON_WORDS = 50
_WORDS_A_VERB = 5
_NAME_CHARS = 40

_FUNCTION_TEXT = """a an the this that these those
about above across after against ahead along alongside among around as at before behind below
beneath beside between beyond by down during for from in inside into near next of off on onto out
outside over past since through to toward towards under until up upon via with within without
am are be been being is was were has have had do does did can could may might must shall should
will would
i me my we us our you your he him his she her it its they them their who whom whose which what
someone something nothing there here
and but if nor not or so than then when where while"""
_FUNCTION_WORDS = frozenset(_FUNCTION_TEXT.split())
_NO_VERBS = frozenset({"building", "ceiling", "evening", "morning", "railing", "speed", "weed"})


@dataclass(frozen=True, slots=True)
class Probe:
    """One probe of one system: what was measured, from where on it is remarkable, and a plain sentence.

    `kind` is `constant`, `word-bag`, `shuffled`, `stuffing`, `near-copy` or `truth-copy`; `value` is
    None when it cannot be said, since there are too few captions. No text quotes a caption, since
    that may be the truth's.
    """

    kind: str
    name: str
    value: float | None
    text: str
    threshold: float
    threshold_text: str
    flagged: bool
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class Exchange:
    """Scores over the V videos with a hazard, with their own captions and with those of others.

    `said` of the V videos have captions. BESM in [0, 1]; `detected` counts videos, on average.
    """

    videos: int
    said: int
    own_besm: float
    other_besm: float
    own_detected: float
    other_detected: float


def probe_board(
    submissions: Sequence[Submission], truth: Sequence[TruthHazard], vectors: TextVectors, threshold: float
) -> list[tuple[Probe, ...]]:
    """Six probes of each submission, in the order of the submissions.

    `vectors` holds every text of the submissions and the truth, `threshold` is that of detection.
    Raises KeyError for a text without a vector and for a video that the truth does not know.
    """
    number = {video_id: n for n, video_id in enumerate(sorted({hazard.video_id for hazard in truth}))}
    hazards = sorted(
        (hazard for hazard in truth if not hazard.is_no_hazard), key=attrgetter("video_id", "hazard_id")
    )
    forms, words = number_forms(vectors.row_of)
    hazard_video = np.array([number[hazard.video_id] for hazard in hazards], dtype=np.int64)
    hazard_text = vectors.rows(hazard.description for hazard in hazards)
    hazard_form = np.array([forms[hazard.description] for hazard in hazards], dtype=np.int64)
    bags = word_bags(words, hazard_form)
    long = np.array([len(words[form].split()) >= _COPIED_WORDS for form in hazard_form], dtype=np.bool_)
    board = [number_captions(submission, number, vectors, forms) for submission in submissions]
    copies = nearest_copies(board, vectors.units, len(number))
    names = [submission.name for submission in submissions]
    return [
        (
            _constant(captions),
            _word_bag(captions, bags),
            _shuffled(exchange(captions, hazard_video, hazard_text, vectors.units, threshold)),
            _stuffing(captions),
            _near_copy(captions, copy, names),
            _truth_copy(captions, hazard_video[long], hazard_form[long]),
        )
        for captions, copy in zip(board, copies, strict=True)
    ]


def is_bag(words: Sequence[str]) -> bool:
    """Whether plain words are strung together without a sentence (English; ours).

    At least four words, none of them an article, preposition, auxiliary, pronoun or conjunction, and
    fewer than one in five that ends like a verb (-ing, -ed). "deer crossing road" is headline style,
    "car road person truck debris" is a bag.
    """
    if len(words) < _BAG_WORDS or not _FUNCTION_WORDS.isdisjoint(words):
        return False
    verbs = sum(w.endswith(("ing", "ed")) and len(w) > 4 and w not in _NO_VERBS for w in words)
    return verbs * _WORDS_A_VERB < len(words)


def word_bags(words: Sequence[str], truth_forms: Collection[int]) -> Sequence[bool] | None:
    """Whether each of the plain texts is a bag of words that are mostly common in the truth.

    Mostly: at least half of them are among the 50 most common content words of the truth. None when
    half of the truth's own descriptions are bags: then it is not in sentences that this probe knows.
    """
    said = [words[form].split() for form in truth_forms]
    if said and sum(map(is_bag, said)) * 2 >= len(said):
        return None
    counts = Counter(w for one in said for w in one if w not in _FUNCTION_WORDS)
    ranked = sorted(counts, key=lambda word: (-counts[word], word))
    common = frozenset(ranked[:_COMMON_WORDS])
    split = (text.split() for text in words)
    return [is_bag(one) and sum(w in common for w in one) * 2 >= len(one) for one in split]


def exchange(
    captions: NumberedCaptions, hazard_video: Index, hazard_text: Index, units: Real, threshold: float
) -> Exchange:
    """BESM and detection of the videos with a hazard when each has the captions of another one.

    Each video is scored with the captions of every other one, and the mean is taken: this is what
    random shuffles that leave no video its own captions come to. Over `EXCHANGED` videos that is within
    groups of at most so many, drawn by a fixed seed, so that time grows with the videos and not with
    their square. `hazard_video` (H,) is ascending, `hazard_text` (H,) are rows of `units`. A video
    without captions scores 0.
    """
    videos = np.unique(hazard_video)
    mine = np.isin(captions.video, videos)
    # The same text twice in a video changes neither its best nor its worst.
    said = np.unique(captions.video[mine] * len(units) + captions.text[mine])
    video, text = said // max(len(units), 1), said % max(len(units), 1)
    n = len(videos)
    own_besm = own_detected = other_besm = other_detected = 0.0
    for group in _exchange_groups(videos):
        here, there = np.isin(video, group), np.isin(hazard_video, group)
        besm, detected = _exchanged(
            video[here], units[text[here]], hazard_video[there], units[hazard_text[there]], threshold
        )
        others = max(len(group) - 1, 1)
        own_besm += float(besm[1]) / max(n, 1)
        other_besm += float(besm[0] - besm[1]) / max(n, 1) / others
        own_detected += float(detected[1])
        other_detected += float(detected[0] - detected[1]) / others
    return Exchange(n, len(np.unique(video)), own_besm, other_besm, own_detected, other_detected)


def _exchange_groups(videos: Index) -> list[Index]:
    """The videos in as few groups as have at most `EXCHANGED` each, drawn by a fixed seed."""
    if len(videos) <= EXCHANGED:
        return [videos]
    drawn = np.random.default_rng(0).permutation(videos)
    return np.array_split(drawn, -(-len(videos) // EXCHANGED))


def _exchanged(
    video: Index, said: Real, hazard_video: Index, described: Real, threshold: float
) -> tuple[Real, Real]:
    """BESM and detected videos, each summed over all pairs of videos, and of each with itself: (2,)."""
    besm, detected = np.zeros(2), np.zeros(2)
    for rows, of_video in whole_blocks(video):
        vectors = said[rows].astype(np.float32)
        for hazards, of_hazard in whole_blocks(hazard_video):
            cosines = (vectors @ described[hazards].astype(np.float32).T).T
            # Each caption takes its best-matching hazard, as in the score.
            matched = np.ascontiguousarray(over_runs(np.maximum, cosines, of_hazard).T)
            best = np.clip(over_runs(np.maximum, matched, of_video), 0.0, 1.0).astype(np.float64)
            worst = np.clip(over_runs(np.minimum, matched, of_video), 0.0, 1.0)
            own = video[rows][of_video, np.newaxis] == hazard_video[hazards][of_hazard]
            both, found = (best + worst) / 2, passes(best, threshold)
            besm += both.sum(), both[own].sum()
            detected += found.sum(), found[own].sum()
    return besm, detected


def _constant(captions: NumberedCaptions) -> Probe:
    wanted = probe_words.from_share(CONSTANT, N_("from {share} of the videos"))
    parts = "constant", N_("Constant caption"), CONSTANT, wanted
    videos = len(np.unique(captions.video))
    if videos < _LEAST:
        return _unsaid(*parts, probe_words.few_videos(videos))
    pairs = np.unique(np.stack([captions.video, captions.form]), axis=1)
    most = int(np.bincount(pairs[1]).max())
    sentence = probe_words.most_common(most, videos)
    return _share(*parts, most / videos, most / videos >= CONSTANT, sentence)


def _word_bag(captions: NumberedCaptions, bags: Sequence[bool] | None) -> Probe:
    wanted = probe_words.from_share(WORD_BAG, N_("from {share} of the captions"))
    parts = "word-bag", N_("Bag of common words"), WORD_BAG, wanted
    total = len(captions.form)
    if bags is None:
        unknown = N_("The truth itself is not in English sentences, so this cannot be said.")
        return _unsaid(*parts, probe_words.said(unknown))
    if total < _LEAST:
        return _unsaid(*parts, probe_words.few_captions(total))
    count = sum(bags[form] for form in captions.form.tolist())
    return _share(*parts, count / total, count / total >= WORD_BAG, probe_words.bags(count, total))


def _shuffled(found: Exchange) -> Probe:
    wanted = probe_words.from_share(SHUFFLED, N_("from {share} of BESM"))
    parts = "shuffled", N_("Shuffled videos"), SHUFFLED, wanted
    if found.said < _LEAST_SHUFFLED:
        return _unsaid(*parts, probe_words.few_with_hazard(found.said))
    if found.own_besm <= 0:
        nothing = N_("BESM is 0 over the videos with a hazard, so nothing can be lost.")
        return _unsaid(*parts, probe_words.said(nothing))
    kept = found.other_besm / found.own_besm
    besm, detected = (found.other_besm, found.own_besm), (found.other_detected, found.own_detected)
    return _share(*parts, kept, kept >= SHUFFLED, probe_words.exchanged(besm, detected, found.videos))


def _stuffing(captions: NumberedCaptions) -> Probe:
    parts = "stuffing", N_("Many captions a video"), STUFFING, probe_words.over_captions(STUFFING)
    counts = np.unique(captions.video, return_counts=True)[1]
    if not len(counts):
        return _unsaid(*parts, probe_words.said(N_("There are no captions.")))
    mean = float(counts.mean())
    sentence = probe_words.captions_on_average(len(counts), mean, int(counts.max()))
    text = probe_words.captions_a_video(mean)
    return Probe(*parts[:2], mean, text, *parts[2:], mean > STUFFING, sentence)


def _near_copy(captions: NumberedCaptions, copy: Copy | None, names: Sequence[str]) -> Probe:
    wanted = probe_words.from_share(NEAR_COPY, N_("from {share} of the videos"))
    parts = "near-copy", N_("Near copy"), NEAR_COPY, wanted
    videos = len(np.unique(captions.video))
    if videos < _LEAST:
        return _unsaid(*parts, probe_words.few_videos(videos))
    if copy is None:
        return _unsaid(*parts, probe_words.said(N_("There is no other submission.")))
    name = shorten(visible(names[copy.other]), _NAME_CHARS)
    sentence = probe_words.same_captions(name, copy.same, copy.either)
    if not copy.same:
        sentence = probe_words.said(N_("In no video the same captions as another submission."))
    return _share(*parts, copy.share, copy.share >= NEAR_COPY, sentence)


def _truth_copy(captions: NumberedCaptions, hazard_video: Index, hazard_form: Index) -> Probe:
    wanted = probe_words.from_share_of_hazards(TRUTH_COPY, _LEAST_COPIES)
    parts = "truth-copy", N_("The truth's own words"), TRUTH_COPY, wanted
    total = len(hazard_form)
    if not len(captions.form):
        return _unsaid(*parts, probe_words.said(N_("There are no captions.")))
    if not total:
        return _unsaid(*parts, probe_words.no_long_truth(_COPIED_WORDS))
    said = set(zip(captions.video.tolist(), captions.form.tolist(), strict=True))
    pairs = zip(hazard_video.tolist(), hazard_form.tolist(), strict=True)
    count = sum(pair in said for pair in pairs)
    flagged = count >= _LEAST_COPIES and count / total >= TRUTH_COPY
    return _share(*parts, count / total, flagged, probe_words.exact_words(count, total))


def _share(
    kind: str, name: str, threshold: float, wanted: str, value: float, flagged: bool, sentence: str
) -> Probe:
    return Probe(kind, name, value, probe_words.share(value), threshold, wanted, flagged, sentence)


def _unsaid(kind: str, name: str, threshold: float, wanted: str, sentence: str) -> Probe:
    return Probe(kind, name, None, probe_words.said(N_("cannot be said")), threshold, wanted, False, sentence)
