"""A rebuild makes again what changed, and gives the bytes of a build from nothing."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.tables import TRUTH
from sitegen import build as build_module
from sitegen.build import build_site
from sitegen.evaluate import evaluate, truth_sha256
from sitegen.pages import Page
from sitegen.readers import read_truth
from tests.clips import write_clip
from tests.site_fixtures import Board, WordEmbedder, make_benchmark, make_board

Made = tuple[Benchmark, Board]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A benchmark of four videos with three submissions."""
    benchmark = make_benchmark(tmp_path_factory.mktemp("benchmark") / "b")
    return benchmark, make_board(benchmark)


@pytest.fixture(scope="module")
def built(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its site."""
    out = tmp_path_factory.mktemp("built")
    build_site(made[0], out, made[1], jobs=1)
    return out


def scored(benchmark: Benchmark, board: Board) -> Board:
    """The board under the benchmark's truth of now."""
    truth, threshold = read_truth(benchmark.truth), benchmark.settings.threshold
    key = truth_sha256(truth)
    return [
        one._replace(evaluation=evaluate(one.stored.submission, truth, WordEmbedder(), threshold, key))
        for one in board
    ]


def nothing(benchmark: Benchmark, board: Board) -> Made:
    return benchmark, board


def other_order(benchmark: Benchmark, board: Board) -> Made:
    return benchmark, board[::-1]


def one_truth_row(benchmark: Benchmark, board: Board) -> Made:
    rows = [
        replace(row, description="A cat sits on the road") if row.video_id == "v1" else row
        for row in read_truth(benchmark.truth)
    ]
    TRUTH.write(benchmark.truth, rows)
    return benchmark, scored(benchmark, board)


def one_submission_less(benchmark: Benchmark, board: Board) -> Made:
    return benchmark, [one for one in board if one.stored.slug != "silent"]


def one_caption(benchmark: Benchmark, board: Board) -> Made:
    first = board[0].stored
    rows = tuple(
        replace(row, description="A dog") if row.video_id == "v3" else row
        for row in first.submission.predictions
    )
    changed = replace(first, submission=replace(first.submission, predictions=rows))
    return benchmark, scored(benchmark, [board[0]._replace(stored=changed), *board[1:]])


def one_clip(benchmark: Benchmark, board: Board) -> Made:
    write_clip(benchmark.videos / "v2.mp4", 20, (320, 180))
    return benchmark, board


def another_name(benchmark: Benchmark, board: Board) -> Made:
    settings = benchmark.root / "coooler.toml"
    text = settings.read_text(encoding="utf-8")
    settings.write_text(text.replace("Small", "Little"), encoding="utf-8")
    return open_benchmark(benchmark.root), board


EVERY = {f"videos/{name}.html" for name in ("v1", "v2", "v3", "zz-gone")}

CHANGES: list[tuple[Callable[[Benchmark, Board], Made], set[str]]] = [
    (nothing, set()),
    (other_order, set()),
    (one_truth_row, {"videos/v1.html"}),
    (one_submission_less, EVERY),
    (one_caption, {"videos/v3.html"}),
    (one_clip, {"videos/v2.html"}),
    (another_name, EVERY),
]


@pytest.mark.parametrize(("change", "videos"), CHANGES, ids=[change.__name__ for change, _ in CHANGES])
def test_a_rebuild_equals_a_build_from_nothing(
    made: Made,
    built: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[Benchmark, Board], Made],
    videos: set[str],
) -> None:
    shutil.copytree(made[0].root, tmp_path / "b")
    shutil.copytree(built, tmp_path / "site")
    benchmark, board = change(open_benchmark(tmp_path / "b"), made[1])
    rendered: list[str] = []
    real = build_module.render

    def counted(page: Page, address: str) -> bytes:
        rendered.append(page.path)
        return real(page, address)

    with monkeypatch.context() as patched:
        patched.setattr(build_module, "render", counted)
        again = build_site(benchmark, tmp_path / "site", board, jobs=1)
    fresh = build_site(benchmark, tmp_path / "fresh", board, jobs=1)
    assert again.tree_sha256 == fresh.tree_sha256
    assert _contents(tmp_path / "site") == _contents(tmp_path / "fresh")
    assert {path for path in rendered if path.startswith("videos/")} == videos
    assert bool(rendered) == (change not in {nothing, other_order})


def _contents(folder: Path) -> dict[str, bytes]:
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
