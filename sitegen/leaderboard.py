"""Evaluations in order, best first."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from pipeline.errors import InputError
from pipeline.scores import Evaluation

Key: TypeAlias = Literal["besm", "sam", "detection_rate", "hazard_recall"]


@dataclass(frozen=True, slots=True)
class Ranked:
    """An evaluation with its competition rank (1, 2, 2, 4) by `value`; None ranks last."""

    rank: int
    value: float | None
    evaluation: Evaluation


def rank(evaluations: Sequence[Evaluation], key: Key = "besm") -> list[Ranked]:
    """The evaluations by rank, then name. A tie is an equal value at full precision (ours).

    Raises InputError when two signatures differ: their numbers cannot be compared.
    """
    for other in evaluations[1:]:
        _same_signature(evaluations[0], other)
    values = [getattr(evaluation.card, key) for evaluation in evaluations]
    rows = [
        Ranked(1 + sum(_above(better, value) for better in values), value, evaluation)
        for value, evaluation in zip(values, evaluations, strict=True)
    ]
    return sorted(rows, key=lambda row: (row.rank, row.evaluation.submission.name))


def _above(better: float | None, value: float | None) -> bool:
    return better is not None and (value is None or better > value)


def _same_signature(one: Evaluation, other: Evaluation) -> None:
    if one.card.signature != other.card.signature:
        raise InputError(
            "These cannot be ranked together, since their signatures differ; score both the same way.\n"
            f"  {one.submission.name}: {one.card.signature}\n"
            f"  {other.submission.name}: {other.card.signature}"
        )
