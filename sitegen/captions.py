"""What a file of an outside format says, before its videos are matched with the truth's."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from pipeline.records import Prediction
from sitegen.checks import Faults, Wrong

_SHOWN_NAMES = 20

T = TypeVar("T")


@dataclass(slots=True)
class Captions:
    """Predictions with the video ids of the file.

    `column` is where the ids stand (None: nowhere but in the row), `rows` gives for each id the row
    where it comes first.
    """

    column: str | None
    rows: dict[str, int] = field(default_factory=dict)
    predictions: list[Prediction] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def checked(
    check: Callable[[Any], T], value: object, faults: Faults, row: int, column: str | None
) -> T | None:
    """The clean value of a cell, or None after its fault is noted."""
    try:
        return check(value)
    except Wrong as wrong:
        faults.add(row, column, wrong.found, wrong.expected, wrong.mend)
        return None


def counted(count: int, one: str, many: str) -> str:
    """A count and its noun: "1 row has", "1,204 rows have"."""
    return f"{count:,} {one if count == 1 else many}"


def some(names: Sequence[str]) -> str:
    """Names between commas, the first 20 of them and the count of the others."""
    rest = len(names) - _SHOWN_NAMES
    return ", ".join(names[:_SHOWN_NAMES]) + (f" and {rest:,} more" if rest > 0 else "")
