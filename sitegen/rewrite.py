"""Files with our columns written again with changes; what is not changed stays as it was."""

import csv
import io
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sitegen.checks import Faults
from sitegen.sheets import values_of
from sitegen.texts import csv_rows, json_record

BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(slots=True)
class Changes:
    """What to change, by the rows' numbers (see `Sheet`).

    `names` renames columns, `cells` gives new texts by column and row, `ranks` a new column `rank`, and
    `drop` holds the rows to leave out.
    """

    names: dict[str, str] = field(default_factory=dict)
    cells: dict[str, dict[int, str]] = field(default_factory=dict)
    ranks: dict[int, int] = field(default_factory=dict)
    drop: set[int] = field(default_factory=set)


def rewritten(data: bytes, source_format: str, changes: Changes, known: Sequence[str]) -> bytes | None:
    """The content with the changes, or None where it cannot be written again as a whole.

    Of a Parquet file only the columns that are `known` (or get such a name) are kept.
    """
    if source_format == "parquet":
        return _parquet(data, changes, known)
    write: dict[str, Callable[[bytes, Changes], bytes | None]] = {"csv": _csv, "jsonl": _jsonl}
    return write[source_format](data, changes)


def spaced_names(data: bytes) -> int:
    """How many column names of a CSV file have blanks around them."""
    with csv_rows(data, Faults("")) as rows:
        return sum(name != name.strip() for name in next(rows, []))
    return 0


def csv_bytes(rows: Iterable[Sequence[Any]]) -> bytes:
    """Rows as a CSV file; None is an empty cell, lists are JSON."""
    target = io.StringIO(newline="")
    plain = csv.writer(target, lineterminator="\n")
    quoted = csv.writer(target, lineterminator="\n", quoting=csv.QUOTE_ALL)
    for row in rows:
        cells = [_cell(value) for value in row]
        # Not every version of Python quotes a cell for a carriage return in it.
        writer = quoted if any("\r" in cell for cell in cells) else plain
        writer.writerow(cells)
    return target.getvalue().encode("utf-8", "surrogateescape")


def _cell(value: Any) -> str:
    if isinstance(value, list | tuple):
        return json.dumps(value, ensure_ascii=False) if value else ""
    return "" if value is None else str(value)


def _csv(data: bytes, changes: Changes) -> bytes | None:
    written: list[list[str]] = []
    is_whole = False
    with csv_rows(data, Faults("")) as rows:
        header = [name.strip() for name in next(rows, [])]
        places = {name: header.index(name) for name in changes.cells}
        ranked = ["rank"] if changes.ranks else []
        written.append([changes.names.get(name, name) for name in header] + ranked)
        for row, cells in enumerate(rows, start=1):
            if row in changes.drop:
                continue
            if len(cells) == len(header):
                for name, edits in changes.cells.items():
                    cells[places[name]] = edits.get(row, cells[places[name]])
                cells.extend([str(changes.ranks[row])] if changes.ranks else [])
            written.append(cells)
        is_whole = True
    return csv_bytes(written) if is_whole else None


def _jsonl(data: bytes, changes: Changes) -> bytes:
    lines: list[bytes] = []
    edited = set(changes.ranks).union(*changes.cells.values())
    for row, line in enumerate(data.split(b"\n"), start=1):
        if row in changes.drop:
            continue
        lines.append(_record(line, row, changes) if changes.names or row in edited else line)
    return b"\n".join(lines)


def _record(line: bytes, row: int, changes: Changes) -> bytes:
    try:
        record = json_record(line.decode("utf-8"))
    except (ValueError, RecursionError):
        return line
    if type(record) is not dict:
        return line
    new = {changes.names.get(name, name): value for name, value in record.items()}
    new |= {name: edits[row] for name, edits in changes.cells.items() if row in edits}
    new |= {"rank": changes.ranks[row]} if row in changes.ranks else {}
    if new.keys() == record.keys() and not any(row in edits for edits in changes.cells.values()):
        return line
    try:
        text = json.dumps(new, ensure_ascii=False).encode()
    except UnicodeEncodeError:  # half of a surrogate pair
        text = json.dumps(new).encode()
    return text + (b"\r" if line.endswith(b"\r") else b"")


def _parquet(data: bytes, changes: Changes, known: Sequence[str]) -> bytes | None:
    """The Parquet file again; texts stay dictionaries, so that a small file does not unpack to a huge one."""
    try:
        leaves = pq.read_metadata(pa.BufferReader(data)).schema
        kept = [leaves.column(place) for place in range(len(leaves))]
        texts = [leaf.path for leaf in kept if leaf.physical_type == "BYTE_ARRAY"]
        with pq.ParquetFile(pa.BufferReader(data), read_dictionary=texts) as file:
            names = file.schema_arrow.names
            table = file.read(columns=[name for name in names if changes.names.get(name, name) in known])
        marks = table.schema.metadata
        table = table.rename_columns([changes.names.get(name, name) for name in table.column_names])
        for name, edits in changes.cells.items():
            cells = values_of(table.column(name))
            for row, text in edits.items():
                cells[row - 1] = text
            table = table.set_column(table.column_names.index(name), name, _dictionary(cells))
        if changes.ranks:
            ranks = [changes.ranks.get(row) for row in range(1, table.num_rows + 1)]
            table = table.append_column("rank", pa.array(ranks, pa.int32()))
        if changes.drop:
            table = table.take([row for row in range(table.num_rows) if row + 1 not in changes.drop])
        sink = io.BytesIO()
        pq.write_table(table.replace_schema_metadata(marks), sink, compression="zstd", compression_level=3)
    except (pa.ArrowException, OSError, ValueError, IndexError, MemoryError):
        return None
    return sink.getvalue()


def _dictionary(cells: Sequence[Any]) -> pa.DictionaryArray:
    """Texts and whole numbers as an Arrow column of texts, each distinct one kept once."""
    texts = [cell if cell is None else str(cell) for cell in cells]
    places = {
        text: place for place, text in enumerate(dict.fromkeys(text for text in texts if text is not None))
    }
    indices = [None if text is None else places[text] for text in texts]
    return pa.DictionaryArray.from_arrays(pa.array(indices, pa.int32()), pa.array(list(places), pa.string()))
