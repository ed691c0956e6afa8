"""COOOL results read by column: the same captions as `coool.coool` gives, for files without any fault.

Whatever is wrong, odd or in doubt gives None, and the rows are read one by one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from pipeline.columns import Coded
from pipeline.errors import FaultsError
from pipeline.predictions import FRAMES, LABEL, TRACKS, Predictions
from sitegen import checks, texts
from sitegen.checks import MAX_LIST_ITEMS, Faults, Wrong
from sitegen.columns import Accepted, DoubtError, distinct
from sitegen.coool import MAX_SLOTS, frame_of, header_of, track_id, untold_warnings
from sitegen.plain_csv import csv_table
from sitegen.video_ids import VideoIds

Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Frames:
    """The rows: each one's video, by its place in `videos` (in the order of the file), and its frame."""

    videos: list[str]
    video: Index
    frame: Index


@dataclass(frozen=True, slots=True)
class _Slots:
    """All slots with a caption: the row, the slot's place, the track (0: none) and the caption by number.

    `untold` counts the slots with a track alone.
    """

    row: Index
    place: Index
    track: Index
    name: Index
    tracks: list[str]
    names: list[str]
    untold: int


def coool_predictions(
    data: bytes, known: set[str] | None, video_map: Mapping[str, str]
) -> tuple[Accepted, list[str]] | None:
    """The predictions of COOOL results, and the warnings about their captions; None when in doubt."""
    try:
        found = csv_table(data, None, unlike={"0"})
        if found is None:
            return None
        header = header_of(found[0], Faults(""))
        frames = _frames(found[1].column(0))
        slots = _slots(found[1], len(header))
        ids = VideoIds(known, video_map, frames.videos)
        predictions = _predictions(frames, slots, [ids(video) for video in frames.videos])
    except (DoubtError, Wrong, FaultsError, pa.ArrowException, ValueError, MemoryError):
        return None
    return Accepted(predictions, ids, is_verbatim=False), untold_warnings(slots.untold)


def _frames(column: pa.ChunkedArray) -> _Frames:
    """The rows' videos and frames. Raises DoubtError when a frame comes twice."""
    parts = pc.split_pattern(column.combine_chunks(), "_", max_splits=1, reverse=True)
    if pc.min(pc.list_value_length(parts)).as_py() != 2:
        raise DoubtError
    video, videos = distinct(pa.chunked_array([pc.list_element(parts, 0)]))
    number, numbers = distinct(pa.chunked_array([pc.list_element(parts, 1)]))
    if any(not text or text != text.strip() for text in videos[:-1]):
        raise DoubtError
    frame = np.array([_number(text) for text in numbers[:-1]], dtype=np.int64)[number]
    key = video.astype(np.int64) << 32 | frame
    if not bool(np.all(key[1:] > key[:-1])):
        key = np.sort(key)
        if not bool(np.all(key[1:] > key[:-1])):
            raise DoubtError
    return _Frames(videos[:-1], video.astype(np.int64), frame)


def _number(text: str) -> int:
    """The frame of an ID that ends in `_` and this text."""
    found = frame_of(f"v_{text}")
    if found is None:
        raise DoubtError
    return found[1]


def _slots(table: pa.Table, n_columns: int) -> _Slots:
    """The captions of all rows, slot by slot. Raises DoubtError for cells past the header's columns."""
    if not all(_is_blank(table.column(place)) for place in range(n_columns, table.num_columns)):
        raise DoubtError
    tracks, names = _Numbers(track_id), _Numbers(checks.description)
    found: list[tuple[Index, Index, Index, Index]] = []
    untold = 0
    for place in range(2, n_columns, 2):
        if _is_blank(table.column(place)) and _is_blank(table.column(place + 1)):
            continue
        track, name = tracks.of(table.column(place)), names.of(table.column(place + 1))
        untold += int(np.count_nonzero((track > 0) & (name == 0)))
        rows = np.flatnonzero(name)
        found.append((rows, np.full(len(rows), place - 2), track[rows], name[rows]))
    none = np.zeros(0, dtype=np.int64)
    columns = [np.concatenate(parts) for parts in zip(*found, (none,) * 4, strict=True)] if found else []
    row, place_, track, name = columns or (none,) * 4
    return _Slots(row, place_, track, name, list(tracks.number), list(names.number), untold)


def _is_blank(column: pa.ChunkedArray) -> bool:
    if pa.types.is_null(column.type):
        return True
    return not any(text.strip() for chunk in column.chunks for text in chunk.dictionary.to_pylist())


class _Numbers:
    """The distinct clean texts of several columns, counted from 1; 0 is an empty cell."""

    def __init__(self, check: Callable[[Any], str]) -> None:
        """`check` gives a clean text or raises Wrong."""
        self.number = {"": 0}
        self._check = check
        self._known: dict[str, int] = {}

    def of(self, column: pa.ChunkedArray) -> Index:
        """The number of each cell."""
        if pa.types.is_null(column.type):
            return np.zeros(len(column), dtype=np.int64)
        codes, values = distinct(column)
        return np.array([self._number(text) for text in values[:-1]], dtype=np.int64)[codes]

    def _number(self, text: str) -> int:
        if text not in self._known:
            stripped = text.strip()
            clean = self._check(stripped) if stripped else ""
            self._known[text] = self.number.setdefault(clean, len(self.number))
        return self._known[text]


def _predictions(frames: _Frames, slots: _Slots, video_ids: list[str]) -> Predictions:
    """The captions of each video, ranked as `coool.coool` ranks them. `video_ids` are the truth's."""
    if len(video_ids) * len(slots.tracks) * len(slots.names) >= 2**62:
        raise DoubtError
    # Videos by their sorted ids, only those with captions.
    video = frames.video[slots.row]
    said = sorted(set(video.tolist()), key=video_ids.__getitem__)
    position = np.zeros(len(video_ids), dtype=np.int64)
    position[said] = np.arange(len(said))
    video = position[video]

    frame = frames.frame[slots.row]
    group = (video * len(slots.tracks) + slots.track) * len(slots.names) + slots.name
    order = np.lexsort((frame * (MAX_SLOTS * 2) + slots.place, group))
    group, frame = group[order], frame[order]
    is_first = np.concatenate(([True], group[1:] != group[:-1]))[: len(group)]
    starts = np.flatnonzero(is_first)
    # A caption may stand in two slots of one frame.
    kept = np.flatnonzero(is_first | np.concatenate(([True], frame[1:] != frame[:-1]))[: len(frame)])
    begins = np.searchsorted(kept, starts)
    counts = np.diff(begins, append=len(kept))
    if len(counts) > texts.MAX_ROWS or counts.max(initial=0) > MAX_LIST_ITEMS:
        raise DoubtError
    first = order[starts]
    rows = np.lexsort((slots.place[first], frame[starts], -counts, video[first]))
    first = first[rows]
    videos = video[first]
    is_new = np.concatenate(([True], videos[1:] != videos[:-1]))[: len(videos)]
    begin = np.maximum.accumulate(np.where(is_new, np.arange(len(videos)), 0))
    lists = pa.ListArray.from_arrays(
        pa.array(np.append(begins, len(kept)).astype(np.int32)), pa.array(frame[kept].astype(np.int32))
    )
    return Predictions(
        Coded(videos.astype(np.int32), pa.array([video_ids[place] for place in said], pa.string())),
        (np.arange(len(videos)) - begin + 1).astype(np.int32),
        Coded((slots.name[first] - 1).astype(np.int32), pa.array(slots.names[1:], pa.string())),
        Coded.same(None, len(videos), LABEL),
        Coded(
            slots.track[first].astype(np.int32), pa.array([[t] if t else [] for t in slots.tracks], TRACKS)
        ),
        Coded(rows.astype(np.int32), lists.cast(FRAMES)),
    )
