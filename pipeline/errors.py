"""Every error that COOOLER raises on purpose.

    CooolerError            has the process exit code that fits it
    ├── InputError          the user's input is wrong; exit 1
    │   ├── FaultsError     a file or table with faults, all of them listed
    │   ├── ConfigError     a configuration that cannot be used
    │   └── VideoError      a video that cannot be decoded as it is
    └── OutsideError        something outside failed; exit 3
        ├── ModelMissingError   a model is not installed; says how to install it
        └── AgentError      an agent (a model server, say) did not answer

A fault that a person can mend is an `InputError` and says the place, what was
found, what was expected, and what to do.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass


class CooolerError(Exception):
    """Root of all errors raised on purpose."""

    exit_code = 1


class InputError(CooolerError):
    """The user's input is wrong."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing wrong in a file or table.

    `row` is the 1-based number of the data row (a CSV's header is not counted),
    None when the fault is of the whole file; `column` is None when it is of the whole row.
    `line` is the 1-based line of a text file, where that is known.
    """

    file: str
    row: int | None
    column: str | None
    found: str
    expected: str
    mend: str
    line: int | None = None

    def __str__(self) -> str:
        """One line: place, found, expected, mend."""
        place = self.file
        if self.row is not None:
            place += f", row {self.row}"
        if self.column is not None:
            place += f", column {self.column}"
        return f"{place}: found {self.found}; expected {self.expected}. {self.mend}"

    def as_dict(self) -> dict[str, str | int | None]:
        """The fields that are said, by name, for JSON; `line` serves annotations only."""
        return {name: value for name, value in asdict(self).items() if name != "line"}


class FaultsError(InputError):
    """A file with faults; carries every one of them."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        """`faults` must not be empty."""
        self.faults = tuple(faults)
        count = len(self.faults)
        heading = f"{count} fault{'s' if count != 1 else ''} found; nothing was written."
        super().__init__("\n".join([heading, *(f"  {fault}" for fault in self.faults)]))

    def __reduce__(self) -> tuple[type["FaultsError"], tuple[tuple[Fault, ...]]]:
        """Pickles as its faults: it may be raised in a worker."""
        return (FaultsError, (self.faults,))


class ConfigError(InputError):
    """A configuration that cannot be used."""


class VideoError(InputError):
    """A video that cannot be decoded as it is."""


class OutsideError(CooolerError):
    """Something outside this program failed."""

    exit_code = 3


class ModelMissingError(OutsideError):
    """A model is not installed; the message says how to install it."""


class AgentError(OutsideError):
    """An agent did not give an answer."""
