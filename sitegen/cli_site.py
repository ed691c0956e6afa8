"""Commands that show a site, set one up, or take votes: serve, init, demo, votes import."""

from pathlib import Path
from typing import Annotated

import typer

from pipeline import console
from pipeline.cli import JsonOption
from sitegen.cli_common import OutOption, here, print_board


def serve(
    site: Annotated[Path, typer.Argument(help="Folder of the built site.")] = Path("site"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free one.")] = 8000,
    accept: Annotated[
        bool, typer.Option("--accept", help="Take uploads too: check, score, queue, add (extra `server`).")
    ] = False,
    host: Annotated[str, typer.Option(help="Address to listen on, with --accept.")] = "127.0.0.1",
    token_env: Annotated[
        str, typer.Option(help="Environment variable with the token that uploads must show; none: no token.")
    ] = "",
    max_mb: Annotated[int, typer.Option(min=1, max=512, help="Largest upload, in MB.")] = 64,
    per_minute: Annotated[int, typer.Option(min=1, help="Uploads a minute from one address.")] = 30,
    trust_proxy: Annotated[
        bool, typer.Option("--trust-proxy", help="Believe X-Forwarded-For, behind a proxy of your own.")
    ] = False,
) -> None:
    """Show a built site on http://127.0.0.1:PORT/ until Ctrl-C; with --accept, take submissions."""
    if accept:
        from sitegen.intake_server import accept as run_intake

        run_intake(
            here(),
            site,
            host=host,
            port=port,
            token_env=token_env,
            max_mb=max_mb,
            per_minute=per_minute,
            trust_proxy=trust_proxy,
        )
        return
    from sitegen.serve import serve as run_server

    run_server(site, port)


def init(
    folder: Annotated[Path, typer.Argument(help="New folder for the benchmark.")],
    name: Annotated[str, typer.Option(help="Name of the benchmark.")] = "A COOOLER benchmark",
) -> None:
    """Set up a benchmark folder, with workflows that check and score submissions by pull request."""
    from sitegen.scaffold import write_benchmark

    for path in write_benchmark(folder, name):
        console.stdout().print(str(path), markup=False, soft_wrap=True)


def votes_import(
    files: Annotated[list[Path], typer.Argument(help="Files that the voting page exported.")],
    as_json: JsonOption = False,
) -> None:
    """Check files of votes and add them to the benchmark, all or none."""
    from dataclasses import asdict

    from sitegen.votes import import_votes

    report = import_votes(here(), files)
    if as_json:
        names = {
            "stored": [str(path) for path in report.stored],
            "known": [str(path) for path in report.known],
        }
        console.print_json({**asdict(report), **names})
        return
    console.stdout().print(
        f"{len(report.stored)} new files, {len(report.known)} already there; {report.votes} votes: "
        f"{report.counted} count, {report.replaced} followed by a later vote, {report.apart} on captions "
        "that have changed",
        markup=False,
        soft_wrap=True,
    )


def demo(
    out: OutOption = None,
    work: Annotated[
        Path | None,
        typer.Option(help="Where to copy the demo's folder. Default: in place, or coooler-demo/."),
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
) -> None:
    """Run the pipeline on the demo's real clips, score it, build the site."""
    from sitegen.demo import run_demo

    folder = out or Path("site")
    print_board([standing.evaluation for standing in run_demo(folder, work, workers)])
    page = folder / "index.html"
    console.stdout().print(f"open {page} in a browser, or: coooler serve {folder}", markup=False)
