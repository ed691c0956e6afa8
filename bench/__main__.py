"""`python -m bench [NAME ...]`: the measurements with their ratios; all of them go to bench/report.md.

With names, only these are measured, and the report is left as it is.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TypeAlias

from bench import (
    bootstrap,
    clip,
    coool_import,
    embedding,
    executors,
    http_client,
    keyframes,
    media,
    pages,
    pipeline_cost,
    processes,
    ray_scale,
    reading,
    rebuild,
    scoring,
    site,
)
from bench.timing import Measure, report
from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.files import write_text
from sitegen.demo import run_demo

HERE = Path(__file__).parent
Job: TypeAlias = tuple[Callable[..., list[Measure]], tuple[object, ...]]
NEED_SUBMISSIONS = {"pages", "site"}


def jobs(benchmark: Benchmark, submitted: Benchmark) -> dict[str, Job]:
    """What is measured, by name, with what it is given; `submitted` has submissions."""
    return {
        "keyframes": (keyframes.measure, (sorted(benchmark.videos.glob("*.mp4")),)),
        "media": (media.measure, (benchmark,)),
        "pipeline_cost": (pipeline_cost.measure, (benchmark,)),
        "executors": (executors.measure, (benchmark,)),
        "ray_scale": (ray_scale.measure, ()),
        "http_client": (http_client.measure, ()),
        "clip": (clip.measure, ()),
        "embedding": (embedding.measure, ()),
        "scoring": (scoring.measure, ()),
        "bootstrap": (bootstrap.measure, ()),
        "reading": (reading.measure, ()),
        "coool_import": (coool_import.measure, ()),
        "pages": (pages.measure, (submitted,)),
        "site": (site.measure, (submitted,)),
        "rebuild": (rebuild.measure, ()),
        "processes": (processes.measure, ()),
    }


MADE_BY = """Made by `make bench`. Each row is of one run: medians of at least five rounds in which ours and
its floor or peer take turns, unless the note says otherwise. Boards of 20,000 videos follow below, as
`python -m bench.growth` last measured them."""


def main(names: list[str]) -> None:
    """Measure, print the table, and keep it in bench/report.md when nothing was left out."""
    benchmark = open_benchmark(HERE.parent / "demo")
    known = jobs(benchmark, benchmark)
    unknown = sorted(set(names) - set(known))
    if unknown:
        sys.exit(f"found no measurement {', '.join(unknown)}; expected some of {', '.join(known)}")
    wanted = names or list(known)
    measures: list[Measure] = []
    with tempfile.TemporaryDirectory() as scratch:
        if NEED_SUBMISSIONS & set(wanted):
            work = Path(scratch) / "demo"
            run_demo(Path(scratch) / "site", work, 0)
            known = jobs(benchmark, open_benchmark(work))
        for name in wanted:
            function, arguments = known[name]
            start = time.perf_counter()
            # Each in a process of its own: what one has loaded must not slow the next.
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
                measures += alone.submit(function, *arguments).result()
            print(f"{name}: {time.perf_counter() - start:.0f} s", file=sys.stderr)
    text = report("Measurements", MADE_BY, measures)
    if not names:
        growth = (HERE / "growth.md").read_text(encoding="utf-8")
        write_text(HERE / "report.md", f"{text}\n#{growth}")  # its title one level down
    print(text)


if __name__ == "__main__":
    main(sys.argv[1:])
