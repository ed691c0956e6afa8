"""Reading and checking a submission of a million rows against pyarrow's bare read of the same file."""

import csv
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pyarrow.csv as arrow_csv
import pyarrow.parquet as pq

from bench.embedding import sentences
from bench.timing import Measure, interleaved
from pipeline.data.hazard_tracks import HazardTrack
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen.coool_write import results_csv
from sitegen.readers import PREDICTION_COLUMNS, read_predictions

VIDEOS, ROWS_A_VIDEO = 20_000, 50
CAPTIONS = 20_000
GOAL = "at most 4"


def truth() -> list[TruthHazard]:
    """One hazard a video."""
    return [TruthHazard(f"v{number:05}", "1", "car", "A car brakes") for number in range(VIDEOS)]


def predictions() -> Iterator[Prediction]:
    """A million rows, whose captions repeat as those of systems do."""
    texts = sentences(CAPTIONS)
    for number in range(VIDEOS):
        for rank in range(1, ROWS_A_VIDEO + 1):
            text = texts[(number * 31 + rank * 7) % CAPTIONS]
            yield Prediction(f"v{number:05}", rank, text, "car", (str(rank),), (rank, rank + 1))


def write_all(folder: Path) -> dict[str, Path]:
    """The submission as Parquet, as CSV, and one of as many frames as COOOL results."""
    paths = {name: folder / name for name in ("predictions.parquet", "predictions.csv", "results.csv")}
    rows = list(predictions())
    PREDICTIONS.write(paths["predictions.parquet"], rows)
    with paths["predictions.csv"].open("w", encoding="utf-8", newline="") as sink:
        writer = csv.writer(sink)
        writer.writerow(PREDICTION_COLUMNS)
        for row in rows:
            lists = ";".join(row.track_ids), ";".join(map(str, row.frame_indices))
            writer.writerow((row.video_id, row.rank, row.description, row.label, *lists))
    counts = {f"v{number:05}": ROWS_A_VIDEO for number in range(VIDEOS)}
    texts = sentences(CAPTIONS)
    tracks = {
        video: (HazardTrack(video, "1", texts[place % CAPTIONS], "car", tuple(range(10, 40)), 0, 0.0),)
        for place, video in enumerate(counts)
    }
    reactions = dict.fromkeys(counts, 25)
    paths["results.csv"].write_bytes(results_csv(counts, tracks, reactions).data)
    return paths


def measure() -> list[Measure]:
    """One row a format; the truth's videos are known, so that every id is looked up."""
    with tempfile.TemporaryDirectory() as name:
        paths = write_all(Path(name))
        hazards = truth()
        functions: dict[str, Callable[[], object]] = {}
        for file, path in paths.items():
            functions[file] = partial(read_predictions, path, hazards)
            bare = pq.read_table if path.suffix == ".parquet" else arrow_csv.read_csv
            functions[f"{file}, bare"] = partial(bare, path)
        times = interleaved(functions)
        sizes = {file: path.stat().st_size / 1e6 for file, path in paths.items()}
    rows = VIDEOS * ROWS_A_VIDEO
    return [
        Measure(
            f"read and check {rows:,} rows of {VIDEOS:,} videos, {file}",
            times[file],
            "pyarrow's bare read",
            times[f"{file}, bare"],
            GOAL,
            f"{sizes[file]:.1f} MB",
        )
        for file in paths
    ]
