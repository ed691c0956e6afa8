"""Where watermarks are, said by a person: a CSV of boxes by video."""

import csv
import io
import math
from collections.abc import Collection
from pathlib import Path

from pipeline.data.watermark_find import PixelBox
from pipeline.errors import Fault, FaultsError, InputError
from pipeline.video import MAX_SIDE_PX

COLUMNS = ("video_id", "x1_px", "y1_px", "x2_px", "y2_px")
MAX_BYTES = 16 << 20


def read_watermark_boxes(path: Path, video_ids: Collection[str]) -> dict[str, tuple[PixelBox, ...]]:
    """The boxes of each video that has some, rounded outwards to whole pixels, in the file's order.

    Raises InputError when the file is no such CSV, FaultsError with every row that is wrong.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: found {path.stat().st_size:,} bytes; expected at most {MAX_BYTES:,}.")
        reader = csv.DictReader(io.StringIO(path.read_text("utf-8-sig"), newline=""), restkey="", strict=True)
        rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not readable ({error}); expected a CSV of {','.join(COLUMNS)}.") from error
    if sorted(reader.fieldnames or ()) != sorted(COLUMNS):
        found = ",".join(reader.fieldnames or ())[:200] or "nothing"
        raise InputError(f"{path}: found columns {found}; expected {','.join(COLUMNS)}.")
    faults: list[Fault] = []
    boxes: dict[str, list[PixelBox]] = {}
    for number, row in enumerate(rows, start=1):
        video_id, values = row["video_id"], [_number(row[name]) for name in COLUMNS[1:]]
        x1, y1, x2, y2 = values
        if "" in row or None in row.values():
            faults.append(_fault(path, number, None, "another number of cells", f"{len(COLUMNS)}"))
        elif video_id not in video_ids:
            faults.append(_fault(path, number, "video_id", repr(video_id[:80]), "the id of a clip"))
        elif not (0 <= x1 < x2 <= MAX_SIDE_PX and 0 <= y1 < y2 <= MAX_SIDE_PX):
            found = ",".join(str(row[name])[:20] for name in COLUMNS[1:])
            faults.append(_fault(path, number, None, found, "0 <= x1_px < x2_px and 0 <= y1_px < y2_px"))
        else:
            box = (math.floor(x1), math.floor(y1), math.ceil(x2), math.ceil(y2))
            boxes.setdefault(video_id, []).append(box)
    if faults:
        raise FaultsError(faults)
    return {video_id: tuple(found) for video_id, found in boxes.items()}


def _number(cell: str | None) -> float:
    """A cell as a number, NaN when it is none: NaN fits no range."""
    try:
        return float(cell or "")
    except ValueError:
        return math.nan


def _fault(path: Path, number: int, column: str | None, found: str, expected: str) -> Fault:
    return Fault(str(path), number, column, found, expected, "Correct the row.")
