"""A folder of Parquet files, its shards, which together are one table of predictions.

They are read in the order of their names. Hidden files and what writers leave beside their shards are not
read; anything else that is no Parquet file is a fault. Every bound of one file holds for all of them
together. A row's number is counted over all shards; a fault names the shard and its row there.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

import pyarrow as pa

from pipeline.files import sha256_of
from sitegen import formats, sheets, texts
from sitegen.checks import Faults, visible
from sitegen.columns import DoubtError, RawColumns, raw_columns
from sitegen.formats import bounded_bytes, refuse_empty, refuse_other_kind
from sitegen.sheets import Sheet, sheet_of

ASIDE = frozenset({"_SUCCESS", "_metadata", "_common_metadata"})
MAX_SHARDS = 10_000

_ITEM_BYTES = 4
_EXPECTED = "a folder of Parquet files"


def is_aside(name: str) -> bool:
    """Whether a file of this name in a folder of shards is not read."""
    return name.startswith(".") or name in ASIDE


def limit_shards(count: int, faults: Faults) -> None:
    """Raise FaultsError for more files than a folder of shards may have."""
    if count > MAX_SHARDS:
        faults.stop(f"{count:,} files", f"at most {MAX_SHARDS:,} shards", "Write fewer, larger shards.")


@dataclass(frozen=True, slots=True)
class Shards:
    """The shards, in order: how faults call each, its path and hash, by name; see `read_shards`."""

    paths: Mapping[str, tuple[str, Path, str]]
    sha256: str

    def contents(self) -> Iterator[tuple[str, bytes]]:
        """Each shard's name and bytes, which are read again. Raises FaultsError when they are others now."""
        for name, (called, path, sha256) in self.paths.items():
            here = Faults(called)
            data = bounded_bytes(path, here, "a Parquet file")
            if sha256_of(data) != sha256:
                here.stop("a file that changed while it was read", "a Parquet file", "Try again.")
            yield name, data


def read_shards(folder: Path, faults: Faults) -> Shards:
    """The shards of a folder; each is read once, and not kept, so that all of them need not fit in memory.

    The hash is of the text that `sha256sum` gives of them: for each a line of its content's SHA-256, two
    blanks and its name. Raises FaultsError for links out of the folder, for what is no Parquet file, for
    a folder without any and for more bytes than one file may have.
    """
    try:
        found = [path for path in folder.iterdir() if not is_aside(path.name)]
    except OSError as error:
        faults.stop(f"a folder that cannot be read ({error.strerror})", _EXPECTED, "Check its permissions.")
    paths = sorted(found, key=lambda path: path.name)
    if not paths:
        faults.stop("no Parquet file in it", _EXPECTED, "Give a run folder, a folder of shards, or a file.")
    limit_shards(len(paths), faults)
    shards: dict[str, tuple[str, Path, str]] = {}
    size = 0
    home = folder.resolve()
    for path in paths:
        here = Faults(_name(faults, path.name))
        if path.is_symlink() and path.resolve().parent != home:
            here.stop("a link out of the folder", "a file in it", "Copy the file itself.")
        data = bounded_bytes(path, here, "a Parquet file")
        refuse_empty(data, here, "a Parquet file")
        refuse_other_kind(data, "parquet", here)
        shards[path.name] = here.file, path, sha256_of(data)
        size += len(data)
        if size > formats.MAX_BYTES:
            limit = f"{formats.MAX_BYTES // 2**20} MB"
            faults.stop(f"more than {limit}", f"at most {limit} in all shards", "Leave out predictions.")
    lines = (f"{sha256}  {name}\n" for name, (_, _, sha256) in shards.items())
    return Shards(shards, sha256_of("".join(lines).encode("utf-8", "surrogateescape")))


def shards_columns(shards: Shards, known: tuple[str, ...]) -> RawColumns | None:
    """The shards' columns one below the other; None when in doubt, or when they are not all alike."""
    parts: list[RawColumns] = []
    rows = listed = unpacked = 0
    for _, data in shards.contents():
        unpacked += sheets.unpacked_bytes(data)
        part = raw_columns(data, "parquet", known) if unpacked <= sheets.MAX_UNPACKED_BYTES else None
        if part is None or part.names != (parts or [part])[0].names:
            return None
        rows += part.rows
        listed += sum(array.nbytes for array in part.arrays.values() if pa.types.is_nested(array.type))
        if rows > texts.MAX_ROWS or listed > sheets.MAX_LIST_BYTES:
            return None
        parts.append(part)
    try:
        arrays = {name: _stacked([part.arrays[name] for part in parts]) for name in parts[0].arrays}
    except DoubtError:
        return None
    return RawColumns(parts[0].names, rows, arrays, _marks([part.metadata for part in parts]))


def _stacked(columns: list[pa.ChunkedArray]) -> pa.ChunkedArray:
    kind = columns[0].type
    if any(column.type != kind for column in columns):
        raise DoubtError
    return pa.chunked_array([chunk for column in columns for chunk in column.chunks], kind)


def shards_sheet(shards: Shards, known: tuple[str, ...], faults: Faults) -> Sheet:
    """The shards' cells one below the other; a column that only some of them have is null in the others.

    Sets how `faults` tells of a row. Raises FaultsError for a shard that cannot be read, and for more rows
    or bytes than one file may have.
    """
    parts: dict[str, Sheet] = {}
    rows = unpacked = items = 0
    for name, data in shards.contents():
        unpacked += sheets.unpacked_bytes(data)
        if unpacked > sheets.MAX_UNPACKED_BYTES:
            expected = f"at most {sheets.MAX_UNPACKED_BYTES:,} bytes in all shards"
            faults.stop(f"{unpacked:,} bytes, unpacked", expected, "Leave out columns or predictions.")
        part = parts[name] = sheet_of(data, "parquet", known, Faults(_name(faults, name)))
        rows += len(part.rows)
        texts.limit_rows(rows, faults)
        items += sum(len(cell) for cells in part.cells.values() for cell in cells if isinstance(cell, list))
        if items * _ITEM_BYTES > sheets.MAX_LIST_BYTES:
            faults.stop(f"lists of {items:,} items", "fewer items in all shards", "Shorten the lists.")
    names = list(dict.fromkeys(name for part in parts.values() for name in part.columns))
    cells = {
        name: [cell for part in parts.values() for cell in part.cells.get(name) or [None] * len(part.rows)]
        for name in known
        if name in names
    }
    ends = list(accumulate(len(part.rows) for part in parts.values()))
    shard_names = [_name(faults, name) for name in parts]

    def source_of(row: int) -> tuple[str, int]:
        shard = bisect_right(ends, row - 1)
        return shard_names[shard], row - (ends[shard - 1] if shard else 0)

    faults.source_of = source_of
    marks = _marks([part.metadata for part in parts.values()])
    return Sheet(tuple(names), range(1, rows + 1), cells, marks)


def _marks(parts: list[dict[str, str]]) -> dict[str, str]:
    """The marks that all shards share."""
    return {key: value for key, value in parts[0].items() if all(part.get(key) == value for part in parts)}


def _name(faults: Faults, shard: str) -> str:
    return f"{faults.file}/{visible(shard, 300)}"
