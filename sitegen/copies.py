"""Captions as numbers, and which two submissions say the same in the same videos."""

import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import itemgetter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.predictions import Predictions
from pipeline.scores import Submission
from sitegen.evaluate import TextVectors
from sitegen.score import Index, Mask, Real

NEAR = 0.98
"""Captions with a larger cosine count as the same (ours)."""

MAX_COMPARED = 25
"""More captions than this in one video are compared by their words only, never by cosines."""

_BLOCK = 2_048  # captions: cosines of two blocks are 16 MB
_SHORT_RUN = 64

T = TypeVar("T", bound=np.generic)


class _Plain(dict[int, str | None]):
    """For str.translate: hidden characters vanish, punctuation, symbols and blanks become a blank."""

    def __missing__(self, code: int) -> str | None:
        category = unicodedata.category(chr(code))
        self[code] = None if category == "Cf" else " " if category[0] in "CPSZ" else chr(code)
        return self[code]


_PLAIN = _Plain()


def plain(text: str) -> str:
    """The words of a text: NFKC, without case, punctuation, symbols, hidden characters, extra blanks.

    A text of nothing but symbols comes back as it is.
    """
    folded = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())
    return " ".join(folded.translate(_PLAIN).split()) or folded


@dataclass(frozen=True, slots=True, eq=False)
class NumberedCaptions:
    """A submission's P captions by video, then rank; each column (P,).

    `video` counts the videos of the truth in the order of their ids, `text` is the row of the
    caption's vector, `form` the number of its `plain` words.
    """

    video: Index
    text: Index
    form: Index


@dataclass(frozen=True, slots=True)
class Copy:
    """The other submission (its place in the list) that says the same in `same` of `either` videos.

    `either` counts the videos in which one of the two or both have captions.
    """

    other: int
    same: int
    either: int

    @property
    def share(self) -> float:
        """`same` / `either`, in [0, 1]."""
        return self.same / self.either if self.either else 0.0


def number_forms(texts: Iterable[str]) -> tuple[dict[str, int], list[str]]:
    """The number of each text's `plain` words (equal words have equal numbers), and the words by number."""
    numbers: dict[str, int] = {}
    forms = {text: numbers.setdefault(plain(text), len(numbers)) for text in texts}
    return forms, list(numbers)


def number_captions(
    submission: Submission, number: Mapping[str, int], vectors: TextVectors, forms: Mapping[str, int]
) -> NumberedCaptions:
    """The captions of a submission; `number` counts the videos of the truth.

    Raises KeyError for a video or text that is not there.
    """
    rows = Predictions.of(submission.predictions)
    texts = rows.texts
    return NumberedCaptions(
        np.array([number[video] for video in rows.video_ids], dtype=np.int64)[rows.video.codes],
        vectors.rows(texts)[rows.description.codes],
        np.array([forms[text] for text in texts], dtype=np.int64)[rows.description.codes],
    )


def nearest_copies(board: Sequence[NumberedCaptions], units: Real, n_videos: int) -> list[Copy | None]:
    """For each of the S submissions the one that says the same in the largest share of videos.

    In a video two submissions say the same when each caption of either has a partner among the
    other's: equal in its plain words, or with a cosine over 0.98. Equal sets of words are found by
    number for all pairs at once; then each video's captions are compared by cosine, every pair of
    submissions, unless one of them has more than 25 captions there. So memory is bounded, and time
    grows with the square of the captions of one video only. The first of equals is named. A
    submission without captions, or alone, has None.
    """
    if len(board) < 2:
        return [None] * len(board)
    sets = _set_numbers(board, n_videos)
    same = np.array([((sets == row) & (row > 0)).sum(axis=1) for row in sets], dtype=np.int64)
    for systems, also in _near_in_videos(board, sets, units):
        same[np.ix_(systems, systems)] += also
    says = (sets > 0).astype(np.float64)
    counts, both = says.sum(axis=1), says @ says.T
    either = counts[:, np.newaxis] + counts - both
    share = np.divide(same, either, out=np.full(same.shape, -1.0), where=either > 0)
    np.fill_diagonal(share, -2.0)
    found: list[Copy | None] = []
    for system, count in enumerate(counts):
        other = int(share[system].argmax())
        pair = Copy(other, int(same[system, other]), int(either[system, other]))
        found.append(pair if count else None)
    return found


def _set_numbers(board: Sequence[NumberedCaptions], n_videos: int) -> Index:
    """A number for each set of forms, (S, N); 0 where a submission has no caption."""
    sets = np.zeros((len(board), n_videos), dtype=np.int64)
    known: dict[frozenset[int], int] = {}
    for system, captions in enumerate(board):
        pairs = zip(captions.video.tolist(), captions.form.tolist(), strict=True)
        for video, rows in groupby(pairs, key=itemgetter(0)):
            forms = frozenset(form for _, form in rows)
            sets[system, video] = known.setdefault(forms, len(known) + 1)
    return sets


def _near_in_videos(
    board: Sequence[NumberedCaptions], sets: Index, units: Real
) -> Iterator[tuple[Index, Mask]]:
    """For each video the submissions compared (s,), and which of them say the same (s, s), by cosine.

    Pairs with equal sets of words are left out, since they are counted already.
    """
    system = np.repeat(np.arange(len(board)), [len(captions.video) for captions in board])
    video, text, form = (
        np.concatenate([getattr(one, name) for one in board]) for name in NumberedCaptions.__slots__
    )
    # Each text once in a video of a submission; sorted by video, then by submission.
    _, first = np.unique((video * len(board) + system) * len(units) + text, return_index=True)
    system, video, text, form = (column[first] for column in (system, video, text, form))
    for begin, end in _runs(video):
        here = system[begin:end]
        few = begin + np.flatnonzero(np.bincount(here)[here] <= MAX_COMPARED)
        systems = np.unique(system[few])
        if len(systems) < 2:
            continue
        covers = _covers(system[few], units[text[few]].astype(np.float32), form[few])
        numbers = sets[systems, video[begin]]
        yield systems, covers & covers.T & (numbers[:, np.newaxis] != numbers)


def _covers(system: Index, vectors: NDArray[np.float32], form: Index) -> Mask:
    """Whether each caption of submission a has a partner of submission b: (s, s) by a, then b.

    The rows are captions, sorted by submission.
    """
    blocks = list(whole_blocks(system))
    columns = []
    for b, starts_b in blocks:
        rows = []
        for a, starts_a in blocks:
            near = vectors[b] @ vectors[a].T > NEAR
            near |= form[b, np.newaxis] == form[a]
            partner = over_runs(np.logical_or, near, starts_b)
            rows.append(over_runs(np.logical_and, np.ascontiguousarray(partner.T), starts_a))
        columns.append(np.concatenate(rows))
    return np.concatenate(columns, axis=1)


def over_runs(function: np.ufunc, values: NDArray[T], starts: Index) -> NDArray[T]:
    """`function` over each run of rows of `values` (n, m) that begins at `starts`: (runs, m).

    The same as `function.reduceat(values, starts)`; where runs are short, row by row of all runs at
    once, which takes a tenth of the time.
    """
    lengths = np.diff(starts, append=len(values))
    longest = int(lengths.max(initial=0))
    if longest > _SHORT_RUN:
        return np.asarray(function.reduceat(values, starts, axis=0))
    found = values if longest <= 1 else values[starts]
    for place in range(1, longest):
        longer = np.flatnonzero(lengths > place)
        found[longer] = function(found[longer], values[starts[longer] + place])
    return found


def whole_blocks(keys: Index) -> Iterator[tuple[slice, Index]]:
    """Ascending `keys` in blocks of whole runs, 2,048 rows and the rest of a run long at most.

    Gives the rows of each block and where its runs begin in it.
    """
    starts = np.array([first for first, _ in _runs(keys)], dtype=np.int64)
    block = np.unique(np.searchsorted(starts, np.arange(0, len(keys), _BLOCK), side="right") - 1)
    for begin, end in pairwise([*starts[block].tolist(), len(keys)]):
        yield slice(begin, end), starts[(starts >= begin) & (starts < end)] - begin


def _runs(keys: Index) -> list[tuple[int, int]]:
    """Where each run of equal keys begins and ends in ascending `keys`."""
    edges = np.flatnonzero(np.diff(keys)) + 1
    bounds = [0, *edges.tolist(), len(keys)] if len(keys) else [0]
    return list(pairwise(bounds))
