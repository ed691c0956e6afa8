"""Keyframe extraction against a plain sequential decode of the same clips, alone and with two workers."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import av
import numpy as np

from bench.timing import Measure, interleaved
from pipeline.records import RgbImage
from pipeline.video import frame_indices, read_keyframes

COUNT = 25
COPIES = 3  # so that both workers have enough to do


def plain_decode(path: Path, thread_type: str, threads: int) -> int:
    """Decode every frame and look at none."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = thread_type
        stream.codec_context.thread_count = threads
        return sum(1 for _ in container.decode(stream))


def threaded_keyframes(path: Path) -> list[RgbImage]:
    """The same pictures by a decoder with as many threads as FFmpeg likes; the header's count is believed."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        stream.codec_context.thread_count = 0
        wanted = set(frame_indices(stream.frames, COUNT))
        frames = enumerate(container.decode(stream))
        return [np.asarray(frame.to_ndarray(format="rgb24")) for at, frame in frames if at in wanted]


def keyframes_of(path: Path) -> int:
    """How many keyframes a clip gives: the pictures stay in the process that decoded them."""
    return len(read_keyframes(path, path.stem, COUNT).frames)


def measure(videos: list[Path]) -> list[Measure]:
    """All clips, 25 frames each; the floors use one decoder thread, and FFmpeg's own choice.

    The two workers are there before the clock starts, as they are for all but the first clips of a run.
    """
    many = videos * COPIES
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        functions: dict[str, Callable[[], object]] = {
            "ours": lambda: [keyframes_of(path) for path in videos],
            "plain": lambda: [plain_decode(path, "SLICE", 1) for path in videos],
            "decoded": lambda: [plain_decode(path, "AUTO", 0) for path in videos],
            "two": lambda: list(pool.map(keyframes_of, many)),
            "threaded": lambda: [len(threaded_keyframes(path)) for path in many],
        }
        times = interleaved(functions)
    what = f"{COUNT} keyframes of {len(videos)} clips"
    return [
        Measure(what, times["ours"], "plain sequential decode, one thread", times["plain"], "at most 1.1"),
        Measure(what, times["ours"], "plain decode, threads AUTO", times["decoded"], ""),
        Measure(
            f"{COUNT} keyframes of {len(many)} clips, two workers",
            times["two"],
            "the same pictures, serial, threads AUTO",
            times["threaded"],
            "at most 0.8",
        ),
    ]
