"""Predictions behind a URL, copied here within the bounds of one file, to be read like any others."""

from collections.abc import Mapping, Sequence
from pathlib import Path, PureWindowsPath

from pipeline.places import Place
from sitegen import formats
from sitegen.checks import Faults, visible
from sitegen.formats import ONE_OF
from sitegen.shards import is_aside, limit_shards

_EXPECTED = f"{ONE_OF}, or a folder of Parquet files"


def fetched(url: str, folder: Path, wanted: Sequence[str] = ()) -> Path:
    """The path of a copy of a file or a folder, in `folder`; what a `file://` URL leads to is not copied.

    Of a folder with the first of the files `wanted` those of them that it has are copied, of any other
    folder all shards. Raises FaultsError when there is nothing, and for more shards or bytes than may be:
    where the store tells sizes nothing is fetched then, else no more than that. Raises OutsideError when
    the store fails.
    """
    place = Place(url)
    if here := place.local():
        return here
    faults = Faults(visible(url, 1_000))
    try:
        there = place.entry()
    except FileNotFoundError:
        faults.stop("no such file", _EXPECTED, "Check the URL.")
    if there.kind == "file":
        target = folder / _file_name(place.name)
        _copy({target: (place, there.size)}, faults)
        return target
    entries = [entry for entry in place.entries() if not is_aside(entry.name)]
    if wanted and any(entry.name == wanted[0] and entry.kind == "file" for entry in entries):
        entries = [entry for entry in entries if entry.name in wanted]
    limit_shards(len(entries), faults)
    target = folder / _file_name(place.name)
    target.mkdir()
    for entry in entries:
        if _file_name(entry.name) != entry.name:
            faults.stop(f"the name '{visible(entry.name)}' in it", "the name of a file", "Rename it.")
        if entry.kind != "file":
            (target / entry.name).mkdir()  # reading tells of it as of any folder
    files = [entry for entry in entries if entry.kind == "file"]
    _copy({target / entry.name: (place / entry.name, entry.size) for entry in files}, faults)
    return target


def _copy(files: Mapping[Path, tuple[Place, int | None]], faults: Faults) -> None:
    """Copy the files, each a place and its size where that is known, to their targets."""
    if (told := sum(size or 0 for _, size in files.values())) > formats.MAX_BYTES:
        _too_large(f"{told / 2**20:,.0f} MB", faults)
    fetched_bytes = 0
    for target, (place, _) in files.items():
        with target.open("xb") as sink:
            try:
                for chunk in place.chunks():
                    fetched_bytes += len(chunk)
                    if fetched_bytes > formats.MAX_BYTES:
                        _too_large(f"more than {formats.MAX_BYTES // 2**20} MB", faults)
                    sink.write(chunk)
            except FileNotFoundError:
                faults.stop(f"no file '{visible(place.name)}' any more", _EXPECTED, "Try again.")


def _too_large(found: str, faults: Faults) -> None:
    limit = f"at most {formats.MAX_BYTES // 2**20} MB behind a URL"
    faults.stop(found, limit, "Leave out what is no prediction, or fetch it and give its path.")


def _file_name(name: str) -> str:
    """The name itself where every system can have a file of that name, else a plain one."""
    name = name.partition("?")[0]  # what a web address asks for is no part of it
    is_plain = PureWindowsPath(name).name == name and name not in ("", "..") and "\0" not in name
    return name if is_plain and len(name.encode("utf-8", "replace")) <= 200 else "predictions"
