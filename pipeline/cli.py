"""The pipeline's commands. Heavy modules are imported inside them, so that --help is quick."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.errors import CooolerError, FaultsError, InputError

if TYPE_CHECKING:
    from pipeline.config import RunConfig
    from pipeline.interfaces import Executor
    from pipeline.records import TrackBox
    from pipeline.run import RunReport

app = typer.Typer(
    name="coooler",
    help="Caption unexpected road hazards in dashcam video, score captions, build the report.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def main() -> None:
    """Run the command line. Exit 0 good, 1 the input is wrong, 2 usage, 3 something outside failed."""
    try:
        app()
    except CooolerError as error:
        if "--json" in sys.argv and isinstance(error, FaultsError):
            console.print_json({"faults": [fault.as_dict() for fault in error.faults]})
        console.stderr().print(f"coooler: {error}", markup=False)
        raise SystemExit(error.exit_code) from error
    except BrokenPipeError:
        raise SystemExit(0) from None


@app.command()
def predict(
    videos: Annotated[
        Path | None, typer.Option(help="Folder of clips; a video's id is its file's stem.")
    ] = None,
    boxes: Annotated[Path | None, typer.Option(help="The `boxes` table (Parquet) of these clips.")] = None,
    out: Annotated[
        Path, typer.Option(help="Run folder; gets predictions.parquet and the other tables.")
    ] = Path("run"),
    config: Annotated[Path | None, typer.Option(help="TOML file with the run's settings.")] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    strict: Annotated[
        bool, typer.Option(help="Exit 1 when any video failed, not only when all did.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Run the pipeline over clips. Run it again to go on where it stopped."""
    from pipeline.benchmark import find_benchmark
    from pipeline.config import RunConfig, read_run_config
    from pipeline.run import find_videos
    from pipeline.tables import BOXES

    if videos is None or boxes is None:
        benchmark = find_benchmark(Path.cwd())
        videos = videos or benchmark.videos
        boxes = boxes or benchmark.boxes
    settings = read_run_config(config) if config else RunConfig()
    if not boxes.is_file():
        raise InputError(f"{boxes}: no such file; expected the `boxes` table (--boxes).")
    paths, rows = find_videos(videos), BOXES.read(boxes)
    report = run_with_progress(paths, rows, settings, out, workers)
    if as_json:
        console.print_json(
            {
                "out": str(out),
                "config_sha256": settings.sha256,
                "videos": len(report.outcomes),
                "reused": report.reused,
                "predictions": report.predictions,
                "failed": [{"video_id": o.video_id, "error": o.error} for o in report.failed],
                "notes": [{"video_id": o.video_id, "note": o.note} for o in report.outcomes if o.note],
            }
        )
    else:
        console.stdout().print(
            f"{len(report.outcomes)} videos ({report.reused} from before, {len(report.failed)} failed), "
            f"{report.predictions} predictions -> {out / 'predictions.parquet'}",
            markup=False,
        )
    if report.failed and (strict or len(report.failed) == len(report.outcomes)):
        raise typer.Exit(1)


def run_with_progress(
    paths: "list[Path]", boxes: "list[TrackBox]", settings: "RunConfig", out: Path, workers: int
) -> "RunReport":
    """`pipeline.run.predict` with a progress bar, and each failed or odd video said on the way."""
    from pipeline.execute import ProcessExecutor, SerialExecutor, default_workers
    from pipeline.run import VideoRun
    from pipeline.run import predict as run_all

    count = min(workers or default_workers(), len(paths))
    executor: Executor = ProcessExecutor(count) if count > 1 else SerialExecutor()
    with console.progress() as bar:
        task = bar.add_task(settings.name, total=len(paths))

        def done(run: VideoRun) -> None:
            bar.advance(task)
            outcome = run.outcome
            if outcome.error:
                bar.console.print(f"failed: {outcome.error}", markup=False)
            elif outcome.note:
                bar.console.print(f"note: {outcome.file}: {outcome.note}", markup=False)

        return run_all(paths, boxes, settings, out, executor, done)


@app.command()
def models(as_json: JsonOption = False) -> None:
    """List the models: where each was found, its hash and licence, how to install it."""
    from dataclasses import asdict

    from pipeline.models import known_models

    found = known_models()
    if as_json:
        console.print_json(
            [
                {key: str(value) if isinstance(value, Path) else value for key, value in asdict(m).items()}
                for m in found
            ]
        )
        return
    from rich.table import Table

    table = Table(
        "role", "model", "sha256", "licence", "found at, or how to install it", box=None, pad_edge=False
    )
    for model in found:
        place = str(model.path) if model.path else f"not found: {model.install}"
        table.add_row(model.role, model.name, (model.sha256 or "")[:12], model.licence, place)
    console.stdout().print(table)
