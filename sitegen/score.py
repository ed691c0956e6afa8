"""The metrics: cosines in, scores out. Pure NumPy in float64; no model, no I/O.

Everything works on flat rows: P predictions and H truth hazards, each with the number of its
video in [0, N), both ascending; K pairs, one for every prediction and every hazard of its video,
ordered by prediction, then by hazard. A no-hazard video has no hazard rows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pipeline.scores import Scorecard, Signature, VideoScore

METRIC_VERSION = "1"

TOLERANCE = 1e-6
"""A similarity passes when it exceeds the threshold by more than this (ours).

The paper's rule is strict: exactly 0.80 does not pass. An fp32 embedding is right to about 1e-7,
so a cosine this close to the threshold cannot be told from one that equals it.
"""

_CHUNK_PAIRS = 1_024  # two chunks of gathered rows stay in the processor's cache

Real: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.int64]
Mask: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class VideoArrays:
    """`VideoScore`s as columns, each of shape (N,); similarities in [0, 1]."""

    n_predictions: Index
    n_hazards: Index
    n_hazards_found: Index
    best: Real
    worst: Real
    mean: Real
    besm: Real
    sam: Real
    detected: Mask

    def records(self, video_ids: Sequence[str]) -> tuple[VideoScore, ...]:
        """One record a video; `video_ids` names them in order, N of them."""
        columns = [getattr(self, name).tolist() for name in self.__slots__]
        return tuple(VideoScore(*row) for row in zip(video_ids, *columns, strict=True))


def unit_rows(vectors: NDArray[np.floating]) -> Real:
    """The rows (T, D) divided by their norm, in float64.

    An fp32 unit vector is one to 1e-7 only; this makes the cosine of a text with itself 1 to 1e-15.
    Raises ValueError when a row is zero or not finite: it has no direction.
    """
    rows = np.asarray(vectors, dtype=np.float64)
    norms = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    if not bool(np.all(np.isfinite(norms) & (norms > 0))):
        bad = int(np.flatnonzero(~(np.isfinite(norms) & (norms > 0)))[0])
        raise ValueError(f"vector {bad} has norm {norms[bad]}; expected a finite vector that is not zero")
    return np.asarray(rows / norms[:, np.newaxis])


def pair_rows(prediction_video: Index, hazard_video: Index, n_videos: int) -> tuple[Index, Index]:
    """The K pairs: which prediction (K,) meets which hazard (K,).

    `prediction_video` (P,) and `hazard_video` (H,) are ascending numbers in [0, n_videos).
    """
    hazards_of = np.bincount(hazard_video, minlength=n_videos)
    first_hazard = np.cumsum(hazards_of) - hazards_of
    repeats = hazards_of[prediction_video]
    pair_prediction = np.repeat(np.arange(len(prediction_video)), repeats)
    first_pair = np.cumsum(repeats) - repeats
    within = np.arange(len(pair_prediction)) - first_pair[pair_prediction]
    return pair_prediction, first_hazard[prediction_video[pair_prediction]] + within


def pair_cosines(units: Real, left: Index, right: Index) -> Real:
    """Cosines (K,) in [-1, 1] of rows `left` (K,) with rows `right` (K,) of the unit vectors (T, D).

    Gathers in chunks, so that memory stays bounded however many pairs there are.
    """
    cosines = np.empty(len(left), dtype=np.float64)
    for start in range(0, len(left), _CHUNK_PAIRS):
        part = slice(start, start + _CHUNK_PAIRS)
        np.einsum("ij,ij->i", units[left[part]], units[right[part]], out=cosines[part])
    return np.clip(cosines, -1.0, 1.0, out=cosines)


def similarities(cosines: Real) -> Real:
    """Cosines clipped pair by pair to [0, 1] (ours; the paper says 0 to 1), same shape. -0.0 becomes 0.0."""
    clipped = np.clip(cosines, 0.0, 1.0)
    clipped += 0.0  # which of two zeros is the least would depend on their order, which must not matter
    return clipped


def passes(similarity: Real, threshold: float) -> Mask:
    """Whether each similarity exceeds the threshold (paper: strictly), beyond rounding noise (ours)."""
    return np.asarray(similarity - threshold > TOLERANCE)


def score_pairs(
    cosines: Real, prediction_video: Index, hazard_video: Index, n_videos: int, threshold: float
) -> VideoArrays:
    """Scores of all N videos (paper, section on metrics; more than one hazard and none: ours).

    `cosines` (K,) in the order of `pair_rows(prediction_video, hazard_video, n_videos)`.
    Each prediction takes its best-matching hazard. BESM is (max + min) / 2 of these similarities
    (equal to the value when there is only one), SAM their mean, `detected` says that the best
    passes; a hazard is found when its best prediction passes. A hazard video without predictions
    has 0 everywhere; a no-hazard video has 1 and is detected when nothing was predicted, else 0.
    """
    pair_prediction, pair_hazard = pair_rows(prediction_video, hazard_video, n_videos)
    if cosines.shape != pair_prediction.shape:
        raise ValueError(f"cosines have shape {cosines.shape}; expected {pair_prediction.shape}")
    similarity = similarities(cosines)
    n_predictions = np.bincount(prediction_video, minlength=n_videos)
    n_hazards = np.bincount(hazard_video, minlength=n_videos)

    hazard_best = np.zeros(len(hazard_video))
    np.maximum.at(hazard_best, pair_hazard, similarity)
    found = hazard_video[passes(hazard_best, threshold)]

    # A prediction in a no-hazard video has no pair; `correct` below settles those videos.
    first_pair = _starts(pair_prediction)
    video = prediction_video[pair_prediction[first_pair]]
    value = np.maximum.reduceat(similarity, first_pair) if len(first_pair) else similarity
    if len(n_predictions) and n_predictions.max() > 2:
        # The last bit of a sum of three depends on their order, which must not matter.
        value = _sorted_within(value, video)

    best, worst, mean = np.zeros(n_videos), np.zeros(n_videos), np.zeros(n_videos)
    if len(value):
        starts = _starts(video)
        scored = video[starts]
        best[scored] = np.maximum.reduceat(value, starts)
        worst[scored] = np.minimum.reduceat(value, starts)
        mean[scored] = np.add.reduceat(value, starts) / n_predictions[scored]
    correct = (n_hazards == 0) & (n_predictions == 0)
    for column in (best, worst, mean):
        column[correct] = 1.0
    # The rounded mean of equal numbers can miss them by one bit.
    np.clip(mean, worst, best, out=mean)
    return VideoArrays(
        n_predictions=n_predictions,
        n_hazards=n_hazards,
        n_hazards_found=np.bincount(found, minlength=n_videos),
        best=best,
        worst=worst,
        mean=mean,
        besm=(best + worst) / 2,
        sam=mean.copy(),
        detected=correct | ((n_hazards > 0) & passes(best, threshold)),
    )


def score_video(video_id: str, cosines: Real, threshold: float) -> VideoScore:
    """`score_pairs` for one video; `cosines` (m, k): m predictions, k hazards, either may be 0."""
    m, k = cosines.shape
    rows = np.zeros(m, dtype=np.int64), np.zeros(k, dtype=np.int64)
    return score_pairs(np.asarray(cosines, dtype=np.float64).ravel(), *rows, 1, threshold).records(
        [video_id]
    )[0]


def scorecard(videos: VideoArrays | Sequence[VideoScore], signature: Signature) -> Scorecard:
    """The figures over all N videos of the truth; BESM and SAM are means over N (paper).

    `hazard_recall` (ours) is hazards found / all hazards. Raises ValueError when N is 0.
    """
    rows = videos if not isinstance(videos, VideoArrays) else videos.records([""] * len(videos.best))
    n = len(rows)
    if n == 0:
        raise ValueError("no videos: nothing to average over")
    hazards = sum(row.n_hazards for row in rows)
    return Scorecard(
        besm=math.fsum(row.besm for row in rows) / n,
        sam=math.fsum(row.sam for row in rows) / n,
        detection_rate=sum(row.detected for row in rows) / n,
        hazard_recall=sum(row.n_hazards_found for row in rows) / hazards if hazards else None,
        n_videos=n,
        signature=signature,
    )


def _sorted_within(values: Real, keys: Index) -> Real:
    """The values, ascending within each run of equal ascending `keys`.

    As `np.lexsort` orders them, but by plain sorts, which NumPy does with vector instructions.
    """
    order = np.argsort(values)
    rank = np.empty(len(values), dtype=np.int64)
    rank[order] = np.arange(len(values))
    return np.asarray(values[order][np.sort(keys * len(values) + rank) % len(values)])


def _starts(keys: Index) -> Index:
    """Where each run of equal keys begins in ascending `keys`."""
    return np.flatnonzero(np.concatenate(([True], keys[1:] != keys[:-1]))[: len(keys)])
