"""The ledger of a benchmark: one JSON line for every submission added, replaced, rescored or withdrawn.

It only grows. Each line holds the SHA-256 of the line before, so that a change shows.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, ValidationError

from pipeline.errors import InputError
from pipeline.files import sha256_of, write_bytes

FILE_NAME = "ledger.jsonl"
FIRST = "0" * 64

Event: TypeAlias = Literal["add", "replace", "rescore", "withdraw"]


class Entry(BaseModel):
    """One line: what happened to which submission, on which day, why, and with which scores.

    `add` and `replace` bring content, whose hashes they hold; `rescore` brings scores under another
    signature; `withdraw` takes the submission off the board. `previous` is the hash of the line before,
    64 zeros at first. `date` is ISO 8601 and never before that of the line before.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    event: Event
    slug: str
    name: str
    date: str
    predictions_sha256: str
    original_sha256: str = ""
    reason: str = ""
    signature: str = ""
    besm: float | None = None
    sam: float | None = None
    detection_rate: float | None = None
    hazard_recall: float | None = None
    previous: str = FIRST


def read(folder: Path) -> list[Entry]:
    """Every entry of the folder's ledger, oldest first; none when there is no ledger yet.

    Raises InputError when a line is no entry or does not follow from the line before.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return []
    entries: list[Entry] = []
    previous = FIRST
    for number, line in enumerate(path.read_bytes().splitlines(), start=1):
        try:
            entry = Entry.model_validate_json(line)
        except ValidationError as error:
            raise InputError(
                f"{path}, line {number}: not a ledger entry: {error.errors()[0]['msg']}."
            ) from error
        if entry.previous != previous:
            raise InputError(
                f"{path}, line {number}: found previous {entry.previous[:12]}, expected {previous[:12]}. "
                "A line before it was changed or removed; restore the file from version control."
            )
        previous = sha256_of(line)
        entries.append(entry)
    return entries


def append(folder: Path, new: Sequence[Entry]) -> None:
    """Add entries, all or none, with `previous` filled in. Call it while the folder is locked.

    An entry that is dated before the line before takes that line's date.
    """
    if not new:
        return
    path = folder / FILE_NAME
    entries = read(folder)
    before = path.read_bytes() if path.exists() else b""
    lines = before.splitlines()
    previous = sha256_of(lines[-1]) if lines else FIRST
    date = entries[-1].date if entries else ""
    added = b""
    for entry in new:
        date = max(date, entry.date)
        line = entry.model_copy(update={"previous": previous, "date": date}).model_dump_json().encode()
        previous = sha256_of(line)
        added += line + b"\n"
    end = b"" if before.endswith(b"\n") or not before else b"\n"
    write_bytes(path, before + end + added)


def until(entries: Iterable[Entry], date: str) -> list[Entry]:
    """The entries up to and including a day (ISO 8601); all of them for an empty date."""
    return [entry for entry in entries if not date or entry.date <= date]


def withdrawn(entries: Iterable[Entry]) -> set[str]:
    """The slugs whose last event is a withdrawal."""
    last = {entry.slug: entry.event for entry in entries}
    return {slug for slug, event in last.items() if event == "withdraw"}


def versions(entries: Iterable[Entry]) -> dict[str, list[Entry]]:
    """Slug -> the entries that brought content, oldest first: version 1, 2, ..."""
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        if entry.event in {"add", "replace"}:
            found.setdefault(entry.slug, []).append(entry)
    return found
