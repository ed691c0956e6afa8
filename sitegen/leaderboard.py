"""Evaluations in order, best first."""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.scores import Evaluation
from sitegen.uncertainty import Key, Uncertainty, board_order, require_same_signature


@dataclass(frozen=True, slots=True)
class Ranked:
    """An evaluation with its rank by `value`, and its place in the order, from 1; None comes last.

    `rank` is the band's rank where the uncertainty is known: systems that cannot be told apart
    share it. Without, it is the competition rank (1, 2, 2, 4), shared by equal values only.
    """

    rank: int
    value: float | None
    evaluation: Evaluation
    place: int
    uncertainty: Uncertainty | None = None


def rank(
    evaluations: Sequence[Evaluation],
    key: Key = "besm",
    uncertainty: Sequence[Uncertainty] | None = None,
) -> list[Ranked]:
    """The evaluations by value at full precision, best first, then by name (ours).

    `uncertainty` has one for each evaluation, from `uncertainties(evaluations, key)` by the same
    key. Raises InputError when two signatures differ: their numbers cannot be compared.
    """
    require_same_signature(evaluations)
    known: Sequence[Uncertainty | None] = uncertainty or [None] * len(evaluations)
    pairs = sorted(zip(evaluations, known, strict=True), key=lambda pair: board_order(pair[0], key))
    rows: list[Ranked] = []
    for place, (evaluation, sure) in enumerate(pairs, start=1):
        value: float | None = getattr(evaluation.card, key)
        shared = rows[-1].rank if rows and rows[-1].value == value else place
        rows.append(Ranked(sure.band if sure else shared, value, evaluation, place, sure))
    return rows
