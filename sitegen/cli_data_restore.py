"""`coooler data restore`: clips without watermark, noise and blur."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import here

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.data.restore_all import RestoreOutcome
    from pipeline.data.restore_record import RestoreJob


def restore(
    videos: Annotated[
        Path | None, typer.Option(help="Folder of clips. Default: the benchmark folder's.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the restored clips. Default: beside, -restored.")
    ] = None,
    denoise_model: Annotated[
        Path | None, typer.Option(help="ONNX denoiser, as NAFNet. Default: OpenCV non-local means.")
    ] = None,
    deblur_model: Annotated[
        Path | None, typer.Option(help="ONNX deblurrer, as NAFNet. Default: an unsharp mask.")
    ] = None,
    steps: Annotated[
        str, typer.Option(help="What is done, always in this order.")
    ] = "watermark,denoise,deblur",
    watermark: Annotated[str, typer.Option(help="auto: look for logos; none: only given boxes.")] = "auto",
    watermark_boxes: Annotated[
        Path | None, typer.Option(help="CSV (video_id,x1_px,y1_px,x2_px,y2_px) of watermarks that are known.")
    ] = None,
    only: Annotated[list[str] | None, typer.Option(help="Just this video; may be given again.")] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    crf: Annotated[
        int, typer.Option(min=0, max=51, help="Quality of the H.264, lower is better and larger.")
    ] = 18,
    preset: Annotated[str, typer.Option(help="libx264's preset, from ultrafast to veryslow.")] = "medium",
    as_json: JsonOption = False,
) -> None:
    """Remove watermarks, noise and blur from clips. Run it again to go on where it stopped."""
    from pipeline.data.encode import PRESETS
    from pipeline.data.restore import STEPS, RestoreSettings
    from pipeline.data.restore_boxes import read_watermark_boxes
    from pipeline.data.restore_record import RestoreJob
    from pipeline.errors import InputError
    from pipeline.places import Place
    from pipeline.run import find_videos

    wanted = [step.strip() for step in steps.split(",") if step.strip()]
    if not wanted or not set(wanted) <= set(STEPS):
        raise typer.BadParameter(f"--steps: found {steps!r}; expected some of {','.join(STEPS)}.")
    if watermark not in ("auto", "none"):
        raise typer.BadParameter(f"--watermark: found {watermark!r}; expected auto or none.")
    if preset not in PRESETS:
        raise typer.BadParameter(f"--preset: found {preset!r}; expected one of {', '.join(PRESETS)}.")
    folder = videos or here().videos
    clips = [Path(place.where) for place in find_videos(Place(str(folder)))]
    target = out or folder.resolve().with_name(f"{folder.resolve().name}-restored")
    if target.resolve() == folder.resolve():
        raise InputError(f"{target}: found the folder of the clips; expected another one (--out).")
    ids = [clip.stem for clip in clips]
    if unknown := sorted(set(only or ()) - set(ids)):
        raise InputError(f"found no clip for {', '.join(unknown)}; expected ids of the videos (--only).")
    boxes = read_watermark_boxes(watermark_boxes, ids) if watermark_boxes else {}
    if watermark == "none" and not boxes:
        wanted = [step for step in wanted if step != "watermark"]
    settings = RestoreSettings(
        tuple(step for step in STEPS if step in wanted),
        denoise_model if "denoise" in wanted else None,
        deblur_model if "deblur" in wanted else None,
        crf,
        preset,
    )
    jobs = [
        RestoreJob(clip, target, settings, boxes.get(clip.stem, None if watermark == "auto" else ()))
        for clip in clips
        if not only or clip.stem in only
    ]
    _report(_run(jobs, workers), target, as_json)


def _run(jobs: "list[RestoreJob]", workers: int) -> "list[RestoreOutcome]":
    """Restore with a progress bar of frames, and each odd clip said."""
    from pipeline.data.restore_all import RestoreOutcome, restore_all
    from pipeline.execute import ProcessExecutor, SerialExecutor, default_workers

    count = max(1, min(workers or default_workers(), len(jobs)))
    with console.progress() as bar:
        task = bar.add_task("frames", total=None)

        def done(outcome: RestoreOutcome) -> None:
            if outcome.error:
                bar.console.print(f"failed: {outcome.video_id}: {outcome.error}", markup=False)
            for note in outcome.notes:
                bar.console.print(f"note: {outcome.video_id}: {note}", markup=False)

        return restore_all(
            jobs,
            ProcessExecutor(count) if count > 1 else SerialExecutor(),
            done=done,
            frames_done=lambda finished, total: bar.update(task, completed=finished, total=total),
        )


def _report(outcomes: "Sequence[RestoreOutcome]", out: Path, as_json: bool) -> None:
    """Say what was done; exit 1 when a clip failed."""
    from dataclasses import asdict

    failed = [outcome for outcome in outcomes if outcome.error]
    if as_json:
        console.print_json({"out": str(out), "videos": [asdict(outcome) for outcome in outcomes]})
    else:
        output = console.stdout()
        methods = dict.fromkeys(method for outcome in outcomes for method in outcome.methods)
        marked = sum(bool(outcome.watermarks) for outcome in outcomes)
        reused = sum(outcome.reused for outcome in outcomes)
        lines = [
            f"{len(outcomes) - len(failed)} clips restored ({reused} from before), {len(failed)} failed, "
            f"watermarks on {marked} -> {out}",
            *(f"  {method}" for method in methods),
        ]
        output.print("\n".join(lines), markup=False, soft_wrap=True)
    if failed:
        raise typer.Exit(1)
