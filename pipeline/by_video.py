"""A table file by video, of which only the rows around the video that was last asked for are in memory."""

import sys
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, pairwise
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipeline.errors import Fault, FaultsError, InputError
from pipeline.files import sha256_file
from pipeline.table import ROW_GROUP, Table, parquet_faults

R = TypeVar("R")

_BATCH_ROWS = 2**14
_VIDEO = "video_id"


class ByVideo(Mapping[str, tuple[R, ...]]):
    """Video id -> its records, in the order of the file; read-only, sorted by video.

    The file is gone through once, a batch at a time, to see that it is whole. The row groups that hold a
    video are read when it is asked for, and kept as columns until one is asked for that they do not hold:
    ask in sorted order. A file that is not sorted by video, as `Table.write` sorts it, is kept as a whole,
    as columns. The repr names the content by its hash.
    """

    def __init__(self, table: Table[R], path: Path, only: Collection[str] | None = None) -> None:
        """The table at `path`, of all videos, or of those in `only`.

        Raises FaultsError when the file is damaged or is no such table.
        """
        self._table, self._path = table, path
        self._touch = _touch(path)
        self._sha256 = sha256_file(path)
        with table.opened(path, str(path)) as file:
            groups = [
                file.metadata.row_group(place).num_rows for place in range(file.metadata.num_row_groups)
            ]
            runs = self._runs(file.iter_batches(_BATCH_ROWS, columns=table.schema.names))
        self._bounds = [0, *accumulate(groups)]
        self._start, self._rows = 0, table.schema.empty_table()
        if any(one >= other for (one, _), (other, _) in pairwise(runs)):
            rows = self._read(0, len(groups))
            self._rows = rows.take(pc.sort_indices(rows.column(_VIDEO)))  # equal ones stay in their order
            runs = self._runs(self._rows.to_batches())
        stops = [*(start for _, start in runs), self._bounds[-1]][1:]
        found = zip(runs, stops, strict=True)
        self._places = {one: (start, stop) for (one, start), stop in found if only is None or one in only}
        self._last: tuple[str, tuple[R, ...]] | None = None
        self._lock = Lock()

    def _runs(self, batches: Iterable[pa.RecordBatch]) -> list[tuple[str, int]]:
        """The video of each run of rows with the same, and its first row."""
        runs: list[tuple[str, int]] = []
        row = 0
        for batch in batches:
            videos = batch.column(_VIDEO)
            if videos.null_count:
                raise self._fault(None, "a row without video", "a video id in every row")
            found = pc.run_end_encode(videos)
            starts = [0, *found.run_ends.to_pylist()]
            for video, start in zip(found.values.to_pylist(), starts, strict=False):
                if not runs or runs[-1][0] != video:
                    runs.append((sys.intern(video), row + start))  # many tables have the same videos
            row += len(videos)
        return runs

    def _read(self, first: int, last: int) -> pa.Table:
        """The row groups from `first` to before `last`."""
        if _touch(self._path) != self._touch:
            raise InputError(f"{self._path} changed while it was read; start again.")
        with parquet_faults(str(self._path)), pq.ParquetFile(self._path) as file:
            return file.read_row_groups(range(first, last), columns=self._table.schema.names)

    def __getitem__(self, video_id: str) -> tuple[R, ...]:
        """The records of a video. Raises FaultsError for a row that is no such record."""
        with self._lock:  # what is handed to a process is pickled by a thread
            if self._last is None or self._last[0] != video_id:
                self._last = video_id, self._made(*self._places[video_id])
            return self._last[1]

    def __contains__(self, video_id: object) -> bool:
        """Whether a video has records; nothing is read."""
        return video_id in self._places

    def _made(self, start: int, stop: int) -> tuple[R, ...]:
        if not self._start <= start < stop <= self._start + len(self._rows):
            first = bisect_right(self._bounds, start) - 1
            wanted = min(self._bounds[first] + ROW_GROUP, self._bounds[-1])  # small groups are read together
            self._rows = self._rows.slice(0, 0)  # frees them before the next are read
            self._rows = self._read(first, bisect_left(self._bounds, max(stop, wanted)))
            self._start = self._bounds[first]
        part = self._rows.slice(start - self._start, stop - start)
        cells = zip(*(column.to_pylist() for column in part.columns), strict=True)
        names = self._table.schema.names
        made: list[R] = []
        for row in cells:
            try:
                made.append(self._table.from_row(dict(zip(names, row, strict=True))))
            except (TypeError, ValueError) as error:
                expected = f"a row of a `{self._table.name}` table"
                raise self._fault(start + len(made) + 1, str(error), expected) from error
        return tuple(made)

    def _fault(self, row: int | None, found: str, expected: str) -> FaultsError:
        return FaultsError([Fault(str(self._path), row, None, found, expected, "Write the file again.")])

    def __iter__(self) -> Iterator[str]:
        """The videos, sorted."""
        return iter(self._places)

    def __len__(self) -> int:
        """How many videos there are."""
        return len(self._places)

    def __repr__(self) -> str:
        """The kind of table and the hash of the file."""
        return f"{self._table.name} {self._sha256}"


class Later(Sequence[R]):
    """The records of one video, looked up again whenever they are needed; pickled as a tuple of them."""

    def __init__(self, by_video: Mapping[str, tuple[R, ...]], video_id: str) -> None:
        """Empty where the mapping has none; it holds no empty tuples."""
        self._by_video, self._video_id = by_video, video_id

    def _now(self) -> tuple[R, ...]:
        return self._by_video.get(self._video_id, ())

    def __getitem__(self, place: Any) -> Any:
        """As a tuple's."""
        return self._now()[place]

    def __len__(self) -> int:
        """How many there are."""
        return len(self._now())

    def __bool__(self) -> bool:
        """Whether there are any; they are not looked up."""
        return self._video_id in self._by_video

    def __iter__(self) -> Iterator[R]:
        """Each record; they are looked up once for all."""
        return iter(self._now())

    def __reduce__(self) -> tuple[type, tuple[tuple[R, ...]]]:
        """As a tuple."""
        return tuple, (self._now(),)


def _touch(path: Path) -> tuple[int, int, int]:
    """What tells that a file was replaced or written to."""
    found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns
