"""The ledger of a benchmark: one JSON line for every submission added, replaced or withdrawn.

It only grows. Each line holds the SHA-256 of the line before, so that a change shows.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from pipeline.errors import InputError
from pipeline.files import sha256_of, write_bytes

if sys.platform != "win32":
    import fcntl

FILE_NAME = "ledger.jsonl"
FIRST = "0" * 64


class Entry(BaseModel):
    """One line. `reason` is empty unless something was withdrawn; `previous` is 64 zeros at first."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    event: Literal["add", "replace", "withdraw"]
    slug: str
    name: str
    date: str
    predictions_sha256: str
    reason: str = ""
    previous: str = FIRST


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the submissions folder, so that one process at a time changes it (not on Windows)."""
    folder.mkdir(parents=True, exist_ok=True)
    if sys.platform == "win32":
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


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


def append(folder: Path, entry: Entry) -> None:
    """Add an entry, whole or not at all, with `previous` filled in. Call it inside `locked`."""
    path = folder / FILE_NAME
    read(folder)
    before = path.read_bytes() if path.exists() else b""
    lines = before.splitlines()
    linked = entry.model_copy(update={"previous": sha256_of(lines[-1]) if lines else FIRST})
    end = b"" if before.endswith(b"\n") or not before else b"\n"
    write_bytes(path, before + end + linked.model_dump_json().encode() + b"\n")


def withdrawn(entries: list[Entry]) -> set[str]:
    """The slugs whose last event is a withdrawal."""
    last = {entry.slug: entry.event for entry in entries}
    return {slug for slug, event in last.items() if event == "withdraw"}
