"""The command `data import-coool`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption

if TYPE_CHECKING:
    from pipeline.data.coool_import import ImportReport

_EXAMPLES = 3


def import_coool(
    annotations: Annotated[
        Path, typer.Argument(help="COOOL's annotations_public.pkl, or the same as .json.")
    ],
    videos: Annotated[
        Path | None, typer.Option(help="Folder of clips. Default: the benchmark folder's, or none.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for boxes.parquet, videos.parquet and the report. Default: the benchmark's."
        ),
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace boxes that are there already.")] = False,
    workers: Annotated[int, typer.Option(min=0, help="Processes that look at clips; 0: one a core.")] = 0,
    as_json: JsonOption = False,
) -> None:
    """Turn COOOL's pickle into the boxes table, safely, and report all that is odd about it."""
    from pipeline.data import coool_import as coool
    from pipeline.execute import default_workers

    boxes, folder = _places(videos, out)
    with console.progress() as bar:
        tasks = {}

        def said(what: str, done: int, of: int) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=of)
            bar.update(tasks[what], completed=done)

        report = coool.import_coool(
            annotations, boxes, folder, replace=replace, workers=workers or default_workers(), said=said
        )
    if as_json:
        console.print_json({"boxes_file": str(boxes), **report.as_dict()})
        return
    for line in _lines(report, boxes):
        console.stdout().print(line, markup=False, soft_wrap=True)


def _places(videos: Path | None, out: Path | None) -> tuple[Path, Path | None]:
    """Where the boxes go, and the folder of clips, or None."""
    from pipeline.benchmark import find_benchmark
    from pipeline.errors import ConfigError
    from pipeline.run import VIDEO_SUFFIXES

    try:
        benchmark = find_benchmark(Path.cwd())
    except ConfigError:
        return (out or Path()) / "boxes.parquet", videos
    boxes = benchmark.boxes if out is None else out / "boxes.parquet"
    if videos is None and benchmark.videos.is_dir():
        # A new benchmark's folder has none yet.
        some = any(path.suffix.lower() in VIDEO_SUFFIXES for path in benchmark.videos.iterdir())
        videos = benchmark.videos if some else None
    return boxes, videos


def _lines(report: "ImportReport", boxes: Path) -> list[str]:
    """The report as text: counts, then each kind of finding with its first examples."""
    from pipeline.data.coool_import import REPORT_NAME
    from pipeline.data.coool_pickle import Oddity

    lines = [
        f"{report.boxes:,} boxes ({report.challenge_boxes:,} of challenge objects) of "
        f"{report.tracks:,} tracks in {report.annotated_frames:,} frames of "
        f"{report.annotated_videos:,} videos -> {boxes}"
    ]
    if report.missing_videos is None:
        lines.append(
            "no folder of clips (--videos): sizes of frames and numbers of frames could not be checked"
        )
    for what, ids in (
        ("annotated videos without a clip", report.missing_videos),
        ("clips without annotations", report.videos_without_annotations),
        ("clips that cannot be read", list(report.unreadable or ())),
    ):
        if ids:
            lines.append(f"{len(ids):,} {what}: {_some(ids)}")
    for oddity in Oddity:
        examples = [
            f"{finding.video_id}"
            + (f" frame {finding.frame_index}" if finding.frame_index is not None else "")
            + (f" track {finding.track_id}" if finding.track_id is not None else "")
            + f" ({finding.detail})"
            for finding in report.findings
            if finding.oddity is oddity
        ]
        if examples:
            lines.append(f"{report.counts[oddity]:,} x {oddity}: {_some(examples, report.counts[oddity])}")
    lines.append(f"all of it: {boxes.parent / REPORT_NAME}")
    return lines


def _some(items: list[str], count: int = 0) -> str:
    more = max(count, len(items)) - _EXAMPLES
    return ", ".join(items[:_EXAMPLES]) + (f", and {more:,} more" if more > 0 else "")
