"""The submissions of a benchmark on disk: a folder each, and the ledger.

    submissions/ledger.jsonl
    submissions/<slug>/submission.toml      who sent it, and the hashes
                       predictions.parquet  what is scored
                       original.<ending>    the file as it came
                       stages.parquet, snippets.parquet, matches.parquet, usage.parquet,
                       outcomes.parquet     what the pipeline noted (optional)
                       recording.zip        every answer behind it (optional)

Scores are never stored here: they are computed again from the predictions.
"""

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pipeline.errors import FaultsError, InputError
from pipeline.files import sha256_file, slug
from pipeline.recording_zip import import_zip
from pipeline.records import TruthHazard
from pipeline.scores import Submission
from pipeline.tables import MATCHES, OUTCOMES, PREDICTIONS, SNIPPETS, STAGES, USAGE
from sitegen import about as about_file
from sitegen import ledger
from sitegen.about import About
from sitegen.checks import visible
from sitegen.readers import ReadPredictions, read_predictions

EXTRAS = {table.name: table for table in (STAGES, SNIPPETS, MATCHES, USAGE, OUTCOMES)}

_PREDICTIONS = "predictions.parquet"
_RECORDING = "recording.zip"


@dataclass(frozen=True, slots=True)
class StoredSubmission:
    """A submission with where it lies; `extras` names the optional tables that came with it."""

    slug: str
    folder: Path
    submission: Submission
    agents: str
    predictions_sha256: str
    original_sha256: str
    config_sha256: str
    extras: tuple[str, ...]

    @property
    def has_stages(self) -> bool:
        """Whether it is known what each stage of the pipeline said."""
        return "stages" in self.extras


def store(
    folder: Path,
    *,
    name: str,
    authors: str,
    url: str,
    date: str,
    agents: str,
    read: ReadPredictions,
    original: Path,
    extras: Mapping[str, Path] | None = None,
    recording: Path | None = None,
    replace: bool = False,
) -> Path:
    """Store a submission under `folder` (`submissions/`) and note it in the ledger; give its folder.

    `original` is the file that `read` came from; `extras` maps table names (`stages`, `snippets`,
    `matches`, `usage`, `outcomes`) to files; `recording` is a zip of the answers of its models, from
    which others can rebuild the predictions. The same content again changes nothing. Raises InputError for
    a wrong name, date or url, for a name that is taken, and for content that differs from what is
    stored under the name unless `replace`; FaultsError for extras that are not such tables.
    """
    extras = dict(extras or {})
    given = {"name": name, "authors": authors, "url": url, "date": date, "agents": agents}
    for table, path in extras.items():
        if table not in EXTRAS:
            raise InputError(f"Extra table '{table}' is unknown; expected one of {', '.join(EXTRAS)}.")
        EXTRAS[table].read(path)
    if recording:
        with tempfile.TemporaryDirectory() as scratch:
            import_zip(recording, Path(scratch))
    with ledger.locked(folder), _building(folder) as new:
        about = _fill(new, read, original, extras, given)
        if recording:
            shutil.copyfile(recording, new / _RECORDING)
        place = slug(about.name)
        target = folder / place
        current = about_file.read(target) if target.exists() else None
        if current and current.name != about.name:
            raise InputError(
                f"The name '{about.name}' shortens to '{place}', as does '{current.name}', which is there "
                "already. Choose another name."
            )
        is_withdrawn = place in ledger.withdrawn(ledger.read(folder))
        if current and not is_withdrawn:
            if _same(target, new, current, about):
                return target
            if not replace:
                raise InputError(
                    f"There is a submission '{about.name}' already, with other content. Choose another name, "
                    "or replace it."
                )
        event: Literal["add", "replace"] = "replace" if current and not is_withdrawn else "add"
        entry = ledger.Entry(
            event=event,
            slug=place,
            name=about.name,
            date=about.date,
            predictions_sha256=about.predictions_sha256,
        )
        with _swapped(new, target):
            ledger.append(folder, entry)
    return target


def withdraw(folder: Path, slug_or_name: str, why: str, date: str) -> None:
    """Note in the ledger that a submission is withdrawn; its folder stays, but is no longer loaded.

    Raises InputError when there is no such submission, it is withdrawn already, or `why` is empty.
    """
    place = slug(slug_or_name)
    with ledger.locked(folder):
        entries = ledger.read(folder)
        if not place or not (folder / place / about_file.FILE_NAME).is_file():
            names = sorted(path.parent.name for path in folder.glob(f"*/{about_file.FILE_NAME}"))
            there = f"Those there are: {', '.join(names)}." if names else "There is none at all."
            raise InputError(f"There is no submission '{visible(slug_or_name)}'. {there}")
        if place in ledger.withdrawn(entries):
            raise InputError(f"Submission '{place}' is withdrawn already.")
        if not why.strip():
            raise InputError("A withdrawal needs a reason.")
        about = about_file.read(folder / place)
        entry = ledger.Entry(
            event="withdraw",
            slug=place,
            name=about.name,
            date=about_file.validated({**about.model_dump(), "date": date}, "withdrawal").date,
            predictions_sha256=about.predictions_sha256,
            reason=visible(why.strip(), 500),
        )
        ledger.append(folder, entry)


def load_all(folder: Path, truth: Iterable[TruthHazard] | None = None) -> list[StoredSubmission]:
    """Every submission under `folder` that is not withdrawn, by slug; each is checked as if it were new.

    Raises InputError for folders that are no submissions or do not match their hashes, FaultsError
    for faults in the predictions; when several are wrong, one InputError tells of all.
    """
    hazards = None if truth is None else list(truth)
    gone = ledger.withdrawn(ledger.read(folder))
    places = sorted(path for path in folder.glob("*/") if not path.name.startswith("."))
    loaded: list[StoredSubmission] = []
    errors: list[InputError] = []
    for place in places:
        if place.name not in gone:
            try:
                loaded.append(_load(place, hazards))
            except InputError as error:
                errors.append(error)
    if len(errors) > 1:
        raise InputError("\n".join(str(error) for error in errors))
    if errors:
        raise errors[0]
    return loaded


@contextmanager
def _building(folder: Path) -> Iterator[Path]:
    """A temporary folder beside the submissions, removed afterwards if it is still there."""
    new = Path(tempfile.mkdtemp(dir=folder, prefix=".new-"))
    try:
        new.chmod(0o755)
        yield new
    finally:
        shutil.rmtree(new, ignore_errors=True)


@contextmanager
def _swapped(new: Path, target: Path) -> Iterator[None]:
    """Put `new` at `target`; when the body raises, what was there comes back."""
    old = new.with_name(f".old-{new.name}")
    if target.exists():
        target.rename(old)
    try:
        new.rename(target)
        yield
    except BaseException:
        shutil.rmtree(target, ignore_errors=True)
        if old.exists():
            old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _fill(
    new: Path, read: ReadPredictions, original: Path, extras: Mapping[str, Path], given: Mapping[str, str]
) -> About:
    """Write a submission's files into the folder `new`."""
    PREDICTIONS.write(new / _PREDICTIONS, read.predictions)
    about = about_file.validated(
        {
            **given,
            "source_format": read.source_format,
            "original_sha256": read.sha256,
            "predictions_sha256": sha256_file(new / _PREDICTIONS),
            "config_sha256": read.config_sha256,
        },
        "submission",
    )
    shutil.copyfile(original, new / f"original.{about.source_format}")
    if sha256_file(new / f"original.{about.source_format}") != about.original_sha256:
        raise InputError(f"{original} changed after it was read; submit it again.")
    for table, path in extras.items():
        shutil.copyfile(path, new / f"{table}.parquet")
    about_file.write(new, about)
    return about


def _same(target: Path, new: Path, current: About, about: About) -> bool:
    """Whether two folders hold the same submission; its date is that of the first time."""
    ignored = {"date", "predictions_sha256"}  # the bytes of equal rows differ between pyarrow versions
    if current.model_dump(exclude=ignored) != about.model_dump(exclude=ignored):
        return False
    files = sorted(path.name for path in new.iterdir())
    if files != sorted(path.name for path in target.iterdir()):
        return False
    try:
        if PREDICTIONS.read(target / _PREDICTIONS) != PREDICTIONS.read(new / _PREDICTIONS):
            return False
    except FaultsError:
        return False
    optional = [*(f"{table}.parquet" for table in EXTRAS), _RECORDING]
    extras = [name for name in optional if name in files]
    return all(sha256_file(target / extra) == sha256_file(new / extra) for extra in extras)


def _load(folder: Path, truth: list[TruthHazard] | None) -> StoredSubmission:
    if any(path.is_symlink() for path in (folder, *folder.iterdir())):
        raise InputError(f"{folder}: holds a symbolic link; expected plain files. Copy the file itself.")
    about = about_file.read(folder)
    if slug(about.name) != folder.name:
        raise InputError(f"{folder}: is named '{about.name}'; its folder must be named '{slug(about.name)}'.")
    read = read_predictions(folder / _PREDICTIONS, truth)
    if read.sha256 != about.predictions_sha256:
        raise InputError(
            f"{folder / _PREDICTIONS}: its hash is {read.sha256[:12]}, {about_file.FILE_NAME} says "
            f"{about.predictions_sha256[:12]}. It was changed by hand; submit it again."
        )
    submission = Submission(
        about.name,
        about.authors,
        about.url,
        about.date,
        about.source_format,
        read.predictions,
        read.warnings,
    )
    extras = tuple(table for table in EXTRAS if (folder / f"{table}.parquet").is_file())
    return StoredSubmission(
        folder.name,
        folder,
        submission,
        about.agents,
        about.predictions_sha256,
        about.original_sha256,
        about.config_sha256,
        extras,
    )
