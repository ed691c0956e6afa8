"""What the folder of a submission holds: writing it, and telling whether two hold the same."""

import shutil
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

from pipeline.errors import FaultsError, InputError
from pipeline.files import sha256_file
from pipeline.tables import MATCHES, OUTCOMES, PREDICTIONS, SNIPPETS, STAGES, USAGE
from sitegen import about as about_file
from sitegen.about import About, Sender
from sitegen.readers import ReadPredictions

EXTRAS = {table.name: table for table in (STAGES, SNIPPETS, MATCHES, USAGE, OUTCOMES)}
FILE_NAME = "predictions.parquet"
RECORDING = "recording.zip"


def fill(
    new: Path, read: ReadPredictions, original: Path, extras: Mapping[str, Path], sender: Sender
) -> About:
    """Write a submission's files into the folder `new`.

    Raises InputError for a wrong name, date or url, and when `original` is no longer what was read.
    """
    PREDICTIONS.write(new / FILE_NAME, read.predictions)
    about = about_file.validated(
        {
            **asdict(sender),
            "source_format": read.source_format,
            "ending": read.ending,
            "original_sha256": read.sha256,
            "predictions_sha256": sha256_file(new / FILE_NAME),
            "config_sha256": read.config_sha256,
        },
        "submission",
    )
    shutil.copyfile(original, new / about.original)
    if sha256_file(new / about.original) != about.original_sha256:
        raise InputError(f"{original} changed after it was read; submit it again.")
    for table, path in extras.items():
        shutil.copyfile(path, new / f"{table}.parquet")
    about_file.write(new, about)
    return about


def as_one_file(read: ReadPredictions, folder: Path) -> tuple[Path, ReadPredictions]:
    """What shards hold as the one file that is stored, written into `folder`."""
    path = folder / FILE_NAME
    PREDICTIONS.write(path, read.predictions)
    return path, replace(read, sha256=sha256_file(path))


def same(target: Path, new: Path, current: About, about: About) -> bool:
    """Whether two folders hold the same submission; its date is that of the first time."""
    ignored = {"date", "predictions_sha256"}  # the bytes of equal rows differ between pyarrow versions
    if current.model_dump(exclude=ignored) != about.model_dump(exclude=ignored):
        return False
    files = sorted(path.name for path in new.iterdir())
    if files != sorted(path.name for path in target.iterdir()):
        return False
    try:
        if PREDICTIONS.read(target / FILE_NAME) != PREDICTIONS.read(new / FILE_NAME):
            return False
    except FaultsError:
        return False
    optional = [*(f"{table}.parquet" for table in EXTRAS), RECORDING]
    extras = [name for name in optional if name in files]
    return all(sha256_file(target / extra) == sha256_file(new / extra) for extra in extras)
