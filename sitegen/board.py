"""From a benchmark folder to its scores and site: what `submit`, `build` and `demo` share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.benchmark import Benchmark
from pipeline.minilm import open_embedder
from pipeline.scores import Evaluation
from pipeline.table import metadata
from pipeline.tables import MATCHES, OUTCOMES, SNIPPETS, STAGES, USAGE
from sitegen.build import BuildReport, build_site
from sitegen.evaluate import embed_all, evaluate, texts_of, truth_sha256
from sitegen.readers import read_predictions, read_truth
from sitegen.submissions import StoredSubmission, load_all, store

if TYPE_CHECKING:
    from rich.progress import Progress

EXTRAS = (STAGES, SNIPPETS, MATCHES, USAGE, OUTCOMES)


def submit_file(
    benchmark: Benchmark,
    file: Path,
    name: str,
    authors: str,
    url: str,
    agents: str,
    date: str,
    replace: bool,
    recording: Path | None = None,
) -> tuple[StoredSubmission, Evaluation]:
    """Check, score and store a predictions file, or those of a run folder with all its records.

    Raises FaultsError with every fault of the file, before anything is written.
    """
    truth = read_truth(benchmark.truth)
    path = file / "predictions.parquet" if file.is_dir() else file
    read = read_predictions(path, truth)
    extras: dict[str, Path] = {}
    if file.is_dir():
        extras = {table.name: file / f"{table.name}.parquet" for table in EXTRAS}
        extras = {key: extra for key, extra in extras.items() if extra.is_file()}
        agents = agents or metadata(path).get("agents", "")
    folder = store(
        benchmark.submissions,
        name=name,
        authors=authors,
        url=url,
        date=date,
        agents=agents,
        read=read,
        original=path,
        extras=extras,
        recording=recording,
        replace=replace,
    )
    return next((one, score) for one, score in evaluate_board(benchmark) if one.folder == folder)


def evaluate_board(benchmark: Benchmark) -> list[tuple[StoredSubmission, Evaluation]]:
    """Every submission on the board with its scores; each distinct text is embedded once."""
    truth = read_truth(benchmark.truth)
    stored = load_all(benchmark.submissions, truth)
    embedder = open_embedder()
    vectors = embed_all(texts_of([one.submission for one in stored], truth), embedder)
    key = truth_sha256(truth)
    return [
        (one, evaluate(one.submission, truth, embedder, benchmark.settings.threshold, key, vectors=vectors))
        for one in stored
    ]


def build_board(benchmark: Benchmark, out: Path, bar: "Progress") -> tuple[Sequence[Evaluation], BuildReport]:
    """Score every submission and build the site into `out`."""
    board = evaluate_board(benchmark)
    report = build_site(benchmark, out, board, bar)
    return [evaluation for _, evaluation in board], report
