"""A recording as one zip: the same bytes for the same answers; hostile until checked when it comes in."""

import re
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import Fault, FaultsError, InputError
from pipeline.files import replacing
from pipeline.recording import MAX_RECORD_BYTES, Record, Recording, checked, why

MAX_RECORDS = 1_000_000
MAX_TOTAL_BYTES = 4 << 30
MAX_FAULTS = 20

_MEMBER = re.compile(r"([0-9a-f]{2})/(\1[0-9a-f]{62})\.json")
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold: the same bytes at any hour


@dataclass(frozen=True, slots=True)
class Exported:
    """How many answers a zip got, and the corrupt files that were left out."""

    count: int
    corrupt: tuple[Path, ...]


def export(recording: Recording, target: Path) -> Exported:
    """Write a recording as a zip: the same answers give the same bytes (with one zlib).

    Raises InputError when the recording holds no answer.
    """
    count = 0
    corrupt: list[Path] = []
    with replacing(target) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for path in sorted(recording.folder.glob("??/*.json")):
            name = f"{path.parent.name}/{path.name}"
            try:
                data = checked(path.read_bytes(), name).as_bytes()
            except (OSError, ValueError):
                corrupt.append(path)
                continue
            entry = zipfile.ZipInfo(name, _ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # else it differs between Windows and the rest
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data, compresslevel=6)
            count += 1
        if not count:
            raise InputError(
                f"{recording.folder}: found no recorded answer; expected a folder of a recording."
            )
    return Exported(count, tuple(corrupt))


def import_zip(source: Path, folder: Path) -> int:
    """Add the answers in a zip to the recording in `folder`; how many were new.

    The zip is hostile until checked: nothing is written before every entry has the name, size and
    content of a record. Answers that are there already stay. Raises FaultsError, InputError.
    """
    recording = Recording(folder)
    added = 0
    try:
        with zipfile.ZipFile(source) as archive:
            entries = _entries(archive, source)
            # Twice, since a large zip does not fit into memory: first only to see that all is well.
            for writing in (False, True):
                for record in _records(archive, entries, source):
                    if writing and recording.find(record.request) is None:
                        recording.keep(record.request, record.answer)
                        added += 1
    except (OSError, zipfile.BadZipFile, NotImplementedError) as error:
        raise InputError(f"{source}: not readable as a zip: {error}. Export the recording anew.") from error
    return added


def _entries(archive: zipfile.ZipFile, source: Path) -> list[zipfile.ZipInfo]:
    """The entries, after what can be checked without unpacking. Raises FaultsError."""
    entries = [entry for entry in archive.infolist() if not entry.is_dir()]
    if len(entries) > MAX_RECORDS:
        raise InputError(f"{source}: found {len(entries)} entries; expected at most {MAX_RECORDS}.")
    total = sum(entry.file_size for entry in entries)
    if total > MAX_TOTAL_BYTES:
        raise InputError(f"{source}: found {total} bytes unpacked; expected at most {MAX_TOTAL_BYTES}.")
    faults: list[Fault] = []
    seen: set[str] = set()
    for entry in entries:
        name = entry.filename
        if not _MEMBER.fullmatch(name):
            faults.append(_fault(source, f"an entry named {name[:100]!r}", "ab/<64 hex digits>.json"))
        elif name in seen:
            faults.append(_fault(source, f"{name} twice", "each entry once"))
        elif entry.file_size > MAX_RECORD_BYTES:
            faults.append(_fault(source, f"{name} of {entry.file_size} bytes", f"up to {MAX_RECORD_BYTES}"))
        elif entry.flag_bits & 1:
            faults.append(_fault(source, f"{name} encrypted", "an entry that can be read"))
        seen.add(name)
    if faults:
        raise FaultsError(faults[:MAX_FAULTS])
    return entries


def _records(archive: zipfile.ZipFile, entries: list[zipfile.ZipInfo], source: Path) -> Iterator[Record]:
    """The checked records of a zip; raises FaultsError at the end when any was wrong."""
    faults: list[Fault] = []
    for entry in entries:
        try:
            # The header's size may lie: read no more than allowed, whatever it says.
            with archive.open(entry) as packed:
                yield checked(packed.read(MAX_RECORD_BYTES + 1), entry.filename)
        except (
            ValueError,
            zipfile.BadZipFile,
            zlib.error,
            NotImplementedError,
            RuntimeError,
            EOFError,
        ) as error:
            faults.append(_fault(source, f"{entry.filename} with {why(error)}", "a recorded answer"))
            if len(faults) == MAX_FAULTS:
                break
    if faults:
        raise FaultsError(faults)


def _fault(source: Path, found: str, expected: str) -> Fault:
    return Fault(str(source), None, None, found, expected, "Nothing was added. Export the recording anew.")
