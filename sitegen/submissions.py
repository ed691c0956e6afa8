"""The submissions of a benchmark on disk: a folder each, and the ledger.

    submissions/ledger.jsonl
    submissions/<slug>/submission.toml      who sent it, and the hashes
                       predictions.parquet  what is scored
                       original.<ending>    the file as it came
                       stages.parquet, snippets.parquet, matches.parquet, usage.parquet,
                       outcomes.parquet     what the pipeline noted (optional)
                       recording.zip        every answer behind it (optional)
    submissions/_earlier/<slug>-<n>/        version n, which was replaced

The ledger decides what is on the board; `shelf.py` moves folders so that they follow it.
"""

import shutil
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.files import locked, slug, sync_folder
from pipeline.recording_zip import import_zip
from pipeline.records import TruthHazard
from pipeline.scores import Scorecard, Submission
from sitegen import about as about_file
from sitegen import ledger, packing, shelf
from sitegen.about import About, Sender
from sitegen.checks import visible
from sitegen.ledger import Event
from sitegen.readers import ReadPredictions, read_predictions


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
    licence: str = ""
    notes: str = ""

    @property
    def has_stages(self) -> bool:
        """Whether it is known what each stage of the pipeline said."""
        return "stages" in self.extras


def store(
    folder: Path,
    sender: Sender,
    read: ReadPredictions,
    original: Path,
    *,
    card: Scorecard | None = None,
    extras: Mapping[str, Path] | None = None,
    recording: Path | None = None,
    replace: bool = False,
    why: str = "",
    today: str = "",
) -> Path:
    """Store a submission under `folder` (`submissions/`) and note it in the ledger; give its folder.

    `original` is the file that `read` came from, `card` what it scores; `extras` maps table names
    (`stages`, `snippets`, `matches`, `usage`, `outcomes`) to files; `recording` is a zip of the answers of
    its models, from which others can rebuild the predictions; `today` is the ledger's date, by default
    the sender's. The same content again changes nothing. Raises InputError for a wrong name, date or
    url, for a name that is taken, and for content that differs from what is stored under the name
    unless `replace`; FaultsError for extras that are not such tables.
    """
    extras = dict(extras or {})
    for table, path in extras.items():
        if table not in packing.EXTRAS:
            raise InputError(
                f"Extra table '{table}' is unknown; expected one of {', '.join(packing.EXTRAS)}."
            )
        packing.EXTRAS[table].read(path)
    if recording:
        with tempfile.TemporaryDirectory() as scratch:
            import_zip(recording, Path(scratch))
    with locked(folder):
        entries = ledger.read(folder)
        shelf.settle(folder, entries)
        with shelf.building(folder) as new:
            about = packing.fill(new, read, original, extras, sender)
            if recording:
                shutil.copyfile(recording, new / packing.RECORDING)
            target = folder / slug(about.name)
            is_withdrawn = target.name in ledger.withdrawn(entries)
            current = _current(target, about)
            if current and not is_withdrawn:
                if packing.same(target, new, current, about):
                    return target
                if not replace:
                    raise InputError(
                        f"There is a submission '{about.name}' already, with other content. "
                        "Choose another name, or replace it."
                    )
            event: Event = "replace" if current and not is_withdrawn else "add"
            reason = why or ("submitted" if event == "add" else "new content")
            entry = _entry(event, target.name, about, today or about.date, reason, card)
            sync_folder(new)
            version = len(ledger.versions(entries).get(target.name, [])) + 1
            new.rename(shelf.staged(folder, target.name, version))
            ledger.append(folder, [entry])
            shelf.settle(folder, ledger.read(folder))
    return target


def withdraw(folder: Path, slug_or_name: str, why: str, date: str) -> None:
    """Note in the ledger that a submission is withdrawn; its folder stays, but is no longer loaded.

    Raises InputError when there is no such submission, it is withdrawn already, or `why` is empty.
    """
    place = slug(slug_or_name)
    with locked(folder):
        entries = ledger.read(folder)
        shelf.settle(folder, entries)
        if not place or not (folder / place / about_file.FILE_NAME).is_file():
            names = sorted(path.parent.name for path in folder.glob(f"[!._]*/{about_file.FILE_NAME}"))
            there = f"Those there are: {', '.join(names)}." if names else "There is none at all."
            raise InputError(f"There is no submission '{visible(slug_or_name)}'. {there}")
        if place in ledger.withdrawn(entries):
            raise InputError(f"Submission '{place}' is withdrawn already.")
        if not why.strip():
            raise InputError("A withdrawal needs a reason.")
        about = about_file.read(folder / place)
        day = about_file.validated({**about.model_dump(), "date": date}, "withdrawal").date
        ledger.append(folder, [_entry("withdraw", place, about, day, why)])


def rescore(folder: Path, cards: Mapping[str, Scorecard], today: str) -> list[ledger.Entry]:
    """Note the scores (slug -> scorecard) whose signature is not the one in the ledger; give the entries.

    The reason names what of the signature changed. Other submissions are left as they are.
    """
    with locked(folder):
        entries = ledger.read(folder)
        last = {entry.slug: entry for entry in entries if entry.signature}
        content = {place: found[-1] for place, found in ledger.versions(entries).items()}
        new = []
        for place, card in sorted(cards.items()):
            before = last[place].signature if place in last else ""
            if place in content and before != str(card.signature):
                reason = _change(before, str(card.signature))
                new.append(_entry("rescore", place, content[place], today, reason, card))
        ledger.append(folder, new)
    return new


def _change(before: str, after: str) -> str:
    """The parts of two signatures that differ, in words."""
    if not before:
        return "no scores were noted before"
    old, new = (dict(part.partition(":")[::2] for part in line.split("|")) for line in (before, after))
    names = dict.fromkeys([*old, *new])
    changed = [name for name in names if old.get(name) != new.get(name)]
    return "; ".join(f"{name} {old.get(name, 'none')} -> {new.get(name, 'none')}" for name in changed)


def load_all(
    folder: Path, truth: Iterable[TruthHazard] | None = None, as_of: str = ""
) -> list[StoredSubmission]:
    """Every submission on the board, by slug; each is checked as if it were new.

    `as_of` is a day (ISO 8601) whose board is meant, by default today's. Raises InputError for folders
    that are missing, are no submissions, do not match their hashes, or are not in the ledger, FaultsError
    for faults in the predictions; when several are wrong, one InputError tells of all.
    """
    if not folder.is_dir():
        return []
    hazards = None if truth is None else list(truth)
    loaded: list[StoredSubmission] = []
    errors: list[InputError] = []
    with locked(folder):
        entries = ledger.read(folder)
        shelf.settle(folder, entries)
        for place, entry in shelf.on_board(folder, entries, as_of):
            try:
                loaded.append(load(place, entry, hazards))
            except InputError as error:
                errors.append(error)
        for place in shelf.strangers(folder, entries):
            mend = "Move it away and submit its file: coooler submit FILE --name NAME."
            errors += [InputError(f"{place}: is not in the ledger. {mend}")]
    if len(errors) > 1:
        raise InputError("\n".join(str(error) for error in errors))
    if errors:
        raise errors[0]
    return loaded


def _current(target: Path, about: About) -> About | None:
    """What is stored under a name's slug. Raises InputError when that is of another name."""
    current = about_file.read(target) if target.exists() else None
    if current and current.name != about.name:
        raise InputError(
            f"The name '{about.name}' shortens to '{target.name}', as does '{current.name}', which is there "
            "already. Choose another name."
        )
    return current


def _entry(
    event: Event,
    place: str,
    content: About | ledger.Entry,
    date: str,
    reason: str,
    card: Scorecard | None = None,
) -> ledger.Entry:
    """A line for the ledger; `content` holds the name and the hashes."""
    scores: dict[str, Any] = {}
    if card:
        names = ("besm", "sam", "detection_rate", "hazard_recall")
        scores = {**{name: getattr(card, name) for name in names}, "signature": str(card.signature)}
    return ledger.Entry(
        event=event,
        slug=place,
        name=content.name,
        date=date,
        predictions_sha256=content.predictions_sha256,
        original_sha256=content.original_sha256,
        reason=visible(reason.strip(), 500),
        **scores,
    )


def load(folder: Path, entry: ledger.Entry, truth: list[TruthHazard] | None = None) -> StoredSubmission:
    """The version of a submission that `entry` brought, from its folder. Raises as `load_all` does."""
    if not folder.is_dir():
        raise InputError(f"{folder}: found nothing; the ledger says that a submission lies there.")
    if any(path.is_symlink() for path in (folder, *folder.iterdir())):
        raise InputError(f"{folder}: holds a symbolic link; expected plain files. Copy the file itself.")
    about = about_file.read(folder)
    if slug(about.name) != entry.slug:
        raise InputError(
            f"{folder}: is named '{about.name}'; the ledger says that '{entry.slug}' lies there."
        )
    read = read_predictions(folder / packing.FILE_NAME, truth)
    for place, said in ((about_file.FILE_NAME, about), ("the ledger", entry)):
        if read.sha256 != said.predictions_sha256:
            raise InputError(
                f"{folder / packing.FILE_NAME}: its hash is {read.sha256[:12]}, {place} says "
                f"{said.predictions_sha256[:12]}. It was changed by hand; submit it again."
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
    extras = tuple(table for table in packing.EXTRAS if (folder / f"{table}.parquet").is_file())
    return StoredSubmission(
        entry.slug,
        folder,
        submission,
        about.agents,
        about.predictions_sha256,
        about.original_sha256,
        about.config_sha256,
        extras,
        about.licence,
        about.notes,
    )
