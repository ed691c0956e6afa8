"""From a benchmark folder to its scores and site: what `submit`, `build`, the server and the demo share."""

from collections.abc import Mapping, Sequence
from dataclasses import replace as replaced
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from pipeline.files import locked, slug
from pipeline.memory import collected_rarely
from pipeline.minilm import open_embedder
from pipeline.records import TruthHazard
from pipeline.scores import Submission
from pipeline.tables import TRUTH
from sitegen import about as about_file
from sitegen import ledger
from sitegen.about import Sender
from sitegen.build import BuildReport, build_site
from sitegen.evaluate import embed_all, evaluate, texts_of, truth_sha256
from sitegen.packing import as_one_file
from sitegen.probes import probe_board
from sitegen.readers import ReadOptions, ReadPredictions, read_given, read_truth
from sitegen.run_folder import extras_of, predictions_of, with_agents
from sitegen.scoreboard import board_lines
from sitegen.standings import Standing
from sitegen.submissions import StoredSubmission, load_all, rescore, store
from sitegen.untouched import Built, kept_truth, only_noted, recall, remember, sources

if TYPE_CHECKING:
    from rich.progress import Progress

FIRST_DAY = "1970-01-01"
"""The date of a rescoring when none is given: the ledger then takes that of its last line."""


def submit_file(
    benchmark: Benchmark,
    file: Path,
    sender: Sender,
    *,
    options: ReadOptions | None = None,
    recording: Path | None = None,
    replace: bool = False,
    why: str = "",
    today: str = "",
) -> Standing:
    """Check, score and store a predictions file, shards, or those of a run folder with all its records.

    Raises FaultsError with every fault of the file, before anything is written.
    """
    path = predictions_of(file)
    read = read_given(path, known_videos(benchmark), options)
    with TemporaryDirectory() as folder:
        if path.is_dir():
            path, read = as_one_file(read, Path(folder))
        return submit_read(
            benchmark,
            read,
            path,
            with_agents(sender, file),
            extras=extras_of(file),
            recording=recording,
            replace=replace,
            why=why,
            today=today,
        )


def submit_read(
    benchmark: Benchmark,
    read: ReadPredictions,
    original: Path,
    sender: Sender,
    *,
    extras: Mapping[str, Path] | None = None,
    recording: Path | None = None,
    replace: bool = False,
    why: str = "",
    today: str = "",
) -> Standing:
    """Score and store predictions that were read from `original`; give their place on the board.

    `today` is the ledger's date; it and the sender's stand in for each other. Raises as `store` does.
    """
    sender = replaced(sender, date=sender.date or today)
    truth = read_truth(benchmark.truth)
    embedder = open_embedder()
    submission = _submission(sender, read)
    card = evaluate(submission, truth, embedder, benchmark.settings.threshold, truth_sha256(truth)).card
    _keep_truth(benchmark, truth)
    folder = store(
        benchmark.submissions,
        sender,
        read,
        original,
        card=card,
        extras=extras,
        recording=recording,
        replace=replace,
        why=why,
        today=today,
    )
    return next(one for one in evaluate_board(benchmark) if one.stored.folder == folder)


def rehearse(benchmark: Benchmark, read: ReadPredictions, original: Path, sender: Sender) -> list[Standing]:
    """The board as it would be with these predictions on it, which are marked `rehearsed`.

    Nothing is stored. A submission of the same name is left out. Raises InputError for a wrong
    name, date or url.
    """
    about = about_file.validated(
        {
            **{name: getattr(sender, name) for name in Sender.__slots__},
            "source_format": read.source_format,
            "original_sha256": read.sha256,
            "predictions_sha256": read.sha256,
        },
        "submission",
    )
    extras = tuple(extras_of(original.parent)) if original.name == "predictions.parquet" else ()
    folder = original.parent if extras else benchmark.submissions / ".rehearsed"
    one = StoredSubmission(
        slug(about.name),
        folder,
        _submission(sender, read),
        about.agents,
        "",
        read.sha256,
        read.config_sha256,
        extras,
        about.licence,
        about.notes,
    )
    board = load_all(benchmark.submissions, known_videos(benchmark))
    standings = _standings(benchmark, [*(other for other in board if other.slug != one.slug), one])
    return [standing._replace(rehearsed=standing.stored is one) for standing in standings]


def evaluate_board(benchmark: Benchmark, as_of: str = "") -> list[Standing]:
    """Every submission on the board with its scores, by slug; each distinct text is embedded once.

    `as_of` is a day (ISO 8601): that day's submissions, under the truth and the threshold that the
    ledger notes for it.
    """
    then = as_it_was(benchmark, as_of) if as_of else benchmark
    return _standings(then, load_all(then.submissions, known_videos(then), as_of), as_of)


def known_videos(benchmark: Benchmark) -> list[TruthHazard]:
    """What a check of predictions may know: the truth, or no more than its videos when it is hidden."""
    truth = read_truth(benchmark.truth)
    if not benchmark.settings.hide_truth:
        return truth
    return [TruthHazard(video_id, "", "", "") for video_id in sorted({row.video_id for row in truth})]


def build_board(
    benchmark: Benchmark, out: Path, bar: "Progress | None" = None, *, as_of: str = "", today: str = ""
) -> tuple[list[Standing], BuildReport]:
    """Score every submission and build the site into `out`.

    Scores under another signature than the ledger's are noted there, dated `today`; `as_of` builds the
    board of a day and notes nothing. One process at a time builds into a folder.
    """
    with locked(out):
        board, report, _ = _build(benchmark, out, bar, as_of, today)
    return board, report


def rebuild_board(
    benchmark: Benchmark, out: Path, bar: "Progress | None" = None, *, as_of: str = "", today: str = ""
) -> Built:
    """`build_board`, which ends at once when neither the benchmark nor the site was touched since."""
    with locked(out):
        made_by, found = f"{open_embedder().sha256} {as_of}", sources(benchmark)
        same = recall(benchmark, out, made_by, found)
        if same:
            return same
        lines = len(ledger.read(benchmark.submissions))
        board, report, noted = _build(benchmark, out, bar, as_of, today)
        last = [one.history[-1] for one in board if one.history]
        rescored = [f"{one.date}: {one.slug}: {one.reason}" for one in last if one.event == "rescore"]
        built = Built(board_lines([one.evaluation for one in board]), tuple(rescored), report)
        now = sources(benchmark)
        if only_noted(found, now) and len(ledger.read(benchmark.submissions)) == lines + len(noted):
            found = now
        remember(benchmark, built, made_by, found)
    return built


@collected_rarely()
def _build(
    benchmark: Benchmark, out: Path, bar: "Progress | None", as_of: str, today: str
) -> tuple[list[Standing], BuildReport, list[ledger.Entry]]:
    """The board, what was built, and the new scores that were noted in the ledger."""
    board = evaluate_board(benchmark, as_of)
    noted: list[ledger.Entry] = []
    if not as_of and board:
        _keep_truth(benchmark, read_truth(benchmark.truth))
        cards = {one.stored.slug: one.evaluation.card for one in board}
        noted = rescore(benchmark.submissions, cards, today or FIRST_DAY)
        if noted:
            board = _histories(benchmark, board)
    then = as_it_was(benchmark, as_of) if as_of else benchmark
    return board, build_site(then, out, board, bar, as_of=as_of, embedder=open_embedder()), noted


def _submission(sender: Sender, read: ReadPredictions) -> Submission:
    return Submission(
        sender.name,
        sender.authors,
        sender.url,
        sender.date,
        read.source_format,
        read.predictions,
        read.warnings,
    )


def _standings(benchmark: Benchmark, stored: Sequence[StoredSubmission], as_of: str = "") -> list[Standing]:
    truth, threshold = read_truth(benchmark.truth), benchmark.settings.threshold
    embedder = open_embedder()
    submissions = [one.submission for one in stored]
    vectors = embed_all(texts_of(submissions, truth), embedder)
    key = truth_sha256(truth)
    probes = probe_board(submissions, truth, vectors, threshold)
    entries = ledger.until(ledger.read(benchmark.submissions), as_of)
    return [
        Standing(
            one,
            evaluate(one.submission, truth, embedder, threshold, key, vectors=vectors),
            found,
            tuple(entry for entry in entries if entry.slug == one.slug),
        )
        for one, found in zip(stored, probes, strict=True)
    ]


def _histories(benchmark: Benchmark, board: Sequence[Standing]) -> list[Standing]:
    """The board with what the ledger holds now."""
    entries = ledger.read(benchmark.submissions)
    return [
        one._replace(history=tuple(entry for entry in entries if entry.slug == one.stored.slug))
        for one in board
    ]


def _kept_truth(benchmark: Benchmark, digest: str) -> Path:
    """Where the truth of a hash, or of its first 12 characters, is kept for `as_of`."""
    return kept_truth(benchmark) / f"{digest[:12]}.parquet"


def _keep_truth(benchmark: Benchmark, truth: Sequence[TruthHazard]) -> None:
    path = _kept_truth(benchmark, truth_sha256(truth))
    if not path.exists():
        TRUTH.write(path, truth)


def as_it_was(benchmark: Benchmark, day: str) -> Benchmark:
    """The benchmark with the truth and the threshold by which a day's board was scored; its name says so.

    Raises InputError when that truth is not kept.
    """
    entries = ledger.until(ledger.read(benchmark.submissions), day)
    signatures = [entry.signature for entry in entries if entry.signature]
    changed: dict[str, object] = {"name": f"{benchmark.settings.name}, as of {day}"}
    if not signatures:
        return replaced(benchmark, settings=benchmark.settings.model_copy(update=changed))
    parts = dict(part.partition(":")[::2] for part in signatures[-1].split("|"))
    changed["threshold"] = float(parts["thr"].removeprefix(">"))
    if not truth_sha256(read_truth(benchmark.truth)).startswith(parts["truth"]):
        path = _kept_truth(benchmark, parts["truth"])
        if not path.is_file():
            raise InputError(
                f"{path}: found nothing; the board of {day} was scored by the truth of this hash. Put that "
                "truth back there, or build the board of today."
            )
        changed["truth"] = str(path)
    return replaced(benchmark, settings=benchmark.settings.model_copy(update=changed))
