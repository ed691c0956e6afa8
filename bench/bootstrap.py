"""Uncertainty of a large board against plain loops over NumPy: one system and one resample at a time."""

import numpy as np

from bench.timing import Measure, interleaved
from pipeline.scores import Evaluation, Signature, Submission, VideoScore
from sitegen.score import Real, scorecard
from sitegen.uncertainty import uncertainties, video_columns

SYSTEMS, VIDEOS, RESAMPLES = 300, 1_000, 1_000
STEP = 6  # the loops take every sixth system: they would take half a minute, and are linear


def board() -> list[Evaluation]:
    """300 systems over 1,000 videos, ever better; the same every time."""
    chance = np.random.default_rng(0)
    signature = Signature("1", "bench", "0" * 64, "0" * 64, VIDEOS, 0.8)
    rows = []
    for system in range(SYSTEMS):
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


def measure() -> list[Measure]:
    """One row: intervals, bands and ranks of all systems, from evaluations."""
    rows = board()
    times = interleaved({"ours": lambda: uncertainties(rows), "loops": lambda: loops(rows[::STEP])})
    return [
        Measure(
            f"{RESAMPLES:,} resamples of {SYSTEMS} systems over {VIDEOS:,} videos",
            times["ours"],
            "plain loops over NumPy",
            times["loops"] * STEP,
            "under a second",
            "four intervals, bands and ranks; the loops make the intervals only, of every sixth system; "
            "their time is multiplied",
        )
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, one.ratio)
