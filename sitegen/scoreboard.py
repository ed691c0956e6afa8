"""The board as the terminal prints it: a line a submission, best first."""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.scores import Evaluation
from sitegen.leaderboard import rank
from sitegen.uncertainty import uncertainties


@dataclass(frozen=True, slots=True)
class BoardLine:
    """The scores of one submission; `rank` from 1, `shared` by all that cannot be told apart.

    `low` and `high` bound the 95 % interval of BESM; `hazard_recall` is None without any hazard.
    """

    rank: int
    shared: bool
    name: str
    besm: float
    low: float
    high: float
    sam: float
    detection_rate: float
    hazard_recall: float | None
    n_videos: int
    signature: str


def board_lines(evaluations: Sequence[Evaluation]) -> tuple[BoardLine, ...]:
    """The lines of the board. Raises InputError when two signatures differ."""
    rows = rank(evaluations, "besm", uncertainties(evaluations))
    ranks = [row.rank for row in rows]
    lines = []
    for row in rows:
        assert row.uncertainty is not None
        card, besm = row.evaluation.card, row.uncertainty.besm
        lines.append(
            BoardLine(
                row.rank,
                ranks.count(row.rank) > 1,
                row.evaluation.submission.name,
                card.besm,
                besm.low,
                besm.high,
                card.sam,
                card.detection_rate,
                card.hazard_recall,
                card.n_videos,
                str(card.signature),
            )
        )
    return tuple(lines)
