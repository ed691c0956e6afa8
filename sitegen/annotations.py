"""Faults and warnings as the workflow commands that GitHub shows beside the lines of a pull request."""

from collections.abc import Iterable

from pipeline.errors import Fault

_DATA = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_PROPERTY = {**_DATA, ":": "%3A", ",": "%2C"}
_ESCAPED = (str.maketrans(_DATA), str.maketrans(_PROPERTY))


def error_lines(faults: Iterable[Fault], file: str = "") -> list[str]:
    """An `::error` command for each fault; `file` is its path in the repository, if not the fault's own.

    A fault whose line is not known (a Parquet file's, or one of the whole file) is told without.
    """
    return [
        _command(
            "error",
            {"file": file or fault.file, "line": fault.line, "title": _title(fault)},
            f"found {fault.found}; expected {fault.expected}. {fault.mend}",
        )
        for fault in faults
    ]


def warning_lines(file: str, warnings: Iterable[str]) -> list[str]:
    """A `::warning` command for each warning about a file."""
    return [_command("warning", {"file": file, "title": "Predictions"}, warning) for warning in warnings]


def _title(fault: Fault) -> str:
    if fault.row is None:
        return f"Column {fault.column}" if fault.column else "The file"
    return f"Row {fault.row}" + (f", column {fault.column}" if fault.column else "")


def _command(kind: str, properties: dict[str, str | int | None], message: str) -> str:
    data, value = _ESCAPED
    said = ",".join(f"{key}={str(part).translate(value)}" for key, part in properties.items() if part)
    return f"::{kind} {said}::{message.translate(data)}"
