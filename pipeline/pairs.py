"""The pairs of one system's predictions and the truth's hazards as columns: a few numbers a pair."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from pipeline.columns import Columns
from pipeline.predictions import Predictions
from pipeline.scores import PairScore


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PairScores(Columns[PairScore]):
    """K pairs, sorted by video, rank and hazard; each is made when it is asked for.

    `prediction` (K,) counts the rows of `predictions`, `hazard` (K,) those of `hazard_ids`, which may
    repeat; `cosine` (K,) in [-1, 1] and `similarity` (K,) in [0, 1].
    """

    predictions: Predictions
    hazard_ids: pa.Array
    prediction: NDArray[np.int64]
    hazard: NDArray[np.int64]
    cosine: NDArray[np.float64]
    similarity: NDArray[np.float64]

    def __len__(self) -> int:
        """K."""
        return len(self.cosine)

    def made(self, start: int, stop: int) -> list[PairScore]:
        """The pairs from `start` to before `stop`."""
        columns = (column.to_pylist() for column in self.arrays(start, stop))
        return [PairScore(*row) for row in zip(*columns, strict=True)]

    def arrays(self, start: int, stop: int) -> list[pa.Array]:
        """The rows as columns of the `pairs` table."""
        rows = self.prediction[start:stop]
        return [
            self.predictions.video.values.take(pa.array(self.predictions.video.codes[rows])),
            pa.array(self.predictions.rank[rows]),
            self.hazard_ids.take(pa.array(self.hazard[start:stop])),
            pa.array(self.cosine[start:stop]),
            pa.array(self.similarity[start:stop]),
        ]
