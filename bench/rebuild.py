"""What a rebuild costs: nothing changed, another truth row, a submission more, a video more.

The boards are generated: 10 systems on 200 videos with the demo's clips, and on 2,000 without clips, whose
cost does not depend on how many there are; `bench.growth` has 20,000. Every build scores all submissions
again, with their vectors cached. `python -m bench.rebuild 2000` measures 2,000 videos with the demo's clips.
"""

import os
import random
import shutil
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

from bench.embedding import sentences
from bench.timing import Measure
from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.minilm import OnnxEmbedder, find_embedder
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import BOXES, PREDICTIONS, TRUTH
from sitegen.about import Sender
from sitegen.board import evaluate_board, rebuild_board
from sitegen.readers import read_predictions, read_truth
from sitegen.submissions import store

DEMO = Path(__file__).parent.parent / "demo"
SYSTEMS = 10
FEW, MANY = 200, 2_000
EMBEDDED = 2_000  # captions, by whose time that of more is told
Times = dict[str, list[float]]


def demo_clips(folder: Path) -> list[Path]:
    """Copies of the demo's clips in a new folder, where they can be linked."""
    return sorted(Path(shutil.copytree(DEMO / "videos", folder)).glob("*.mp4"))


def write_benchmark(root: Path, clips: Mapping[str, Path | None], systems: int) -> Benchmark:
    """A benchmark folder whose videos have these clips, or none; systems are right ever less often."""
    (root / "videos").mkdir(parents=True)
    (root / "coooler.toml").write_text('name = "Rebuilds"\ntruth = "truth.parquet"\n', encoding="utf-8")
    for video_id, clip in clips.items():
        if clip:
            os.link(clip, root / "videos" / f"{video_id}.mp4")
    chance = random.Random(0)  # noqa: S311
    texts = sentences(2 * len(clips))
    truth = [TruthHazard(one, "1", "car", text) for one, text in zip(clips, texts, strict=False)]
    TRUTH.write(root / "truth.parquet", truth)
    benchmark = open_benchmark(root)
    for number in range(systems):
        said = [
            row.description if chance.random() > number / systems else chance.choice(texts) for row in truth
        ]
        submit(benchmark, f"System {number + 1}", said)
    return benchmark


def submit(benchmark: Benchmark, name: str, said: list[str]) -> None:
    """Store a caption a video; nothing is embedded."""
    truth = read_truth(benchmark.truth)
    rows = [Prediction(row.video_id, 1, text) for row, text in zip(truth, said, strict=True)]
    file = benchmark.root / "new.parquet"
    PREDICTIONS.write(file, rows)
    store(benchmark.submissions, Sender(name, date="2026-01-01"), read_predictions(file, truth), file)


@contextmanager
def timed(times: Times, what: str) -> Iterator[None]:
    """Note the seconds that the body takes."""
    start = time.perf_counter()
    yield
    times[what].append(time.perf_counter() - start)


def board_of(root: Path, clips: list[Path], videos: int, rounds: int) -> dict[str, float]:
    """Seconds of each kind of build, by name: medians of `rounds`, but for what is measured once.

    The videos have these clips in turn, or none. A full build and that of a new submission are measured
    once; `embed` is what the new captions take, told by `EMBEDDED` of them.
    """
    ids = {f"v{number:05}": clips[number % len(clips)] if clips else None for number in range(videos)}
    benchmark = write_benchmark(root, ids, SYSTEMS)
    evaluate_board(benchmark)
    embedder = OnnxEmbedder(find_embedder() or DEMO)
    embedder.embed(sentences(8, seed=1))
    times: Times = defaultdict(list)
    with timed(times, "score"):
        evaluate_board(benchmark)
    with timed(times, "full"):
        rebuild_board(benchmark, root / "site")
    rebuild_board(benchmark, root / "site")
    for turn in range(rounds):
        with timed(times, "nothing"):
            rebuild_board(benchmark, root / "site")
        change_truth(benchmark, turn)
        with timed(times, "truth"):
            rebuild_board(benchmark, root / "site")
    few = min(videos, EMBEDDED)
    with timed(times, "embed"):
        embedder.embed(sentences(few, seed=100))
    times["embed"][0] *= videos / few
    submit(benchmark, "New", sentences(videos, seed=10))
    with timed(times, "submission"):
        rebuild_board(benchmark, root / "site")
    shutil.rmtree(root)
    return {what: statistics.median(values) for what, values in times.items()}


def rows_of(videos: int, has_clips: bool, rounds: int, spent: Mapping[str, float]) -> list[Measure]:
    """Three rows of what `board_of` measured."""
    what = f"rebuild of {videos:,} videos x {SYSTEMS} systems, {'the demo’s' if has_clips else 'no'} clips:"
    full = "full build, measured once"
    floor = spent["embed"] + 0.02 * spent["full"]
    note = f"medians of {rounds}" if rounds > 1 else "measured once"
    return [
        Measure(
            f"{what} nothing changed", spent["nothing"], full, spent["full"], "at most 0.02 at 2,000", note
        ),
        Measure(f"{what} one truth row changed", spent["truth"], full, spent["full"], "", note),
        Measure(
            f"{what} a submission more",
            spent["submission"],
            "embedding its captions and 2 % of a full build",
            floor,
            "at most 1.3",
            f"measured once; embedding {spent['embed']:.3g} s, a full build {spent['full']:.3g} s",
        ),
    ]


def change_truth(benchmark: Benchmark, turn: int) -> None:
    """Describe the hazard of one video in other words."""
    rows = read_truth(benchmark.truth)
    rows[turn] = replace(rows[turn], description=f"A car turns for the {turn + 1}. time")
    TRUTH.write(benchmark.truth, rows)


def one_more_video(root: Path, rounds: int = 5) -> list[Measure]:
    """One row: the demo's clips and two of them again; the last comes, unknown to the systems, and goes."""
    clips: dict[str, Path] = {}
    boxes = []
    demo = demo_clips(root / "clips")
    all_boxes = BOXES.read(DEMO / "boxes.parquet")
    for number, clip in enumerate([*demo, *demo[:2]], start=1):
        video_id = f"v{number:02}"
        clips[video_id] = Path(shutil.copyfile(clip, root / "clips" / f"{video_id}.mp4"))
        boxes += [replace(box, video_id=video_id) for box in all_boxes if box.video_id == clip.stem]
    last = list(clips)[-1]
    new_clip = clips.pop(last)
    benchmark = write_benchmark(root / "benchmark", clips, 3)
    BOXES.write(benchmark.boxes, boxes)
    truth = read_truth(benchmark.truth)
    rebuild_board(benchmark, root / "site")
    times: Times = defaultdict(list)
    for _ in range(rounds):
        os.link(new_clip, benchmark.videos / new_clip.name)
        TRUTH.write(benchmark.truth, [*truth, TruthHazard(last, "1", "car", "A car brakes")])
        with timed(times, "one"):
            rebuild_board(benchmark, root / "site")
        with timed(times, "full"):
            rebuild_board(benchmark, root / "full")
        shutil.rmtree(root / "full")
        (benchmark.videos / new_clip.name).unlink()
        TRUTH.write(benchmark.truth, truth)
        rebuild_board(benchmark, root / "site")
    one, full = statistics.median(times["one"]), statistics.median(times["full"])
    what = f"rebuild of {len(clips) + 1} videos x 3 systems, one video new"
    return [Measure(what, one, "full build", full, "at most 0.15", f"medians of {rounds}")]


def measure() -> list[Measure]:
    """A row for a video more, and three for each size of board."""
    with scratch() as root:
        rows = one_more_video(root / "sixteen")
        rows += rows_of(FEW, True, 5, board_of(root / "few", demo_clips(root / "clips"), FEW, 5))
        return rows + rows_of(MANY, False, 5, board_of(root / "many", [], MANY, 5))


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder and a cache of vectors that are thrown away."""
    with tempfile.TemporaryDirectory() as name, patch.dict(os.environ, {"COOOLER_CACHE": f"{name}/cache"}):
        yield Path(name)


def main(videos: int) -> None:
    """Print the rows of a board of so many videos with the demo's clips."""
    with scratch() as root:
        for row in rows_of(videos, True, 1, board_of(root / "board", demo_clips(root / "clips"), videos, 1)):
            print(f"{row.what}: {row.ours_s:.3g} s, {row.ratio:.3g} of {row.peer}; {row.note}")


if __name__ == "__main__":
    main(int(sys.argv[1]))
