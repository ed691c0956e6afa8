"""All pairs of some systems at once, each with the numbers that `compare` gives for the two alone."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from pipeline.scores import Evaluation
from sitegen.compare import Comparison, bootstrap_p
from sitegen.uncertainty import (
    SAME,
    Key,
    flipped_means,
    interval,
    randomisation_p,
    require_same_signature,
    resampled,
    video_columns,
)

RESAMPLES = 10_000
SEED = 0


def all_pairs(
    evaluations: Sequence[Evaluation], *, resamples: int = RESAMPLES, seed: int = SEED
) -> dict[tuple[int, int], dict[Key, Comparison]]:
    """(place of a, place of b) -> the comparison of a with b, in both directions.

    The draws are made once for all systems, so that all pairs together cost little more than one.
    Raises as `compare` does.
    """
    if len(evaluations) < 2:
        return {}
    require_same_signature(evaluations)
    columns = video_columns(evaluations)
    flipped = flipped_means(np.hstack(list(columns.values.values())), resamples, seed)
    flips = dict(zip(columns.values, np.split(flipped, len(columns.values)), strict=True))
    pairs = list(permutations(range(len(evaluations)), 2))
    found: dict[tuple[int, int], dict[Key, Comparison]] = {pair: {} for pair in pairs}
    for key, drawn in resampled(columns, resamples, seed).items():
        cards = [getattr(evaluation.card, key) for evaluation in evaluations]
        values = columns.values[key]
        for a, b in pairs:
            per_video = values[:, a] - values[:, b]
            wins, losses = int(np.sum(per_video > SAME)), int(np.sum(per_video < -SAME))
            difference, differences = cards[a] - cards[b], drawn[a] - drawn[b]
            found[a, b][key] = Comparison(
                key=key,
                a=cards[a],
                b=cards[b],
                difference=difference,
                interval=interval(differences),
                p_bootstrap=bootstrap_p(difference, differences),
                p_randomisation=randomisation_p(per_video.mean(), flips[key][a], flips[key][b]),
                wins=wins,
                losses=losses,
                ties=len(per_video) - wins - losses,
            )
    return found
