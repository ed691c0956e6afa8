"""Votes of people on captions, as the site's voting page exports them: checked, stored, loaded.

    votes/<first 16 hex digits of the file's SHA-256>.json     a file as it came

A file holds one voter's votes, who is known by a random seed. Votes are on captions, so each carries the
hashes of the predictions it was shown; when those change, the vote stays on disk and is kept apart.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

from pipeline.benchmark import Benchmark
from pipeline.errors import Fault, FaultsError, InputError
from pipeline.files import sha256_of, write_bytes
from sitegen import ledger
from sitegen.checks import MAX_ID_CHARS, Faults, show, visible
from sitegen.evaluate import truth_sha256
from sitegen.judgements import Choice, Vote, Votes
from sitegen.readers import read_truth

FOLDER = "votes"
FORMAT = "coooler-votes"
TRUTH_CHARS = 12
"""How much of the truth's hash a file holds: as much as a signature prints."""

MAX_BYTES = 8 * 2**20
MAX_VOTES = 20_000
MAX_FIELDS = 32

M = TypeVar("M", bound=BaseModel)

_Slug = Annotated[str, Field(pattern=r"^[a-z0-9-]{1,64}$")]
_Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_AGAIN = "Export the votes again on the voting page; a file of it is not meant to be edited."


class VoteEntry(BaseModel):
    """One vote in a file: whose captions of a video are better; the systems are named by slug."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    video_id: Annotated[str, Field(min_length=1, max_length=MAX_ID_CHARS)]
    left: _Slug
    right: _Slug
    choice: Choice
    left_predictions_sha256: _Hash
    right_predictions_sha256: _Hash


class VoteFile(BaseModel):
    """What a file says of all its votes, which are checked one by one.

    `revision` counts every vote and every undoing of one, so of two files of one voter it tells the later.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal["coooler-votes"]
    version: Literal[1]
    benchmark: Annotated[str, Field(min_length=1, max_length=120)]
    truth_sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{12}$")]
    voter: Annotated[str, Field(max_length=80)]
    seed: Annotated[int, Field(ge=0, lt=2**32)]
    revision: Annotated[int, Field(ge=0, lt=2**53)]
    votes: Annotated[list[Any], Field(min_length=1, max_length=MAX_VOTES)]


@dataclass(frozen=True, slots=True)
class _Read:
    """A file that was read; `entries` holds each right vote by its number, from 1.

    `file` is None when what it says of all its votes is wrong; `sha256` is of its bytes.
    """

    sha256: str
    file: VoteFile | None
    entries: Mapping[int, VoteEntry]
    data: bytes


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What came of an import: files that are new and files that were there; their votes.

    Of the `votes` in the files, `counted` are on captions of the board; `replaced` were followed by another
    vote of the same voter on the same captions, `apart` are on captions that have changed or are withdrawn.
    """

    stored: tuple[Path, ...]
    known: tuple[Path, ...]
    votes: int
    counted: int
    replaced: int
    apart: int


_Key: TypeAlias = tuple[int, str, tuple[tuple[str, str], tuple[str, str]]]


def import_votes(benchmark: Benchmark, files: Sequence[Path]) -> ImportReport:
    """Check files of votes and store them under `<benchmark>/votes/`, all or none.

    The same file again changes nothing. Raises FaultsError with every fault of every file: not readable,
    too large, not of the form that the voting page exports, of another benchmark or truth, or with a
    video, a system or a hash of predictions that the benchmark has never had.
    """
    truth = read_truth(benchmark.truth)
    videos, digest = {row.video_id for row in truth}, truth_sha256(truth)[:TRUTH_CHARS]
    entries = ledger.read(benchmark.submissions)
    had = {
        place: {entry.predictions_sha256 for entry in found}
        for place, found in ledger.versions(entries).items()
    }
    faults: list[Fault] = []
    given: dict[str, _Read] = {}
    for path in files:
        told = Faults(visible(str(path), 1_000))
        try:
            read = _read(path, told)
            _check(read, benchmark.settings.name, digest, videos, had, told)
            told.raise_if_any()
            given[read.sha256] = read
        except FaultsError as error:
            faults += error.faults
    if faults:
        raise FaultsError(faults)
    there = {read.sha256: read for read in _stored(benchmark)}
    folder = benchmark.root / FOLDER
    stored: list[Path] = []
    known: list[Path] = []
    for sha256, read in sorted(given.items()):
        path = folder / _name(sha256)
        (known if sha256 in there else stored).append(path)
        if sha256 not in there:
            write_bytes(path, read.data)
    last = _last([*{**there, **given}.values()])
    votes = sum(len(read.entries) for read in given.values())
    kept = [entry for sha256, _, entry in last.values() if sha256 in given]
    counted = sum(_is_current(entry, on_board(entries)) for entry in kept)
    return ImportReport(tuple(stored), tuple(known), votes, counted, votes - len(kept), len(kept) - counted)


def load_votes(benchmark: Benchmark, predictions: Mapping[str, str] | None = None) -> Votes:
    """Every stored vote; of two votes of one voter on the same captions of a video, the last.

    `predictions` maps each slug of the board to the hash of its predictions; by default the board is
    that of the ledger. Votes under another truth are kept apart too. Raises InputError for a file that
    is not as it was imported.
    """
    reads = _stored(benchmark)
    if not reads:
        return Votes()
    board = predictions if predictions is not None else on_board(ledger.read(benchmark.submissions))
    digest = truth_sha256(read_truth(benchmark.truth))[:TRUTH_CHARS]
    last = _last(reads)
    current = [
        _vote(key[0], entry)
        for key, (_, truth, entry) in sorted(last.items())
        if truth == digest and _is_current(entry, board)
    ]
    return Votes(tuple(current), len(last) - len(current))


def on_board(entries: Iterable[ledger.Entry]) -> dict[str, str]:
    """Slug -> hash of the predictions that the ledger has on the board now."""
    every = list(entries)
    gone = ledger.withdrawn(every)
    return {
        place: found[-1].predictions_sha256
        for place, found in ledger.versions(every).items()
        if place not in gone
    }


def _read(path: Path, faults: Faults) -> _Read:
    """The file's content, each vote checked by itself. Raises FaultsError, or adds to `faults`."""
    data = _bytes(path, faults)
    try:
        content = from_json(data)
    except ValueError as error:
        faults.stop(f"no JSON ({visible(str(error), 200)})", "a JSON object", _AGAIN)
    file = _validated(VoteFile, content, None, faults)
    votes = content.get("votes") if isinstance(content, dict) else None
    entries = {
        row: entry
        for row, value in enumerate(votes[:MAX_VOTES] if isinstance(votes, list) else [], start=1)
        if (entry := _validated(VoteEntry, value, row, faults)) is not None
    }
    return _Read(sha256_of(data), file, entries, data)


def _validated(model: type[M], value: object, row: int | None, faults: Faults) -> M | None:
    """The value as a record, or None and what is wrong with it in `faults`."""
    if isinstance(value, dict) and len(value) > MAX_FIELDS:  # each would be a fault of its own
        expected = f"the {len(model.model_fields)} fields of one"
        faults.add(row, None, f"{len(value):,} fields", expected, _AGAIN)
        return None
    try:
        return model.model_validate(value)
    except ValidationError as error:
        for fault in error.errors(include_url=False, include_context=False):
            column = visible(".".join(str(part) for part in fault["loc"]))
            found = "nothing" if fault["type"] == "missing" else show(fault["input"])
            said = visible(fault["msg"], 200)
            faults.add(row, column or None, found, said[:1].lower() + said[1:], _AGAIN)
        return None


def _bytes(path: Path, faults: Faults) -> bytes:
    try:
        if not path.is_file():
            faults.stop("no plain file there", "a JSON file of votes", "Give the path of the file.")
        with path.open("rb") as source:
            data = source.read(MAX_BYTES + 1)
    except OSError as error:
        faults.stop(f"not readable ({error.strerror})", "a JSON file of votes", "Check its permissions.")
    if len(data) > MAX_BYTES:
        faults.stop(f"over {MAX_BYTES // 2**20} MB", f"at most {MAX_VOTES:,} votes", _AGAIN)
    return data


def _check(
    read: _Read,
    benchmark: str,
    digest: str,
    videos: set[str],
    had: Mapping[str, set[str]],
    faults: Faults,
) -> None:
    """Add what does not fit the benchmark to `faults`; `had` maps a slug to the hashes it ever had."""
    if read.file and read.file.benchmark != benchmark:
        mend = "Import it in the folder of its own benchmark."
        faults.add(None, "benchmark", show(read.file.benchmark), show(benchmark), mend)
    if read.file and read.file.truth_sha256 != digest:
        mend = "These votes are of another version of the benchmark; they cannot be added to this one."
        faults.add(None, "truth_sha256", show(read.file.truth_sha256), show(digest), mend)
    for row, entry in read.entries.items():
        if entry.video_id not in videos:
            expected = f"one of the {len(videos):,} video ids of the truth"
            faults.add(row, "video_id", show(entry.video_id), expected, _AGAIN)
        if entry.left == entry.right:
            faults.add(row, "right", f"{show(entry.right)} on both sides", "two systems", _AGAIN)
        for side in ("left", "right"):
            slug, sha256 = getattr(entry, side), getattr(entry, f"{side}_predictions_sha256")
            if slug not in had:
                faults.add(row, side, show(slug), "the slug of a submission in the ledger", _AGAIN)
            elif sha256 not in had[slug]:
                expected = f"the hash of predictions that '{slug}' has or had"
                faults.add(row, f"{side}_predictions_sha256", show(sha256), expected, _AGAIN)


def _stored(benchmark: Benchmark) -> list[_Read]:
    """Every stored file, by name. Raises InputError for one that was changed."""
    reads = []
    for path in sorted((benchmark.root / FOLDER).glob("*.json")):
        faults = Faults(visible(str(path), 1_000))
        read = _read(path, faults)
        faults.raise_if_any()
        if path.name != _name(read.sha256):
            raise InputError(
                f"{path}: its name does not fit its content, whose hash is {read.sha256[:16]}. "
                "It was changed by hand; restore it, or move it away and import it again."
            )
        reads.append(read)
    return reads


def _name(sha256: str) -> str:
    return f"{sha256[:16]}.json"


def _last(reads: Iterable[_Read]) -> dict[_Key, tuple[str, str, VoteEntry]]:
    """Voter, video and captions -> the last vote, with the hash of its file and of the truth."""
    last: dict[_Key, tuple[str, str, VoteEntry]] = {}
    right = [(read.file, read) for read in reads if read.file]
    for file, read in sorted(right, key=lambda pair: (pair[0].revision, pair[1].sha256)):
        for entry in read.entries.values():
            one = (entry.left, entry.left_predictions_sha256)
            other = (entry.right, entry.right_predictions_sha256)
            key = (file.seed, entry.video_id, (min(one, other), max(one, other)))
            last[key] = (read.sha256, file.truth_sha256, entry)
    return last


def _is_current(entry: VoteEntry, board: Mapping[str, str]) -> bool:
    shown = {entry.left: entry.left_predictions_sha256, entry.right: entry.right_predictions_sha256}
    return all(board.get(slug) == sha256 for slug, sha256 in shown.items())


def _vote(voter: int, entry: VoteEntry) -> Vote:
    return Vote(
        voter,
        entry.video_id,
        entry.left,
        entry.right,
        entry.choice,
        entry.left_predictions_sha256,
        entry.right_predictions_sha256,
    )
