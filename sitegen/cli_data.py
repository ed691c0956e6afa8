"""The commands of `coooler data`: from raw clips and annotations to a benchmark."""

import typer

from sitegen.cli_data_annotate import agreement, annotate
from sitegen.cli_data_check import check
from sitegen.cli_data_frames import frames, overlay
from sitegen.cli_data_import import import_coool
from sitegen.cli_data_propose import propose
from sitegen.cli_data_rebuild import boxes, cut, rebuild
from sitegen.cli_data_restore import restore
from sitegen.cli_data_split import card, split

data = typer.Typer(help="Tools for the data of a benchmark.", rich_markup_mode=None)

data.command("import-coool")(import_coool)
for command in (
    cut,
    boxes,
    restore,
    propose,
    annotate,
    agreement,
    frames,
    overlay,
    check,
    split,
    card,
    rebuild,
):
    data.command()(command)
