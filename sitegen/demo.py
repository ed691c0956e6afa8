"""The demo: the packaged benchmark folder, its runs made here and now, its site."""

import shutil
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from pipeline import console
from pipeline.benchmark import FILE_NAME, Benchmark, open_benchmark
from pipeline.cli import default_executor, run_with_progress, snippets_line
from pipeline.config import read_run_config
from pipeline.errors import ConfigError
from pipeline.files import slug
from pipeline.places import Place
from pipeline.run import find_videos
from pipeline.tables import BOXES
from sitegen.about import Sender
from sitegen.board import build_board, submit_file
from sitegen.standings import Standing

NAME = "coooler-demo"


def demo_folder(work: Path | None) -> Benchmark:
    """The demo's benchmark folder: the checkout's own in place, else a copy of the packaged one.

    Raises ConfigError when `work` exists and is something else, or nothing is packaged.
    """
    packaged = Path(str(files("sitegen"))) / "demo_benchmark"
    checkout = Path(str(files("sitegen"))).parent / "demo"
    source = packaged if (packaged / FILE_NAME).is_file() else checkout
    if not (source / FILE_NAME).is_file():
        raise ConfigError(f"found no demo in this installation (looked in {packaged} and {checkout}).")
    if work is None and source == checkout:
        return open_benchmark(checkout)
    target = work or Path(NAME)
    if not target.exists():
        partial = target.with_name(f".{target.name}.partial")
        shutil.rmtree(partial, ignore_errors=True)
        shutil.copytree(
            source, partial, ignore=shutil.ignore_patterns("runs", "submissions", ".coooler-clips.parquet")
        )
        partial.rename(target)
    if not (target / FILE_NAME).is_file():
        raise ConfigError(f"{target}: exists and is no benchmark folder; expected a new path (--work).")
    return open_benchmark(target)


def run_demo(out: Path, work: Path | None, workers: int) -> Sequence[Standing]:
    """Run the demo's configurations on its clips, submit them, build the site into `out`."""
    benchmark = demo_folder(work)
    clips, boxes = find_videos(Place(str(benchmark.videos))), BOXES.read(benchmark.boxes)
    for entry in benchmark.settings.demo:
        file = benchmark.root / entry.predictions
        if entry.run:
            file = benchmark.root / "runs" / slug(entry.name)
            settings = read_run_config(benchmark.root / entry.run)
            executor = default_executor(settings, workers, len(clips))
            report = run_with_progress(clips, boxes, settings, Place(str(file)), executor)
            console.stdout().print(f"{entry.name}: {snippets_line(report)}", markup=False, soft_wrap=True)
        if not entry.board:
            continue
        sender = Sender(entry.name, entry.authors, entry.url, entry.date, entry.agents, entry.licence)
        submit_file(benchmark, file, sender, replace=True)
    with console.progress() as bar:
        board, _ = build_board(benchmark, out, bar)
    return board
