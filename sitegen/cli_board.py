"""Commands that change or rebuild the board: submit, withdraw, build, verify."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import (
    CaptionOption,
    DateOption,
    FileArgument,
    FormatOption,
    Given,
    MapOption,
    OutOption,
    given,
    here,
    options_of,
    print_board,
    print_lines,
    read_file,
    say_warnings,
    today,
)

if TYPE_CHECKING:
    from pipeline.benchmark import Benchmark
    from sitegen.about import Sender
    from sitegen.readers import ReadPredictions


def submit(
    context: typer.Context,
    file: FileArgument,
    name: Annotated[str, typer.Option(help="Name on the leaderboard, at most 80 characters.")] = "",
    authors: Annotated[str, typer.Option(help="Who made it.")] = "",
    url: Annotated[str, typer.Option(help="Paper, code or project page (http or https).")] = "",
    agents: Annotated[str, typer.Option(help="Which models produced it, in one line.")] = "",
    licence: Annotated[str, typer.Option(help="Licence of the predictions.")] = "",
    notes: Annotated[str, typer.Option(help="Anything a reader should know.")] = "",
    date: Annotated[str, typer.Option(help="Date of the system as YYYY-MM-DD. Default: today.")] = "",
    about: Annotated[
        Path | None, typer.Option(help="TOML file with name, authors, url, agents, licence, notes, date.")
    ] = None,
    source_format: FormatOption = "",
    caption_column: CaptionOption = "",
    video_map: MapOption = None,
    recording: Annotated[
        Path | None, typer.Option(help="Zip of its models' answers, as `recording export` writes it.")
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace the submission of this name; the old one is kept.")
    ] = False,
    why: Annotated[str, typer.Option(help="The reason, for the ledger.")] = "",
    rehearse: Annotated[
        bool,
        typer.Option("--rehearse", help="Add nothing: the full report, preview pages, the rank to expect."),
    ] = False,
    preview: Annotated[Path, typer.Option(help="Folder of a rehearsal's pages.")] = Path("rehearsal"),
    markdown: Annotated[
        Path | None, typer.Option(help="Write the report there as Markdown too, faults included.")
    ] = None,
    out: OutOption = None,
    build_site: Annotated[
        bool, typer.Option("--build/--no-build", help="Rebuild what changed of the site, where there is one.")
    ] = True,
    as_json: JsonOption = False,
) -> None:
    """Check a predictions file, add it to the benchmark folder, print its scores, rebuild the site."""
    from tempfile import TemporaryDirectory

    from sitegen.board import build_board, submit_read
    from sitegen.packing import as_one_file
    from sitegen.rehearsal import report
    from sitegen.run_folder import RUN_FILES, extras_of, with_agents

    benchmark = here()
    said = {
        "name": name,
        "authors": authors,
        "url": url,
        "agents": agents,
        "licence": licence,
        "notes": notes,
    }
    sender = _sender({**said, "date": date}, about)
    options = options_of(source_format, caption_column, video_map)
    named = given(file, context, RUN_FILES)
    path, read = named.path, _read(benchmark, named, options, markdown, sender.name)
    if path.is_dir():
        path, read = as_one_file(read, Path(context.with_resource(TemporaryDirectory())))
    sender = with_agents(sender, named.home)
    if rehearse:
        _rehearse(benchmark, path, read, sender, preview, markdown, as_json)
        return
    standing = submit_read(
        benchmark,
        read,
        path,
        sender,
        extras=extras_of(named.home),
        recording=recording,
        replace=replace,
        why=why,
        today=today(),
    )
    say_warnings(read.warnings)
    site = out or Path("site")
    board = [standing]
    if build_site and (site / "index.html").is_file():
        with console.progress() as bar:
            board, _ = build_board(benchmark, site, bar, today=today())
    if as_json:
        place = next(place for place, one in enumerate(board) if one.stored.slug == standing.stored.slug)
        told = report(board, place)
        folder = str(standing.stored.folder)
        card = standing.evaluation.card
        console.print_json({"slug": standing.stored.slug, "folder": folder, "besm": card.besm, **told})
        return
    console.stdout().print(f"stored as {standing.stored.folder}", markup=False, soft_wrap=True)
    print_board([one.evaluation for one in board])


def _sender(given: dict[str, str], about: Path | None) -> "Sender":
    """Who sends what: the options, and for those that are empty the file."""
    from pipeline.errors import InputError
    from sitegen.about import Sender, read_sender

    said = {key: value for key, value in given.items() if value}
    if about:
        written = read_sender(about)
        said = {**{key: getattr(written, key) for key in Sender.__slots__}, **said}
    if not said.get("name"):
        raise InputError("found no name; expected one: --name NAME, or `name` in the file of --about.")
    return Sender(**{**said, "date": said.get("date") or today()})


def _read(
    benchmark: "Benchmark", file: Given, options: Any, markdown: Path | None, name: str
) -> "ReadPredictions":
    """The file, read; its faults go to the Markdown report too."""
    from pipeline.errors import FaultsError
    from pipeline.files import write_text
    from sitegen.board import known_videos
    from sitegen.rehearsal import faults_markdown

    try:
        return read_file(file, known_videos(benchmark), options)
    except FaultsError as error:
        if markdown:
            write_text(markdown, faults_markdown(name, error.faults))
        raise


def _rehearse(
    benchmark: "Benchmark",
    path: Path,
    read: "ReadPredictions",
    sender: "Sender",
    preview: Path,
    markdown: Path | None,
    as_json: bool,
) -> None:
    from pipeline.files import linked_copy, write_text
    from pipeline.minilm import open_embedder
    from sitegen.board import rehearse
    from sitegen.build import build_site
    from sitegen.rehearsal import markdown as as_markdown
    from sitegen.rehearsal import rank_words, report

    board = rehearse(benchmark, read, path, sender)
    place = next(place for place, standing in enumerate(board) if standing.rehearsed)
    told = report(board, place)
    built = Path("site")
    if not preview.exists() and (built / "index.html").is_file():
        linked_copy(built, preview)  # its pictures need not be made again
    with console.progress() as bar:
        build_site(benchmark, preview, board, bar, embedder=open_embedder())
    page = preview / "submissions" / f"{board[place].stored.slug}.html"
    if markdown:
        write_text(markdown, as_markdown(told))
    if as_json:
        console.print_json({**told, "preview": str(page)})
        return
    say_warnings(read.warnings)
    print_board([standing.evaluation for standing in board])
    output = console.stdout()
    output.print(f"{sender.name}: {rank_words(told)}", markup=False, soft_wrap=True)
    for probe in board[place].probes:
        if probe.flagged:
            output.print(f"probe: {probe.sentence}", markup=False, soft_wrap=True)
    output.print(f"nothing was added; preview: {page}", markup=False, soft_wrap=True)


def withdraw(
    name: Annotated[str, typer.Argument(help="Name or slug of the submission.")],
    why: Annotated[str, typer.Option(help="The reason; it stays in the ledger.")],
    date: DateOption = "",
) -> None:
    """Take a submission off the leaderboard; the ledger keeps the fact and the reason."""
    from sitegen.submissions import withdraw as take_off

    take_off(here().submissions, name, why, date or today())
    console.stdout().print(f"withdrawn: {name}", markup=False)


def build(
    out: OutOption = None,
    as_of: Annotated[str, typer.Option("--as-of", help="The board of this day, YYYY-MM-DD.")] = "",
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit 1 when the site breaks a budget or has a dead link.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Score all submissions and build the site; only what changed is written."""
    from datetime import date

    from pipeline.errors import InputError
    from sitegen.board import rebuild_board
    from sitegen.strict import strict_faults

    try:
        day = date.fromisoformat(as_of).isoformat() if as_of else ""
    except ValueError as error:
        raise typer.BadParameter(f"found {as_of!r}; expected a date as YYYY-MM-DD") from error
    folder = out or Path("site")
    with console.progress() as bar:
        built = rebuild_board(here(), folder, bar, as_of=day, today=today())
    report = built.report
    faults = strict_faults(folder) if strict else []
    if as_json:
        console.print_json(
            {
                "site": str(folder),
                "as_of": day,
                "written": report.written,
                "unchanged": report.unchanged,
                "removed": report.removed,
                "bytes": report.bytes,
                "tree_sha256": report.tree_sha256,
                "strict_faults": faults,
            }
        )
        if faults:
            raise InputError(f"{len(faults)} faults in the site.")
        return
    print_lines(built.board)
    for line in built.rescored:
        console.stderr().print(f"rescored {line}", markup=False)
    console.stdout().print(
        f"{folder / 'index.html'}  ({report.written} files written, {report.unchanged} unchanged, "
        f"{report.removed} removed; tree {report.tree_sha256[:12]})",
        markup=False,
        soft_wrap=True,
    )
    if faults:
        raise InputError(
            "\n".join([f"{len(faults)} faults in the site:", *(f"  {fault}" for fault in faults)])
        )


def verify(
    site: Annotated[
        Path | None, typer.Option(help="Folder of the site. Default: site/ here, if built.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Work everything out again: the ledger's chain, the stored content, the scores, the site."""
    from dataclasses import asdict

    from pipeline.errors import InputError
    from sitegen.verify import verify as verify_all

    benchmark = here()
    if site and not (site / "index.html").is_file():
        raise InputError(f"{site}: found no index.html; expected a built site.")
    folder = site or (Path("site") if Path("site/index.html").is_file() else None)
    checks = []
    with console.progress() as bar:
        for found in verify_all(benchmark, folder, bar):
            checks.append(found)
            if not as_json:
                verdict = "good" if not found.faults else f"{len(found.faults)} faults"
                console.stdout().print(
                    f"{found.name}: {verdict} ({found.looked_at})", markup=False, soft_wrap=True
                )
                for fault in found.faults:
                    console.stdout().print(f"  {fault}", markup=False, soft_wrap=True)
    if as_json:
        console.print_json({"good": not any(c.faults for c in checks), "checks": [asdict(c) for c in checks]})
    if any(found.faults for found in checks):
        raise InputError("The board does not verify; see the faults above.")
