"""Files written for tests of the readers, and the faults that are found in them."""

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import FaultsError
from pipeline.records import TruthHazard

HAZARDS = [
    TruthHazard("v1", "1", "cat", "A cat crosses the road."),
    TruthHazard("v2", "1", "dog", "A dog crosses the road."),
    TruthHazard("v3", "", "", ""),
]
HEAD = "video_id,rank,description\n"
TRUTH_HEAD = "video_id,hazard_id,label,description\n"


def faults(read: Callable[[], object]) -> list[tuple[int | None, str | None, str]]:
    """Row, column and found text of every fault that `read` raises; each must say how to mend it."""
    with pytest.raises(FaultsError) as caught:
        read()
    for fault in caught.value.faults:
        assert fault.expected
        assert fault.mend
        assert str(fault).isprintable()
    return [(fault.row, fault.column, fault.found) for fault in caught.value.faults]


def places(read: Callable[[], object]) -> list[tuple[int | None, str | None]]:
    """Row and column of every fault that `read` raises."""
    return [fault[:2] for fault in faults(read)]


def write(folder: Path, name: str, content: str | bytes) -> Path:
    """Write a file into a folder."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def lines(read: Callable[[], object]) -> list[int | None]:
    """The line of every fault that `read` raises."""
    with pytest.raises(FaultsError) as caught:
        read()
    return [fault.line for fault in caught.value.faults]


def files(read: Callable[[], object]) -> list[str]:
    """The file of every fault that `read` raises."""
    with pytest.raises(FaultsError) as caught:
        read()
    return [fault.file for fault in caught.value.faults]
