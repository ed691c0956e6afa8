"""A file's content as a sheet of raw cells: CSV, JSON Lines or Parquet.

Bounds come before parsing: rows, and for Parquet what its pages would unpack to.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sitegen import texts
from sitegen.checks import Faults, visible
from sitegen.texts import RepeatedKeys, csv_rows, json_record, limit_rows

MAX_UNPACKED_BYTES = 4 * 2**30
MAX_LIST_BYTES = 2**30
LIST_ROWS = 4_096
"""How many rows' lists are unpacked before their bytes are counted."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """Raw cells by known column, each column as long as `rows`, the 1-based row numbers.

    CSV numbers its data rows (the header and blank lines are not counted), JSON Lines its lines,
    Parquet its rows. `columns` names every column that the file has, `metadata` holds a Parquet
    file's text marks.
    """

    columns: tuple[str, ...]
    rows: Sequence[int]
    cells: dict[str, list[Any]]
    metadata: dict[str, str] = field(default_factory=dict)


def sheet_of(data: bytes, source_format: str, known: Sequence[str], faults: Faults) -> Sheet:
    """The sheet of a file's content in one of our formats; cells that cannot be read go to `faults`.

    Raises FaultsError at once when the content as a whole cannot be read.
    """
    parse: dict[str, Callable[[bytes, Sequence[str], Faults], Sheet]] = {
        "csv": _csv,
        "jsonl": _jsonl,
        "parquet": _parquet,
    }
    return parse[source_format](data, known, faults)


def _csv(data: bytes, known: Sequence[str], faults: Faults) -> Sheet:
    header: list[str] = []
    lines: list[list[str]] = []
    with csv_rows(data, faults) as records:
        header += [name.strip() for name in next(records, [])]
        lines.extend(islice(records, texts.MAX_ROWS + 1))  # keeps what came before a broken line
    limit_rows(len(lines), faults)
    _header_hints(header, known, faults)
    rows = []
    kept = []
    for number, line in enumerate(lines, start=1):
        if len(line) == len(header):
            rows.append(number)
            kept.append(line)
        else:
            found = f"{len(line)} cells"
            mend = 'Quote a cell that holds a comma: "a cat, running".'
            faults.add(number, None, found, f"{len(header)} cells, as in the header", mend)
    places = {name: header.index(name) for name in known if name in header}
    cells = {name: [line[place] for line in kept] for name, place in places.items()}
    return Sheet(tuple(header), rows, cells)


def _header_hints(header: Sequence[str], known: Sequence[str], faults: Faults) -> None:
    for name in sorted({name for name in known if header.count(name) > 1}):
        faults.add(None, name, f"{header.count(name)} columns of this name", "one", "Remove or rename one.")
    if len(header) == 1:
        for sign, word in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
            if sign in header[0]:
                mend = "Export the table with commas between the cells."
                faults.stop(f"{word} between the cells", "commas", mend)


def _jsonl(data: bytes, known: Sequence[str], faults: Faults) -> Sheet:
    rows: list[int] = []
    records: list[dict[str, Any]] = []
    names: dict[str, None] = {}
    expected = "one JSON object a line"
    faults.line_of = int  # a row's number is its line's
    for number, line in enumerate(data.removeprefix(b"\xef\xbb\xbf").split(b"\n"), start=1):
        if not line.strip():
            continue
        limit_rows(len(records) + 1, faults)
        try:
            record = json_record(line.decode("utf-8"))
        except UnicodeDecodeError as error:
            found = f"byte {line[error.start]:#04x} at position {error.start + 1}, which is not UTF-8"
            faults.add(number, None, found, "text in UTF-8", "Save the file as UTF-8.")
        except json.JSONDecodeError as error:
            found = f"{error.msg} at character {error.pos + 1} of '{visible(error.doc)}'"
            faults.add(number, None, found, expected, "Mend the line, or write it with a JSON library.")
        except (ValueError, RecursionError) as error:
            found = f"JSON that cannot be read ({visible(str(error))})"
            faults.add(number, None, found, expected, "Mend the line.")
        else:
            if isinstance(record, RepeatedKeys):
                faults.add(number, None, record.words, "each key once", "Remove one of the two.")
            elif isinstance(record, dict):
                rows.append(number)
                records.append(record)
                names.update(dict.fromkeys(record))
            else:
                faults.add(number, None, f"a JSON {type(record).__name__}", expected, "Use {...}.")
    cells = {name: [record.get(name) for record in records] for name in known if name in names}
    return Sheet(tuple(names), rows, cells)


def _parquet(data: bytes, known: Sequence[str], faults: Faults) -> Sheet:
    try:
        metadata = pq.read_metadata(pa.BufferReader(data))
        leaves = [metadata.schema.column(place) for place in range(len(metadata.schema))]
        leaves = [leaf for leaf in leaves if leaf.path.split(".")[0] in known]
        _parquet_bounds(metadata, faults)
        # Texts stay dictionaries, so that a small file does not unpack to a huge one.
        strings = [leaf.path for leaf in leaves if leaf.physical_type == "BYTE_ARRAY"]
        with pq.ParquetFile(pa.BufferReader(data), read_dictionary=strings) as file:
            names = file.schema_arrow.names
            marks = marks_of(file.schema_arrow)
            for name in sorted({name for name in known if names.count(name) > 1}):
                faults.stop(f"{names.count(name)} columns `{name}`", "one", "Remove or rename one.")
            lists = {leaf.path.split(".")[0] for leaf in leaves if leaf.max_repetition_level > 0}
            cells = {name: _lists(file, name, faults) for name in known if name in lists}
            table = file.read(columns=[name for name in known if name in names and name not in lists])
        cells |= {name: values_of(table.column(name)) for name in table.column_names}
        if any(len(column) != metadata.num_rows for column in cells.values()):
            raise ValueError(f"not every column has {metadata.num_rows} rows")
    except (pa.ArrowException, OSError, ValueError, IndexError, MemoryError) as error:
        found = f"a damaged Parquet file ({visible(str(error), 200)})"
        faults.stop(found, "a Parquet file", "Write it again.")
    return Sheet(tuple(names), range(1, metadata.num_rows + 1), cells, marks)


def marks_of(schema: pa.Schema) -> dict[str, str]:
    """A Parquet file's text marks."""
    marks = (schema.metadata or {}).items()
    return {key.decode("utf-8", "replace"): value.decode("utf-8", "replace") for key, value in marks}


def _parquet_bounds(metadata: pq.FileMetaData, faults: Faults) -> None:
    limit_rows(metadata.num_rows, faults)
    unpacked = _unpacked_bytes(metadata)
    if unpacked > MAX_UNPACKED_BYTES:
        expected = f"at most {MAX_UNPACKED_BYTES:,} bytes"
        faults.stop(f"{unpacked:,} bytes, unpacked", expected, "Leave out columns or predictions.")


def unpacked_bytes(data: bytes) -> int:
    """What a Parquet file's footer says its pages unpack to; 0 when it cannot be read."""
    try:
        return _unpacked_bytes(pq.read_metadata(pa.BufferReader(data)))
    except (pa.ArrowException, OSError, ValueError, IndexError, MemoryError):
        return 0


def _unpacked_bytes(metadata: pq.FileMetaData) -> int:
    # A row group's columns are not asked: pyarrow aborts the process where a damaged file has none.
    return sum(metadata.row_group(place).total_byte_size for place in range(metadata.num_row_groups))


def _lists(file: pq.ParquetFile, name: str, faults: Faults) -> list[Any]:
    """A column of lists, read in parts, since few bytes of a file can hold very many items."""
    values: list[Any] = []
    unpacked = 0
    for batch in file.iter_batches(batch_size=LIST_ROWS, columns=[name]):
        unpacked += batch.nbytes
        if unpacked > MAX_LIST_BYTES:
            found = f"lists of more than {MAX_LIST_BYTES // 2**20} MB in `{name}`"
            faults.stop(found, "fewer items", "Shorten the lists.")
        values += _plain(batch.column(0))
    return values


def values_of(column: pa.ChunkedArray) -> list[Any]:
    """An Arrow column as Python values; repeated texts of a dictionary are one object."""
    values: list[Any] = []
    for chunk in column.chunks:
        if isinstance(chunk, pa.DictionaryArray):
            distinct = [*_plain(chunk.dictionary), None]
            values += [distinct[place] for place in chunk.indices.fill_null(len(distinct) - 1).to_pylist()]
        else:
            values += _plain(chunk)
    return values


def _plain(chunk: pa.Array) -> list[Any]:
    try:
        return list(chunk.to_pylist())
    except (ValueError, OverflowError):  # text that is not UTF-8, a time out of range
        return [_value(scalar) for scalar in chunk]


def _value(scalar: pa.Scalar) -> Any:
    try:
        return scalar.as_py()
    except UnicodeDecodeError as error:
        return error.object.decode("utf-8", "surrogateescape")
    except (ValueError, OverflowError) as error:
        return error
