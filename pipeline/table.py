"""A kind of table on disk: Parquet (zstd), an explicit schema, rows sorted, a version in the metadata.

Sorting makes the bytes a function of the rows alone, whatever order they came in.
"""

import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeAlias, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.columns import Columns
from pipeline.errors import Fault, FaultsError
from pipeline.files import replacing

SCHEMA_VERSION = "1"
ROW_GROUP = 2**17
"""Rows of a row group: what is held in memory at once when columns are written."""

R = TypeVar("R")
Row: TypeAlias = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Table(Generic[R]):
    """A kind of table: its name, its columns, its sort key, and how a record becomes a row."""

    name: str
    schema: pa.Schema
    key: Callable[[R], tuple[Any, ...]]
    to_row: Callable[[R], Row]
    from_row: Callable[[Row], R]

    def to_arrow(self, records: Iterable[R]) -> pa.Table:
        """The records, sorted by key, as an Arrow table of this schema."""
        return pa.Table.from_batches(self._batches(records), self.schema)

    def to_bytes(self, records: Iterable[R], metadata: Mapping[str, str] | None = None) -> bytes:
        """The records, sorted by key, as the content of a Parquet file."""
        sink = io.BytesIO()
        self._write(sink, records, metadata)
        return sink.getvalue()

    def write(self, path: Path, records: Iterable[R], metadata: Mapping[str, str] | None = None) -> None:
        """Write the records, sorted by key, whole or not at all."""
        with replacing(path) as temporary:
            self._write(temporary, records, metadata)

    def _write(
        self, sink: Path | io.BytesIO, records: Iterable[R], metadata: Mapping[str, str] | None
    ) -> None:
        marks = {"schema_version": SCHEMA_VERSION, "table": self.name, **(metadata or {})}
        schema = self.schema.with_metadata({key: marks[key] for key in sorted(marks)})
        with pq.ParquetWriter(sink, schema, compression="zstd", compression_level=3) as writer:
            for batch in self._batches(records):
                writer.write_table(pa.Table.from_batches([batch]).cast(schema))

    def _batches(self, records: Iterable[R]) -> Iterator[pa.RecordBatch]:
        """The records, sorted by key, a row group at a time; at least one. Columns are sorted already."""
        if isinstance(records, Columns):
            for start in range(0, len(records) or 1, ROW_GROUP):
                arrays = records.arrays(start, min(start + ROW_GROUP, len(records)))
                yield pa.RecordBatch.from_arrays(arrays, schema=self.schema)
            return
        kept = sorted(records, key=self.key)
        for start in range(0, len(kept) or 1, ROW_GROUP):
            rows = [self.to_row(record) for record in kept[start : start + ROW_GROUP]]
            yield pa.RecordBatch.from_pylist(rows, schema=self.schema)

    def read(self, path: Path) -> list[R]:
        """Read the records of a file that `write` made.

        Raises FaultsError when the file is no Parquet file or its columns are not these.
        """
        return self._read(path, str(path))

    def from_bytes(self, data: bytes, name: str) -> list[R]:
        """Read the records of a file's content; `name` is how errors call it. Raises as `read` does."""
        return self._read(io.BytesIO(data), name)

    def _read(self, source: Path | io.BytesIO, path: str) -> list[R]:
        with self.opened(source, path) as file:
            return [self.from_row(row) for row in file.read(columns=self.schema.names).to_pylist()]

    @contextmanager
    def opened(self, source: Path | io.BytesIO, path: str) -> Iterator[pq.ParquetFile]:
        """The open file, whose columns are these; `path` is how errors call it. Raises as `read` does."""
        with parquet_faults(path), pq.ParquetFile(source) as file:
            found = {field.name: field.type for field in file.schema_arrow}
            faults = [
                Fault(
                    path,
                    None,
                    column.name,
                    str(found.get(column.name, "no such column")),
                    str(column.type),
                    f"This is not a `{self.name}` table of version {SCHEMA_VERSION}.",
                )
                for column in self.schema
                if found.get(column.name) != column.type
            ]
            if faults:
                raise FaultsError(faults)
            yield file


@contextmanager
def parquet_faults(path: str) -> Iterator[None]:
    """Raise FaultsError where a Parquet file, called `path`, cannot be read."""
    try:
        yield
    except (pa.ArrowException, OSError) as error:
        fault = Fault(path, None, None, str(error), "a Parquet file", "Write it again.")
        raise FaultsError([fault]) from error


def metadata(source: Path | io.BytesIO) -> dict[str, str]:
    """The text marks in a Parquet file's metadata (`schema_version`, `config_sha256`, ...)."""
    marks = pq.read_schema(source).metadata or {}
    return {key.decode(): value.decode() for key, value in marks.items() if not key.startswith(b"ARROW")}
