"""Scoring a million pairs on cached unit vectors, against one chunked einsum and one maximum of the same.

The vectors are random: how long a cosine takes does not depend on what it says.
"""

import tracemalloc
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.timing import Measure, interleaved
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Submission
from sitegen.evaluate import TextVectors, evaluate
from sitegen.score import Index, Real, VideoArrays, pair_cosines, pair_rows, score_pairs

VIDEOS, PREDICTIONS, HAZARDS = 20_000, 10, 5  # the last two a video
WIDTH = 384
THRESHOLD = 0.8
CHUNK = 1_024


class _Named:
    """An embedder that is never asked: all vectors are given."""

    name = "random vectors"
    sha256 = "0" * 64

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Raises AssertionError."""
        raise AssertionError(f"asked for {texts}")


def unit_vectors(count: int) -> Real:
    """Random unit vectors (count, 384), the same every time."""
    chance = np.random.default_rng(0)
    units = np.empty((count, WIDTH))
    for start in range(0, count, 10_000):
        part = units[start : start + 10_000]
        part[:] = chance.standard_normal(part.shape, np.float32)
        part /= np.linalg.norm(part, axis=1, keepdims=True)
    return units


def ours(units: Real, prediction_video: Index, hazard_video: Index) -> VideoArrays:
    """The product: from who is compared with whom to the scores of all videos."""
    left, right = pair_rows(prediction_video, hazard_video, VIDEOS)
    cosines = pair_cosines(units, left, right + len(prediction_video))
    return score_pairs(cosines, prediction_video, hazard_video, VIDEOS, THRESHOLD)


def floor(units: Real, left: Index, right: Index, starts: Index) -> Real:
    """The cosines, and the best of each prediction; who is compared with whom is given."""
    cosines = np.empty(len(left))
    for start in range(0, len(left), CHUNK):
        part = slice(start, start + CHUNK)
        np.einsum("ij,ij->i", units[left[part]], units[right[part]], out=cosines[part])
    best: Real = np.maximum.reduceat(cosines, starts)
    return best


def records() -> tuple[Submission, list[TruthHazard], dict[str, int]]:
    """The same as records, each text with a vector of its own; and the row of each text."""
    videos = [f"v{number:05}" for number in range(VIDEOS)]
    said = [(video, rank) for video in videos for rank in range(1, PREDICTIONS + 1)]
    true = [(video, number) for video in videos for number in range(1, HAZARDS + 1)]
    rows = tuple(Prediction(video, rank, f"{video} says {rank}") for video, rank in said)
    truth = [TruthHazard(video, str(number), "thing", f"{video} has {number}") for video, number in true]
    texts = [row.description for row in rows] + [row.description for row in truth]
    submission = Submission("bench", "", "", "2026-01-01", "csv", rows)
    return submission, truth, {text: place for place, text in enumerate(texts)}


def measure() -> list[Measure]:
    """Two rows: the metrics by themselves with their memory, and an evaluation with all its records."""
    prediction_video = np.repeat(np.arange(VIDEOS), PREDICTIONS)
    hazard_video = np.repeat(np.arange(VIDEOS), HAZARDS)
    units = unit_vectors(len(prediction_video) + len(hazard_video))
    left, right = pair_rows(prediction_video, hazard_video, VIDEOS)
    right += len(prediction_video)
    starts = np.flatnonzero(np.concatenate(([True], left[1:] != left[:-1])))
    submission, truth, row_of = records()
    vectors = TextVectors(row_of, units)
    whole = partial(evaluate, submission, truth, _Named(), THRESHOLD, "0" * 64, vectors=vectors)

    tracemalloc.start()
    ours(units, prediction_video, hazard_video)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    times = interleaved(
        {
            "ours": lambda: ours(units, prediction_video, hazard_video),
            "floor": lambda: floor(units, left, right, starts),
            "whole": whole,
        }
    )
    what = f"{len(left):,} pairs over {VIDEOS:,} videos, {len(units):,} cached vectors"
    memory = (units.nbytes + peak_bytes) / units.nbytes
    peer = "chunked einsum and maximum.reduceat"
    return [
        Measure(
            f"score {what}",
            times["ours"],
            peer,
            times["floor"],
            "at most 1.2; memory at most 1.5 times the vectors",
            f"memory at its peak {memory:.2f} times the vectors' {units.nbytes / 1e6:.0f} MB",
        ),
        Measure(f"evaluate {what}, records included", times["whole"], peer, times["floor"], ""),
    ]
