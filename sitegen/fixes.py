"""A corrected copy of a predictions file, where the mend is safe: no caption is invented or lost."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.errors import FaultsError
from pipeline.records import Prediction, TruthHazard
from sitegen import checks
from sitegen.captions import counted, some
from sitegen.checks import Faults, Wrong, visible
from sitegen.formats import NAMES, TABLES, ending_of
from sitegen.readers import PREDICTION_COLUMNS, ReadOptions, choose_format, read_predictions
from sitegen.rewrite import BYTE_ORDER_MARK, Changes, csv_bytes, rewritten, spaced_names
from sitegen.sheets import Sheet, sheet_of
from sitegen.unpack import content_of
from sitegen.video_ids import VideoIds

_SYNONYMS = {"caption": "description", "video": "video_id"}


@dataclass(frozen=True, slots=True)
class Fixed:
    """The content of a corrected copy, what its name should end in, and what was done.

    Without notes nothing was done, and `data` is the file's content, unpacked. With notes the copy is
    read with `ReadOptions()`: it is a file with our columns, and its ids are the truth's.
    """

    data: bytes
    ending: str
    notes: tuple[str, ...]


@dataclass(slots=True)
class _Work:
    """The copy as it comes to be."""

    data: bytes
    source_format: str
    truth: Sequence[TruthHazard] | None
    options: ReadOptions
    notes: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    def sheet(self) -> tuple[Sheet, bool]:
        """The copy's cells, and whether every row could be read. Raises FaultsError as `sheet_of`."""
        faults = Faults("")
        sheet = sheet_of(self.data, self.source_format, PREDICTION_COLUMNS, faults)
        return sheet, None not in faults.kept

    def apply(self, changes: Changes, notes: Sequence[str]) -> None:
        """Make the changes and keep the notes; where the content cannot be written again, do neither."""
        new = rewritten(self.data, self.source_format, changes, PREDICTION_COLUMNS) if notes else None
        if new is not None:
            self.data = new
            self.notes += notes


def fixed(
    path: Path, truth: Sequence[TruthHazard] | None = None, options: ReadOptions | None = None
) -> Fixed:
    """A corrected copy of a predictions file; of an outside format, our CSV of what was read.

    Mended are a byte order mark, the spelling of column names, blanks around ids and captions, ids that
    are the truth's but for case (or by the options' map, or by number), a missing column of ranks (in
    file order), and rows that repeat an equal row. Other faults stay. Raises FaultsError when the file
    as a whole cannot be read.
    """
    options = options or ReadOptions()
    faults = Faults(visible(options.name or str(path), 1_000))
    content = content_of(path, faults)
    source_format = choose_format(content, options, faults)
    work = _Work(content.data, source_format, truth, options)
    try:
        if source_format not in TABLES:
            _as_csv(work, path)
        _mend_mark(work)
        _mend_columns(work)
        _mend_rows(work)
        if work.notes and work.unknown and source_format == "parquet":
            work.notes.append(f"Left out the columns that are not read: {some(work.unknown)}.")
    except FaultsError:  # not to be read any further: what is mended so far stands
        pass
    return Fixed(work.data, ending_of(work.source_format), tuple(work.notes))


def _as_csv(work: _Work, path: Path) -> None:
    try:
        read = read_predictions(path, work.truth, work.options)
        work.options = ReadOptions()
    except FaultsError:  # perhaps only for its ids, which may be mended
        read = read_predictions(
            path, None, ReadOptions(work.options.source_format, work.options.caption_column)
        )
        work.options = ReadOptions(video_map=work.options.video_map)
    said = counted(len(read.predictions), "prediction", "predictions")
    work.notes.append(f"Wrote {said} of {NAMES[work.source_format]} as a CSV file with our columns.")
    work.data = predictions_csv(read.predictions)
    work.source_format = "csv"


def predictions_csv(predictions: Sequence[Prediction]) -> bytes:
    """Predictions as a CSV file with our columns."""
    rows = [[getattr(row, name) for name in PREDICTION_COLUMNS] for row in predictions]
    return csv_bytes([list(PREDICTION_COLUMNS), *rows])


def _mend_mark(work: _Work) -> None:
    if work.data.startswith(BYTE_ORDER_MARK):
        work.data = work.data.removeprefix(BYTE_ORDER_MARK)
        work.notes.append("Took away the byte order mark at the start.")


def _mend_columns(work: _Work) -> None:
    sheet, _ = work.sheet()
    names = _names(sheet.columns)
    work.unknown = [visible(name) for name in sheet.columns if name not in (*PREDICTION_COLUMNS, *names)]
    notes = [f"Renamed the column '{visible(old)}' to '{new}'." for old, new in names.items()]
    if work.source_format == "csv" and (spaced := spaced_names(work.data)):
        said = counted(spaced, "column", "columns")
        notes.append(f"Took surrounding spaces from the names of {said}.")
    work.apply(Changes(names=names), notes)


def _names(columns: Sequence[str]) -> dict[str, str]:
    """Column names that mean one of ours, and ours; none where two columns could be it."""
    found: dict[str, str] = {}
    spelled = {name: name.strip("\ufeff \t").lower().replace(" ", "_").replace("-", "_") for name in columns}
    for meanings in ({name: name for name in PREDICTION_COLUMNS}, _SYNONYMS):
        for plain, ours in meanings.items():
            same = [name for name in columns if spelled[name] == plain]
            if ours not in (*columns, *found.values()) and len(same) == 1:
                found[same[0]] = ours
    return found


def _mend_rows(work: _Work) -> None:
    sheet, is_whole = work.sheet()
    changes = Changes()
    notes: list[str] = []
    videos = list(sheet.cells.get("video_id", ()))
    captions = list(sheet.cells.get("description", ()))
    if videos:
        meant = _meant(videos, work)
        notes += _mend_cells(
            sheet.rows, videos, "video_id", lambda value: meant.get(_key(value), value), changes
        )
    if captions:
        notes += _mend_cells(sheet.rows, captions, "description", _stripped, changes)
    columns = {**sheet.cells, "video_id": videos, "description": captions}
    columns = {name: cells for name, cells in columns.items() if name in sheet.cells}
    keys = list(zip(*([_key(cell) for cell in cells] for cells in columns.values()), strict=True))
    first: dict[tuple[Any, ...], int] = {}
    changes.drop = {
        row for row, key in zip(sheet.rows, keys, strict=False) if first.setdefault(key, row) != row
    }
    if changes.drop:
        said = counted(len(changes.drop), "row that repeats", "rows that repeat")
        notes.append(f"Removed {said} an equal row.")
    if "rank" not in sheet.columns and videos and captions and is_whole:
        counts: dict[Any, int] = {}
        for row, video in zip(sheet.rows, videos, strict=True):
            if row not in changes.drop:
                counts[_key(video)] = changes.ranks[row] = counts.get(_key(video), 0) + 1
        said = counted(len(changes.ranks), "row", "rows")
        notes.append(f"Added the column 'rank': the captions of each video in file order, in {said}.")
    work.apply(changes, notes)


def _mend_cells(
    rows: Sequence[int], cells: list[Any], name: str, mend: Callable[[Any], Any], changes: Changes
) -> list[str]:
    """Mend the cells in place, and note what was done. Equal cells are mended once: they may be very many."""
    counts: dict[str, int] = {}
    edits: dict[int, str] = {}
    known: dict[Any, tuple[str, str] | None] = {}
    for place, (row, value) in enumerate(zip(rows, cells, strict=True)):
        key = _key(value)
        if key not in known:
            known[key] = _mended(value, mend(value))
        if done := known[key]:
            cells[place] = edits[row] = done[0]
            counts[done[1]] = counts.get(done[1], 0) + 1
    if edits:
        changes.cells[name] = edits
    words = {
        "spaces": f"Took surrounding spaces from {name} in",
        "case": f"Wrote {name} in the truth's upper and lower case in",
        "id": f"Wrote the truth's {name} for the file's, by the map or by number, in",
    }
    return [
        f"{said} {counted(counts[kind], 'row', 'rows')}." for kind, said in words.items() if kind in counts
    ]


def _mended(value: Any, new: Any) -> tuple[str, str] | None:
    """The new text of a cell and what kind of mend it is; None where nothing changes."""
    if not isinstance(new, str) or new == str(value):
        return None
    plain = str(value).strip()
    return new, "spaces" if new == plain else "case" if new.lower() == plain.lower() else "id"


def _stripped(value: Any) -> Any:
    return value.strip() or value if isinstance(value, str) else value


def _key(value: Any) -> Any:
    """A cell for comparison: texts are equal, other values are equal in type, too."""
    return value if isinstance(value, str) else (type(value).__name__, repr(value))


def _meant(cells: Sequence[Any], work: _Work) -> dict[Any, str]:
    """Raw ids and the videos that they mean. Ids that would only then be one video stay apart."""
    known = None if work.truth is None else {hazard.video_id for hazard in work.truth}
    ids = VideoIds(known, work.options.video_map, cells)
    spelled = {video.lower(): video for video in sorted(known or ())}
    clean: dict[Any, str] = {}
    video_of: dict[str, str] = {}
    for value in {_key(cell): cell for cell in cells}.values():
        try:
            own = clean[_key(value)] = checks.identifier(value)
        except Wrong:
            continue
        try:
            video_of[own] = ids(value)
        except Wrong:
            mapped = work.options.video_map.get(own, own)
            video_of[own] = spelled.get(mapped.lower(), mapped)
    owners: dict[str, set[str]] = {}
    for own, video in video_of.items():
        owners.setdefault(video, set()).add(own.lower())
    return {key: video_of[own] if len(owners[video_of[own]]) == 1 else own for key, own in clean.items()}
