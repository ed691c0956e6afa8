"""Tables with our columns, read and checked column by column: what is clean becomes `Predictions`.

The definition of what is right is the reading cell by cell (sheets.py, readers.py), which also words the
faults. Here a whole column is checked at once, and each distinct text by the very check of its cells.
Whatever is wrong, odd or in doubt gives None, and the cells are read one by one.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pipeline.columns import Coded
from pipeline.predictions import FRAMES, LABEL, TRACKS, Predictions
from sitegen import checks, sheets, texts
from sitegen.checks import MAX_LIST_ITEMS, MAX_WHOLE, Wrong, is_missing
from sitegen.plain_csv import csv_table
from sitegen.video_ids import VideoIds

Codes: TypeAlias = NDArray[np.int32]

COLUMNAR = ("csv", "parquet")
"""The formats with our columns that are read by column."""

_REQUIRED = ("video_id", "rank", "description")


class DoubtError(Exception):
    """The cells have to be looked at one by one."""


@dataclass(frozen=True, slots=True)
class RawColumns:
    """A file's columns as they came: the `names` of all, the `arrays` of the known ones, `rows` long each.

    `metadata` holds a Parquet file's text marks.
    """

    names: tuple[str, ...]
    rows: int
    arrays: dict[str, pa.ChunkedArray]
    metadata: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Accepted:
    """The predictions of clean columns, how their video ids were taken, and whether a cell was changed."""

    predictions: Predictions
    ids: VideoIds
    is_verbatim: bool


def raw_columns(data: bytes, source_format: str, known: Sequence[str]) -> RawColumns | None:
    """The columns of a file's content in one of the `COLUMNAR` formats; None when in doubt."""
    try:
        return _csv(data, known) if source_format == "csv" else _parquet(data, known)
    except (DoubtError, pa.ArrowException, OSError, ValueError, IndexError, MemoryError):
        return None


def accepted(raw: RawColumns, known: set[str] | None, video_map: Mapping[str, str]) -> Accepted | None:
    """The predictions in the columns when everything in them is right; None when anything is not.

    `known` are the truth's video ids, None when there is no truth.
    """
    try:
        return _accepted(raw, known, video_map)
    except (DoubtError, Wrong, pa.ArrowException, ValueError, OverflowError, MemoryError):
        return None


def _csv(data: bytes, known: Sequence[str]) -> RawColumns | None:
    found = csv_table(data, known)
    if found is None:
        return None
    header, table = found
    names = tuple(name.strip() for name in header)
    if any(names.count(name) > 1 for name in known):
        return None
    arrays = {names[int(place)]: table.column(place) for place in table.column_names}
    return RawColumns(names, table.num_rows, arrays)


def _parquet(data: bytes, known: Sequence[str]) -> RawColumns | None:
    metadata = pq.read_metadata(pa.BufferReader(data))
    groups = [metadata.row_group(place) for place in range(metadata.num_row_groups)]
    unpacked = sum(group.total_byte_size for group in groups)
    if metadata.num_rows > texts.MAX_ROWS or unpacked > sheets.MAX_UNPACKED_BYTES:
        return None
    leaves = [metadata.schema.column(place) for place in range(len(metadata.schema))]
    leaves = [leaf for leaf in leaves if leaf.path.split(".")[0] in known]
    strings = [leaf.path for leaf in leaves if leaf.physical_type == "BYTE_ARRAY"]
    with pq.ParquetFile(pa.BufferReader(data), read_dictionary=strings) as file:
        names = tuple(file.schema_arrow.names)
        if any(names.count(name) > 1 for name in known):
            return None
        marks = sheets.marks_of(file.schema_arrow)
        lists = {leaf.path.split(".")[0] for leaf in leaves if leaf.max_repetition_level > 0}
        arrays = {name: _lists(file, name) for name in known if name in lists}
        table = file.read(columns=[name for name in known if name in names and name not in lists])
    arrays |= {name: table.column(name) for name in table.column_names}
    if any(len(array) != metadata.num_rows for array in arrays.values()):
        return None
    return RawColumns(names, metadata.num_rows, arrays, marks)


def _lists(file: pq.ParquetFile, name: str) -> pa.ChunkedArray:
    """A column of lists, read in parts as `sheets` does, since few bytes can hold very many items."""
    parts: list[pa.Array] = []
    unpacked = 0
    for batch in file.iter_batches(batch_size=sheets.LIST_ROWS, columns=[name]):
        unpacked += batch.nbytes
        if unpacked > sheets.MAX_LIST_BYTES:
            raise DoubtError
        parts.append(batch.column(0))
    return pa.chunked_array(parts, file.schema_arrow.field(name).type)


def _accepted(raw: RawColumns, known: set[str] | None, video_map: Mapping[str, str]) -> Accepted:
    if any(name not in raw.arrays for name in _REQUIRED):
        raise DoubtError
    video, ids, same_ids = _videos(raw.arrays["video_id"], known, video_map)
    rank = _ranks(raw.arrays["rank"])
    description, same_texts = _texts(raw.arrays["description"], checks.description)
    label, same_labels = _optional(raw, "label", checks.text, LABEL, None)
    tracks, same_tracks = _optional(raw, "track_ids", checks.track_ids, TRACKS, ())
    frames, same_frames = _optional(raw, "frame_indices", checks.frame_indices, FRAMES, ())
    predictions = Predictions(video, rank, description, label, tracks, frames)
    key = video.codes.astype(np.int64) << 32 | rank
    is_sorted = bool(np.all(key[1:] > key[:-1]))
    if not is_sorted:
        predictions = _sorted(predictions, key)
    is_verbatim = is_sorted and same_ids and same_texts and same_labels and same_tracks and same_frames
    return Accepted(predictions, ids, is_verbatim)


def _sorted(rows: Predictions, key: NDArray[np.int64]) -> Predictions:
    order = np.argsort(key, kind="stable")
    key = key[order]
    if not bool(np.all(key[1:] > key[:-1])):  # a rank twice in a video
        raise DoubtError
    columns = (rows.description, rows.label, rows.track_ids, rows.frame_indices)
    return Predictions(
        rows.video.ordered(order), rows.rank[order], *(column.ordered(order) for column in columns)
    )


def _videos(
    column: pa.ChunkedArray, known: set[str] | None, video_map: Mapping[str, str]
) -> tuple[Coded, VideoIds, bool]:
    """The videos, sorted, with the number of each row's."""
    codes, values = distinct(column)
    met = pa.array(codes).dictionary_encode().dictionary.to_pylist()  # in the order of the file
    ids = VideoIds(known, video_map, [values[code] for code in met])
    video_of = {code: ids(values[code]) for code in met}
    video_ids = sorted(set(video_of.values()))
    number = {video_id: place for place, video_id in enumerate(video_ids)}
    new = np.zeros(len(values), dtype=np.int32)
    for code, video_id in video_of.items():
        new[code] = number[video_id]
    is_same = all(values[code] == video_id for code, video_id in video_of.items())
    return Coded(new[codes], pa.array(video_ids, pa.string())), ids, is_same


def _ranks(column: pa.ChunkedArray) -> Codes:
    if pa.types.is_integer(column.type):
        return _integers(column, 1)
    codes, values = distinct(column)
    used = np.bincount(codes, minlength=len(values)) > 0
    ranks = [checks.whole(value, 1) if is_used else 0 for value, is_used in zip(values, used, strict=True)]
    return np.array(ranks, dtype=np.int32)[codes]


def _integers(column: pa.ChunkedArray, minimum: int) -> Codes:
    """Whole numbers from `minimum` that are numbers already."""
    if column.null_count:
        raise DoubtError
    if len(column):
        bounds = pc.min_max(column).as_py()
        if bounds["min"] < minimum or bounds["max"] > MAX_WHOLE:
            raise DoubtError
    return np.asarray(column.cast(pa.int32()).to_numpy(), dtype=np.int32)


def _optional(
    raw: RawColumns, name: str, check: Callable[[Any], Any], kind: pa.DataType, missing: Any
) -> tuple[Coded, bool]:
    """A column that may be missing, in whole or in single cells, and whether all of it stayed as it was."""
    column = raw.arrays.get(name)
    if column is None:
        return Coded.same(missing, raw.rows, kind), True
    if pa.types.is_list(column.type) or pa.types.is_large_list(column.type):
        if not pa.types.is_list(kind):
            raise DoubtError
        return _items(column, name)
    found, is_same = _texts(column, lambda value: missing if is_missing(value) else check(value), kind)
    return found, is_same and not pa.types.is_list(kind)


def _texts(
    column: pa.ChunkedArray, check: Callable[[Any], Any], kind: pa.DataType = LABEL
) -> tuple[Coded, bool]:
    """A column by its distinct values, each checked once; and whether the check left all as they were."""
    codes, values = distinct(column)
    used = np.bincount(codes, minlength=len(values)) > 0
    number: dict[Any, int] = {}
    new = np.zeros(len(values), dtype=np.int32)
    is_same = True
    for code in np.flatnonzero(used).tolist():
        clean = check(values[code])
        is_same &= clean == values[code]
        new[code] = number.setdefault(clean, len(number))
    if not np.array_equal(new[used], np.flatnonzero(used)):
        codes = new[codes]
    return Coded(codes, pa.array(list(number), kind)), is_same


def _items(column: pa.ChunkedArray, name: str) -> tuple[Coded, bool]:
    """A column of lists: their items are checked as one column; a null is an empty list."""
    lengths = np.asarray(pc.fill_null(pc.list_value_length(column), 0).to_numpy(), dtype=np.int64)
    if len(lengths) and lengths.max() > MAX_LIST_ITEMS:
        raise DoubtError
    flat = pa.chunked_array([chunk.flatten() for chunk in column.chunks], column.type.value_type)
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    if offsets[-1] > MAX_WHOLE or offsets[-1] != len(flat):
        raise DoubtError
    is_same = True
    if name == "frame_indices" and pa.types.is_integer(flat.type):
        items = pa.array(_integers(flat, 0))
    elif name == "frame_indices":
        raise DoubtError
    else:
        coded, is_same = _texts(flat, lambda value: checks.identifier(value, "track ids"))
        items = pa.DictionaryArray.from_arrays(pa.array(coded.codes), coded.values)
    lists = pa.ListArray.from_arrays(pa.array(offsets.astype(np.int32)), items)
    return Coded(np.arange(len(lists), dtype=np.int32), lists), is_same


def distinct(column: pa.ChunkedArray) -> tuple[Codes, list[Any]]:
    """A column as places in a list of its distinct values, which may also hold some that it has not.

    Raises DoubtError for other values than texts and numbers, ValueError for text that is not UTF-8.
    """
    kind = column.type
    if pa.types.is_null(kind):  # also a column of empty cells in a CSV
        return np.zeros(len(column), dtype=np.int32), [None]
    if not pa.types.is_dictionary(kind):
        column = column.dictionary_encode()
    inner = column.type.value_type
    is_number = pa.types.is_integer(inner) or pa.types.is_float64(inner) or pa.types.is_float32(inner)
    if not (is_number or pa.types.is_string(inner) or pa.types.is_large_string(inner)):
        raise DoubtError
    for chunk in column.chunks:  # a damaged file's places may lie outside, which nothing below looks at
        places = pc.min_max(chunk.indices).as_py()
        if places["min"] is not None and not 0 <= places["min"] <= places["max"] < len(chunk.dictionary):
            raise DoubtError
    array = column.unify_dictionaries().combine_chunks()
    values = [*array.dictionary.to_pylist(), None]
    codes = array.indices.fill_null(len(values) - 1) if array.null_count else array.indices
    return np.asarray(codes.to_numpy(zero_copy_only=False), dtype=np.int32), values
