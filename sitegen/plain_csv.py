"""The columns of a CSV by pyarrow, where its rules and those of `texts.csv_rows` give the same cells.

Where they might not, there is no answer here, and the cells are read one by one.
"""

import csv
from collections.abc import Collection

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from numpy.typing import NDArray

from sitegen import texts as text_files

BYTE_ORDER_MARK = b"\xef\xbb\xbf"

_QUOTE, _COMMA, _LINE_END, _RETURN = b'",\n\r'
_REPEATED = pa.dictionary(pa.int32(), pa.string())
_MAX_HEADER_BYTES = 64 * 2**10
_SAMPLE_BYTES = 64 * 2**10
_BLOCK_BYTES = 256 * 2**10


def csv_table(
    data: bytes, known: Collection[str] | None, *, unlike: Collection[str] = ()
) -> tuple[list[str], pa.Table] | None:
    """A CSV's header, and its data rows as a table of texts; None when in doubt.

    The table's columns are those named in `known` (None: all of them), by their place in the header from
    "0": dictionaries, plain texts where `unlike` says that hardly one repeats, nulls where every cell is
    empty. Else an empty cell is an empty text. Blanks around names and texts are kept.
    """
    start = len(BYTE_ORDER_MARK) if data.startswith(BYTE_ORDER_MARK) else 0
    end = data.find(b"\n", start, start + _MAX_HEADER_BYTES) + 1
    # pyarrow would leave out a mark at the start of the rows, too, which is part of a cell.
    if not end or end == len(data) or data.startswith(BYTE_ORDER_MARK, end) or not _is_plain(data, start):
        return None
    try:
        (names,) = csv.reader([data[start:end].decode()], strict=True)
    except (csv.Error, ValueError):  # ValueError: a blank line, or no UTF-8
        return None
    places = [str(place) for place, name in enumerate(names) if known is None or name.strip() in known]
    types = {place: pa.string() if place in unlike else _REPEATED for place in places}
    empty = dict.fromkeys(_empty_at_first(data[end : end + _SAMPLE_BYTES], types), pa.null())
    table = _read(data, end, len(names), types | empty)
    if table is None and empty:
        table = _read(data, end, len(names), types)
    return None if table is None else (names, table)


def _empty_at_first(sample: bytes, places: Collection[str]) -> list[str]:
    """The columns without any text in the first rows. An empty column costs a tenth of a column of texts."""
    lines = sample.decode("utf-8", "replace").split("\n")[:-1]
    columns = list(zip(*csv.reader(lines), strict=False))
    return [place for place in places if int(place) < len(columns) and not any(columns[int(place)])]


def _read(data: bytes, start: int, n_columns: int, types: dict[str, pa.DataType]) -> pa.Table | None:
    if not types:
        return None
    try:
        table = arrow_csv.read_csv(
            pa.py_buffer(data).slice(start),
            arrow_csv.ReadOptions(column_names=[str(place) for place in range(n_columns)]),
            arrow_csv.ParseOptions(),
            arrow_csv.ConvertOptions(
                column_types=types, include_columns=list(types), null_values=[""], strings_can_be_null=False
            ),
        )
    except (pa.ArrowException, OSError, ValueError, MemoryError):
        return None
    return table if table.num_rows <= text_files.MAX_ROWS else None


def _is_plain(data: bytes, start: int) -> bool:
    """Whether quotes and line ends can be read in one way only.

    Lines end in LF or CR LF. Each cell is quoted as a whole or not at all, and no quoted one holds a line
    end. So an opening quote stands at a line's start or after a comma, or doubles the quote before it; a
    closing one before a comma or a line's end, or before the quote that doubles it.
    """
    content = np.frombuffer(data, dtype=np.uint8)
    if b"\0" in data or (b"\r" in data and not _all_before(content, _RETURN, _LINE_END)):
        return False
    if b'"' not in data:
        return True
    quotes = np.flatnonzero(content == _QUOTE)
    if len(quotes) % 2:
        return False
    opening, closing = quotes[::2], quotes[1::2]
    before = content[opening - 1]  # at 0 the last byte, which the next line puts right
    before[opening == start] = _LINE_END
    after = content[np.minimum(closing + 1, len(content) - 1)]
    after[closing + 1 == len(content)] = _LINE_END
    if not bool(np.isin(before, (_QUOTE, _COMMA, _LINE_END)).all()):
        return False
    if not bool(np.isin(after, (_QUOTE, _COMMA, _LINE_END, _RETURN)).all()):
        return False
    ends = np.flatnonzero(content == _LINE_END)
    return bool(np.array_equal(np.searchsorted(ends, opening), np.searchsorted(ends, closing)))


def _all_before(content: NDArray[np.uint8], byte: int, next_byte: int) -> bool:
    """Whether after each `byte` comes `next_byte`."""
    if content[-1] == byte:
        return False
    for start in range(0, len(content), _BLOCK_BYTES):  # small enough for the processor's cache
        block = content[start : start + _BLOCK_BYTES + 1]
        if not bool(((block[:-1] != byte) | (block[1:] == next_byte)).all()):
            return False
    return True
