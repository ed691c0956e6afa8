"""The figures of a benchmark's data: what its truth, boxes and clips hold, counted. Pure.

Words are runs of letters and digits, joined by `'` or `-`, compared without case.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import log2

from pipeline.records import Kind, TrackBox, TruthHazard

WORD = re.compile(r"[^\W_]+(?:['’-][^\W_]+)*")
NO_LABEL = "no label"
MOST_COMMON = 15
# Words too common to say anything of a caption.
STOP_WORDS = frozenset(
    re.findall(
        r"\w+",
        """
        a about above across after against ahead all along alongside an and another any are around as at
        away back be because been before behind being below beside between both but by can close comes
        coming could did do does down during each for from front further had has have he her his in into is
        it its just left may more most moving near next no not of off on one onto or our out over own past
        right same she side so some than that the their them then there these they this those through to too
        toward towards two under until up us very was we were what when where which while who will with
        without would you your
        """,
    )
)


def words_of(text: str) -> list[str]:
    """The words of a text, in lower case."""
    return [word.casefold() for word in WORD.findall(text)]


@dataclass(frozen=True, slots=True)
class BoxFacts:
    """What the boxes of one video come to; frames are those with at least one box."""

    frames: int
    last_frame: int
    hazard_tracks: frozenset[str]
    traffic_tracks: frozenset[str]
    frames_of: Mapping[str, tuple[int, int]]
    proposed_tracks: frozenset[str] = frozenset()


def box_facts(rows: Iterable[TrackBox]) -> dict[str, BoxFacts]:
    """Video id -> the facts of its boxes; `frames_of` holds each track's first and last frame."""
    frames: dict[str, set[int]] = {}
    tracks: dict[str, dict[Kind, set[str]]] = {}
    spans: dict[str, dict[str, tuple[int, int]]] = {}
    for row in rows:
        frames.setdefault(row.video_id, set()).add(row.frame_index)
        kinds = tracks.setdefault(row.video_id, {kind: set() for kind in Kind})
        kinds[row.kind].add(row.track_id)
        of = spans.setdefault(row.video_id, {})
        low, high = of.get(row.track_id, (row.frame_index, row.frame_index))
        of[row.track_id] = (min(low, row.frame_index), max(high, row.frame_index))
    return {
        name: BoxFacts(
            len(found),
            max(found),
            frozenset(tracks[name][Kind.CHALLENGE]),
            frozenset(tracks[name][Kind.TRAFFIC]),
            spans[name],
            frozenset(tracks[name][Kind.PROPOSED]),
        )
        for name, found in frames.items()
    }


@dataclass(frozen=True, slots=True)
class TextFigures:
    """Descriptions counted: `lengths` are words -> how many descriptions; `common` leaves out stop words.

    `type_token_ratio` is distinct words over all words; the numbers are 0 when there is no description.
    """

    descriptions: int
    lengths: tuple[tuple[int, int], ...]
    mean_words: float
    median_words: float
    tokens: int
    vocabulary: int
    type_token_ratio: float
    common: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class LabelFigures:
    """Labels counted without case, most common first; `evenness` is entropy over its largest value, 0 to 1.

    `entropy_bits` is Shannon's, over hazards.
    """

    counts: tuple[tuple[str, int], ...]
    entropy_bits: float
    evenness: float
    singletons: int


@dataclass(frozen=True, slots=True)
class TruthFigures:
    """Videos, hazards, texts and labels of a truth."""

    videos: int
    hazards: int
    no_hazard_videos: int
    several_hazards: int
    with_track: int
    with_frames: int
    text: TextFigures
    labels: LabelFigures


def truth_figures(truth: Sequence[TruthHazard]) -> TruthFigures:
    """The figures of a truth."""
    hazards = [row for row in truth if not row.is_no_hazard]
    per_video = Counter(row.video_id for row in hazards)
    return TruthFigures(
        videos=len({row.video_id for row in truth}),
        hazards=len(hazards),
        no_hazard_videos=sum(row.is_no_hazard for row in truth),
        several_hazards=sum(count > 1 for count in per_video.values()),
        with_track=sum(row.track_id is not None for row in hazards),
        with_frames=sum(row.first_frame is not None and row.last_frame is not None for row in hazards),
        text=text_figures([row.description for row in hazards]),
        labels=label_figures([row.label for row in hazards]),
    )


def text_figures(texts: Sequence[str]) -> TextFigures:
    """Descriptions counted."""
    words = [words_of(text) for text in texts]
    lengths = sorted(map(len, words))
    counts = Counter(word for found in words for word in found)
    tokens, half = sum(lengths), len(lengths) // 2
    median = 0.0
    if lengths:
        median = float(lengths[half]) if len(lengths) % 2 else (lengths[half - 1] + lengths[half]) / 2
    telling = [(word, count) for word, count in counts.items() if word not in STOP_WORDS]
    return TextFigures(
        len(texts),
        tuple(sorted(Counter(lengths).items())),
        tokens / len(texts) if texts else 0.0,
        median,
        tokens,
        len(counts),
        len(counts) / tokens if tokens else 0.0,
        tuple(sorted(telling, key=_often)[:MOST_COMMON]),
    )


def label_figures(labels: Sequence[str]) -> LabelFigures:
    """Labels counted, one a hazard."""
    counts = Counter(label_key(label) or NO_LABEL for label in labels)
    shares = [count / len(labels) for count in counts.values()]
    entropy = -sum(share * log2(share) for share in shares) if len(counts) > 1 else 0.0
    return LabelFigures(
        tuple(sorted(counts.items(), key=_often)),
        entropy,
        entropy / log2(len(counts)) if len(counts) > 1 else 0.0,
        sum(count == 1 for count in counts.values()),
    )


def label_key(label: str) -> str:
    """A label without case and outer or double spaces."""
    return " ".join(label.casefold().split())


def _often(entry: tuple[str, int]) -> tuple[int, str]:
    return -entry[1], entry[0]


@dataclass(frozen=True, slots=True)
class ClipFigures:
    """Clips counted: `sizes` and `rates` are what is found -> how many clips, most common first."""

    clips: int
    unreadable: int
    seconds: float
    frames: int
    bytes: int
    sizes: tuple[tuple[str, int], ...]
    rates: tuple[tuple[str, int], ...]
    codecs: tuple[tuple[str, int], ...]


def clip_figures(clips: Iterable[tuple[bool, float, int, int, str, str, str]]) -> ClipFigures:
    """Counted from (readable, seconds, frames, bytes, size, rate, codec) of each clip."""
    rows = list(clips)
    good = [row for row in rows if row[0]]
    sizes, rates, codecs = (
        tuple(sorted(Counter(str(row[place]) for row in good if row[place]).items(), key=_often))
        for place in (4, 5, 6)
    )
    seconds, frames = sum(row[1] for row in good), sum(row[2] for row in good)
    return ClipFigures(
        len(rows), len(rows) - len(good), seconds, frames, sum(row[3] for row in rows), sizes, rates, codecs
    )
