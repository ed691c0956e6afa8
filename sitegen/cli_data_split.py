"""`coooler data split` and `coooler data card`."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import TruthOption, here

if TYPE_CHECKING:
    from pipeline.benchmark import Benchmark
    from pipeline.records import TruthHazard
    from sitegen.split import Split


def split(
    parts: Annotated[str, typer.Option(help="Parts and their shares, as NAME=SHARE,NAME=SHARE.")],
    truth: TruthOption = None,
    seed: Annotated[int, typer.Option(help="Another seed, another split.")] = 0,
    by: Annotated[str, typer.Option(help="Keep even in all parts: label, kind, size or none.")] = "label",
    group_by: Annotated[
        str, typer.Option(help="Pattern; videos whose ids match with one text go to one part.")
    ] = "",
    together: Annotated[
        Path | None, typer.Option(help="CSV (video_id,group): videos of one group go to one part.")
    ] = None,
    out: Annotated[Path, typer.Option(help="CSV to write: video_id, part.")] = Path("splits.csv"),
    truths: Annotated[
        Path | None, typer.Option(help="Folder for a truth file a part (PART.parquet).")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Divide the videos into parts, stratified and seeded; near-copies stay in one part."""
    from pipeline.files import write_text
    from pipeline.tables import BOXES, TRUTH
    from sitegen import split as splitting
    from sitegen.readers import read_truth

    if by not in splitting.BY:
        raise typer.BadParameter(f"found {by!r}; expected one of {', '.join(splitting.BY)}")
    shares = splitting.read_parts(parts)
    benchmark = None if truth else here()
    rows = read_truth(truth or (benchmark.truth if benchmark else Path()))
    boxes = benchmark.boxes if benchmark else Path("boxes.parquet")
    found = BOXES.read(boxes) if by == "size" and boxes.is_file() else []
    stratum_of = splitting.strata(rows, by, len(shares), found)
    groups = [*_named(together), *_matching(group_by, stratum_of), *(_copies(benchmark) if benchmark else ())]
    made = splitting.split(stratum_of, shares, seed, groups)
    lines = [f"{name},{part}\n" for name, part in made.part_of.items()]
    write_text(out, "".join(["video_id,part\n", *lines]))
    if truths:
        for part in shares:
            kept: list[TruthHazard] = [row for row in rows if made.part_of[row.video_id] == part.name]
            TRUTH.write(truths / f"{part.name}.parquet", kept)
    if as_json:
        table = [{"stratum": name, **_counts(made, counts)} for name, counts in made.table()]
        console.print_json({"seed": seed, "by": by, "file": str(out), "strata": table})
    else:
        _print(made, out)


def _counts(made: "Split", counts: Sequence[int]) -> dict[str, int]:
    return {part.name: count for part, count in zip(made.parts, counts, strict=True)}


def _print(made: "Split", out: Path) -> None:
    from rich.table import Table
    from rich.text import Text

    from sitegen.words import visible

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("stratum", overflow="fold")
    for part in made.parts:
        table.add_column(f"{part.name} ({part.share:.0%})", justify="right")
    rows = made.table()
    for name, counts in rows:
        table.add_row(Text(visible(name)), *map(str, counts))
    sums = [sum(counts[place] for _, counts in rows) for place in range(len(made.parts))]
    table.add_row(Text("together", style="bold"), *map(str, sums))
    output = console.stdout()
    output.print(table)
    output.print(f"{len(made.part_of)} videos -> {out}", markup=False, soft_wrap=True)


def _named(path: Path | None) -> Iterable[Sequence[str]]:
    """The groups of a CSV. Raises InputError when it has not the two columns."""
    import csv

    from pipeline.errors import InputError

    if path is None:
        return []
    try:
        with path.open(encoding="utf-8-sig", newline="") as source:
            rows = list(csv.DictReader(source))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not readable as CSV ({error}).") from error
    if rows and not {"video_id", "group"} <= rows[0].keys():
        columns = ", ".join(map(str, rows[0]))
        raise InputError(f"{path}: found the columns {columns}; expected video_id and group.")
    groups: dict[str, list[str]] = {}
    for row in rows:
        groups.setdefault(row["group"] or "", []).append(row["video_id"] or "")
    return [names for group, names in sorted(groups.items()) if group]


def _matching(pattern: str, ids: Iterable[str]) -> Iterable[Sequence[str]]:
    """Ids that hold the same text where a pattern matches; its first group counts, if it has one."""
    import re

    if not pattern:
        return []
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise typer.BadParameter(f"--group-by: {error}") from error
    groups: dict[str, list[str]] = {}
    for name in ids:
        if match := compiled.search(name):
            groups.setdefault(match[1] if compiled.groups else match[0], []).append(name)
    return list(groups.values())


def _copies(benchmark: "Benchmark") -> Iterable[Sequence[str]]:
    """Copies and near-copies among the clips, from what the last check kept; none without one."""
    from pipeline.data.clip_facts import CACHE, known_clips
    from pipeline.data.clip_hash import near_copies

    clips = known_clips(benchmark.root / CACHE)
    if not clips:
        said = "clips were not checked for copies: coooler data check"
        console.stderr().print(said, markup=False)
        return []
    same: dict[str, list[str]] = {}
    for clip in clips:
        if not clip.problem:
            same.setdefault(clip.sha256, []).append(clip.video_id)
    pairs = near_copies({clip.video_id: clip.hashes for clip in clips})
    return [*same.values(), *([pair.first, pair.second] for pair in pairs)]


def card(
    out: Annotated[Path | None, typer.Option(help="File to write. Default: DATASET.md here.")] = None,
    licence: Annotated[str, typer.Option(help="Licence of the data, as in a package (cc-by-4.0).")] = "",
    splits: Annotated[Path | None, typer.Option(help="CSV that `data split` wrote.")] = None,
) -> None:
    """Write a dataset card in Markdown; every figure in it is counted."""
    from pipeline.files import write_text
    from sitegen.card import make_card
    from sitegen.card_data import read_card

    path = out or Path("DATASET.md")
    write_text(path, make_card(read_card(here(), licence, splits)))
    console.stdout().print(str(path), markup=False, soft_wrap=True)
