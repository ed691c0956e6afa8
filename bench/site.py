"""The site of the demo: pages a second, and a rebuild when nothing changed against a full build."""

import tempfile
import time
from pathlib import Path

from bench.timing import Measure
from pipeline.benchmark import Benchmark
from sitegen.board import evaluate_board
from sitegen.build import build_site

FULL_ROUNDS = 3
REBUILDS_A_ROUND = 3


def measure(benchmark: Benchmark) -> list[Measure]:
    """Full builds into new folders and rebuilds of the same folders, in turns.

    The submissions are those that are stored in the benchmark.
    """
    board = evaluate_board(benchmark)
    full: list[float] = []
    again: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(FULL_ROUNDS):
            out = Path(folder) / str(turn)
            start = time.perf_counter()
            build_site(benchmark, out, board)
            full.append(time.perf_counter() - start)
            for _ in range(REBUILDS_A_ROUND):
                start = time.perf_counter()
                report = build_site(benchmark, out, board)
                again.append(time.perf_counter() - start)
        pages = len(list(out.rglob("*.html")))
    full_s, again_s = sorted(full)[len(full) // 2], sorted(again)[len(again) // 2]
    size = f"{report.bytes / 1e6:.1f} MB, {pages} pages"
    return [
        Measure("rebuild, nothing changed", again_s, "full build", full_s, "under 0.1", size),
        Measure(
            "a page: gather, render, compare",
            again_s / pages,
            "",
            None,
            "",
            f"{pages / again_s:.0f} pages/s in a rebuild",
        ),
    ]
