"""When the driver of each video reacts, as people or programs write it down: a table of two columns (ours).

`video_id,changed_at_frame`: the first frame at which the driver's state has changed, empty for never. A
video that is not in the table is one of which nothing is known.
"""

from collections.abc import Collection
from pathlib import Path

from sitegen import checks
from sitegen.captions import checked
from sitegen.checks import Faults, is_missing, visible
from sitegen.formats import format_of
from sitegen.sheets import sheet_of
from sitegen.unpack import content_of

FILE_NAME = "driver_states.csv"
COLUMNS = ("video_id", "changed_at_frame")
REACTION_COLUMNS = ("video_id", "frame_index")


def read_driver_states(path: Path, known: Collection[str] | None = None) -> dict[str, int | None]:
    """Video -> the frame of the change, or None for never; CSV, JSON Lines or Parquet.

    A `reactions` table, whose column is `frame_index`, is read as well. With `known`, these are the only
    videos there are. Raises FaultsError with every fault.
    """
    faults = Faults(visible(str(path), 1_000))
    content = content_of(path, faults)
    source_format = format_of(content.data, content.name, faults)
    sheet = sheet_of(content.data, source_format, (*COLUMNS, *REACTION_COLUMNS[1:]), faults)
    column = REACTION_COLUMNS[1] if REACTION_COLUMNS[1] in sheet.cells else COLUMNS[1]
    for name in (COLUMNS[0], column):
        if name not in sheet.columns:
            shown = ", ".join(visible(other) for other in sheet.columns[:20])
            mend = f"Write {','.join(COLUMNS)} in the first line."
            faults.add(None, name, f"no such column, but the columns {shown}", f"a column `{name}`", mend)
    faults.raise_if_any()
    found: dict[str, int | None] = {}
    cells = zip(sheet.rows, sheet.cells[COLUMNS[0]], sheet.cells[column], strict=True)
    for row, raw_video, raw_frame in cells:
        video = checked(checks.safe_identifier, raw_video, faults, row, COLUMNS[0])
        missing = is_missing(raw_frame)
        frame = None if missing else checked(_frame, raw_frame, faults, row, column)
        if video is None:
            continue
        if video in found:
            faults.add(row, COLUMNS[0], f"'{video}' again", "each video once", "Remove one of the rows.")
        elif known is not None and video not in known:
            expected = f"one of the {len(known)} videos of the truth"
            faults.add(row, COLUMNS[0], f"'{video}'", expected, "Correct the id, or leave the row out.")
        found.setdefault(video, frame)
    faults.raise_if_any()
    return found


def _frame(value: object) -> int:
    return checks.whole(value, 0)
