"""The predictions of one system as columns: distinct texts once, and small numbers a row."""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from pipeline.columns import Coded, Columns
from pipeline.records import Prediction

LABEL = pa.string()
TRACKS = pa.list_(pa.string())
FRAMES = pa.list_(pa.int32())


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Predictions(Columns[Prediction]):
    """P predictions, sorted by video and rank; each is made when it is asked for.

    The values of `video` are the videos that have predictions, sorted, so that its codes ascend; `rank`
    is (P,). No list is null: a prediction without tracks has an empty one.
    """

    video: Coded
    rank: NDArray[np.int32]
    description: Coded
    label: Coded
    track_ids: Coded
    frame_indices: Coded

    @classmethod
    def of(cls, rows: Iterable[Prediction]) -> "Predictions":
        """The same predictions, sorted; what are columns already are given back."""
        if isinstance(rows, Predictions):
            return rows
        kept = sorted(rows, key=attrgetter("video_id", "rank"))
        return cls(
            Coded.of((row.video_id for row in kept), pa.string()),
            np.array([row.rank for row in kept], dtype=np.int32),
            Coded.of((row.description for row in kept), pa.string()),
            Coded.of((row.label for row in kept), LABEL),
            Coded.of((row.track_ids for row in kept), TRACKS),
            Coded.of((row.frame_indices for row in kept), FRAMES),
        )

    @property
    def video_ids(self) -> list[str]:
        """The videos that have predictions, sorted."""
        return list(self.video.values.to_pylist())

    @property
    def texts(self) -> list[str]:
        """The distinct descriptions, by the codes of `description`."""
        return list(self.description.values.to_pylist())

    def __len__(self) -> int:
        """P."""
        return len(self.rank)

    def made(self, start: int, stop: int) -> list[Prediction]:
        """The predictions from `start` to before `stop`."""
        *columns, tracks, frames = (column.to_pylist() for column in self.arrays(start, stop))
        rows = zip(*columns, map(tuple, tracks), map(tuple, frames), strict=True)
        return [Prediction(*row) for row in rows]

    def arrays(self, start: int, stop: int) -> list[pa.Array]:
        """The rows as columns of the `predictions` table."""
        coded = (self.description, self.label, self.track_ids, self.frame_indices)
        ranks = pa.array(self.rank[start:stop])
        return [self.video.array(start, stop), ranks, *(column.array(start, stop) for column in coded)]
