"""The pipeline's commands. Heavy modules are imported inside them, so that --help is quick."""

import gc
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.errors import CooolerError, FaultsError, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.config import RunConfig
    from pipeline.interfaces import Executor
    from pipeline.places import Place
    from pipeline.records import TrackBox, UsageRow
    from pipeline.run import RunReport
    from pipeline.team import Services

app = typer.Typer(
    name="coooler",
    help="Caption unexpected road hazards in dashcam video, score captions, build the report.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

recordings = typer.Typer(help="Recordings of what models answered: export and import.", rich_markup_mode=None)
app.add_typer(recordings, name="recording", no_args_is_help=True)

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def main() -> None:
    """Run the command line. Exit 0 good, 1 the input is wrong, 2 usage, 3 something outside failed."""
    gc.freeze()  # the modules stay to the end: no search for garbage, not even the last, needs to see them
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
        str, typer.Option(help="Folder of clips, a path or a URL; a video's id is its file's stem.")
    ] = "",
    boxes: Annotated[
        str, typer.Option(help="The `boxes` table (Parquet) of these clips, a path or a URL.")
    ] = "",
    out: Annotated[
        str, typer.Option(help="Run folder, a path or a URL; gets predictions.parquet and more.")
    ] = "run",
    config: Annotated[Path | None, typer.Option(help="TOML file with the run's settings.")] = None,
    only: Annotated[list[str] | None, typer.Option(help="Run just this video; may be given again.")] = None,
    recording: Annotated[str, typer.Option(help="Folder that keeps every answer paid for.")] = "",
    replay: Annotated[bool, typer.Option(help="Answer from the recording alone, with no network.")] = False,
    executor: Annotated[str, typer.Option(help="auto, serial, threads, processes or ray.")] = "auto",
    workers: Annotated[int, typer.Option(min=0, help="Threads or processes; 0: one a core.")] = 0,
    address: Annotated[str, typer.Option(help="Address of a Ray cluster; none: start one here.")] = "",
    strict: Annotated[
        bool, typer.Option(help="Exit 1 when any video failed, not only when all did.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Run the pipeline over clips. Run it again to go on where it stopped."""
    from pipeline.benchmark import find_benchmark
    from pipeline.config import RunConfig, read_run_config
    from pipeline.places import Place
    from pipeline.run import find_videos
    from pipeline.tables import BOXES
    from pipeline.team import Services
    from pipeline.verify import exclusion_counts

    if not videos or not boxes:
        benchmark = find_benchmark(Path.cwd())
        videos = videos or str(benchmark.videos)
        boxes = boxes or str(benchmark.boxes)
    settings = read_run_config(config) if config else RunConfig()
    if not Place(boxes).is_file():
        raise InputError(
            f"{boxes}: no such file; expected the `boxes` table (--boxes). Without annotations, make one "
            "from the clips: coooler data propose."
        )
    if replay and not recording:
        raise InputError("--replay needs --recording; expected the folder of a recording.")
    clips, rows = find_videos(Place(videos)), BOXES.from_bytes(Place(boxes).read(), boxes)
    services = Services(recording, replay)
    chosen = _executor(executor, workers, address, settings, services, len(clips))
    report = run_with_progress(clips, rows, settings, Place(out), chosen, services, only or [])
    excluded = {str(reason): count for reason, count in exclusion_counts(report.tables["snippets"]).items()}
    predictions = len(report.tables["predictions"])
    if as_json:
        console.print_json(
            {
                "out": out,
                "config_sha256": settings.sha256,
                "videos": len(report.outcomes),
                "reused": report.reused,
                "not_run": report.not_run,
                "predictions": predictions,
                "snippets": len(report.tables["snippets"]),
                "snippets_excluded": excluded,
                "usage": usage_totals(report.tables["usage"]),
                "failed": [{"video_id": o.video_id, "error": o.error} for o in report.failed],
                "notes": [{"video_id": o.video_id, "note": o.note} for o in report.outcomes if o.note],
            }
        )
    else:
        lines = [
            f"{len(report.outcomes)} videos ({report.reused} from before, {len(report.failed)} failed"
            f"{f', {report.not_run} not run' if report.not_run else ''}), "
            f"{predictions} predictions -> {Place(out) / 'predictions.parquet'}",
            snippets_line(report),
        ]
        spent = spent_line(report.tables["usage"], settings.currency)
        console.stdout().print("\n".join([*lines, *([spent] if spent else [])]), markup=False, soft_wrap=True)
    ran = len(report.outcomes) - report.not_run
    if report.failed and (strict or len(report.failed) == ran):
        raise typer.Exit(1)


def _executor(
    name: str, workers: int, address: str, settings: "RunConfig", services: "Services", videos: int
) -> "Executor":
    """The executor of that name; `auto` is threads for agents that wait for servers, else processes."""
    from pipeline.execute import (
        ProcessExecutor,
        RayExecutor,
        SerialExecutor,
        ThreadExecutor,
        default_workers,
    )
    from pipeline.team import open_team

    choices = ("auto", "serial", "threads", "processes", "ray")
    if name not in choices:
        raise typer.BadParameter(f"found {name!r}; expected one of {', '.join(choices)}.")
    count = max(1, min(workers or default_workers(), videos))
    if name == "auto":
        waits = open_team(settings, services).waits_for_servers
        name = "threads" if waits else "processes" if count > 1 else "serial"
    if name == "ray":
        return RayExecutor(address or None)
    if name == "threads":
        return ThreadExecutor(count)
    return ProcessExecutor(count) if name == "processes" else SerialExecutor()


def snippets_line(report: "RunReport") -> str:
    """How many snippets each limit left out, and how many predictions were tied to a track."""
    from pipeline.verify import exclusion_counts

    counts = exclusion_counts(report.tables["snippets"])
    left_out = ", ".join(f"{count} {reason}" for reason, count in counts.items() if count)
    tied = sum(bool(prediction.track_ids) for prediction in report.tables["predictions"])
    return (
        f"{len(report.tables['snippets'])} snippets, left out: {left_out or 'none'}; "
        f"{tied} of {len(report.tables['predictions'])} predictions tied to a track"
    )


def default_executor(settings: "RunConfig", workers: int, videos: int) -> "Executor":
    """What `predict` takes when nothing is said."""
    from pipeline.team import Services

    return _executor("auto", workers, "", settings, Services(), videos)


def usage_totals(rows: "Sequence[UsageRow]") -> dict[str, dict[str, float | int | None]]:
    """Calls, tokens, seconds and cost of each role over all videos; None where nothing was counted."""
    totals: dict[str, dict[str, float | int | None]] = {}
    for row in sorted(rows, key=lambda row: (row.role, row.video_id)):
        total = totals.setdefault(row.role, {})
        for name in ("calls", "input_tokens", "output_tokens", "seconds", "cost"):
            value, before = getattr(row, name), total.get(name)
            total[name] = before if value is None else value + (before or 0)
    return totals


def spent_line(rows: "Sequence[UsageRow]", currency: str) -> str:
    """Tokens and money spent so far as one line, empty where nothing was counted."""
    tokens = [(row.input_tokens or 0) + (row.output_tokens or 0) for row in rows]
    if not any(tokens):
        return ""
    costs = [row.cost for row in rows if row.cost is not None]
    money = f", {sum(costs):.4f} {currency}" if costs else ""
    return f"{sum(row.calls for row in rows):,} calls, {sum(tokens):,} tokens{money}"


def run_with_progress(
    clips: "Sequence[Place]",
    boxes: "Sequence[TrackBox]",
    settings: "RunConfig",
    out: "Place",
    executor: "Executor",
    services: "Services | None" = None,
    only: "Sequence[str]" = (),
) -> "RunReport":
    """`pipeline.run.predict` with a progress bar and what was spent, and each odd video said."""
    from pipeline.run import NOT_RUN, VideoRun
    from pipeline.run import predict as run_all
    from pipeline.team import Services

    with console.progress() as bar:
        task = bar.add_task(settings.name, total=len(clips))
        spent: list[UsageRow] = []

        def done(run: VideoRun) -> None:
            spent.extend(run.tables["usage"])
            line = spent_line(spent, settings.currency)
            bar.update(task, advance=1, description=f"{settings.name} ({line})" if line else settings.name)
            outcome = run.outcome
            if outcome.error and outcome.error != NOT_RUN:
                bar.console.print(f"failed: {outcome.video_id}: {outcome.error}", markup=False)
            elif outcome.note:
                bar.console.print(f"note: {outcome.file}: {outcome.note}", markup=False)

        return run_all(
            clips, boxes, settings, out, executor, services=services or Services(), only=only, done=done
        )


@app.command()
def models(
    config: Annotated[
        Path | None, typer.Option(help="A run's settings, for the CLIP that they name.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List the models: where each is, its hash and licence, how to install it."""
    from dataclasses import asdict

    from pipeline.config import read_run_config
    from pipeline.models import known_models

    found = known_models(read_run_config(config).clip_folder if config else "")
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


@app.command("local-llm")
def local_llm(
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port on 127.0.0.1.")] = 8080,
    gguf: Annotated[
        Path | None, typer.Option(help="A GGUF file. Default: the packaged Gemma 3 270M.")
    ] = None,
) -> None:
    """Serve a small language model here, and print the settings that use it."""
    from pipeline.local_llm import run_local_llm

    run_local_llm(port, gguf)


@recordings.command("export")
def recording_export(
    folder: Annotated[Path, typer.Argument(help="Folder of the recording.")],
    target: Annotated[Path, typer.Argument(help="Zip to write.")],
) -> None:
    """Write a recording as one zip, so that others can rebuild its predictions."""
    from pipeline.recording import Recording
    from pipeline.recording_zip import export

    done = export(Recording(folder), target)
    for path in done.corrupt:
        console.stderr().print(f"left out, damaged: {path}", markup=False)
    console.stdout().print(f"{done.count} answers -> {target}", markup=False)


@recordings.command("import")
def recording_import(
    source: Annotated[Path, typer.Argument(help="Zip that `recording export` wrote.")],
    folder: Annotated[Path, typer.Argument(help="Folder of the recording; made if it is not there.")],
) -> None:
    """Add the answers in a zip to a recording; everything in it is checked first."""
    from pipeline.recording_zip import import_zip

    console.stdout().print(f"{import_zip(source, folder)} answers added to {folder}", markup=False)
