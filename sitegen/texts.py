"""CSV and JSON text of outside files: read within bounds, with the physical line of every row."""

import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from sitegen.checks import Faults, visible
from sitegen.formats import MAX_BYTES

MAX_ROWS = 2_000_000
MAX_JSON_MARKS = 16_000_000

_BLANKS = re.compile(r"[ \t\n\r]*")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"

Pairs = list[tuple[str, Any]]


class RepeatedKeys(dict[str, Any]):
    """A JSON object that gives a key more than once; `pairs` are its keys and values as they stand."""

    def __init__(self, pairs: Pairs) -> None:
        """Of equal keys, the last one's value."""
        super().__init__(pairs)
        self.pairs = pairs

    @property
    def words(self) -> str:
        """What is wrong, in words."""
        seen: set[str] = set()
        again = next(key for key, _ in self.pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        return f"the key '{visible(again)}' twice in one object"


def json_object(pairs: Pairs) -> dict[str, Any]:
    """The hook for `json.loads`: a plain dict, or `RepeatedKeys`."""
    found = dict(pairs)
    return found if len(found) == len(pairs) else RepeatedKeys(pairs)


_RECORDS = json.JSONDecoder(object_pairs_hook=json_object)


def json_record(text: str) -> Any:
    """The JSON value of a line, as `json.loads` gives it, but with `RepeatedKeys`."""
    if text.startswith("\ufeff"):  # a mark within the file
        return json.loads(text)
    return _RECORDS.decode(text)


def limit_rows(count: int, faults: Faults) -> None:
    """Raise FaultsError when there are more than MAX_ROWS rows."""
    if count > MAX_ROWS:
        faults.stop(f"more than {MAX_ROWS:,} rows", f"at most {MAX_ROWS:,}", "Leave out some predictions.")


@contextmanager
def csv_rows(data: bytes, faults: Faults, *, spaced: bool = False) -> Iterator[Iterator[list[str]]]:
    """The header and then the data rows of a CSV, blank lines left out, while the context lasts.

    `spaced` leaves out blanks after a comma. Where the CSV is broken the context ends, and the fault is
    noted. Bytes that are not UTF-8 come as surrogates, so that they become faults of their own cells.
    """
    faults.line_of = _csv_line_of(data, spaced)
    with _reader(data, spaced) as reader:
        try:
            yield filter(None, reader)
        except csv.Error as error:
            expected = 'cells between commas, quoted with " where they hold commas, quotes or line ends'
            mend = f"Line {reader.line_num}: close the quote, or double quotes inside quotes."
            starts = _csv_starts(data, spaced)
            faults.add(len(starts) - 1 or None, None, str(error), expected, mend, starts[-1])


@contextmanager
def _reader(data: bytes, spaced: bool) -> Iterator[Any]:
    source = io.StringIO(data.decode("utf-8-sig", "surrogateescape"), newline="")
    before = csv.field_size_limit(MAX_BYTES)
    try:
        yield csv.reader(source, strict=True, skipinitialspace=spaced)
    finally:
        csv.field_size_limit(before)


def _csv_line_of(data: bytes, spaced: bool) -> Callable[[int], int | None]:
    """The line where a data row starts, found when it is first asked for."""
    starts: list[int] = []

    def line_of(row: int) -> int | None:
        if not starts:
            starts.extend(_csv_starts(data, spaced))
        return starts[row] if row < len(starts) else None

    return line_of


def _csv_starts(data: bytes, spaced: bool) -> list[int]:
    """The lines where the header and the data rows start, the last one where the CSV is broken."""
    starts: list[int] = []
    with _reader(data, spaced) as reader:
        try:
            before = 0
            for line in reader:
                if line:
                    starts.append(before + 1)
                before = reader.line_num
        except csv.Error:
            starts.append(before + 1)
    return starts


def json_value(data: bytes, faults: Faults) -> tuple[Any, tuple[str, ...]]:
    """The value in a JSON file, and what it holds that is no JSON number (`NaN`, `Infinity`).

    An object that repeats a key is a `RepeatedKeys`. Raises FaultsError when it is no JSON, is nested too
    deep, or has so many items that they would fill the memory.
    """
    marks = sum(data.count(mark) for mark in (b",", b"[", b"{"))
    if marks > MAX_JSON_MARKS:
        expected = f"at most {MAX_JSON_MARKS:,}"
        faults.stop(f"{marks:,} commas and brackets", expected, "Leave out what is no prediction.")
    try:
        text = data.removeprefix(_BYTE_ORDER_MARK).decode("utf-8")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        found = f"byte {error.object[error.start]:#04x} in line {line}, which is not UTF-8"
        faults.stop(found, "text in UTF-8", "Save the file as UTF-8.", line)
    odd: list[str] = []

    def constant(name: str) -> float:
        odd.append(name)
        return float(name)

    try:
        value = json.loads(text, object_pairs_hook=json_object, parse_constant=constant)
    except json.JSONDecodeError as error:
        found = f"{error.msg} at line {error.lineno}, character {error.colno}"
        faults.stop(found, "JSON", "Mend the place, or write the file with a JSON library.", error.lineno)
    except (ValueError, RecursionError) as error:
        faults.stop(f"JSON that cannot be read ({visible(str(error))})", "JSON", "Mend the file.")
    faults.line_of = _json_line_of(text)
    return value, tuple(odd)


def _json_line_of(text: str) -> Callable[[int], int | None]:
    """The line where an item of the outer list or object starts, found when it is first asked for."""
    starts: list[int] = []

    def line_of(row: int) -> int | None:
        if not starts:
            starts.extend(_json_starts(text))
        return starts[row - 1] if row <= len(starts) else None

    return line_of


def _json_starts(text: str) -> list[int]:
    """The lines where the items of the outer list, or the keys of the outer object, start."""
    decode = json.JSONDecoder().raw_decode
    starts: list[int] = []
    opening = _after_blanks(text, 0)
    line, counted = 1, 0
    place = _after_blanks(text, opening + 1)
    try:
        while text[place] not in "]}":
            line, counted = line + text.count("\n", counted, place), place
            starts.append(line)
            _, place = decode(text, place)
            if text[opening] == "{":
                _, place = decode(text, _after_blanks(text, _after_blanks(text, place) + 1))
            place = _after_blanks(text, place)
            if text[place] == ",":
                place = _after_blanks(text, place + 1)
    except (ValueError, RecursionError, IndexError):
        pass
    return starts


def _after_blanks(text: str, place: int) -> int:
    found = _BLANKS.match(text, place)
    return found.end() if found else place
