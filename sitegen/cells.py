"""A sheet's raw cells to clean values, cell by cell; every fault is noted with its row."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from sitegen.captions import some
from sitegen.checks import Faults, Wrong, is_missing, visible
from sitegen.sheets import Sheet

BAD: Any = object()  # a cell whose fault is already noted

_SHOWN_COLUMNS = 20
_TEXTS = {str, type(None)}
_NUMBERS = {int, type(None)}


def clean_column(
    sheet: Sheet, name: str, check: Callable[[Any], Any], faults: Faults, missing: Any = BAD
) -> list[Any]:
    """The clean values of a column, `BAD` where a fault was noted.

    A cell that holds nothing becomes `missing`; left at `BAD`, the column is required and `check`
    words the fault. Equal texts and numbers are checked once: ids, ranks and captions repeat.
    """
    cells = sheet.cells.get(name)
    if cells is None:
        return [BAD if name in faults.kept else missing] * len(sheet.rows)
    kinds = set(map(type, cells))
    results: Iterator[Any] = (_result(value, check, missing) for value in cells)
    if kinds <= _TEXTS or kinds <= _NUMBERS:
        of_value = {value: _result(value, check, missing) for value in dict.fromkeys(cells)}
        results = map(of_value.__getitem__, cells)
        if Wrong not in set(map(type, of_value.values())):
            return list(results)
    clean: list[Any] = []
    for row, result in zip(sheet.rows, results, strict=True):
        is_wrong = type(result) is Wrong
        if is_wrong:
            faults.add(row, name, result.found, result.expected, result.mend)
        clean.append(BAD if is_wrong else result)
    return clean


def _result(value: Any, check: Callable[[Any], Any], missing: Any) -> Any:
    """The clean value of a cell, or what is wrong with it."""
    try:
        return missing if missing is not BAD and is_missing(value) else check(value)
    except Wrong as wrong:
        return wrong.with_traceback(None)


def missing_columns(sheet: Sheet, required: Sequence[str], faults: Faults) -> None:
    """Note the required columns that a sheet has not."""
    if not sheet.columns and faults.kept:  # no line could be read, so nothing is known of columns
        return
    spelled = {name.strip().lower().replace(" ", "_").replace("-", "_"): name for name in sheet.columns}
    for name in required:
        if name not in sheet.columns:
            near = spelled.get(name)
            found = f"the columns {', '.join(visible(column) for column in sheet.columns[:_SHOWN_COLUMNS])}"
            mend = f"Rename '{visible(near)}' to '{name}'." if near else "Add the column."
            faults.add(None, name, f"no such column, but {found}", f"a column `{name}`", mend)


def unknown_columns(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """A warning that names the columns that are not read, if there are any."""
    unknown = [visible(name) for name in names if name not in known]
    return [f"Ignored unknown columns: {some(unknown)}."] if unknown else []


def note_repeats(sheet: Sheet, videos: list[Any], numbers: list[Any], column: str, faults: Faults) -> None:
    """Note the rows whose number (a rank, a hazard) an earlier row of the same video has."""
    first_row: dict[tuple[Any, Any], int] = {}
    for row, key in zip(sheet.rows, zip(videos, numbers, strict=True), strict=True):
        before = first_row.setdefault(key, row)
        if before != row and BAD not in key and key[1] != "":
            again = f"{column} '{visible(str(key[1]))}' again"
            found = f"{again} in video '{visible(key[0])}' (first in {faults.place(before)})"
            faults.add(row, column, found, f"each {column} once in a video", "Renumber or remove the row.")
