"""What a user names as predictions: a file, shards, or the folder of a run with all that it noted."""

from dataclasses import replace
from pathlib import Path

from sitegen.about import Sender
from sitegen.packing import EXTRAS

RUN_FILES = ("predictions.parquet", *(f"{name}.parquet" for name in EXTRAS))
"""The files of a run folder that a submission is made of, the predictions first."""


def predictions_of(file: Path) -> Path:
    """The predictions file of a run folder; any other file, or folder of shards, is meant itself."""
    return file / RUN_FILES[0] if (file / RUN_FILES[0]).is_file() else file


def extras_of(file: Path) -> dict[str, Path]:
    """Table name -> file of what a run noted beside its predictions; nothing for a plain file."""
    if not file.is_dir():
        return {}
    extras = {name: file / f"{name}.parquet" for name in EXTRAS}
    return {name: path for name, path in extras.items() if path.is_file()}


def with_agents(sender: Sender, file: Path) -> Sender:
    """The sender, with the agents that a run folder names, unless the sender named some."""
    if sender.agents or predictions_of(file) == file:
        return sender
    from pipeline.table import metadata

    return replace(sender, agents=metadata(predictions_of(file)).get("agents", ""))
