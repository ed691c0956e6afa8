"""`coooler data check`: what one wants to know before a benchmark is published."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import TruthOption, here

if TYPE_CHECKING:
    from sitegen.data_findings import CheckInput, Finding

VideosOption = Annotated[Path | None, typer.Option(help="Folder of clips. Default: the benchmark folder's.")]
BoxesOption = Annotated[Path | None, typer.Option(help="Table of boxes. Default: the benchmark folder's.")]


def check(
    truth: TruthOption = None,
    videos: VideosOption = None,
    boxes: BoxesOption = None,
    as_json: JsonOption = False,
    quick: Annotated[
        bool, typer.Option("--quick", "--no-pictures", help="Decode nothing: no hashes, no near-copies.")
    ] = False,
    models: Annotated[
        bool, typer.Option("--models", help="Also look for near-identical and verbless descriptions.")
    ] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit 1 on warnings too.")] = False,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
) -> None:
    """Check a benchmark's clips, boxes and truth: coverage, copies, captions, balance, leaks."""
    given, made, findings = _checked(truth, videos, boxes, quick, models, workers)
    if as_json:
        console.print_json(made)
    else:
        _print(given, made, findings)
    counts = made["counts"]
    if counts["error"] or (strict and counts["warning"]):
        raise typer.Exit(1)


def _checked(
    truth: Path | None, videos: Path | None, boxes: Path | None, quick: bool, models: bool, workers: int
) -> "tuple[CheckInput, dict[str, Any], list[Finding]]":
    from pipeline.data.clip_facts import CACHE
    from pipeline.data.clip_hash import near_copies
    from pipeline.execute import default_workers
    from sitegen import data_check_run as run
    from sitegen.data_check import check_data
    from sitegen.data_findings import CheckInput
    from sitegen.readers import read_truth

    benchmark = None if truth and videos else here()
    truth_path = truth or (benchmark.truth if benchmark else Path())
    folder = videos or (benchmark.videos if benchmark else Path())
    boxes_path = boxes or (benchmark.boxes if benchmark else Path())
    rows = read_truth(truth_path)
    facts = run.read_boxes(boxes_path, boxes is not None)
    cache = benchmark.root / CACHE if benchmark and not videos else None
    with console.progress() as bar:
        line = bar.add_task("Looking at clips", total=None)
        clips = run.read_clips(
            folder,
            videos is not None,
            cache=cache,
            decode=not quick,
            workers=workers or default_workers(),
            tell=lambda done, total: bar.update(line, completed=done, total=total),
        )
    hashes = {clip.video_id: clip.hashes for clip in clips or () if clip.hashes}
    near: Sequence[Any] = () if quick else near_copies(hashes)
    said: Sequence[Any] = ()
    plain: Sequence[Any] = ()
    if models:
        from pipeline.minilm import open_embedder

        said, plain = run.alike(rows, open_embedder()), run.verbless(rows)
    given = CheckInput(rows, facts, clips, near, said, plain)
    findings = check_data(given)
    inputs = run.inputs_of(rows, boxes_path, {clip.video_id: clip.sha256 for clip in clips or ()})
    made = run.report(given, findings, inputs, not quick)
    if benchmark and not (truth or videos or boxes):
        run.store(benchmark.root, made)
    return given, made, findings


def _print(given: "CheckInput", made: dict[str, Any], findings: "Sequence[Finding]") -> None:
    """The figures on a few lines, then the findings, the gravest first."""
    from rich.table import Table
    from rich.text import Text

    from sitegen.data_findings import some
    from sitegen.words import visible

    output = console.stdout()
    for line in _figures(made["figures"]):
        output.print(line, markup=False)
    if not findings:
        output.print("\nnothing found", markup=False)
        return
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 1, 0))
    table.add_column("", no_wrap=True)
    table.add_column("found", no_wrap=False, max_width=22)
    table.add_column("what, and how to mend it", overflow="fold")
    styles = {"error": "bold red", "warning": "yellow", "note": "dim"}
    for one in findings:
        told = not one.where or one.where[0] in one.message
        where = "" if told else f" ({some([visible(name) for name in one.where])})"
        text = Text(f"{visible(one.message)}{where}\n").append(visible(one.mend), style="dim")
        table.add_row(Text(one.severity, style=styles[one.severity]), one.kind, text)
    output.print()
    output.print(table)
    counts = made["counts"]
    said = (f"{counts[kind]} {kind}{'s' if counts[kind] != 1 else ''}" for kind in counts)
    output.print(", ".join(said), markup=False)


def _figures(figures: dict[str, Any]) -> list[str]:
    from sitegen.numerals import percent
    from sitegen.words import shorten, visible

    truth, clips = figures["truth"], figures["clips"]
    text, labels = truth["text"], truth["labels"]
    lines = [
        f"videos    {truth['videos']:,} in the truth, {truth['no_hazard_videos']:,} without a hazard, "
        f"{truth['several_hazards']:,} with several",
        f"hazards   {truth['hazards']:,}; {truth['with_track']:,} with a track, "
        f"{truth['with_frames']:,} with frames",
        f"captions  {text['mean_words']:.1f} words on average, median {text['median_words']:g}; "
        f"{text['vocabulary']:,} distinct words in {text['tokens']:,} "
        f"(ratio {text['type_token_ratio']:.2f})",
        f"labels    {len(labels['counts']):,}, entropy {labels['entropy_bits']:.2f} bits "
        f"({percent(labels['evenness'])} of even): "
        + ", ".join(f"{shorten(visible(name), 40)} {count}" for name, count in labels["counts"][:6])
        + (", …" if len(labels["counts"]) > 6 else ""),
    ]
    if clips:
        kinds = ", ".join(f"{name} ({count})" for name, count in [*clips["sizes"][:2], *clips["rates"][:2]])
        lines.append(
            f"clips     {clips['clips']:,}, {clips['seconds']:.0f} s, {clips['frames']:,} frames, "
            f"{clips['bytes'] / 1e6:.1f} MB; {kinds}"
        )
    if figures["videos_with_boxes"] is not None:
        share = figures["annotated_share"]
        covered = "" if share is None else f"; {percent(share)} of all frames have a box"
        lines.append(f"boxes     in {figures['videos_with_boxes']:,} of {truth['videos']:,} videos{covered}")
    return lines
