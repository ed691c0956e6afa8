"""Where each version of a submission lies, and how new content gets there, whenever a process is killed.

New content is staged beside the submissions, then noted in the ledger, which decides, then moved to its
place. `settle` does the moving, and undoes what was staged but never noted.
"""

import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from sitegen import ledger
from sitegen.ledger import Entry

EARLIER = "_earlier"

_STAGED = re.compile(r"\.staged-([a-z0-9-]+)-([0-9]+)")


@contextmanager
def building(folder: Path) -> Iterator[Path]:
    """A temporary folder beside the submissions, removed afterwards if it is still there."""
    new = Path(tempfile.mkdtemp(dir=folder, prefix=".new-"))
    try:
        new.chmod(0o755)
        yield new
    finally:
        shutil.rmtree(new, ignore_errors=True)


def staged(folder: Path, place: str, version: int) -> Path:
    """Where version 1, 2, ... of the submission `place` waits for its line in the ledger."""
    return folder / f".staged-{place}-{version}"


def earlier(folder: Path, place: str, version: int) -> Path:
    """Where a version lies that was replaced."""
    return folder / EARLIER / f"{place}-{version}"


def settle(folder: Path, entries: Sequence[Entry]) -> None:
    """Bring the folders in line with the ledger, after a process was killed too. `folder` must be locked."""
    known = {place: len(found) for place, found in ledger.versions(entries).items()}
    for path in sorted(folder.glob(".staged-*")):
        found = _STAGED.fullmatch(path.name)
        place, version = (found[1], int(found[2])) if found else ("", 0)
        if not version or version != known.get(place):
            shutil.rmtree(path)
            continue
        target, before = folder / place, earlier(folder, place, version - 1)
        if target.exists() and not before.exists():
            before.parent.mkdir(exist_ok=True)
            target.rename(before)
        path.rename(target)
    for path in folder.glob(".new-*"):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)


def on_board(folder: Path, entries: Iterable[Entry], as_of: str = "") -> list[tuple[Path, Entry]]:
    """The submissions on the board of a day, by slug: folder, and the entry that brought its content.

    For an empty day, those of now.
    """
    every = list(entries)
    then = ledger.until(every, as_of)
    now = ledger.versions(every)
    gone = ledger.withdrawn(then)
    return [
        (folder / place if len(found) == len(now[place]) else earlier(folder, place, len(found)), found[-1])
        for place, found in sorted(ledger.versions(then).items())
        if place not in gone
    ]


def strangers(folder: Path, entries: Iterable[Entry]) -> list[Path]:
    """Folders that look like submissions, but that the ledger does not know."""
    known = ledger.versions(entries)
    places = (path for path in folder.glob("*/") if not path.name.startswith((".", "_")))
    return sorted(path for path in places if path.name not in known)
