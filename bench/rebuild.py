"""What a rebuild costs: nothing changed, another truth row, a submission more, a video more.

The boards are generated: 10 systems on 200 and on 2,000 videos, whose clips are short and small pieces
of the demo's. Every build scores all submissions again, with their vectors cached.
"""

import os
import random
import shutil
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from itertools import islice
from pathlib import Path
from unittest.mock import patch

from av.video.reformatter import VideoReformatter

from bench.embedding import sentences
from bench.timing import Measure
from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.data.decode import decoded
from pipeline.data.encode import write_h264
from pipeline.minilm import OnnxEmbedder, find_embedder
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import BOXES, PREDICTIONS, TRUTH
from sitegen.about import Sender
from sitegen.board import evaluate_board, rebuild_board
from sitegen.readers import read_predictions, read_truth
from sitegen.submissions import store

DEMO = Path(__file__).parent.parent / "demo"
SYSTEMS = 10
SCALES = ((200, 5, 5), (2_000, 5, 1))  # videos, rounds, of which so many with what takes minutes
SMALL_PX, SMALL_FRAMES = (160, 90), 30
Times = dict[str, list[float]]


def small_clips(folder: Path) -> list[Path]:
    """A small piece of each of the demo's clips."""
    made = []
    for clip in sorted((DEMO / "videos").glob("*.mp4")):
        reformatter = VideoReformatter()
        frames = islice(decoded(clip), SMALL_FRAMES)
        small = (reformatter.reformat(frame, *SMALL_PX) for frame in frames)
        made.append(folder / clip.name)
        write_h264(made[-1], small, rate=Fraction(25), size=SMALL_PX)
    return made


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


def board_of(root: Path, clips: list[Path], videos: int, rounds: int, full_rounds: int) -> list[Measure]:
    """Three rows; a new submission stays, and the next rounds build it as well.

    Full builds and new submissions come in `full_rounds` of the rounds only.
    """
    ids = {f"v{number:05}": clips[number % len(clips)] for number in range(videos)}
    benchmark = write_benchmark(root, ids, SYSTEMS)
    evaluate_board(benchmark)
    embedder = OnnxEmbedder(find_embedder() or DEMO)
    embedder.embed(sentences(8, seed=1))
    times: Times = defaultdict(list)
    for turn in range(rounds):
        if turn < full_rounds:
            shutil.rmtree(root / "site", ignore_errors=True)
            with timed(times, "full"):
                rebuild_board(benchmark, root / "site")
        with timed(times, "nothing"):
            rebuild_board(benchmark, root / "site")
        change_truth(benchmark, turn)
        with timed(times, "truth"):
            rebuild_board(benchmark, root / "site")
        if turn < full_rounds:
            submit(benchmark, f"New {turn}", sentences(videos, seed=10 + turn))
            with timed(times, "embed"):
                embedder.embed(sentences(videos, seed=100 + turn))
            with timed(times, "submission"):
                rebuild_board(benchmark, root / "site")
    shutil.rmtree(root)
    spent = {what: statistics.median(values) for what, values in times.items()}
    what = f"rebuild of {videos:,} videos x {SYSTEMS} systems,"
    once = "measured once" if full_rounds == 1 else f"medians of {full_rounds}"
    full = f"full build, {once}"
    floor = spent["embed"] + 0.02 * spent["full"]
    note = f"medians of {rounds}"
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
            f"{once}; embedding {spent['embed']:.3g} s, a full build {spent['full']:.3g} s",
        ),
    ]


def change_truth(benchmark: Benchmark, turn: int) -> None:
    """Describe the hazard of one video in other words."""
    rows = read_truth(benchmark.truth)
    rows[turn] = replace(rows[turn], description=f"A car turns for the {turn + 1}. time")
    TRUTH.write(benchmark.truth, rows)


def one_more_video(root: Path, rounds: int = 5) -> list[Measure]:
    """One row: the demo's clips and two of them again; the last comes, unknown to the systems, and goes."""
    (root / "clips").mkdir(parents=True)
    clips: dict[str, Path] = {}
    boxes = []
    demo = sorted((DEMO / "videos").glob("*.mp4"))
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
    """Seven rows, in folders and with a cache of vectors that are thrown away."""
    with tempfile.TemporaryDirectory() as name, patch.dict(os.environ, {"COOOLER_CACHE": f"{name}/cache"}):
        root = Path(name)
        (root / "small").mkdir()
        clips = small_clips(root / "small")
        rows = one_more_video(root / "sixteen")
        for videos, rounds, full_rounds in SCALES:
            rows += board_of(root / str(videos), clips, videos, rounds, full_rounds)
    return rows
