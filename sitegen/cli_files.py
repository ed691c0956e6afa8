"""Commands about a predictions file: check it, score it, compare two."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import (
    CaptionOption,
    FileArgument,
    FormatOption,
    Given,
    MapOption,
    TruthOption,
    given,
    here,
    options_of,
    print_board,
    read_file,
    say_warnings,
    submission_of,
)
from sitegen.cli_score_coool import ClipsOption, CooolOption, DriverTruthOption, score_coool

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.errors import Fault
    from sitegen.readers import ReadOptions

ThresholdOption = Annotated[
    float, typer.Option(min=0, max=1, help="A caption detects a hazard above this similarity, strictly.")
]


def check(
    context: typer.Context,
    file: FileArgument,
    truth: TruthOption = None,
    source_format: FormatOption = "",
    caption_column: CaptionOption = "",
    video_map: MapOption = None,
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Write a corrected copy, FILE.fixed.ENDING, where that is safe."),
    ] = False,
    github: Annotated[
        bool, typer.Option("--github", help="Print every fault as an annotation of a GitHub workflow.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Check a predictions file against the truth: every fault at once."""
    from pipeline.errors import FaultsError
    from pipeline.predictions import Predictions
    from sitegen.readers import read_truth

    options = options_of(source_format, caption_column, video_map)
    hazards = read_truth(truth or here().truth)
    notes: tuple[str, ...] = ()
    named = given(file, context)
    if fix:
        named, notes, options = _fixed(named, hazards, options)
    try:
        read = read_file(named, hazards, options)
    except FaultsError as error:
        if github:
            _annotate(error.faults, (), named.name)
        for note in notes:
            console.stderr().print(f"fixed: {note}", markup=False)
        raise
    videos = len({hazard.video_id for hazard in hazards})
    covered = len(Predictions.of(read.predictions).video_ids)
    if as_json:
        console.print_json(
            {
                "file": named.name,
                "format": read.source_format,
                "sha256": read.sha256,
                "predictions": len(read.predictions),
                "videos_with_predictions": covered,
                "n_videos": videos,
                "warnings": list(read.warnings),
                "fixed": list(notes),
                "faults": [],
            }
        )
        return
    if github:
        _annotate((), read.warnings, named.name)
    else:
        say_warnings(read.warnings)
    for note in notes:
        console.stdout().print(f"fixed: {note}", markup=False)
    console.stdout().print(
        f"{named.name}: good. {len(read.predictions)} predictions for {covered} of {videos} videos "
        f"({read.source_format}).",
        markup=False,
        soft_wrap=True,
    )


def _annotate(faults: "Sequence[Fault]", warnings: "Sequence[str]", file: str) -> None:
    from sitegen.annotations import error_lines, warning_lines

    for line in [*error_lines(faults, file), *warning_lines(file, warnings)]:
        console.stdout().print(line, markup=False, soft_wrap=True)


def _fixed(file: Given, hazards: Any, options: "ReadOptions") -> "tuple[Given, tuple[str, ...], ReadOptions]":
    """A corrected copy, what was done, how to read it; the file itself if nothing was.

    The copy is beside the file, of a URL in the folder that the command runs in.
    """
    from pipeline.files import write_bytes
    from pipeline.places import is_url
    from sitegen.fixes import fixed
    from sitegen.readers import ReadOptions

    made = fixed(file.path, hazards, replace(options, name=file.name))
    if not made.notes:
        console.stderr().print(f"{file.name}: nothing to fix that is safe to fix", markup=False)
        return file, (), options
    name = f"{file.path.name.split('.')[0] or 'predictions'}.fixed.{made.ending}"
    target = Path(name) if is_url(file.name) else file.path.with_name(name)
    write_bytes(target, made.data)
    console.stderr().print(f"wrote {target}", markup=False)
    return Given(target, target, str(target)), made.notes, ReadOptions()


def score(
    context: typer.Context,
    file: FileArgument,
    truth: TruthOption = None,
    threshold: ThresholdOption = 0.80,
    source_format: FormatOption = "",
    caption_column: CaptionOption = "",
    video_map: MapOption = None,
    coool: CooolOption = False,
    driver_truth: DriverTruthOption = None,
    videos: ClipsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Score a predictions file: BESM, SAM, detection rate, hazard recall, with 95 % intervals."""
    if coool:
        score_coool(file, context, truth, driver_truth, videos, video_map, as_json=as_json)
        return
    if driver_truth or videos:
        raise typer.BadParameter("found --driver-truth or --videos; expected --coool with them.")
    from pipeline.minilm import open_embedder
    from sitegen.evaluate import evaluate, truth_sha256
    from sitegen.readers import read_truth

    options = options_of(source_format, caption_column, video_map)
    hazards = read_truth(truth or here().truth)
    named = given(file, context)
    read = read_file(named, hazards, options)
    submission = submission_of(named.path.stem, read)
    evaluation = evaluate(submission, hazards, open_embedder(), threshold, truth_sha256(hazards))
    say_warnings(read.warnings)
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
    print_board([evaluation])


def compare(
    context: typer.Context,
    a: Annotated[
        str, typer.Argument(help="A submission's name or slug, or predictions as `score` takes them.")
    ],
    b: Annotated[str, typer.Argument(help="The other one.")],
    truth: TruthOption = None,
    threshold: ThresholdOption = 0.80,
    as_json: JsonOption = False,
) -> None:
    """Compare two systems on the same videos: differences, paired tests, wins and losses."""
    from dataclasses import asdict

    from rich.table import Table

    from sitegen.compare import compare as compare_two

    one, other = (_evaluation(name, context, truth, threshold) for name in (a, b))
    found = compare_two(one, other)
    if as_json:
        console.print_json({key: asdict(comparison) for key, comparison in found.items()})
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    headings = ("figure", "A", "B", "A - B", "95 %", "p (bootstrap)", "p (randomisation)", "win-loss-tie")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "figure" else "right")
    for key, comparison in found.items():
        interval = comparison.interval
        table.add_row(
            key.replace("_", " "),
            f"{comparison.a:.4f}",
            f"{comparison.b:.4f}",
            f"{comparison.difference:+.4f}",
            f"{interval.low:+.4f} to {interval.high:+.4f}",
            f"{comparison.p_bootstrap:.3f}",
            f"{comparison.p_randomisation:.3f}",
            f"{comparison.wins}-{comparison.losses}-{comparison.ties}",
        )
    output = console.stdout()
    output.print(f"A {one.submission.name}\nB {other.submission.name}", markup=False, soft_wrap=True)
    output.print(table)
    output.print(f"signature {one.card.signature}", markup=False, soft_wrap=True)


def _evaluation(name: str, context: typer.Context, truth: Path | None, threshold: float) -> Any:
    """The scores of a submission of the board, or of a file."""
    from pipeline.errors import InputError
    from pipeline.files import slug
    from pipeline.minilm import open_embedder
    from pipeline.places import is_url
    from sitegen.evaluate import evaluate, truth_sha256
    from sitegen.readers import ReadOptions, read_truth
    from sitegen.submissions import load_all

    hazards = read_truth(truth or here().truth)
    if is_url(name) or Path(name).exists():
        named = given(name, context)
        read = read_file(named, hazards, ReadOptions())
        submission = submission_of(named.path.stem if named.path == named.home else name, read)
    else:
        board = {one.slug: one.submission for one in load_all(here().submissions, hazards)}
        if slug(name) not in board:
            there = ", ".join(board) or "none"
            raise InputError(f"{name}: found no such file and no such submission; there are: {there}.")
        submission = board[slug(name)]
    return evaluate(submission, hazards, open_embedder(), threshold, truth_sha256(hazards))
