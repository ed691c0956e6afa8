"""The embedded pipeline in one process, in two and on Ray, and how far this machine's two cores reach.

What two processes gain is bounded by what two cores gain: they share memory, caches and turbo. So the
bare model calls are timed in one process and in two, in the same rounds.
"""

import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from bench.embedding import sentences
from bench.timing import Measure, interleaved
from pipeline.benchmark import Benchmark
from pipeline.classifier import SIDE_PX, CropClassifier, open_classifier
from pipeline.config import RunConfig
from pipeline.errors import ModelMissingError
from pipeline.execute import ProcessExecutor, RayExecutor, SerialExecutor
from pipeline.interfaces import Executor
from pipeline.minilm import OnnxEmbedder, find_embedder
from pipeline.places import Place
from pipeline.records import RgbImage
from pipeline.run import find_videos, predict
from pipeline.tables import BOXES

CLIPS = 6
CALLS = 6  # an even number: two processes make half of them each
CROPS = 20
CAPTIONS = 24


@cache
def _models() -> tuple[CropClassifier, OnnxEmbedder]:
    """Both models, one thread each, as the pipeline opens them."""
    root = find_embedder()
    if root is None:
        raise ModelMissingError("The benchmark needs the packaged embedder: see `coooler models`.")
    return open_classifier(threads=1), OnnxEmbedder(root, threads=1)


def model_calls(count: int) -> int:
    """`count` times what a keyframe or two asks of the models: crops in pairs, and captions."""
    classifier, embedder = _models()
    pair: list[RgbImage] = [np.full((SIDE_PX, SIDE_PX, 3), grey, np.uint8) for grey in (60, 190)]
    for _ in range(count):
        for _ in range(CROPS // 2):
            classifier.logits(pair)
        embedder.embed(sentences(CAPTIONS))
    return count


def measure(benchmark: Benchmark) -> list[Measure]:
    """Whole runs in new folders, in turns.

    Two processes start anew in each run. What that takes, with the opening of models, is measured by
    runs of two more clips, with the others and without them; Ray and the serial runs are warm.
    """
    import ray

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = sorted(benchmark.videos.glob("*.mp4"))[-CLIPS:]
        clips = [Place(str(path)) for path in paths]
        boxes = BOXES.read(benchmark.boxes)
        more = folder / "more"
        more.mkdir()
        for copy in ("a", "b"):
            (more / f"{paths[0].stem}-{copy}.mp4").symlink_to(paths[0])
            mine = [box for box in boxes if box.video_id == paths[0].stem]
            boxes += [replace(box, video_id=f"{paths[0].stem}-{copy}") for box in mine]
        two_more = find_videos(Place(str(more)))
        runs = iter(range(1_000))

        def run(executor: Executor, chosen: list[Place]) -> None:
            predict(chosen, boxes, RunConfig(), Place(str(folder / f"{next(runs)}")), executor)

        ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            functions: dict[str, Callable[[], object]] = {
                "one": lambda: run(SerialExecutor(), clips),
                "two": lambda: run(ProcessExecutor(2), [*clips, *two_more]),
                "two more": lambda: run(ProcessExecutor(2), two_more),
                "ray": lambda: run(RayExecutor(), clips),
                "calls in one": lambda: model_calls(CALLS),
                "calls in two": lambda: list(pool.map(model_calls, [CALLS // 2] * 2)),
            }
            times = interleaved(functions)
        ray.shutdown()
    two = times["two"] - times["two more"]
    faster = times["one"] / two
    bound = times["calls in one"] / times["calls in two"]
    what = f"embedded pipeline, {len(clips)} clips"
    return [
        Measure(
            f"{what}, two processes",
            two,
            "one",
            times["one"],
            "at most 0.556 (1.8 times as fast)",
            f"{faster:.2f} times as fast, {faster / bound:.2f} of what two cores allow the models",
        ),
        Measure(
            f"{what}, Ray on two cores, warm",
            times["ray"],
            "one",
            times["one"],
            "at most 0.556 (1.8 times as fast)",
            f"{times['one'] / times['ray']:.2f} times as fast",
        ),
        Measure(
            "bare model calls, two processes",
            times["calls in two"],
            "one",
            times["calls in one"],
            "",
            f"{bound:.2f} times as fast: what two cores allow",
        ),
        Measure(
            "two clips in two new processes, models opened",
            times["two more"],
            "",
            None,
            "",
            "once a run, whatever its length; left out above",
        ),
    ]
