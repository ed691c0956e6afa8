"""The commands of `coooler export`: a run in the formats of others."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import console
from pipeline.cli import JsonOption
from pipeline.errors import InputError
from sitegen.cli_common import here
from sitegen.cli_data_frames import BoxesOption, VideosOption, WorkersOption, executor_for

if TYPE_CHECKING:
    from pipeline.records import TrackBox
    from pipeline.table import Table

export = typer.Typer(help="Write a run as others want it: the COOOL challenge.", rich_markup_mode=None)


@export.callback()
def _group() -> None:
    """Keeps `coool` a command of its own while it is the only one."""


@export.command()
def coool(
    run: Annotated[Path, typer.Argument(help="Run folder, as `predict` writes it.")],
    boxes: BoxesOption = None,
    videos: VideosOption = None,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("results.csv"),
    reactions: Annotated[
        Path | None,
        typer.Option(
            help="When drivers react: CSV (video_id,changed_at_frame) or reactions.parquet. "
            "Default: found in the clips, and kept in the run."
        ),
    ] = None,
    names: Annotated[str, typer.Option(help="What a hazard is called: caption or label.")] = "caption",
    workers: WorkersOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Write a run as a results.csv of the COOOL challenge: driver state, hazard tracks, names.

    Exit 1 when no clip could be looked at for a reaction.
    """
    from pipeline.data.hazard_tracks import hazard_tracks
    from pipeline.files import write_bytes
    from pipeline.tables import BOXES, MATCHES, OUTCOMES, PREDICTIONS
    from sitegen.coool_write import results_csv
    from sitegen.driver_states import read_driver_states

    if names not in ("caption", "label"):
        raise typer.BadParameter(f"found {names!r}; expected caption or label.", param_hint="--names")
    if out.is_dir():
        raise InputError(f"{out}: is a folder; expected the name of a file to write (--out).")
    outcomes = _rows(run, OUTCOMES)
    frames = {outcome.video_id: outcome.frame_count for outcome in outcomes if outcome.frame_count > 0}
    if not frames:
        raise InputError(f"{run}: found no video with frames in its outcomes; expected a finished run.")
    predictions = _rows(run, PREDICTIONS)
    boxes_path = boxes or here().boxes
    if not boxes_path.is_file():
        raise InputError(f"{boxes_path}: no such file; expected the `boxes` table (--boxes).")
    rows = BOXES.read(boxes_path)
    tracks = hazard_tracks(predictions, _rows(run, MATCHES), rows)
    if reactions:
        changed = read_driver_states(reactions)
        failed: list[str] = []
    else:
        changed, failed = _find_reactions(run, sorted(frames), videos, rows, workers)
    written = results_csv(frames, tracks, changed, names)
    try:
        write_bytes(out, written.data)
    except OSError as error:
        raise InputError(
            f"{out}: cannot be written ({error}); expected a place for a file (--out)."
        ) from error
    untied = sum(not prediction.track_ids for prediction in predictions)
    warnings = [
        *(f"no reaction looked for in {problem}" for problem in failed),
        *_said(len(outcomes) - len(frames), "videos of the run without frames are left out"),
        *_said(untied, "predictions are tied to no track and left out: the format has no place for them"),
        *_said(written.crowded, "frames have more hazards than slots; the most confident are kept"),
        *_said(written.odd_tracks, "track ids are no whole numbers, as the rules want them"),
    ]
    for warning in warnings:
        console.stderr().print(f"warning: {warning}", markup=False)
    hazards = sum(len(found) for video, found in tracks.items() if video in frames)
    reacting = sum(changed.get(video) is not None for video in frames)
    if as_json:
        counts = {"videos": len(frames), "rows": written.rows, "hazards": hazards, "reactions": reacting}
        console.print_json({"out": str(out), **counts, "warnings": warnings})
    else:
        line = (
            f"{written.rows} frames of {len(frames)} videos, {hazards} hazard tracks, "
            f"{reacting} drivers reacting -> {out}"
        )
        console.stdout().print(line, markup=False, soft_wrap=True)
    if len(failed) == len(frames):
        raise typer.Exit(1)


def _said(count: int, what: str) -> list[str]:
    return [f"{count} {what}"] if count else []


def _rows(run: Path, table: "Table[Any]") -> list[Any]:
    path = run / f"{table.name}.parquet"
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a run folder, as `coooler predict` writes it.")
    return table.read(path)


def _find_reactions(
    run: Path, wanted: Sequence[str], videos: Path | None, boxes: "Sequence[TrackBox]", workers: int
) -> tuple[dict[str, int | None], list[str]]:
    """Video -> frame of the reaction, from the run's `reactions` or from the clips, and what failed."""
    from pipeline.data.driver_reaction import ReactionJob, find_reactions
    from pipeline.files import sha256_of
    from pipeline.places import Place
    from pipeline.run import find_videos, video_id_of
    from pipeline.tables import REACTIONS

    folder = videos or here().videos
    clips = {video_id_of(place): Path(place.where) for place in find_videos(Place(str(folder)))}
    missing = [video for video in wanted if video not in clips]
    if missing:
        raise InputError(
            f"{folder}: found no clip of {', '.join(missing[:20])}; expected all clips of the run. Give "
            "--videos, or --reactions."
        )
    by_video: dict[str, list[TrackBox]] = {}
    for box in boxes:
        by_video.setdefault(box.video_id, []).append(box)
    jobs = [ReactionJob(video, clips[video], tuple(by_video.get(video, ()))) for video in wanted]
    key = sha256_of("\n".join(job.sha256 for job in jobs).encode())
    kept = _kept(run / f"{REACTIONS.name}.parquet", key)
    if kept is not None:
        return kept, []
    with console.progress() as bar:
        task = bar.add_task("driver reactions", total=len(jobs))
        found = find_reactions(jobs, executor_for(workers, len(jobs)), lambda: bar.update(task, advance=1))
    failed = [f"{result.reaction.video_id}: {result.error}" for result in found if result.error]
    table = [result.reaction for result in found]
    # What else holds a run's tables, such as a submission, is nobody's to add to.
    if not failed and (run / "run.json").is_file():
        REACTIONS.write(run / f"{REACTIONS.name}.parquet", table, {"inputs_sha256": key})
    return {reaction.video_id: reaction.frame_index for reaction in table}, failed


def _kept(path: Path, key: str) -> dict[str, int | None] | None:
    """The reactions that a run keeps, if they were found in these clips and boxes by this code."""
    import pyarrow as pa

    from pipeline.errors import FaultsError
    from pipeline.table import metadata
    from pipeline.tables import REACTIONS

    try:
        if metadata(path).get("inputs_sha256") != key:
            return None
        return {reaction.video_id: reaction.frame_index for reaction in REACTIONS.read(path)}
    except (OSError, ValueError, FaultsError, pa.ArrowException):
        return None
