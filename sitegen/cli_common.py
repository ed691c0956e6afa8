"""What the commands of scores and boards share: options, reading a file, and the printed board."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console

if TYPE_CHECKING:
    from pipeline.benchmark import Benchmark
    from pipeline.records import TruthHazard
    from pipeline.scores import Evaluation, Submission
    from sitegen.readers import ReadOptions, ReadPredictions
    from sitegen.scoreboard import BoardLine

FileArgument = Annotated[
    str,  # a path would take s3://a for s3:/a
    typer.Argument(
        help="Predictions in any format that `check` knows, a folder of Parquet shards, or a run folder; "
        "a path or any URL that fsspec knows (s3://, https://, ...)."
    ),
]
TruthOption = Annotated[
    Path | None, typer.Option(help="Truth: Parquet, CSV or JSON Lines. Default: the benchmark folder's.")
]
FormatOption = Annotated[
    str,
    typer.Option(
        "--format", help="csv, jsonl, parquet, coool, 2coool, scripts or coco. Default: look into the file."
    ),
]
CaptionOption = Annotated[
    str, typer.Option("--caption-column", help="Column of a 2COOOL file that holds the caption.")
]
MapOption = Annotated[
    Path | None,
    typer.Option("--video-map", help="CSV (file_id,video_id) or JSON object: the file's ids to the truth's."),
]
OutOption = Annotated[Path | None, typer.Option(help="Folder of the site. Default: site/ here.")]
DateOption = Annotated[str, typer.Option(help="Date as YYYY-MM-DD. Default: today.")]


def here() -> "Benchmark":
    """The benchmark folder that the command runs in."""
    from pipeline.benchmark import find_benchmark

    return find_benchmark(Path.cwd())


def today() -> str:
    """Today, ISO 8601."""
    from datetime import date

    return date.today().isoformat()


def options_of(source_format: str, caption_column: str, video_map: Path | None) -> "ReadOptions":
    """The options of reading, the map read."""
    from sitegen.readers import FORMATS, ReadOptions, read_video_map

    if source_format and source_format not in FORMATS:
        raise typer.BadParameter(f"found {source_format!r}; expected one of {', '.join(FORMATS)}")
    return ReadOptions(source_format, caption_column, read_video_map(video_map) if video_map else {})


@dataclass(frozen=True, slots=True)
class Given:
    """Predictions that were named by a path or a URL, where they can be read.

    `home` is what was named, `path` the file or the shards in it, both here or copied here; `name` is
    what messages call `path`.
    """

    home: Path
    path: Path
    name: str


def given(file: str, context: typer.Context, wanted: Sequence[str] = ("predictions.parquet",)) -> Given:
    """What a path or a URL means; the copy of what is behind a URL is kept while the command runs.

    Raises as `fetched`, which says what is `wanted` of a folder.
    """
    from pipeline.places import Place, is_url
    from sitegen.run_folder import predictions_of

    home = Path(file)
    if is_url(file):
        from tempfile import TemporaryDirectory

        from sitegen.fetched import fetched

        home = fetched(file, Path(context.with_resource(TemporaryDirectory())), wanted)
    path = predictions_of(home)
    if not is_url(file):
        return Given(home, path, str(path))
    return Given(home, path, file if path == home else str(Place(file) / path.name))


def read_file(file: Given, truth: "Sequence[TruthHazard]", options: "ReadOptions") -> "ReadPredictions":
    """What a predictions file holds.

    Parquet is read in a process of its own: a damaged file can end the process that reads it.
    """
    from sitegen.readers import read_predictions
    from sitegen.sandbox import read_apart

    options = replace(options, name=file.name)
    apart = file.path.is_dir() or _holds_parquet(file.path)
    return (read_apart if apart else read_predictions)(file.path, truth, options)


def _holds_parquet(path: Path) -> bool:
    """Whether a file may be Parquet, packed or not: only CSV and JSON can be told from their first byte."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as source:
            head = source.read(4)
    except OSError:
        return False
    return head[:4] == b"PAR1" or head[:2] in {b"\x1f\x8b", b"PK"} or head == b"\x28\xb5\x2f\xfd"


def submission_of(name: str, read: "ReadPredictions") -> "Submission":
    """Predictions that nobody sent yet."""
    from pipeline.scores import Submission

    return Submission(name, "", "", "", read.source_format, read.predictions, read.warnings)


def say_warnings(warnings: Sequence[str]) -> None:
    """Each on a line of its own, on standard error."""
    for warning in warnings:
        console.stderr().print(f"warning: {warning}", markup=False)


def print_board(evaluations: "Sequence[Evaluation]") -> None:
    """The scores as a table, best first, with their 95 % intervals and the one signature that they share."""
    from sitegen.scoreboard import board_lines

    print_lines(board_lines(evaluations))


def print_lines(lines: "Sequence[BoardLine]") -> None:
    """The lines of a board as a table, with the one signature that they share."""
    from rich.table import Table

    if not lines:
        console.stdout().print("no submissions yet: coooler submit FILE --name NAME", markup=False)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("rank", "submission", "BESM", "95 %", "SAM", "detection", "hazard recall", "videos"):
        table.add_column(heading, justify="left" if heading == "submission" else "right")
    for line in lines:
        table.add_row(
            f"{line.rank}=" if line.shared else str(line.rank),
            line.name,
            f"{line.besm:.4f}",
            f"{line.low:.4f} to {line.high:.4f}",
            f"{line.sam:.4f}",
            f"{line.detection_rate:.4f}",
            "-" if line.hazard_recall is None else f"{line.hazard_recall:.4f}",
            str(line.n_videos),
        )
    output = console.stdout()
    output.print(table)
    output.print(f"signature {lines[0].signature}", markup=False, soft_wrap=True)
