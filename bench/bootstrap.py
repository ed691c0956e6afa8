"""Uncertainty and paired tests of boards against plain loops over NumPy: one resample at a time."""

from itertools import combinations

import numpy as np

from bench.timing import Measure, interleaved
from pipeline.scores import Evaluation, Signature, Submission, VideoScore
from sitegen.paired import RESAMPLES as DRAWS
from sitegen.paired import all_pairs
from sitegen.score import Real, scorecard
from sitegen.uncertainty import uncertainties, video_columns

SYSTEMS, VIDEOS, RESAMPLES = 300, 1_000, 1_000
PAIRED = 10  # systems
STEP = 6  # the loops take every sixth system: they would take half a minute, and are linear


def board(systems: int) -> list[Evaluation]:
    """Systems over 1,000 videos, ever better; the same every time."""
    chance = np.random.default_rng(0)
    signature = Signature("1", "bench", "0" * 64, "0" * 64, VIDEOS, 0.8)
    rows = []
    for system in range(systems):
        scores = np.clip(chance.normal(0.3 + 0.001 * system, 0.2, VIDEOS), 0, 1).tolist()
        videos = tuple(
            VideoScore(f"v{n:04}", 1, 1, int(s > 0.8), s, s, s, s, s, s > 0.8) for n, s in enumerate(scores)
        )
        submission = Submission(f"s{system:03}", "", "", "", "csv", ())
        rows.append(Evaluation(submission, (), videos, scorecard(videos, signature)))
    return rows


def loops(evaluations: list[Evaluation]) -> list[Real]:
    """The intervals only, of the same four metrics: no bands, no ranks."""
    columns = video_columns(evaluations)
    chance = np.random.default_rng(0)
    drawn = [chance.integers(VIDEOS, size=VIDEOS) for _ in range(RESAMPLES)]
    found = []
    for values in columns.values.values():
        for scores in np.ascontiguousarray(values.T):
            means = np.array([scores[rows].mean() for rows in drawn])
            found.append(np.quantile(means, (0.025, 0.975)))
    return found


def paired_loops(evaluations: list[Evaluation]) -> list[Real]:
    """Of each two systems and each metric the differences in every resample, and under random signs."""
    columns = video_columns(evaluations)
    chance = np.random.default_rng(0)
    drawn = [chance.integers(VIDEOS, size=VIDEOS) for _ in range(DRAWS)]
    signs = [chance.integers(2, size=VIDEOS) * 2.0 - 1 for _ in range(DRAWS)]
    found = []
    for values in columns.values.values():
        for a, b in combinations(np.ascontiguousarray(values.T), 2):
            differences = a - b
            found.append(np.quantile([differences[rows].mean() for rows in drawn], (0.025, 0.975)))
            found.append(np.array([(differences * sign).mean() for sign in signs]))
    return found


def measure() -> list[Measure]:
    """Two rows: a large board from evaluations, and every two systems of a small one against each other.

    The loops take some of the systems, and their time is multiplied.
    """
    rows, few = board(SYSTEMS), board(PAIRED)
    times = interleaved(
        {
            "board": lambda: uncertainties(rows),
            "loops": lambda: loops(rows[::STEP]),
            "pairs": lambda: all_pairs(few),
            "paired loops": lambda: paired_loops(few[:2]),
        }
    )
    pairs = PAIRED * (PAIRED - 1) // 2
    return [
        Measure(
            f"{RESAMPLES:,} resamples of {SYSTEMS} systems over {VIDEOS:,} videos",
            times["board"],
            "plain loops over NumPy",
            times["loops"] * STEP,
            "under a second",
            "four intervals, bands and ranks; the loops make the intervals only, of every sixth system; "
            "their time is multiplied",
        ),
        Measure(
            f"paired tests of {PAIRED} systems over {VIDEOS:,} videos, {DRAWS:,} resamples",
            times["pairs"],
            f"plain loops over NumPy, {pairs} times those of one pair",
            times["paired loops"] * pairs,
            "",
            "four metrics, bootstrap and randomisation",
        ),
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, one.ratio)
