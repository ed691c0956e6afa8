"""A build of what nobody touched ends at once; whatever is touched is looked at."""

import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.errors import InputError
from pipeline.records import Prediction
from pipeline.tables import PREDICTIONS, TRUTH
from sitegen import board as board_module
from sitegen.about import Sender
from sitegen.board import build_board, rebuild_board, submit_file
from sitegen.readers import read_truth
from sitegen.submissions import withdraw
from sitegen.untouched import Built, record, sources
from tests.clips import write_clip
from tests.site_fixtures import make_benchmark

DAY = "2026-01-02"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a benchmark `b` of two videos and one submission, and its site, built until it rests."""
    root = tmp_path_factory.mktemp("made")
    benchmark = make_benchmark(root / "b", 1)
    send(benchmark, "One", "A cat crossing the road")
    rebuild_board(benchmark, root / "site", today=DAY)
    rebuild_board(benchmark, root / "site", today=DAY)
    return root


def send(benchmark: Benchmark, name: str, text: str) -> None:
    file = benchmark.root.parent / "new.parquet"
    PREDICTIONS.write(file, [Prediction("v1", 1, text)])
    submit_file(benchmark, file, Sender(name, date=DAY), today=DAY)


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of it, looked at once since a copy has times of its own."""
    shutil.copytree(made, tmp_path / "made")
    build(tmp_path / "made")
    return tmp_path / "made"


def build(folder: Path) -> Built:
    return rebuild_board(open_benchmark(folder / "b"), folder / "site", today=DAY)


def contents(folder: Path) -> dict[str, bytes]:
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith("."))
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Gets an item whenever the board is scored."""
    seen: list[str] = []
    real = board_module.evaluate_board

    def told(benchmark: Benchmark, as_of: str = "") -> object:
        seen.append(as_of)
        return real(benchmark, as_of)

    monkeypatch.setattr(board_module, "evaluate_board", told)
    return seen


def test_nothing_touched_tells_the_same_and_reads_nothing(folder: Path, looked: list[str]) -> None:
    before = contents(folder / "site")
    first = build(folder)
    assert not looked and contents(folder / "site") == before
    record(folder / "site").unlink()
    again = build(folder)
    assert looked == [""] and again == first and contents(folder / "site") == before
    assert (first.report.written, first.report.unchanged) == (0, len(before))
    assert first.board[0].name == "One" and first.report.bytes == sum(map(len, before.values()))


def truth_row(folder: Path) -> None:
    benchmark = open_benchmark(folder / "b")
    rows = [replace(row, description="A dog") for row in read_truth(benchmark.truth)]
    TRUTH.write(benchmark.truth, rows)


def submission(folder: Path) -> None:
    send(open_benchmark(folder / "b"), "Two", "A dog")


def clip(folder: Path) -> None:
    write_clip(folder / "b" / "videos" / "v1.mp4", 12, (160, 96))


def attribution(folder: Path) -> None:
    (folder / "b" / "CREDIT.md").write_text("Nobody", encoding="utf-8")


def settings(folder: Path) -> None:
    path = folder / "b" / "coooler.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("Small", "Large"), encoding="utf-8")


def boxes_gone(folder: Path) -> None:
    (folder / "b" / "boxes.parquet").unlink()


def page_of_same_size(folder: Path) -> None:
    page = folder / "site" / "index.html"
    page.write_bytes(page.read_bytes()[:-1] + b"?")


def picture_gone(folder: Path) -> None:
    next((folder / "site" / "media" / "v1").glob("t*.webp")).unlink()


CHANGES = (
    truth_row,
    submission,
    clip,
    attribution,
    settings,
    boxes_gone,
    page_of_same_size,
    picture_gone,
)


@pytest.mark.parametrize("change", CHANGES, ids=[change.__name__ for change in CHANGES])
def test_what_is_touched_is_looked_at(
    folder: Path, tmp_path: Path, looked: list[str], change: Callable[[Path], None]
) -> None:
    change(folder)
    looked.clear()
    build(folder)
    assert looked == [""]
    build_board(open_benchmark(folder / "b"), tmp_path / "fresh", today=DAY)
    assert contents(folder / "site") == contents(tmp_path / "fresh")


def test_what_a_build_itself_noted_is_not_looked_at_again(folder: Path, looked: list[str]) -> None:
    truth_row(folder)
    first = build(folder)
    ledger_file = folder / "b" / "submissions" / "ledger.jsonl"
    assert first.rescored and b'"rescore"' in ledger_file.read_bytes()
    looked.clear()
    again = build(folder)
    assert not looked and again.board == first.board and again.rescored == first.rescored
    withdraw(open_benchmark(folder / "b").submissions, "One", "by mistake", DAY)
    assert build(folder).board == () and looked == [""]


def test_a_withdrawal_during_a_build_is_seen_by_the_next(
    folder: Path, looked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    truth_row(folder)
    real = board_module.build_site

    def meanwhile(benchmark: Benchmark, *arguments: object, **options: object) -> object:
        withdraw(benchmark.submissions, "One", "by mistake", DAY)
        return real(benchmark, *arguments, **options)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(board_module, "build_site", meanwhile)
        assert build(folder).board
    looked.clear()
    assert build(folder).board == () and looked == [""]


def test_a_stored_file_edited_by_hand_is_refused(folder: Path) -> None:
    file = next((folder / "b" / "submissions").glob("*/predictions.parquet"))
    PREDICTIONS.write(file, [Prediction("v1", 1, "A deer")])
    with pytest.raises(InputError, match="changed by hand"):
        build(folder)


@pytest.mark.parametrize("broken", ["", "[]", "{}", '{"key": 1}', "\udcff"])
def test_a_broken_record_is_no_record(folder: Path, looked: list[str], broken: str) -> None:
    record(folder / "site").write_bytes(broken.encode(errors="surrogateescape"))
    build(folder)
    assert looked == [""]


def test_every_file_that_a_build_opens_is_a_source(folder: Path) -> None:
    """Of the benchmark's folder; but for what only tells that a folder is held."""
    opened: set[str] = set()
    is_on = True

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if is_on and event == "open" and isinstance(arguments[0], (str, os.PathLike)):
            opened.add(os.fspath(arguments[0]))

    sys.addaudithook(hook)
    root = folder / "b"
    record(folder / "site").unlink()
    (root / "data-check.json").unlink(missing_ok=True)
    try:
        build(folder)
    finally:
        is_on = False
    inside = {Path(path) for path in opened if Path(path).is_relative_to(root) and Path(path).is_file()}
    benchmark = open_benchmark(root)
    known = {benchmark.truth, benchmark.boxes, root / "coooler.toml", root / "CREDIT.md"}
    for place in (benchmark.videos, benchmark.submissions, root / "truth-history", root / "votes"):
        known |= {path for path in place.rglob("*") if path.is_file()}
    assert inside and inside <= known
    assert len(sources(benchmark)) == len([path for path in known if path.is_file()])
