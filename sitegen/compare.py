"""Two systems on the same videos: how large the difference is, and whether it can be chance."""

from dataclasses import dataclass

import numpy as np

from pipeline.scores import Evaluation
from sitegen.score import Real
from sitegen.uncertainty import (
    SAME,
    Interval,
    Key,
    flipped_means,
    interval,
    randomisation_p,
    require_same_signature,
    resampled,
    video_columns,
)


@dataclass(frozen=True, slots=True)
class Comparison:
    """System a against system b by one metric: `difference` is a - b, `interval` its 95 % interval.

    The two p-values in (0, 1] are two-sided: how often chance alone makes a difference this large.
    `wins`, `losses` and `ties` count the videos in which a is better, worse, as good as b; together
    they are all videos. By `hazard_recall` a video without a hazard is a tie.
    """

    key: Key
    a: float
    b: float
    difference: float
    interval: Interval
    p_bootstrap: float
    p_randomisation: float
    wins: int
    losses: int
    ties: int


def compare(a: Evaluation, b: Evaluation, *, resamples: int = 10_000, seed: int = 0) -> dict[Key, Comparison]:
    """One Comparison a metric; without a hazard in the truth there is none for `hazard_recall`.

    The same seed gives the same numbers, and resamples the same videos as `uncertainties`.
    Raises InputError when the signatures differ, ValueError when the videos do or there are none.
    """
    require_same_signature([a, b])
    columns = video_columns([a, b])
    flipped = flipped_means(np.hstack(list(columns.values.values())), resamples, seed)
    flips = dict(zip(columns.values, np.split(flipped, len(columns.values)), strict=True))
    found: dict[Key, Comparison] = {}
    for key, drawn in resampled(columns, resamples, seed).items():
        values = columns.values[key]
        per_video = values[:, 0] - values[:, 1]
        wins, losses = int(np.sum(per_video > SAME)), int(np.sum(per_video < -SAME))
        of_a, of_b = getattr(a.card, key), getattr(b.card, key)
        differences = drawn[0] - drawn[1]
        found[key] = Comparison(
            key=key,
            a=of_a,
            b=of_b,
            difference=of_a - of_b,
            interval=interval(differences),
            p_bootstrap=bootstrap_p(of_a - of_b, differences),
            p_randomisation=randomisation_p(per_video.mean(), *flips[key]),
            wins=wins,
            losses=losses,
            ties=len(per_video) - wins - losses,
        )
    return found


def bootstrap_p(difference: float, differences: Real) -> float:
    """Two-sided p-value in (0, 1] of a difference by the paired bootstrap: (count + 1) / (R + 1).

    `differences` (R,) are those of the resamples. Moved by the observed difference they show what
    chance does where there is none; counted are those at least as large, of either sign (Koehn
    2004; Riezler and Maxwell 2005). Equal systems have 1. sacrebleu centres the absolute values
    instead, which for a clear difference leaves one tail: its p-value is then about half of this.
    """
    count = np.count_nonzero(np.abs(differences - difference) >= abs(difference) - SAME)
    return (count + 1) / (len(differences) + 1)
