"""`coooler data propose`: tracks for clips that nobody annotated."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import here
from sitegen.cli_data_frames import OnlyOption, VideosOption, WorkersOption, executor_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.data.propose import Proposed, ProposeSettings
    from pipeline.records import TrackBox


def propose(
    videos: VideosOption = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The `boxes` table (Parquet) to write. Default: the benchmark folder's."),
    ] = None,
    method: Annotated[
        str, typer.Option(help="motion, detector or both. Default: detector with --detector, else motion.")
    ] = "",
    detector: Annotated[
        Path | None, typer.Option(help="ONNX object detector, as docs/proposals.md says.")
    ] = None,
    names: Annotated[
        Path | None, typer.Option(help="Its class names, one a line. Default: those in its metadata.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, max=100, help="Detector: look at every Nth frame.")] = 3,
    min_score: Annotated[
        float, typer.Option(min=0, max=1, help="Least score; of motion they start at 0.5.")
    ] = 0.25,
    replace: Annotated[
        bool, typer.Option("--replace", help="Drop the boxes that these videos have, annotated ones too.")
    ] = False,
    missing: Annotated[bool, typer.Option("--missing", help="Only the videos that have no boxes.")] = False,
    only: OnlyOption = None,
    workers: WorkersOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Propose tracks for clips without boxes, by motion or a detector. Run it again to go on."""
    from pipeline.data.propose import ProposeJob, merged, propose_all, remove_parts
    from pipeline.errors import InputError
    from pipeline.files import locked
    from pipeline.places import Place
    from pipeline.run import find_videos, video_id_of
    from pipeline.table import metadata
    from pipeline.tables import BOXES

    if replace and missing:
        raise typer.BadParameter("found --replace and --missing; expected one of them.")
    settings = _settings(method, detector, names, every, min_score)
    table = (out or here().boxes).resolve()
    clips = {video_id_of(one): Path(one.where) for one in find_videos(Place(str(videos or here().videos)))}
    if unknown := sorted(set(only or ()) - set(clips)):
        raise InputError(f"found no clip for {', '.join(unknown)}; expected ids of the videos (--only).")
    wanted = sorted(only or clips)
    parts = table.parent / f".{table.name}.proposals"
    with locked(table.parent):
        before = BOXES.read(table) if table.exists() else []
        marks = metadata(table) if table.exists() else {}
        if table.exists() and not (replace or missing):
            raise InputError(_refusal(table, before))
        if missing:
            wanted = sorted(set(wanted) - {box.video_id for box in before})
        jobs = [ProposeJob(name, clips[name], settings) for name in wanted]
        outcomes: list[Proposed] = []
        with console.progress() as bar:
            task = bar.add_task("clips", total=len(jobs))

            def done(outcome: "Proposed") -> None:
                bar.update(task, advance=1)
                if outcome.error:
                    bar.console.print(f"failed: {outcome.video_id}: {outcome.error}", markup=False)

            outcomes = propose_all(jobs, parts, executor_for(workers, len(jobs)), done)
        if any(not outcome.error for outcome in outcomes):
            rows, marked = merged(before, outcomes, settings, marks)
            BOXES.write(table, rows, marked)
        if all(not outcome.error for outcome in outcomes):
            remove_parts(parts)
    _report(outcomes, table, settings, as_json)


def _settings(
    method: str, detector: Path | None, names: Path | None, every: int, min_score: float
) -> "ProposeSettings":
    """The settings that the options mean."""
    from typing import cast

    from pipeline.data.detector import DetectorSettings, read_names
    from pipeline.data.propose import Method, ProposeSettings

    method = method or ("detector" if detector else "motion")
    if method not in ("motion", "detector", "both"):
        raise typer.BadParameter(f"--method: found {method!r}; expected motion, detector or both.")
    if (method == "motion") == (detector is not None):
        wanted = "none for --method motion" if detector else f"an ONNX file for --method {method}"
        raise typer.BadParameter(f"--detector: found {detector or 'none'}; expected {wanted}.")
    return ProposeSettings(
        cast(Method, method),
        detector.resolve() if detector else None,
        read_names(names) if names else (),
        min_score,
        detecting=DetectorSettings(every_frames=every),
    )


def _refusal(table: Path, before: "Sequence[TrackBox]") -> str:
    from pipeline.records import Kind

    annotated = {box.video_id for box in before if box.kind is not Kind.PROPOSED}
    proposed = {box.video_id for box in before} - annotated
    return (
        f"{table}: found boxes of {len(annotated)} annotated videos and proposals of {len(proposed)}; "
        "expected no such file. Add --missing to propose only for videos without boxes (others stay "
        "as they are), --replace to put proposals in place of what the videos have, or another --out."
    )


def _report(outcomes: "Sequence[Proposed]", table: Path, settings: "ProposeSettings", as_json: bool) -> None:
    """Say what was found; exit 1 when a clip failed."""
    failed = [outcome for outcome in outcomes if outcome.error]
    if as_json:
        videos = [
            {
                "video_id": one.video_id,
                "frames": one.frames,
                "tracks": one.tracks,
                "boxes": len(one.boxes),
                "labels": dict(one.labels),
                "reused": one.reused,
                "error": one.error,
            }
            for one in outcomes
        ]
        console.print_json({"out": str(table), "proposed_by": list(settings.methods), "videos": videos})
    else:
        empty = sum(not one.boxes for one in outcomes) - len(failed)
        reused = sum(one.reused for one in outcomes)
        console.stdout().print(
            f"{len(outcomes) - len(failed)} clips ({reused} from before), {len(failed)} failed: "
            f"{sum(one.tracks for one in outcomes)} tracks proposed by {' and '.join(settings.methods)}, "
            f"{empty} clips without any -> {table}\n"
            "These are proposals, not annotations: pages mark them so.",
            markup=False,
            soft_wrap=True,
        )
    if failed:
        raise typer.Exit(1)
