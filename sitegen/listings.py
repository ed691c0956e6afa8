"""What lies in a folder, by sizes and times: enough to see that nothing was touched."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

Touch: TypeAlias = tuple[int, int, int]
"""Size in bytes; when the content and when the entry last changed, in ns."""


def listing(folder: Path) -> dict[str, Touch]:
    """Every file below a folder but in hidden places: path from it, `/`-separated -> touch.

    Links to files count as the files, links to folders are not followed. Without the folder, nothing.
    """
    return dict(_below(str(folder), ""))


def touch_of(path: Path) -> Touch | None:
    """The touch of a file; None when there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def newest_ns(touches: Iterator[Touch]) -> int:
    """When the last of the files changed; 0 without any."""
    return max((max(content, entry) for _, content, entry in touches), default=0)


def _below(folder: str, prefix: str) -> Iterator[tuple[str, Touch]]:
    # os.scandir, since a site has files by the hundred thousand and pathlib takes longer than the disk.
    try:
        entries = list(os.scandir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        path = f"{prefix}{entry.name}"
        if entry.is_dir(follow_symlinks=False):
            yield from _below(entry.path, f"{path}/")
        elif entry.is_file():
            stat = entry.stat()
            yield path, (stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
