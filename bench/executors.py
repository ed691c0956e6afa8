"""The embedded pipeline on the demo's clips, each three times: one process against two."""

import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from bench.timing import Measure
from pipeline.benchmark import Benchmark
from pipeline.config import RunConfig
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.places import Place
from pipeline.run import find_videos, predict
from pipeline.tables import BOXES

ROUNDS = 3
COPIES = 3  # a run of a few seconds would measure how long processes take to start


def measure(benchmark: Benchmark) -> list[Measure]:
    """Whole runs in new folders, in turns; the models are open in this process, not in new ones."""
    times: dict[int, list[float]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory() as folder:
        videos = Path(folder) / "videos"
        videos.mkdir()
        boxes = []
        for copy in range(COPIES):
            for path in sorted(benchmark.videos.glob("*.mp4")):
                (videos / f"{path.stem}-{copy}.mp4").symlink_to(path)
            boxes += [replace(box, video_id=f"{box.video_id}-{copy}") for box in BOXES.read(benchmark.boxes)]
        clips = find_videos(Place(str(videos)))
        for turn in range(ROUNDS):
            for workers, taken in times.items():
                executor = SerialExecutor() if workers == 1 else ProcessExecutor(workers)
                start = time.perf_counter()
                predict(clips, boxes, RunConfig(), Place(str(Path(folder) / f"{turn}-{workers}")), executor)
                taken.append(time.perf_counter() - start)
    two, one = statistics.median(times[2]), statistics.median(times[1])
    note = f"{one / two:.2f} times as fast; starting the processes included"
    return [
        Measure(
            f"embedded pipeline, {len(clips)} clips, two processes", two, "one", one, "at most 0.625", note
        )
    ]
