"""`python -m bench`: every measurement in one run, with ratios; also written to bench/report.md."""

import platform
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from bench import bootstrap, clip, embedding, executors, http_client, keyframes, site
from bench.timing import Measure
from pipeline.benchmark import open_benchmark
from pipeline.files import write_text
from sitegen.demo import run_demo

HERE = Path(__file__).parent


def report(measures: list[Measure]) -> str:
    """The measurements as a Markdown table."""
    lines = [
        "# Measurements",
        "",
        f"Python {platform.python_version()} on {platform.system()} {platform.machine()}; medians of",
        "interleaved runs. Machines are noisy: the ratios count, the seconds do not.",
        "",
        "| what | ours | against | theirs | ratio | goal | note |",
        "|---|---:|---|---:|---:|---|---|",
    ]
    for one in measures:
        theirs = "" if one.peer_s is None else f"{one.peer_s:.4g} s"
        ratio = "" if one.ratio is None else f"{one.ratio:.2f}"
        lines.append(
            f"| {one.what} | {one.ours_s:.4g} s | {one.peer} | {theirs} | {ratio} | {one.goal} | {one.note} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure everything on the demo's clips, print the table, keep it in bench/report.md."""
    benchmark = open_benchmark(HERE.parent / "demo")
    videos = sorted(benchmark.videos.glob("*.mp4"))
    run_demo(HERE.parent / "site", None, 0)  # the submissions that the site is measured with
    jobs: list[tuple[Callable[..., list[Measure]], tuple[object, ...]]] = [
        (keyframes.measure, (videos,)),
        (embedding.measure, ()),
        (site.measure, (benchmark,)),
        (http_client.measure, ()),
        (clip.measure, ()),
        (executors.measure, (benchmark,)),
        (bootstrap.measure, ()),
    ]
    measures: list[Measure] = []
    for function, arguments in jobs:
        # Each in a process of its own: what one has loaded must not slow the next.
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
            measures += alone.submit(function, *arguments).result()
        print(f"{len(measures)} measurements", file=sys.stderr)
    text = report(measures)
    write_text(HERE / "report.md", text)
    print(text)


if __name__ == "__main__":
    main()
