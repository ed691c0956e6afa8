"""The journals of annotators: one JSON line a saved state, one file an author, only ever appended to.

A line is on the disk before its author is told so. `merged.jsonl` holds what a merge adopted,
`imported.jsonl` the truth that the work began with.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from pipeline.errors import Fault, FaultsError, InputError
from pipeline.files import slug, sync_listing
from sitegen import checks
from sitegen.annotate_records import Record, record_of

_SUFFIX = ".jsonl"


@dataclass(slots=True)
class Journal:
    """What is known of one author's file: for each video the last record, and the last of each session."""

    author: str
    latest: dict[str, Record] = field(default_factory=dict)
    saves: dict[tuple[str, str], Record] = field(default_factory=dict)
    read_bytes: int = 0
    lines: int = 0

    def take(self, record: Record) -> None:
        """One more record, the newest."""
        self.latest[record.video_id] = record
        self.saves[record.video_id, record.session] = record

    def revision(self, video_id: str) -> int:
        """The newest revision of a video, 0 when there is none."""
        return self.latest[video_id].revision if video_id in self.latest else 0


def read_more(path: Path, journal: Journal) -> int:
    """Take what was appended to a journal since it was last read.

    A last line without its end is taken when it is whole, else left; gives the bytes that were left.
    Raises FaultsError for other damaged lines.
    """
    with path.open("rb") as source:
        source.seek(journal.read_bytes)
        data = source.read()
    faults: list[Fault] = []
    for line in data.splitlines(keepends=True):
        try:
            record = record_of(line, journal.author) if line.strip() else None
        except (ValueError, RecursionError, InputError) as error:
            if not line.endswith(b"\n"):
                return _raise_or(faults, len(line))
            row = journal.lines + 1
            found = f"a damaged line ({checks.visible(str(error))})"
            mend = "Restore the file from a copy, or remove the line; the state that it held is lost then."
            faults.append(Fault(str(path), row, None, found, "a saved state as JSON", mend, row))
            record = None
        journal.lines += 1
        journal.read_bytes += len(line)
        if record:
            journal.take(record)
    return _raise_or(faults, 0)


def _raise_or(faults: list[Fault], left: int) -> int:
    if faults:
        raise FaultsError(faults)
    return left


def read_journals(folder: Path) -> tuple[dict[str, Journal], list[str]]:
    """The journals in a folder by author, sorted, and a notice for each torn last line.

    Raises FaultsError for damaged lines and for journals that cannot be an author's.
    """
    journals: dict[str, Journal] = {}
    notices: list[str] = []
    faults: list[Fault] = []
    for path in journal_files(folder):
        journal = Journal(path.stem)
        try:
            if slug(path.stem) != path.stem:
                found = f"the file name {checks.visible(path.name)}"
                raise FaultsError(
                    [Fault(str(path), None, None, found, "an author in a-z 0-9 -", "Rename it.")]
                )
            left = read_more(path, journal)
        except FaultsError as error:
            faults += error.faults
            continue
        if left:
            notices.append(f"{path}: the last line was cut off and never confirmed; it is left out.")
        journals[path.stem] = journal
    if faults:
        raise FaultsError(faults)
    return journals, notices


def journal_files(folder: Path) -> list[Path]:
    """The journals in a folder, sorted by author; none when there is no folder."""
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.glob(f"*{_SUFFIX}") if path.is_file() and path.name[0] != ".")


def journal_path(folder: Path, author: str) -> Path:
    """Where an author's journal is."""
    return folder / f"{author}{_SUFFIX}"


def append(path: Path, author: str, records: Iterable[Record]) -> None:
    """Add records; they are on the disk when this returns. To be called with the folder locked.

    A last line that a crash cut off goes: nobody was told that it was saved. A failed write leaves
    no part of a line.
    """
    lines = b"".join(record.line() for record in records)
    is_new = not path.exists()
    with path.open("ab+", buffering=0) as target:
        size = target.seek(0, os.SEEK_END)
        last = _last_line(target, size)
        end = size
        if last and _is_record(last, author):
            lines = b"\n" + lines
        elif last:
            end -= len(last)
            target.truncate(end)
        try:
            left = memoryview(lines)
            while left:
                left = left[target.write(left) :]
            os.fsync(target.fileno())
        except OSError:
            target.truncate(end)
            raise
    if is_new:  # the folder may be new as well
        sync_listing(path.parent)
        sync_listing(path.parent.parent)


def _last_line(file: BinaryIO, size: int) -> bytes:
    """What follows the last line end."""
    read = b""
    while b"\n" not in read and len(read) < size:
        step = min(1 << 16, size - len(read))
        file.seek(size - len(read) - step)
        read = file.read(step) + read
    return read.rpartition(b"\n")[2]


def _is_record(line: bytes, author: str) -> bool:
    try:
        record_of(line, author)
    except (ValueError, RecursionError, InputError):
        return False
    return True
