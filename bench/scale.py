"""How the cost of a board grows: `python -m bench.scale [VIDEOS ...]`, by default 100, 1,000 and 10,000.

Ten systems with a caption a video; the videos have no clips, since what a clip costs does not depend on
how many there are. Each size in a process of its own, measured once; prints a Markdown table.
"""

import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from bench.rebuild import SYSTEMS, change_truth, write_benchmark
from sitegen.board import evaluate_board, rebuild_board

SIZES = (100, 1_000, 10_000)


@contextmanager
def _timed(spent: dict[str, float], what: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    spent[what] = time.perf_counter() - start


def cost(videos: int) -> dict[str, float]:
    """Seconds by step; then bytes and files of the site, and the peak of this process's memory in MB."""
    spent: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        os.environ["COOOLER_CACHE"] = f"{name}/cache"
        root = Path(name) / "b"
        benchmark = write_benchmark(root, {f"v{number:06}": None for number in range(videos)}, SYSTEMS)
        with _timed(spent, "read, embed and score all, s"):
            evaluate_board(benchmark)
        with _timed(spent, "the same, vectors cached, s"):
            evaluate_board(benchmark)
        with _timed(spent, "full build, s"):
            rebuild_board(benchmark, root / "site")
        rebuild_board(benchmark, root / "site")  # scores were noted in the ledger, so this looks once more
        with _timed(spent, "nothing changed, s"):
            report = rebuild_board(benchmark, root / "site").report
        change_truth(benchmark, 0)
        with _timed(spent, "one truth row changed, s"):
            rebuild_board(benchmark, root / "site")
        spent["site, MB"] = report.bytes / 1e6
        spent["files"] = report.unchanged
    spent["peak memory, MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return spent


def main(sizes: list[int]) -> None:
    """Print a column a size, and how much more the largest costs a video than the one before."""
    found = []
    for videos in sizes:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
            found.append(alone.submit(cost, videos).result())
        print(f"{videos:,} videos: done", file=sys.stderr)
    print(f"| {SYSTEMS} systems | {' | '.join(f'{videos:,} videos' for videos in sizes)} | slope |")
    print("|---|" + "---:|" * (len(sizes) + 1))
    for what in found[0]:
        values = [one[what] for one in found]
        slope = values[-1] / values[-2] / (sizes[-1] / sizes[-2]) if len(sizes) > 1 else 1.0
        print(f"| {what} | {' | '.join(f'{value:,.3g}' for value in values)} | {slope:.2f} |")


if __name__ == "__main__":
    main([int(videos) for videos in sys.argv[1:]] or list(SIZES))
