"""A build of what nobody touched is told by sizes and times: nothing is read, scored or rendered again.

The record of a build lies in the cache, not in the site, whose bytes no time may change. It may be
deleted at any time.
"""

import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.benchmark import FILE_NAME, Benchmark
from pipeline.files import sha256_of, write_text
from pipeline.graphs import cache_folder
from sitegen import data_check_run, ledger, votes
from sitegen.build import BuildReport
from sitegen.listings import Touch, listing, newest_ns, touch_of
from sitegen.rendering import code_sha256
from sitegen.scoreboard import BoardLine

_SUBMISSIONS, _HISTORY = "submissions", "history"
_LEDGER = f"{_SUBMISSIONS}/{ledger.FILE_NAME}"
_TICK_S = 0.02  # what is younger than a few ticks of a file system's clock could change without a trace


@dataclass(frozen=True, slots=True)
class Built:
    """What a build did, and the board that it shows; `rescored` tells of changed scores, a line each."""

    board: tuple[BoardLine, ...]
    rescored: tuple[str, ...]
    report: BuildReport


def sources(benchmark: Benchmark) -> dict[str, Touch]:
    """Every file that a site of the benchmark may be made of, once their times are old enough to tell.

    A file that was changed within the last 20 ms is waited for.
    """
    found = _sources(benchmark)
    if newest_ns(iter(found.values())) > time.time_ns() - _TICK_S * 1e9:
        time.sleep(_TICK_S)
        found = _sources(benchmark)
    return found


def kept_truth(benchmark: Benchmark) -> Path:
    """The folder in which every truth is kept that a board was scored by."""
    return benchmark.truth.with_name(f"{benchmark.truth.stem}-history")


def _sources(benchmark: Benchmark) -> dict[str, Touch]:
    root, attribution = benchmark.root, benchmark.settings.attribution
    files = [root / FILE_NAME, root / data_check_run.FILE_NAME, benchmark.truth, benchmark.boxes]
    files += [root / attribution] if attribution else []
    folders = {
        "videos": benchmark.videos,
        _SUBMISSIONS: benchmark.submissions,
        _HISTORY: kept_truth(benchmark),
        "votes": root / votes.FOLDER,
    }
    touches = {str(number): touch for number, path in enumerate(files) if (touch := touch_of(path))}
    for name, folder in folders.items():
        touches |= {f"{name}/{path}": touch for path, touch in listing(folder).items()}
    return touches


def only_noted(before: Mapping[str, Touch], after: Mapping[str, Touch]) -> bool:
    """Whether no other source was touched than those in which a build itself notes what it found."""
    touched = {path for path in {*before, *after} if before.get(path) != after.get(path)}
    return all(path == _LEDGER or path.startswith(f"{_HISTORY}/") for path in touched)


def record(out: Path) -> Path:
    """Where the record of the build into a folder lies."""
    return cache_folder() / "builds" / f"{sha256_of(os.fsencode(out.resolve()))}.json"


def recall(benchmark: Benchmark, out: Path, made_by: str, found: Mapping[str, Touch]) -> Built | None:
    """What the build before would tell again; None when it was another one, or anything was touched since.

    `made_by` is the hash of what else decides the site; `found` are the sources now.
    """
    try:
        kept = json.loads(record(out).read_bytes())
        if kept["key"] != _key(benchmark, made_by, found) or kept["site"] != _digest(listing(out)):
            return None
        board = tuple(BoardLine(**line) for line in kept["board"])
        tree, size = str(kept["tree_sha256"]), int(kept["bytes"])
        report = BuildReport(out, 0, int(kept["files"]), 0, 0, tree, size)
        return Built(board, tuple(map(str, kept["rescored"])), report)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def remember(benchmark: Benchmark, built: Built, made_by: str, found: Mapping[str, Touch]) -> None:
    """Record a build, made of what the sources `found` were when it began."""
    report = built.report
    kept: dict[str, Any] = {
        "key": _key(benchmark, made_by, found),
        "site": _digest(listing(report.folder)),
        "files": report.written + report.unchanged,
        "bytes": report.bytes,
        "tree_sha256": report.tree_sha256,
        "rescored": built.rescored,
        "board": [asdict(line) for line in built.board],
    }
    write_text(record(report.folder), json.dumps(kept))


def _key(benchmark: Benchmark, made_by: str, found: Mapping[str, Touch]) -> str:
    return sha256_of(f"{code_sha256()} {made_by} {benchmark.settings!r} {_digest(found)}".encode())


def _digest(touches: Mapping[str, Touch]) -> str:
    return sha256_of(repr(sorted(touches.items())).encode(errors="surrogateescape"))
