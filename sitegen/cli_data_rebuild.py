"""Commands that make a benchmark's clips and boxes from what people wrote: data cut, boxes, rebuild."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import here
from sitegen.cli_data_frames import OnlyOption, WorkersOption, executor_for

SourcesOption = Annotated[
    Path | None, typer.Option(help="Folder of the raw videos. Default: the package that the plan names.")
]


def cut(
    plan: Annotated[Path, typer.Argument(help="TOML file with the plan of the clips.")],
    out: Annotated[Path, typer.Option(help="Folder of the clips.")],
    sources: SourcesOption = None,
    only: OnlyOption = None,
    workers: WorkersOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Cut clips out of raw videos by a plan: same plan, same bytes."""
    from pipeline.data.plan import find_sources, read_plan
    from pipeline.data.rebuild import cut_all

    read = read_plan(plan)
    found = find_sources(read, sources)
    with console.progress() as bar:
        total = len(only) if only else len(read.clips)
        task = bar.add_task("cut", total=total)
        done = cut_all(
            read, found, out, executor_for(workers, total), lambda: bar.update(task, advance=1), only or ()
        )
    if as_json:
        clips = [{"video_id": clip.video_id, "frames": clip.frames} for clip in done]
        console.print_json({"out": str(out), "clips": clips})
        return
    frames = sum(clip.frames for clip in done)
    console.stdout().print(f"{len(done)} clips, {frames} frames -> {out}", markup=False, soft_wrap=True)


def boxes(
    key_boxes: Annotated[Path, typer.Argument(help="CSV of key boxes: a track's boxes at some frames.")],
    out: Annotated[Path, typer.Option(help="The `boxes` table to write (Parquet).")],
    videos: Annotated[
        Path | None,
        typer.Option(help="Folder of the clips, for their sizes. Default: the benchmark folder's."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write the boxes of every frame from key boxes: straight lines between them."""
    from pipeline.data.decode import size_of
    from pipeline.data.keyboxes import interpolate, read_key_boxes
    from pipeline.places import Place
    from pipeline.run import find_videos, video_id_of
    from pipeline.tables import BOXES

    keys = read_key_boxes(key_boxes)
    named = {key.video_id for key in keys}
    places = find_videos(Place(str(videos or here().videos)))
    clips = {video_id_of(place): Path(place.where) for place in places}
    made = interpolate(keys, {name: size_of(clip) for name, clip in clips.items() if name in named})
    BOXES.write(out, made)
    tracks = len({(key.video_id, key.track_id) for key in keys})
    if as_json:
        console.print_json({"out": str(out), "tracks": tracks, "key_boxes": len(keys), "boxes": len(made)})
        return
    line = f"{len(made)} boxes of {tracks} tracks from {len(keys)} key boxes -> {out}"
    console.stdout().print(line, markup=False, soft_wrap=True)


def rebuild(
    plan: Annotated[
        Path | None,
        typer.Argument(help="TOML file with the plan. Default: the benchmark folder's plan.toml."),
    ] = None,
    sources: SourcesOption = None,
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; exit 1 when a file is not what the plan makes.")
    ] = False,
    workers: WorkersOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Make a benchmark's clips and boxes again from its raw videos, and compare or replace."""
    from pipeline.data.plan import FILE_NAME, read_plan
    from pipeline.data.rebuild import rebuild as make_again

    path = plan or here().root / FILE_NAME
    clips = len(read_plan(path).clips)
    with console.progress() as bar:
        task = bar.add_task("rebuild", total=clips)
        executor = executor_for(workers, clips)
        checks = make_again(path, sources, executor, lambda: bar.update(task, advance=1), replace=not check)
    good = all(one.is_good for one in checks)
    if as_json:
        console.print_json(
            {"plan": str(path), "good": good, "replaced": not check, "files": [asdict(one) for one in checks]}
        )
    else:
        for one in checks:
            note = f" ({one.note})" if one.note else ""
            console.stdout().print(f"{one.file}: {one.verdict}{note}", markup=False, soft_wrap=True)
        end = "nothing was changed" if check else "what was not the same bytes was replaced"
        console.stdout().print(f"{len(checks)} files compared; {end}", markup=False, soft_wrap=True)
    if check and not good:
        raise typer.Exit(1)
