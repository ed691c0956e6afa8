"""The command line `coooler`: the pipeline's commands and those that score, submit and build."""

import typer

from pipeline.cli import app, main
from sitegen.cli_board import build, submit, verify, withdraw
from sitegen.cli_data import data
from sitegen.cli_export import export
from sitegen.cli_files import check, compare, score
from sitegen.cli_site import demo, init, serve, votes_import

__all__ = ["app", "main"]

for command in (check, score, compare, submit, withdraw, build, verify, serve, init, demo):
    app.command()(command)

votes = typer.Typer(help="Votes of people on pairs of captions: import.", rich_markup_mode=None)
votes.command("import")(votes_import)
app.add_typer(votes, name="votes", no_args_is_help=True)
app.add_typer(data, name="data", no_args_is_help=True)
app.add_typer(export, name="export", no_args_is_help=True)

if __name__ == "__main__":
    main()
