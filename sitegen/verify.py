"""Everything that a board claims, worked out again: its ledger, its content, its scores, its site."""

import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from pipeline.files import locked, sha256_file, sha256_of
from pipeline.minilm import open_embedder
from sitegen import about as about_file
from sitegen import ledger, shelf
from sitegen.board import evaluate_board
from sitegen.build import build_site
from sitegen.ledger import Entry
from sitegen.output import BLANK, tree_sha256
from sitegen.packing import FILE_NAME
from sitegen.standings import Standing

if TYPE_CHECKING:
    from rich.progress import Progress

SAME_SCORE = 1e-6
"""Scores further apart than this are not the same (ours): fp32 embeddings agree to about 1e-7."""

_STAMP = re.compile(BLANK.replace(b"><", b">([0-9a-f]*)<"))


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was worked out again: what was looked at, and every fault found; none is good."""

    name: str
    looked_at: str
    faults: tuple[str, ...]


def verify(benchmark: Benchmark, site: Path | None, bar: "Progress | None" = None) -> Iterator[Check]:
    """The checks, one after the other; those of the site only when there is one.

    A check whose ground is broken (no ledger to read, no board to score) says so and nothing more.
    """
    folder = benchmark.submissions
    entries: list[Entry] = []
    board: list[Standing] = []

    def chain() -> Iterator[str]:
        entries.extend(ledger.read(folder))
        for before, after in pairwise(entries):
            if after.date < before.date:
                yield f"{after.event} of {after.slug} is dated {after.date}, after a line of {before.date}"

    yield _check("ledger", lambda: f"{len(entries)} lines", chain)
    kept = sum(len(found) for found in ledger.versions(entries).values())
    yield _check("content", lambda: f"{kept} versions of submissions", lambda: _content(folder, entries))

    def scores() -> Iterator[str]:
        board.extend(evaluate_board(benchmark))
        for standing in board:
            yield from _scores(standing)

    yield _check("scores", lambda: f"{len(board)} submissions on the board", scores)
    if site is None:
        return
    yield _check("site", lambda: f"the files of {site}", lambda: _tree(site))
    yield _check("rebuild", lambda: f"{site} built again", lambda: _rebuilt(benchmark, site, board, bar))


def _check(name: str, looked_at: Callable[[], str], faults: Callable[[], Iterator[str]]) -> Check:
    found: list[str] = []
    try:
        found.extend(faults())
    except InputError as error:
        found.append(str(error))
    return Check(name, looked_at(), tuple(found))


def _content(folder: Path, entries: list[Entry]) -> Iterator[str]:
    """Whether every version that the ledger knows is there, unchanged."""
    if not folder.is_dir():
        return
    with locked(folder):
        shelf.settle(folder, ledger.read(folder))
        for place, found in sorted(ledger.versions(entries).items()):
            for version, entry in enumerate(found, start=1):
                where = folder / place if version == len(found) else shelf.earlier(folder, place, version)
                if not where.is_dir():
                    yield f"{where}: found nothing; expected version {version} of {place}"
                    continue
                yield from _hashes(where, entry)
        for path in shelf.strangers(folder, entries):
            yield f"{path}: is not in the ledger"


def _hashes(folder: Path, entry: Entry) -> Iterator[str]:
    try:
        about = about_file.read(folder)
    except InputError as error:
        yield str(error)
        return
    wanted = {FILE_NAME: entry.predictions_sha256}
    if entry.original_sha256:
        wanted[about.original] = entry.original_sha256
    for name, digest in wanted.items():
        path = folder / name
        found = sha256_file(path) if path.is_file() and not path.is_symlink() else "nothing"
        if found != digest:
            yield f"{path}: found hash {found[:12]}, the ledger says {digest[:12]}"


def _scores(standing: Standing) -> Iterator[str]:
    """Whether the scores of now are those that the ledger noted last."""
    slug, card = standing.stored.slug, standing.evaluation.card
    noted = [entry for entry in standing.history if entry.signature]
    if not noted:
        yield f"{slug}: the ledger holds no scores; `coooler build` notes them"
        return
    last = noted[-1]
    if last.signature != str(card.signature):
        yield f"{slug}: scored under {last.signature}, now {card.signature}; `coooler build` rescores it"
        return
    for name in ("besm", "sam", "detection_rate", "hazard_recall"):
        now, then = getattr(card, name), getattr(last, name)
        if (now is None) != (then is None) or (now is not None and abs(now - then) > SAME_SCORE):
            yield f"{slug}: {name} is {now}, the ledger says {then}"


def _tree(site: Path) -> Iterator[str]:
    """Whether the hash in the footer of every page is that of the site's files."""
    files: dict[str, str] = {}
    stamps: dict[str, str] = {}
    for path in sorted(site.rglob("*")):
        name = path.relative_to(site)
        if not path.is_file() or any(part.startswith(".") for part in name.parts):
            continue
        if path.suffix != ".html":
            files[name.as_posix()] = sha256_file(path)
            continue
        page = path.read_bytes()
        found = _STAMP.search(page)
        stamps[name.as_posix()] = found[1].decode() if found else ""
        files[name.as_posix()] = sha256_of(_STAMP.sub(BLANK, page))
    digest = tree_sha256(files)
    if not stamps:
        yield f"{site}: found no page; expected a built site"
    for page_name, stamp in stamps.items():
        if stamp != digest:
            yield f"{page_name}: its footer says {stamp[:12] or 'nothing'}, the files give {digest[:12]}"


def _rebuilt(
    benchmark: Benchmark, site: Path, board: list[Standing], bar: "Progress | None"
) -> Iterator[str]:
    """Which files of the site are not what its inputs give now."""
    with tempfile.TemporaryDirectory() as scratch:
        build_site(benchmark, Path(scratch), board, bar, embedder=open_embedder())
        before, after = _listing(site), _listing(Path(scratch))
    for name in sorted({*before, *after}):
        if name not in after:
            yield f"{name}: is no part of the site that its inputs give now"
        elif name not in before:
            yield f"{name}: is missing"
        elif before[name] != after[name]:
            yield f"{name}: differs from what its inputs give now"


def _listing(folder: Path) -> dict[str, str]:
    paths = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return {path.relative_to(folder).as_posix(): sha256_file(path) for path in paths}
