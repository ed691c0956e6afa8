"""What one cell of an outside table may hold, and how a fault in it is worded.

A check gives the clean value or raises `Wrong`; the readers know the place and collect the faults.
Cells come from CSV (always text), JSON Lines or Parquet (typed): the same content is right or
wrong in all three.
"""

import json
import math
import re
import reprlib
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NoReturn

from pipeline.errors import Fault, FaultsError

MAX_TEXT_CHARS = 2_000
MAX_ID_CHARS = 128
MAX_LIST_ITEMS = 10_000
MAX_WHOLE = 2**31 - 1
MAX_DETAILED_FAULTS = 1_000
SHOWN_CHARS = 80

SAFE_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,127}")
_WHOLE = re.compile(r"([+-]?[0-9]{1,18})(?:\.0*)?", re.ASCII)
_LIST_GAP = re.compile(r"[\s;,]+")
_UNSEEN = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})

SHORTEN = f"Shorten it to at most {MAX_TEXT_CHARS:,} characters."


@dataclass(slots=True, eq=False)
class Wrong(Exception):  # noqa: N818  (a control signal inside the readers, never seen by users)
    """A cell that cannot be accepted."""

    found: str
    expected: str
    mend: str


@dataclass(slots=True)
class Faults:
    """Collects the faults of one file: of each column 1,000 in detail, of the rest the count.

    `line_of` gives the line of a row in a text file; it is asked only for the faults that are told.
    `source_of` gives the file and the row there, where rows are counted over several files.
    """

    file: str
    kept: dict[str | None, list[Fault]] = field(default_factory=dict)
    more: int = 0
    line_of: Callable[[int], int | None] | None = None
    source_of: Callable[[int], tuple[str, int]] | None = None

    def place(self, row: int) -> str:
        """A row, as another row's fault tells of it."""
        if self.source_of is None:
            return f"row {row}"
        file, number = self.source_of(row)
        return f"row {number} of {file}"

    def add(
        self,
        row: int | None,
        column: str | None,
        found: str,
        expected: str,
        mend: str,
        line: int | None = None,
    ) -> None:
        """One more fault; `row` is 1-based, None for the whole file. `line` is needed only without a row."""
        of_column = self.kept.setdefault(column, [])
        if len(of_column) < MAX_DETAILED_FAULTS:
            of_column.append(Fault(self.file, row, column, found, expected, mend, line))
        else:
            self.more += 1

    def stop(self, found: str, expected: str, mend: str, line: int | None = None) -> NoReturn:
        """A fault of the whole file, after which nothing more can be read: raise FaultsError."""
        self.add(None, None, found, expected, mend, line)
        raise self._error()

    def raise_if_any(self) -> None:
        """Raise FaultsError with every fault, in the order of the rows, when there is any."""
        if self.kept:
            raise self._error()

    def _error(self) -> FaultsError:
        faults = sorted(
            (fault for of_column in self.kept.values() for fault in of_column),
            key=lambda fault: fault.row or 0,
        )
        more = self.more + len(faults[MAX_DETAILED_FAULTS:])
        faults = [self._with_line(fault) for fault in faults[:MAX_DETAILED_FAULTS]]
        if more:
            mend = "Mend the faults above and check again."
            faults.append(Fault(self.file, None, None, f"{more:,} more faults", "none", mend))
        return FaultsError(faults)

    def _with_line(self, fault: Fault) -> Fault:
        if self.source_of is not None and fault.row is not None:
            file, row = self.source_of(fault.row)
            return replace(fault, file=file, row=row)
        if self.line_of is None or fault.row is None or fault.line is not None:
            return fault
        return replace(fault, line=self.line_of(fault.row))


def visible(text: str, limit: int = SHOWN_CHARS) -> str:
    """Text on one line: control, bidirectional and other unseen characters as escapes, cut at `limit`."""
    shown = "".join(
        char.encode("unicode_escape").decode() if unicodedata.category(char) in _UNSEEN else char
        for char in text[:limit]
    )
    return shown if len(text) <= limit else f"{shown}..."


def show(value: object) -> str:
    """A cell as a fault quotes it."""
    if isinstance(value, str):
        if not value.strip():
            return "only blanks" if value else "an empty cell"
        size = f"{len(value):,} characters: " if len(value) > SHOWN_CHARS else ""
        return f"{size}'{visible(value)}'"
    if value is None:
        return "nothing (null)"
    if isinstance(value, float) and math.isnan(value):
        return "NaN"
    kind = dict if isinstance(value, dict) else type(value)
    return f"{visible(reprlib.repr(value))} ({kind.__name__})"


def is_missing(value: object) -> bool:
    """Whether an optional cell holds nothing: null or no more than blanks. NaN is a fault."""
    return value is None or (isinstance(value, str) and (not value or value.isspace()))


def text(value: object, expected: str = "text") -> str:
    """A text of 1 to 2,000 characters without NUL, stripped of surrounding blanks."""
    if not isinstance(value, str):
        raise Wrong(show(value), expected, "Write it as text.")
    if "\0" in value:
        raise Wrong(f"a NUL character in {show(value)}", expected, "Remove the NUL character.")
    if not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError as error:
            # U+DC80 to U+DCFF stand for bytes that did not decode, unless others are among them.
            bytes_only = all("\udc80" <= char <= "\udcff" for char in value[error.start : error.end])
            how = "surrogateescape" if bytes_only else "surrogatepass"
            broken = value[error.start : error.end].encode("utf-8", how)
            found = f"{broken[:8]!r}, which is not UTF-8, in {show(value)}"
            raise Wrong(found, "text in UTF-8", "Save the file as UTF-8.") from None
    stripped = value.strip()
    is_plain = bool(stripped) and stripped.isprintable()  # what most are, told at once
    if not is_plain and not any(char.isprintable() and not char.isspace() for char in stripped):
        raise Wrong(show(value), expected, "Fill it in, or leave the row out.")
    if len(stripped) > MAX_TEXT_CHARS:
        raise Wrong(show(value), f"at most {MAX_TEXT_CHARS:,} characters", SHORTEN)
    return stripped


def description(value: object) -> str:
    """A description: `text`, and not the `nan` that pandas writes for a missing value."""
    expected = "a description in words"
    clean = text(value, expected)
    if clean.lower() == "nan":
        raise Wrong(show(value), expected, "This is how a missing value is written; leave the row out.")
    return clean


def identifier(value: object, expected: str = "an id") -> str:
    """An id: text of 1 to 128 characters, or a whole number, which becomes text."""
    if isinstance(value, int) and not isinstance(value, bool):
        value = str(value) if abs(value) <= 10**18 else f"{value:#x}"
    clean = text(value, expected)
    if len(clean) > MAX_ID_CHARS:
        raise Wrong(show(value), f"at most {MAX_ID_CHARS} characters", "Use a shorter id.")
    return clean


def safe_identifier(value: object) -> str:
    """An id that is safe as the name of a page: `[A-Za-z0-9._-]`, not starting with a dot."""
    clean = identifier(value, "a video id")
    if not SAFE_ID.fullmatch(clean):
        expected = "letters, digits, '.', '_' and '-' only, not starting with a dot"
        raise Wrong(show(value), expected, "Rename the video; its id names a page.")
    return clean


def whole(value: object, minimum: int) -> int:
    """A whole number from `minimum` to 2**31 - 1; `1.0` is 1, since pandas writes it so."""
    expected = f"a whole number from {minimum}"
    if isinstance(value, str):
        found = _WHOLE.fullmatch(value.strip())
        number = int(found[1]) if found else None
    elif isinstance(value, float):
        number = int(value) if value.is_integer() else None
    elif isinstance(value, int) and not isinstance(value, bool):
        number = value
    else:
        number = None
    if number is None or not minimum <= number <= MAX_WHOLE:
        mend = "Ranks count 1, 2, 3, ... in each video." if minimum else "Frames count from 0."
        raise Wrong(show(value), expected, mend)
    return number


def listing(value: object) -> list[object]:
    """A list's items: a list, or text with a JSON list or items between blanks, commas, semicolons."""
    if isinstance(value, str):
        value = _split(value.strip())
    if not isinstance(value, list | tuple):
        raise Wrong(show(value), "a list", 'Write it as a JSON list such as ["7", "9"], or as 7;9.')
    if len(value) > MAX_LIST_ITEMS:
        raise Wrong(f"{len(value):,} items", f"at most {MAX_LIST_ITEMS:,} items", "Shorten the list.")
    return list(value)


def _split(value: str) -> object:
    if value.startswith("["):
        try:
            return json.loads(value)
        except (ValueError, RecursionError):
            value = value.removeprefix("[").removesuffix("]")
    return [item.strip("'\"") for item in _LIST_GAP.split(value) if item]


def track_ids(value: object) -> tuple[str, ...]:
    """Track ids: text or whole numbers."""
    return tuple(identifier(item, "track ids") for item in listing(value))


def frame_indices(value: object) -> tuple[int, ...]:
    """Frame indices, 0-based."""
    return tuple(whole(item, 0) for item in listing(value))
