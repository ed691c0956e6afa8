"""How sure a score is: bootstrap intervals over videos, and bands of systems that cannot be told apart.

The videos are drawn with replacement, as often as there are videos, and every system is scored on
the same draws (Efron 1979; for system scores Koehn 2004). Two systems are told apart by paired
approximate randomisation: in every video chance decides which of the two scores belongs to which
system (Noreen 1989; Riezler and Maxwell 2005). Seeds, 95 % and bands are ours.

Every per-video score is first rounded to a binary grid so fine that no sum of them is rounded: a
number then depends neither on the order of the systems, nor on which others are there, nor on how
the machine adds.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from pipeline.errors import InputError
from pipeline.scores import Evaluation
from sitegen.score import Index, Real

Key: TypeAlias = Literal["besm", "sam", "detection_rate", "hazard_recall"]

SAME = 1e-9
"""Scores and differences closer than this are equal: embeddings are right to about 1e-7."""

SIGNIFICANT = 0.05
"""Two systems are told apart when a p-value is below this."""

_TAILS = (0.025, 0.975)
_BOOTSTRAP, _SIGNS = 0, 1  # draws of their own under one seed
_BATCH_DRAWS = 2**20


@dataclass(frozen=True, slots=True)
class Interval:
    """A 95 % interval; `low` <= `high`."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How sure the scores and the rank of one system are.

    Each interval holds the metric in 95 % of the resamples; `hazard_recall` is None when the truth,
    or every resample, has no hazard. `band` is the rank that all systems share which cannot be told
    apart. `rank_low` and `rank_high` are the best and the worst rank in 95 % of the resamples,
    `first_share` in [0, 1] is the share of them in which the system is first, alone or not.
    """

    besm: Interval
    sam: Interval
    detection_rate: Interval
    hazard_recall: Interval | None
    band: int
    rank_low: int
    rank_high: int
    first_share: float


@dataclass(frozen=True, slots=True, eq=False)
class VideoColumns:
    """Per-video scores of S systems over the same N videos: `values` (N, S) each, `hazards` (N,).

    `values["hazard_recall"]` holds the hazards found, of `hazards` in that video.
    """

    values: dict[Key, Real]
    hazards: Real


def uncertainties(
    evaluations: Sequence[Evaluation], key: Key = "besm", *, resamples: int = 1000, seed: int = 0
) -> list[Uncertainty]:
    """The uncertainty of each evaluation, in the order given; `key` is the metric that ranks.

    The same seed gives the same numbers. Without a hazard in the truth nothing ranks by
    `hazard_recall`: all are first. Raises InputError when two signatures differ, ValueError when the
    evaluations are not of the same videos in the same order, without any video or resample.
    """
    if not evaluations:
        return []
    require_same_signature(evaluations)
    columns = video_columns(evaluations)
    drawn = resampled(columns, resamples, seed)
    spans = {metric: _spans(values) for metric, values in drawn.items()}
    n = len(evaluations)
    band, low, high, first = [1] * n, [1] * n, [1] * n, [1.0] * n
    if key in drawn:
        order = sorted(range(n), key=lambda s: board_order(evaluations[s], key))
        for system, rank in zip(order, bands(columns.values[key][:, order], resamples, seed), strict=True):
            band[system] = rank
        ranks = competition_ranks(drawn[key])
        # Whole ranks that were reached: the smallest that covers the share, never one in between.
        low, high = np.quantile(ranks, _TAILS, axis=1, method="inverted_cdf").tolist()
        first = (ranks == 1).mean(axis=1).tolist()
    recall: Sequence[Interval | None] = spans.get("hazard_recall") or [None] * n
    rows = zip(
        spans["besm"], spans["sam"], spans["detection_rate"], recall, band, low, high, first, strict=True
    )
    return [Uncertainty(*row) for row in rows]


def board_order(evaluation: Evaluation, key: Key) -> tuple[bool, float, str]:
    """Sorts evaluations best first by `key`, then by name; None comes last."""
    value: float | None = getattr(evaluation.card, key)
    return value is None, -(value or 0.0), evaluation.submission.name


def require_same_signature(evaluations: Sequence[Evaluation]) -> None:
    """Raise InputError when two signatures differ: their numbers cannot be compared."""
    for other in evaluations[1:]:
        one = evaluations[0]
        if one.card.signature != other.card.signature:
            raise InputError(
                "These cannot be compared, since their signatures differ; score both the same way.\n"
                f"  {one.submission.name}: {one.card.signature}\n"
                f"  {other.submission.name}: {other.card.signature}"
            )


def video_columns(evaluations: Sequence[Evaluation]) -> VideoColumns:
    """The per-video scores of at least one evaluation as columns, on the grid of `on_grid`.

    Raises ValueError when the evaluations are not of the same videos in the same order, with the
    same number of hazards in each, or when there is no video.
    """
    videos = [(row.video_id, row.n_hazards) for row in evaluations[0].videos]
    if not videos:
        raise ValueError("no videos: nothing to resample")
    for other in evaluations[1:]:
        if [(row.video_id, row.n_hazards) for row in other.videos] != videos:
            names = f"{evaluations[0].submission.name!r} and {other.submission.name!r}"
            raise ValueError(f"{names} are not scored over the same videos in the same order")
    table = np.array(
        [[(v.besm, v.sam, v.detected, v.n_hazards_found) for v in one.videos] for one in evaluations],
        dtype=np.float64,
    )
    besm, sam, detected, found = np.moveaxis(on_grid(table, len(videos)), (2, 1), (0, 1))
    values: dict[Key, Real] = {"besm": besm, "sam": sam, "detection_rate": detected, "hazard_recall": found}
    return VideoColumns(values, np.array([hazards for _, hazards in videos], dtype=np.float64))


def on_grid(values: Real, n_videos: int) -> Real:
    """Scores in [0, 1], or whole numbers, rounded so that sums of `n_videos` of them are exact.

    With 1,000 videos the grid is 2**-42 (2.3e-13) fine; whole numbers stay as they are.
    """
    digits = 52 - n_videos.bit_length()
    return np.ldexp(np.rint(np.ldexp(values, digits)), -digits)


def resampled(columns: VideoColumns, resamples: int, seed: int) -> dict[Key, Real]:
    """Each metric of each system in every resample: (S, R); all systems share the resamples.

    Hazard recall is the ratio of the sums; resamples without a hazard are left out of it, and it
    is missing when no resample has one.
    """
    n_videos = len(columns.hazards)
    stacked = np.hstack([*columns.values.values(), columns.hazards[:, np.newaxis]])
    sums = np.concatenate([stacked.T @ counts.T for counts in _counts(n_videos, resamples, seed)], axis=1)
    parts = np.split(sums[:-1], len(columns.values))
    drawn: dict[Key, Real] = dict(zip(columns.values, (part / n_videos for part in parts), strict=True))
    hazards = sums[-1]
    if hazards.any():
        drawn["hazard_recall"] = parts[-1][:, hazards > 0] / hazards[hazards > 0]
    else:
        del drawn["hazard_recall"]
    return drawn


def flipped_means(values: Real, resamples: int, seed: int) -> Real:
    """Means over the videos after random signs, the same for all systems: (N, S) to (S, R).

    The difference of two rows is how far apart the two systems are when in every video chance
    decides which of their scores belongs to which: so all pairs cost one product.
    """
    n_videos = len(values)
    sums = [values.T @ signs.T for signs in _signs(n_videos, resamples, seed)]
    return np.concatenate(sums, axis=1) / n_videos


def randomisation_p(difference: float, flipped: Real, other: Real) -> float:
    """Two-sided p-value in (0, 1] of a difference of means: (count + 1) / (R + 1).

    `flipped` and `other` (R,) are the two systems' rows of `flipped_means`. Equal systems have 1.
    """
    count = np.count_nonzero(np.abs(flipped - other) >= abs(difference) - SAME)
    return (count + 1) / (len(flipped) + 1)


def bands(values: Real, resamples: int, seed: int) -> list[int]:
    """The band of each of the S systems of `values` (N, S), given best first.

    A band begins with the best system not yet placed. The systems below belong to it as long as
    they cannot be told apart from this first one (p >= 0.05); the next begins a band, whose rank is
    1 + the systems above it. So bands are contiguous, and two systems of neighbouring bands may be
    as close as two of one band.

    There is no correction for many comparisons: a band says what the test of that one pair would
    say, the same as comparing the two directly, and does not change meaning as a board grows. Over
    a long board one in twenty equal systems is therefore set apart by chance.
    """
    flipped, means = flipped_means(values, resamples, seed), values.mean(axis=0)
    first, found = 0, []
    for system in range(values.shape[1]):
        if randomisation_p(means[first] - means[system], flipped[first], flipped[system]) < SIGNIFICANT:
            first = system
        found.append(first + 1)
    return found


def competition_ranks(values: Real) -> Index:
    """Ranks (1, 2, 2, 4; the largest is 1) of the S systems in each column of `values` (S, R)."""
    order = np.argsort(-values, axis=0, kind="stable")
    ordered = np.take_along_axis(values, order, axis=0)
    places = np.broadcast_to(np.arange(1, len(values) + 1)[:, np.newaxis], values.shape).copy()
    places[1:][ordered[1:] == ordered[:-1]] = 0
    ranks = np.empty_like(places)
    np.put_along_axis(ranks, order, np.maximum.accumulate(places, axis=0), axis=0)
    return ranks


def interval(statistics: Real) -> Interval:
    """The percentile interval of the statistics (R,) of the resamples."""
    low, high = np.quantile(statistics, _TAILS).tolist()
    return Interval(low, high)


def _spans(values: Real) -> list[Interval]:
    lows, highs = np.quantile(values, _TAILS, axis=1).tolist()
    return [Interval(low, high) for low, high in zip(lows, highs, strict=True)]


def _counts(n_videos: int, resamples: int, seed: int) -> Iterator[Real]:
    """How often each video is drawn in each resample, in batches (B, N) that fit into memory."""
    rng = np.random.default_rng([seed, _BOOTSTRAP])
    for size in _batches(n_videos, resamples):
        drawn = rng.integers(n_videos, size=(size, n_videos))
        drawn += np.arange(size)[:, np.newaxis] * n_videos
        counts = np.bincount(drawn.ravel(), minlength=size * n_videos)
        yield counts.reshape(size, n_videos).astype(np.float64)


def _signs(n_videos: int, resamples: int, seed: int) -> Iterator[Real]:
    """A random sign, 1 or -1, for each video in each resample, in batches (B, N)."""
    rng = np.random.default_rng([seed, _SIGNS])
    for size in _batches(n_videos, resamples):
        yield rng.integers(2, size=(size, n_videos), dtype=np.int8).astype(np.float64) * 2 - 1


def _batches(n_videos: int, resamples: int) -> Iterator[int]:
    if resamples < 1:
        raise ValueError(f"{resamples} resamples; expected at least 1")
    size = max(1, _BATCH_DRAWS // n_videos)
    for start in range(0, resamples, size):
        yield min(size, resamples - start)
