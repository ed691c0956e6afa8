"""Boxes from key boxes: a person draws a box at some frames, those in between are interpolated."""

import csv
import io
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

from pipeline.errors import Fault, FaultsError, InputError
from pipeline.records import Box, Kind, TrackBox

COLUMNS = ("video_id", "track_id", "kind", "frame_index", "x1_px", "y1_px", "x2_px", "y2_px")
MAX_BYTES = 64_000_000
MAX_FRAMES = 1_000_000  # of one track: a wrong frame index must not fill the memory
MAX_PX = 100_000.0
DECIMALS = 1

_SIDES = COLUMNS[4:]


def read_key_boxes(path: Path) -> list[TrackBox]:
    """The key boxes in a CSV file, which may reach beyond the frame.

    Raises FaultsError with every fault: a wrong column, number or kind, a box without an area, a
    second box of a track in one frame, a track of two kinds.
    """
    rows = _rows(path)
    faults: list[Fault] = []
    boxes: list[TrackBox] = []
    seen: dict[tuple[str, str, int], int] = {}
    kinds: dict[tuple[str, str], Kind] = {}
    for number, row in enumerate(rows, 1):
        found = _key_box(str(path), number, row, faults)
        if found is None:
            continue
        first = seen.setdefault((found.video_id, found.track_id, found.frame_index), number)
        if first != number:
            faults.append(_fault(path, number, "frame_index", f"the frame of row {first}", "one box a frame"))
        kind = kinds.setdefault((found.video_id, found.track_id), found.kind)
        if kind != found.kind:
            faults.append(_fault(path, number, "kind", str(found.kind), f"{kind}, as before in this track"))
        boxes.append(found)
    for (video, track), frames in _by_track(boxes).items():
        span = frames[-1].frame_index - frames[0].frame_index
        if span > MAX_FRAMES:
            found_span = f"{span} frames in track {track} of {video}"
            faults.append(_fault(path, None, "frame_index", found_span, f"at most {MAX_FRAMES:,}"))
    if faults:
        raise FaultsError(faults)
    return boxes


def interpolate(keys: Iterable[TrackBox], sizes_px: Mapping[str, tuple[int, int]]) -> list[TrackBox]:
    """A box for every frame from a track's first key box to its last, in the order of the tracks.

    Each side moves in a straight line between two key boxes, is rounded to 0.1 px and cut off at the
    frame's edge; `sizes_px` has the (width, height) of each video. A box that is wholly outside is
    left out. Raises InputError for a video without a size.
    """
    tracks = _by_track(keys)
    missing = sorted({video for video, _ in tracks} - sizes_px.keys())
    if missing:
        raise InputError(f"found no frame size of {', '.join(missing)}; expected one for every video.")
    made: list[TrackBox] = []
    for (video, _), frames in tracks.items():
        width_px, height_px = sizes_px[video]
        for box in _between(frames):
            inside = _cut(box.box, width_px, height_px)
            if inside.width_px > 0 and inside.height_px > 0:
                made.append(TrackBox(video, box.frame_index, box.track_id, box.kind, inside))
    return made


def _between(keys: list[TrackBox]) -> Iterator[TrackBox]:
    for before, after in pairwise(keys):
        for index in range(before.frame_index, after.frame_index):
            share = (index - before.frame_index) / (after.frame_index - before.frame_index)
            yield TrackBox(
                before.video_id, index, before.track_id, before.kind, _mix(before.box, after.box, share)
            )
    last = keys[-1]
    yield TrackBox(last.video_id, last.frame_index, last.track_id, last.kind, _mix(last.box, last.box, 0.0))


def _mix(a: Box, b: Box, share: float) -> Box:
    return Box(
        round(a.x1_px + (b.x1_px - a.x1_px) * share, DECIMALS),
        round(a.y1_px + (b.y1_px - a.y1_px) * share, DECIMALS),
        round(a.x2_px + (b.x2_px - a.x2_px) * share, DECIMALS),
        round(a.y2_px + (b.y2_px - a.y2_px) * share, DECIMALS),
    )


def _cut(box: Box, width_px: int, height_px: int) -> Box:
    (x1, x2), (y1, y2) = (
        # The zero first: of two equal numbers `max` takes that one, and -0.0 is another byte.
        (min(max(0.0, low), float(limit)), min(max(0.0, high), float(limit)))
        for low, high, limit in ((box.x1_px, box.x2_px, width_px), (box.y1_px, box.y2_px, height_px))
    )
    return Box(x1, y1, x2, y2)


def _by_track(boxes: Iterable[TrackBox]) -> dict[tuple[str, str], list[TrackBox]]:
    """The boxes of each (video, track), by frame; tracks sorted."""
    tracks: dict[tuple[str, str], list[TrackBox]] = defaultdict(list)
    for box in boxes:
        tracks[box.video_id, box.track_id].append(box)
    return {key: sorted(tracks[key], key=lambda box: box.frame_index) for key in sorted(tracks)}


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: found more than {MAX_BYTES:,} bytes; expected a table of key boxes.")
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; expected a CSV of key boxes.") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not readable as UTF-8 text ({error}); expected a CSV.") from error
    reader = csv.DictReader(io.StringIO(text, newline=""), restkey="", restval="", strict=True)
    try:
        rows = list(reader)
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not readable as CSV ({error}).") from error
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise FaultsError([_fault(path, None, name, "no such column", "one") for name in missing])
    return rows


def _key_box(file: str, number: int, row: Mapping[str, str], faults: list[Fault]) -> TrackBox | None:
    before = len(faults)

    def wrong(column: str, expected: str) -> None:
        faults.append(_fault(file, number, column, repr(str(row[column])[:60]), expected))

    for column in ("video_id", "track_id"):
        if not row[column].strip():
            wrong(column, "an id")
    if row["kind"] not in (Kind.CHALLENGE, Kind.TRAFFIC):
        wrong("kind", "challenge or traffic")
    index = row["frame_index"]
    if not (index.isascii() and index.isdecimal() and len(index) <= 9):
        wrong("frame_index", "a whole number from 0")
    sides = []
    for column in _SIDES:
        try:
            side = float(row[column])
        except ValueError:
            side = math.nan
        if not abs(side) <= MAX_PX:
            wrong(column, f"a number of pixels, at most {MAX_PX:,.0f} either way")
        sides.append(side)
    if len(faults) == before:
        for low, high in ((0, 2), (1, 3)):
            if sides[low] >= sides[high]:
                wrong(_SIDES[high], f"more than {_SIDES[low]}")
    if len(faults) > before:
        return None
    return TrackBox(row["video_id"], int(index), row["track_id"], Kind(row["kind"]), Box(*sides))


def _fault(path: Path | str, row: int | None, column: str | None, found: str, expected: str) -> Fault:
    return Fault(str(path), row, column, found, expected, "Mend the table of key boxes.")
