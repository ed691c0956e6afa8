"""The command line `coooler`: the pipeline's commands and those that score, submit and build."""

from datetime import date as calendar_date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption, app, main

if TYPE_CHECKING:
    from pipeline.benchmark import Benchmark
    from pipeline.records import TruthHazard
    from pipeline.scores import Evaluation, Submission
    from sitegen.readers import ReadPredictions

__all__ = ["app", "main"]

FileArgument = Annotated[Path, typer.Argument(help="Predictions (Parquet, CSV, JSON Lines) or a run folder.")]
TruthOption = Annotated[
    Path | None, typer.Option(help="Truth: Parquet, CSV or JSON Lines. Default: the benchmark folder's.")
]
OutOption = Annotated[Path | None, typer.Option(help="Folder of the site. Default: site/ here.")]


def _here() -> "Benchmark":
    from pipeline.benchmark import find_benchmark

    return find_benchmark(Path.cwd())


def _read(file: Path, truth: Path | None) -> "tuple[Path, ReadPredictions, list[TruthHazard]]":
    """The predictions file meant by `file` (a run folder means its predictions), read, and the truth."""
    from sitegen.readers import read_predictions, read_truth

    hazards = read_truth(truth or _here().truth)
    path = file / "predictions.parquet" if file.is_dir() else file
    return path, read_predictions(path, hazards), hazards


def _say_warnings(warnings: "tuple[str, ...]") -> None:
    for warning in warnings:
        console.stderr().print(f"warning: {warning}", markup=False)


@app.command()
def check(file: FileArgument, truth: TruthOption = None, as_json: JsonOption = False) -> None:
    """Check a predictions file against the truth: every fault at once, nothing written."""
    path, read, hazards = _read(file, truth)
    videos = len({hazard.video_id for hazard in hazards})
    covered = len({prediction.video_id for prediction in read.predictions})
    if as_json:
        console.print_json(
            {
                "file": str(path),
                "format": read.source_format,
                "sha256": read.sha256,
                "predictions": len(read.predictions),
                "videos_with_predictions": covered,
                "n_videos": videos,
                "warnings": list(read.warnings),
                "faults": [],
            }
        )
        return
    _say_warnings(read.warnings)
    console.stdout().print(
        f"{path}: good. {len(read.predictions)} predictions for {covered} of {videos} videos "
        f"({read.source_format}).",
        markup=False,
    )


@app.command()
def score(
    file: FileArgument,
    truth: TruthOption = None,
    threshold: Annotated[
        float, typer.Option(min=0, max=1, help="A caption detects a hazard above this similarity, strictly.")
    ] = 0.80,
    as_json: JsonOption = False,
) -> None:
    """Score a predictions file: BESM, SAM, detection rate, hazard recall."""
    from pipeline.minilm import open_embedder
    from sitegen.evaluate import evaluate, truth_sha256

    path, read, hazards = _read(file, truth)
    submission = _submission(path.stem, read)
    evaluation = evaluate(submission, hazards, open_embedder(), threshold, truth_sha256(hazards))
    _say_warnings(read.warnings)
    if as_json:
        card = evaluation.card
        console.print_json(
            {
                "besm": card.besm,
                "sam": card.sam,
                "detection_rate": card.detection_rate,
                "hazard_recall": card.hazard_recall,
                "n_videos": card.n_videos,
                "signature": str(card.signature),
            }
        )
        return
    _print_board([evaluation])


def _submission(name: str, read: "ReadPredictions") -> "Submission":
    from pipeline.scores import Submission

    return Submission(name, "", "", "", read.source_format, read.predictions, read.warnings)


def _print_board(evaluations: "list[Evaluation]") -> None:
    """The scores as a table, best first, with the one signature that they share."""
    from rich.table import Table

    from sitegen.leaderboard import rank

    if not evaluations:
        console.stdout().print("no submissions yet: coooler submit FILE --name NAME", markup=False)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("rank", "submission", "BESM", "SAM", "detection", "hazard recall", "videos"):
        left = heading == "submission"
        table.add_column(heading, justify="left" if left else "right")
    for row in rank(evaluations, "besm"):
        card = row.evaluation.card
        recall = "-" if card.hazard_recall is None else f"{card.hazard_recall:.4f}"
        table.add_row(
            str(row.rank),
            row.evaluation.submission.name,
            f"{card.besm:.4f}",
            f"{card.sam:.4f}",
            f"{card.detection_rate:.4f}",
            recall,
            str(card.n_videos),
        )
    output = console.stdout()
    output.print(table)
    output.print(f"signature {evaluations[0].card.signature}", markup=False, soft_wrap=True)


@app.command()
def submit(
    file: FileArgument,
    name: Annotated[str, typer.Option(help="Name on the leaderboard, at most 80 characters.")],
    authors: Annotated[str, typer.Option(help="Who made it.")] = "",
    url: Annotated[str, typer.Option(help="Paper, code or project page (http or https).")] = "",
    agents: Annotated[str, typer.Option(help="Which models produced it, in one line.")] = "",
    date: Annotated[str, typer.Option(help="Date as YYYY-MM-DD. Default: today.")] = "",
    recording: Annotated[
        Path | None, typer.Option(help="Zip of its models' answers, as `recording export` writes it.")
    ] = None,
    replace: Annotated[bool, typer.Option(help="Replace the submission of this name.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Check a predictions file, add it to the benchmark folder, and print its scores."""
    from sitegen.board import submit_file

    benchmark = _here()
    stored, evaluation = submit_file(
        benchmark,
        file,
        name,
        authors,
        url,
        agents,
        date or calendar_date.today().isoformat(),
        replace,
        recording,
    )
    _say_warnings(stored.submission.warnings)
    if as_json:
        console.print_json({"slug": stored.slug, "folder": str(stored.folder), "besm": evaluation.card.besm})
        return
    console.stdout().print(f"stored as {stored.folder}", markup=False)
    _print_board([evaluation])


@app.command()
def withdraw(
    name: Annotated[str, typer.Argument(help="Name or slug of the submission.")],
    why: Annotated[str, typer.Option(help="The reason; it stays in the ledger.")],
    date: Annotated[str, typer.Option(help="Date as YYYY-MM-DD. Default: today.")] = "",
) -> None:
    """Take a submission off the leaderboard; the ledger keeps the fact and the reason."""
    from sitegen.submissions import withdraw as take_off

    take_off(_here().submissions, name, why, date or calendar_date.today().isoformat())
    console.stdout().print(f"withdrawn: {name}", markup=False)


@app.command()
def build(out: OutOption = None, as_json: JsonOption = False) -> None:
    """Score all submissions and build the site; only what changed is written."""
    from sitegen.board import build_board

    benchmark = _here()
    folder = out or Path("site")
    with console.progress() as bar:
        evaluations, report = build_board(benchmark, folder, bar)
    if as_json:
        console.print_json(
            {
                "site": str(folder),
                "written": report.written,
                "unchanged": report.unchanged,
                "removed": report.removed,
                "bytes": report.bytes,
                "tree_sha256": report.tree_sha256,
            }
        )
        return
    _print_board(list(evaluations))
    console.stdout().print(
        f"{folder / 'index.html'}  ({report.written} files written, {report.unchanged} unchanged, "
        f"{report.removed} removed; tree {report.tree_sha256[:12]})",
        markup=False,
        soft_wrap=True,
    )


@app.command()
def serve(
    site: Annotated[Path, typer.Argument(help="Folder of the built site.")] = Path("site"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free one.")] = 8000,
) -> None:
    """Show a built site on http://127.0.0.1:PORT/ until Ctrl-C."""
    from sitegen.serve import serve as run_server

    run_server(site, port)


@app.command()
def demo(
    out: OutOption = None,
    work: Annotated[
        Path | None,
        typer.Option(help="Where to copy the demo's folder. Default: in place, or coooler-demo/."),
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
) -> None:
    """Run the pipeline on the demo's real clips, score it, build the site."""
    from sitegen.demo import run_demo

    folder = out or Path("site")
    evaluations = run_demo(folder, work, workers)
    _print_board(list(evaluations))
    page = folder / "index.html"
    console.stdout().print(f"open {page} in a browser, or: coooler serve {folder}", markup=False)


if __name__ == "__main__":
    main()
