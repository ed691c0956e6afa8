"""`coooler data annotate` and `coooler data agreement`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import here

if TYPE_CHECKING:
    from pipeline.benchmark import Benchmark
    from sitegen.agreement import AgreementReport

TRUTH_FILE = "truth.parquet"
OutOption = Annotated[
    Path | None,
    typer.Option(
        help="Truth to write (Parquet); annotations/ is beside it. Default: the benchmark folder's."
    ),
]


def annotate(
    videos: Annotated[
        Path | None, typer.Option(help="Folder of clips. Default: the benchmark folder's.")
    ] = None,
    boxes: Annotated[
        Path | None, typer.Option(help="Boxes table with the tracks. Default: the benchmark folder's.")
    ] = None,
    truth: Annotated[Path | None, typer.Option(help="Truth to start from. Default: nothing.")] = None,
    out: OutOption = None,
    author: Annotated[str, typer.Option(help="Who annotates. Default: the page asks.")] = "",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes a free one.")] = 8770,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open a browser.")] = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Write over a truth that annotating did not write.")
    ] = False,
) -> None:
    """Write labels and descriptions on a page of this computer; saved to truth.parquet as you go."""
    from pipeline.errors import InputError
    from sitegen.annotate_records import author_of
    from sitegen.annotate_server import annotate as serve
    from sitegen.readers import read_truth

    benchmark = None if videos else here()
    folder = videos or (benchmark.videos if benchmark else Path())
    table = boxes or (benchmark.boxes if benchmark else None)
    if boxes and not boxes.is_file():
        raise InputError(f"{boxes}: no such file; expected a boxes table (--boxes).")
    target = out or _default_out(benchmark)
    serve(
        benchmark.settings.name if benchmark else folder.resolve().name,
        folder,
        table if table and table.is_file() else None,
        target,
        read_truth(truth) if truth else None,
        author=author_of(author) if author else "",
        port=port,
        opens=not no_open,
        replace=replace,
    )
    named = benchmark.truth.resolve() if benchmark else target.resolve()
    if benchmark and named != target.resolve():
        console.stderr().print(
            f"{benchmark.root / 'coooler.toml'} still names {benchmark.settings.truth} as the truth; "
            f'write truth = "{target.name}" there to score against this one.',
            markup=False,
        )


def agreement(out: OutOption = None, as_json: JsonOption = False) -> None:
    """How far annotators agree: hazard or none, descriptions, labels, tracks; per pair and per video."""
    from dataclasses import asdict

    from pipeline.errors import InputError
    from sitegen.annotate_desk import Desk
    from sitegen.annotate_server import FOLDER

    target = out or _default_out(here())
    folder = target.resolve().parent / FOLDER
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected annotations. Make some: coooler data annotate.")
    report = Desk(folder.parent.name, (), folder, target).agreement()
    if as_json:
        pairs = [{"n_videos": pair.n_videos, **asdict(pair)} for pair in report.pairs]
        console.print_json({"pairs": pairs, "problem": report.problem})
    else:
        _print(report)


def _default_out(benchmark: "Benchmark | None") -> Path:
    return (benchmark.root if benchmark else Path()) / TRUTH_FILE


def _print(report: "AgreementReport") -> None:
    from rich.table import Table
    from rich.text import Text

    output = console.stdout()
    if report.problem:
        console.stderr().print(f"without cosines: {report.problem}", markup=False)
    if not report.pairs:
        output.print("no two annotators finished the same video yet", markup=False)
    for pair in report.pairs:
        kappa = "-" if pair.kappa is None else f"{pair.kappa:.3f}"
        verdict = f"hazard or none {pair.verdict:.1%}, kappa {kappa}"
        videos = f"{pair.n_videos} video{'s' if pair.n_videos != 1 else ''}"
        output.print(f"{pair.first} and {pair.second}, {videos}: {verdict}", markup=False)
        table = Table(box=None, pad_edge=False, header_style="bold")
        table.add_column("video", overflow="fold")
        for heading in ("hazard or none", "hazards", "cosine", "labels", "tracks"):
            table.add_column(heading, justify="right")
        for video in pair.videos:
            shares = _shown(video.cosine), f"{video.label:.1%}", f"{video.track:.1%}"
            verdict = "same" if video.same_verdict else "differs"
            counts = f"{video.n_first} and {video.n_second}"
            table.add_row(Text(video.video_id), verdict, counts, *shares)
        means = [_shown(pair.cosine), *("-" if x is None else f"{x:.1%}" for x in (pair.label, pair.track))]
        table.add_row(Text("where both saw one", style="bold"), "", "", *means)
        output.print(table)


def _shown(cosine: float | None) -> str:
    return "-" if cosine is None else f"{cosine:.3f}"
