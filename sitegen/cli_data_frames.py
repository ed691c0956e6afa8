"""Commands that turn clips into pictures: data frames, data overlay."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import console
from pipeline.cli import JsonOption
from pipeline.errors import InputError
from sitegen.cli_common import TruthOption, here

if TYPE_CHECKING:
    from pipeline.interfaces import Executor
    from pipeline.records import TrackBox

VideosOption = Annotated[Path | None, typer.Option(help="Folder of clips. Default: the benchmark folder's.")]
BoxesOption = Annotated[
    Path | None, typer.Option(help="The `boxes` table (Parquet). Default: the benchmark folder's.")
]
OnlyOption = Annotated[list[str] | None, typer.Option(help="Just this video; may be given again.")]
WorkersOption = Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")]


def executor_for(workers: int, jobs: int) -> "Executor":
    """As many processes as were asked for, never more than there are jobs."""
    from pipeline.execute import ProcessExecutor, SerialExecutor, default_workers

    count = max(1, min(workers or default_workers(), jobs))
    return ProcessExecutor(count) if count > 1 else SerialExecutor()


def frames(
    out: Annotated[Path, typer.Option(help="Folder of the pictures; gets frames.parquet, the manifest.")],
    videos: VideosOption = None,
    boxes: BoxesOption = None,
    what: Annotated[str, typer.Option(help="frames, or crops: what is in the boxes.")] = "frames",
    count: Annotated[
        int, typer.Option(min=1, max=10_000, help="So many at equal interval (the paper's sampling).")
    ] = 25,
    every: Annotated[int, typer.Option(min=0, help="Instead: every Nth frame.")] = 0,
    at: Annotated[str, typer.Option(help="Instead: the frames of these indices, as 0,12,24.")] = "",
    fps: Annotated[float, typer.Option(min=0, max=1_000, help="Instead: so many a second.")] = 0.0,
    file_format: Annotated[str, typer.Option("--format", help="jpg, png or webp.")] = "jpg",
    quality: Annotated[int, typer.Option(min=1, max=100, help="Of jpg and webp.")] = 90,
    width: Annotated[int, typer.Option(min=0, max=16_384, help="Widest, in px; 0: as they are.")] = 0,
    margin: Annotated[
        float, typer.Option(min=0, max=10, help="Crops: grown by this share of the box on each side.")
    ] = 0.0,
    limits: Annotated[
        bool, typer.Option("--limits", help="Crops: leave out the boxes that the verification ignores.")
    ] = False,
    reference_width: Annotated[
        int,
        typer.Option(min=0, help="Frame width that --limits are meant for, to scale them; 0: as they are."),
    ] = 0,
    only: OnlyOption = None,
    workers: WorkersOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Write frames of clips, or the crops of their boxes, to files. Run again to go on."""
    from pipeline.config import VerifySettings
    from pipeline.data.frames import FramesJob, PictureSettings, Sampling, write_pictures

    if what not in ("frames", "crops"):
        raise typer.BadParameter(f"found {what!r}; expected frames or crops.", param_hint="--what")
    if file_format not in ("jpg", "png", "webp"):
        raise typer.BadParameter(f"found {file_format!r}; expected jpg, png or webp.", param_hint="--format")
    if sum(map(bool, (every, at, fps))) > 1:
        raise typer.BadParameter(
            "found more than one way to choose frames; expected one of --every, --at, --fps."
        )
    sampling = Sampling(count, every, _indices(at), fps)
    ignored = VerifySettings(reference_width_px=reference_width) if limits else None
    settings = PictureSettings(what, file_format, quality, width, margin, ignored)  # type: ignore[arg-type]
    clips = _clips(videos, only or ())
    rows = _boxes(boxes, needed=what == "crops")
    jobs = [FramesJob(name, clip, tuple(rows.get(name, ())), sampling, settings, out) for name, clip in clips]
    with console.progress() as bar:
        task = bar.add_task(what, total=len(jobs))
        results = write_pictures(
            jobs, out, executor_for(workers, len(jobs)), lambda _: bar.update(task, advance=1)
        )
    made, reused = sum(result.pictures for result in results), sum(result.reused for result in results)
    line = f"{made} {what} of {len(results)} videos ({reused} from before) -> {out / 'frames.parquet'}"
    _report(results, {"out": str(out), what: made, "reused": reused}, line, as_json)


def overlay(
    out: Annotated[Path, typer.Option(help="Folder of the clips with boxes drawn in.")],
    videos: VideosOption = None,
    boxes: BoxesOption = None,
    truth: TruthOption = None,
    labels: Annotated[
        bool, typer.Option(help="Write track ids, and labels of the truth, beside boxes.")
    ] = True,
    kinds: Annotated[
        str, typer.Option(help="Which boxes: challenge (hazards), traffic, proposed.")
    ] = "challenge,traffic,proposed",
    only: OnlyOption = None,
    workers: WorkersOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Draw boxes and track ids into clips, as H.264 that browsers play."""
    from pipeline.data.overlay import Overlaid, OverlayJob, overlay_clip
    from pipeline.records import Kind

    asked = {kind.strip() for kind in kinds.split(",")}
    if not asked or not asked <= set(Kind):
        raise typer.BadParameter(
            f"found {kinds!r}; expected some of challenge,traffic,proposed.", param_hint="--kinds"
        )
    clips, rows = _clips(videos, only or ()), _boxes(boxes, needed=True)
    named = _labels(truth) if labels else {}
    if out.resolve() in {clip.parent.resolve() for _, clip in clips}:
        raise InputError(f"{out}: is the folder of the clips; expected another one, which keeps them.")
    jobs = [
        OverlayJob(
            name,
            clip,
            out / f"{name}.mp4",
            tuple(box for box in rows.get(name, ()) if box.kind in asked),
            named.get(name, {}),
            labels,
        )
        for name, clip in clips
    ]
    results: list[Overlaid] = []
    with console.progress() as bar:
        task = bar.add_task("overlay", total=len(jobs))
        executor = executor_for(workers, len(jobs))
        for result in executor.run(overlay_clip, jobs, lambda job, why: Overlaid(job.video_id, 0, 0, why)):
            results.append(result)
            bar.update(task, advance=1)
    results.sort(key=lambda result: result.video_id)
    drawn, good = sum(result.boxes for result in results), sum(not result.error for result in results)
    _report(results, {"out": str(out), "boxes": drawn}, f"{drawn} boxes in {good} clips -> {out}", as_json)


def _indices(text: str) -> tuple[int, ...]:
    parts = [part.strip() for part in text.split(",")] if text else []
    wrong = [part for part in parts if not (part.isascii() and part.isdecimal() and len(part) <= 9)]
    if wrong:
        raise typer.BadParameter(f"found {wrong[0]!r}; expected frame indices as 0,12,24.", param_hint="--at")
    return tuple(sorted({int(part) for part in parts}))


def _clips(videos: Path | None, only: Sequence[str]) -> list[tuple[str, Path]]:
    """(video id, file) of the clips, sorted; with `only`, those."""
    from pipeline.places import Place
    from pipeline.run import find_videos, video_id_of

    folder = videos or here().videos
    found = [(video_id_of(place), Path(place.where)) for place in find_videos(Place(str(folder)))]
    unknown = sorted(set(only) - {name for name, _ in found})
    if unknown:
        raise InputError(
            f"{folder}: found no clip of {', '.join(unknown)}; expected the id of a clip (--only)."
        )
    return [(name, clip) for name, clip in found if not only or name in only]


def _boxes(boxes: Path | None, *, needed: bool) -> "dict[str, list[TrackBox]]":
    """The boxes of each video."""
    from pipeline.tables import BOXES

    if not needed:
        return {}
    path = boxes or here().boxes
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected the `boxes` table (--boxes).")
    rows: dict[str, list[TrackBox]] = {}
    for box in BOXES.read(path):
        rows.setdefault(box.video_id, []).append(box)
    return rows


def _labels(truth: Path | None) -> dict[str, dict[str, str]]:
    """Video id -> track id -> the labels of the hazards that it is; none outside a benchmark folder."""
    from pipeline.errors import ConfigError
    from sitegen.readers import read_truth
    from sitegen.video_film import track_labels

    try:
        path = truth or here().truth
    except ConfigError:
        return {}
    hazards: dict[str, list[Any]] = {}
    for hazard in read_truth(path):
        hazards.setdefault(hazard.video_id, []).append(hazard)
    return {video: track_labels(rows) for video, rows in hazards.items()}


def _report(results: Sequence[Any], said: dict[str, Any], line: str, as_json: bool) -> None:
    """What was done and what failed; exit 1 when something failed."""
    failed = [result for result in results if result.error]
    if as_json:
        console.print_json({**said, "videos": [asdict(result) for result in results]})
    else:
        console.stdout().print(line, markup=False, soft_wrap=True)
    for result in failed:
        console.stderr().print(f"failed: {result.video_id}: {result.error}", markup=False)
    if failed:
        raise typer.Exit(1)
