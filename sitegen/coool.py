"""The results of two challenges: COOOL's, a row for every frame, and 2COOOL's, a row for every video.

Both as PAPER, section 4, describes them: captions come back, and for COOOL the track and frames they are of.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.records import Prediction
from sitegen import checks
from sitegen.captions import Captions, checked, counted
from sitegen.checks import MAX_LIST_ITEMS, MAX_WHOLE, Faults, Wrong, show, visible
from sitegen.formats import CAPTION_2COOOL
from sitegen.texts import csv_rows, limit_rows

MAX_SLOTS = 23

_ID = re.compile(r"(.+)_([0-9]{1,10})", re.DOTALL)
_FLOAT = re.compile(r"([0-9]{1,18})\.0+")
_HEADER = "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1,Hazard_Track_2,Hazard_Name_2,..."
_QUOTE = 'Quote a cell that holds a comma: "a cat, running".'


@dataclass(slots=True)
class _Seen:
    """A caption of a track in a video: in which frames, and the first frame with its slot."""

    row: int
    column: str
    first: tuple[int, int]
    frames: set[int] = field(default_factory=set)


@dataclass(slots=True)
class _Cells:
    """Cells checked once for each distinct text."""

    check: Callable[[Any], str]
    faults: Faults
    known: dict[str, str | Wrong] = field(default_factory=dict)

    def clean(self, text: str, row: int, column: str) -> str | None:
        """The clean text, or None after its fault is noted."""
        result = self.known.get(text)
        if result is None:
            try:
                result = self.check(text)
            except Wrong as wrong:
                result = wrong.with_traceback(None)
            self.known[text] = result
        if isinstance(result, str):
            return result
        self.faults.add(row, column, result.found, result.expected, result.mend)
        return None


@dataclass(frozen=True, slots=True)
class Slot:
    """A track and its caption in a frame: clean, empty where the cell is; `place` counts the slots' cells."""

    place: int
    column: str
    track: str
    name: str


@dataclass(frozen=True, slots=True)
class FrameRow:
    """One row of COOOL results: a frame, the driver's state as it is written, the slots that are filled."""

    row: int
    video: str
    frame: int
    state: str
    slots: tuple[Slot, ...]


def coool(data: bytes, faults: Faults) -> Captions:
    """The captions of COOOL results: for each video, track and caption the frames in which it stands.

    A video's captions are ranked by the number of their frames, then by first frame and slot. A caption
    without a track has no `track_ids`; a track without a caption is counted in a warning.
    """
    captions = Captions("ID")
    videos: dict[str, dict[tuple[str, str], _Seen]] = {}
    untold = 0
    for read in frame_rows(data, faults):
        captions.rows.setdefault(read.video, read.row)
        for slot in read.slots:
            if not slot.name:
                untold += 1
                continue
            of_video = videos.setdefault(read.video, {})
            seen = of_video.get((slot.track, slot.name))
            if seen is None:
                first = (read.frame, slot.place)
                seen = of_video[slot.track, slot.name] = _Seen(read.row, slot.column, first)
            seen.first = min(seen.first, (read.frame, slot.place))
            seen.frames.add(read.frame)
    for video, of_video in videos.items():
        captions.predictions += _ranked(video, of_video, faults)
    captions.warnings += untold_warnings(untold)
    return captions


def untold_warnings(untold: int) -> list[str]:
    """What is said of the `untold` slots with a track alone; nothing when there are none."""
    places = counted(untold, "track in a frame has", "tracks in frames have")
    return [f"{places} no caption and thus no prediction."] if untold else []


def frame_rows(data: bytes, faults: Faults) -> Iterator[FrameRow]:
    """The rows of COOOL results, those with a fault in their ID left out; what is wrong goes to `faults`."""
    places: dict[str, dict[int, int]] = {}
    tracks, names = _Cells(track_id, faults), _Cells(checks.description, faults)
    with csv_rows(data, faults, spaced=True) as rows:
        header = header_of(next(rows, []), faults)
        for row, cells in enumerate(rows, start=1):
            limit_rows(row, faults)
            place = _frame(cells[0], row, places, faults)
            shifted = bool("".join(cells[len(header) :]).strip())
            if shifted:
                faults.add(
                    row, None, f"{len(cells)} cells", f"at most {len(header)}, as in the header", _QUOTE
                )
            if place is None:
                continue
            slots = [] if shifted else cells[2 : len(header)]
            filled = _filled(slots, header, row, tracks, names) if "".join(slots).strip() else ()
            yield FrameRow(row, *place, cells[1].strip() if len(cells) > 1 else "", filled)


def _filled(
    slots: Sequence[str], header: Sequence[str], row: int, tracks: _Cells, names: _Cells
) -> tuple[Slot, ...]:
    """The slots of a row that hold something; one with a fault is left out."""
    found: list[Slot] = []
    for place in range(0, len(slots), 2):
        column = header[place + 2]
        raw_track = slots[place].strip()
        if place + 1 == len(slots):
            if raw_track:
                what = f"the track '{visible(raw_track)}' without a cell for its caption"
                tracks.faults.add(row, column, what, "a track and its caption", _QUOTE)
            break
        raw_name = slots[place + 1].strip()
        if not (raw_track or raw_name):
            continue
        track = tracks.clean(raw_track, row, column) if raw_track else ""
        name = names.clean(raw_name, row, header[place + 3]) if raw_name else ""
        if track is not None and name is not None:
            found.append(Slot(place, header[place + 3], track, name))
    return tuple(found)


def header_of(header: Sequence[str], faults: Faults) -> list[str]:
    """The header's names, without empty cells at the end; slots count from 0 or 1.

    Raises FaultsError for other columns than the challenge's.
    """
    names = [name.strip() for name in header]
    while names and not names[-1]:
        names.pop()
    plain = [name.lower() for name in names]
    first = 0 if "hazard_track_0" in plain else 1
    count = (len(names) - 2) // 2
    expected = ["id", "driver_state_changed"]
    for slot in range(first, first + max(count, 1)):
        expected += [f"hazard_track_{slot}", f"hazard_name_{slot}"]
    if plain != expected:
        wrong = [f"'{visible(a)}'" for a, b in zip(names, expected, strict=False) if a.lower() != b]
        shown = f"{wrong[0]} among its columns" if wrong else f"{len(names)} columns"
        faults.stop(f"a header with {shown}", _HEADER, "Write the header as the challenge does.")
    if count > MAX_SLOTS:
        faults.stop(f"{count:,} slots for hazards", f"at most {MAX_SLOTS}", "Leave out the others.")
    return names


def _frame(
    cell: str, row: int, frame_rows: dict[str, dict[int, int]], faults: Faults
) -> tuple[str, int] | None:
    """Video and frame of an ID such as `video_0001_0`, or None after its fault is noted."""
    found = frame_of(cell)
    if found is None:
        mend = "Write the video's id, '_', and the frame's number from 0."
        faults.add(row, "ID", show(cell), "an ID such as 'video_0001_0'", mend)
        return None
    video, frame = found
    before = frame_rows.setdefault(video, {}).setdefault(frame, row)
    if before != row:
        again = f"frame {frame} of video '{visible(video)}' again (first in row {before})"
        faults.add(row, "ID", again, "each frame of a video once", "Renumber or remove the row.")
        return None
    return video, frame


def frame_of(cell: str) -> tuple[str, int] | None:
    """Video and frame of an ID such as `video_0001_0`, or None when it is none."""
    found = _ID.fullmatch(cell.strip())
    frame = int(found[2]) if found else MAX_WHOLE + 1
    return (found[1], frame) if found and frame <= MAX_WHOLE else None


def track_id(value: object) -> str:
    """The id of a track, text or a whole number, which some write as `7.0`. Raises Wrong."""
    return _without_zeros(checks.identifier(value, "a track id"))


def _video(value: object) -> str:
    return _without_zeros(checks.identifier(value, "a video's number"))


def _without_zeros(clean: str) -> str:
    """`7.0` is 7, since pandas writes it so."""
    found = _FLOAT.fullmatch(clean)
    return found[1] if found else clean


def _ranked(video: str, of_video: dict[tuple[str, str], _Seen], faults: Faults) -> list[Prediction]:
    order = sorted(of_video.items(), key=lambda item: (-len(item[1].frames), item[1].first, item[0]))
    predictions: list[Prediction] = []
    for rank, ((track, name), seen) in enumerate(order, start=1):
        if len(seen.frames) > MAX_LIST_ITEMS:
            found = f"a caption in {len(seen.frames):,} frames of video '{visible(video)}'"
            faults.add(seen.row, seen.column, found, f"at most {MAX_LIST_ITEMS:,} frames", "Leave some out.")
        frames = tuple(sorted(seen.frames))
        predictions.append(Prediction(video, rank, name, None, (track,) if track else (), frames))
    return predictions


def twocoool(data: bytes, caption_column: str, faults: Faults) -> Captions:
    """The captions of 2COOOL results: one for each video, from the column `caption_column`.

    Empty, it is the challenge's own, `Caption Before Incident`. An empty caption is counted in a warning.
    """
    captions = Captions("video")
    empty = 0
    with csv_rows(data, faults, spaced=True) as rows:
        header = [name.strip() for name in next(rows, [])]
        video_place = _column(header, "video", faults)
        place = _column(header, caption_column.strip() or CAPTION_2COOOL, faults)
        faults.raise_if_any()
        captions.column, column = header[video_place], header[place]
        for row, cells in enumerate(rows, start=1):
            limit_rows(row, faults)
            if len(cells) != len(header):
                faults.add(row, None, f"{len(cells)} cells", f"{len(header)} cells, as in the header", _QUOTE)
                continue
            video = checked(_video, cells[video_place], faults, row, captions.column)
            raw = cells[place]
            empty += checks.is_missing(raw)
            caption = "" if checks.is_missing(raw) else checked(checks.description, raw, faults, row, column)
            if video is None:
                continue
            before = captions.rows.setdefault(video, row)
            if before != row:
                again = f"video '{visible(video)}' again (first in row {before})"
                faults.add(row, captions.column, again, "one row for each video", "Remove one of the rows.")
            elif caption:
                captions.predictions.append(Prediction(video, 1, caption))
    if empty:
        said = counted(empty, "row has", "rows have")
        captions.warnings.append(f"{said} no text in '{visible(column)}' and thus no prediction.")
    return captions


def _column(header: Sequence[str], name: str, faults: Faults) -> int:
    """Where a column stands: the one of this name, else the only one that differs in case alone."""
    exact = [place for place, other in enumerate(header) if other == name]
    same = exact or [place for place, other in enumerate(header) if other.lower() == name.lower()]
    if len(same) == 1:
        return same[0]
    columns = ", ".join(visible(other) for other in header[:20])
    if same:
        faults.add(None, visible(name), f"{len(same)} columns of this name", "one", "Remove or rename one.")
    else:
        found = f"no such column, but the columns {columns}"
        mend = "Choose the column of the captions among these, or add it."
        faults.add(None, visible(name), found, f"a column `{visible(name)}`", mend)
    return -1
