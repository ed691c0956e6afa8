"""A kind of table on disk: Parquet (zstd), an explicit schema, rows sorted, a version in the metadata.

Sorting makes the bytes a function of the rows alone, whatever order they came in.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeAlias, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.errors import Fault, FaultsError
from pipeline.files import replacing

SCHEMA_VERSION = "1"

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
        rows = [self.to_row(record) for record in sorted(records, key=self.key)]
        return pa.Table.from_pylist(rows, schema=self.schema)

    def write(self, path: Path, records: Iterable[R], metadata: Mapping[str, str] | None = None) -> None:
        """Write the records, sorted by key, whole or not at all."""
        table = self.to_arrow(records)
        marks = {"schema_version": SCHEMA_VERSION, "table": self.name, **(metadata or {})}
        table = table.replace_schema_metadata({key: marks[key] for key in sorted(marks)})
        with replacing(path) as temporary:
            pq.write_table(table, temporary, compression="zstd", compression_level=3)

    def read(self, path: Path) -> list[R]:
        """Read the records of a file that `write` made.

        Raises FaultsError when the file is no Parquet file or its columns are not these.
        """
        try:
            file = pq.ParquetFile(path)
        except (pa.ArrowException, OSError) as error:
            fault = Fault(str(path), None, None, str(error), "a Parquet file", "Write it again.")
            raise FaultsError([fault]) from error
        with file:
            found = {field.name: field.type for field in file.schema_arrow}
            wanted = {field.name: field.type for field in self.schema}
            faults = [
                Fault(
                    str(path),
                    None,
                    column,
                    str(found.get(column, "no such column")),
                    str(kind),
                    f"This is not a `{self.name}` table of version {SCHEMA_VERSION}.",
                )
                for column, kind in wanted.items()
                if found.get(column) != kind
            ]
            if faults:
                raise FaultsError(faults)
            return [self.from_row(row) for row in file.read(columns=list(wanted)).to_pylist()]


def metadata(path: Path) -> dict[str, str]:
    """The text marks in a Parquet file's metadata (`schema_version`, `config_sha256`, ...)."""
    marks = pq.read_schema(path).metadata or {}
    return {key.decode(): value.decode() for key, value in marks.items() if not key.startswith(b"ARROW")}
