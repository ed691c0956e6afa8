"""Keyframe extraction against a plain sequential decode of the same clips, alone and with two workers."""

import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import av
from av.video.reformatter import VideoReformatter

from bench.timing import Measure, interleaved
from pipeline.records import RgbImage
from pipeline.video import frame_indices, read_keyframes, upright

COUNT = 25
COPIES = 2  # so that both workers have enough to do
WITHOUT_SKIPS = 4  # clips that are made anew with frames that all need each other


def plain_decode(path: Path, thread_type: str, threads: int, skip: str = "DEFAULT") -> int:
    """Decode every frame, but those that FFmpeg is told to skip, and look at none; how many came."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = thread_type
        stream.codec_context.thread_count = threads
        stream.codec_context.skip_frame = skip
        return sum(1 for _ in container.decode(stream))


def threaded_keyframes(path: Path) -> list[RgbImage]:
    """The same pictures by a decoder with as many threads as FFmpeg likes; the header's count is believed."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        stream.codec_context.thread_count = 0
        wanted = set(frame_indices(stream.frames, COUNT))
        reformatter = VideoReformatter()
        frames = enumerate(container.decode(stream))
        return [upright(frame, reformatter) for at, frame in frames if at in wanted]


def without_skips(source: Path, target: Path) -> Path:
    """The clip encoded again without B-frames: each frame is needed by the next, so none can be skipped."""
    with av.open(str(source)) as clip, av.open(str(target), "w") as output:
        given = clip.streams.video[0]
        stream = output.add_stream("libx264", rate=given.average_rate)
        stream.width, stream.height, stream.pix_fmt = given.width, given.height, "yuv420p"
        stream.options = {"bf": "0"}
        for frame in clip.decode(given):
            frame.pict_type = 0  # the encoder chooses; a decoded frame carries that of its source
            output.mux(stream.encode(frame))
        output.mux(stream.encode())
    return target


def keyframes_of(path: Path) -> int:
    """How many keyframes a clip gives: the pictures stay in the process that decoded them."""
    return len(read_keyframes(path, path.stem, COUNT).frames)


def measure(videos: list[Path]) -> list[Measure]:
    """All clips, 25 frames each; the floors use one decoder thread, and FFmpeg's own choice.

    The two workers are there before the clock starts, as they are for all but the first clips of a run.
    """
    many = videos * COPIES
    with (
        tempfile.TemporaryDirectory() as name,
        ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool,
    ):
        chained = [without_skips(path, Path(name) / path.name) for path in videos[:WITHOUT_SKIPS]]
        functions: dict[str, Callable[[], object]] = {
            "ours": lambda: [keyframes_of(path) for path in videos],
            "plain": lambda: [plain_decode(path, "SLICE", 1) for path in videos],
            "decoded": lambda: [plain_decode(path, "AUTO", 0) for path in videos],
            "chained": lambda: [keyframes_of(path) for path in chained],
            "chained, decoded": lambda: [plain_decode(path, "AUTO", 0) for path in chained],
            "two": lambda: list(pool.map(keyframes_of, many)),
            "threaded": lambda: [len(threaded_keyframes(path)) for path in many],
        }
        times = interleaved(functions)
    total = sum(plain_decode(path, "AUTO", 0) for path in videos)
    needed = sum(plain_decode(path, "AUTO", 0, "NONREF") for path in videos)
    what = f"{COUNT} keyframes of {len(videos)} clips"
    threads = "plain decode, threads AUTO"
    return [
        Measure(what, times["ours"], "plain sequential decode, one thread", times["plain"], "at most 1.1"),
        Measure(
            what,
            times["ours"],
            threads,
            times["decoded"],
            "at most 0.9",
            f"no other frame needs {total - needed:,} of {total:,}: they are skipped unless wanted",
        ),
        Measure(
            f"{COUNT} keyframes of {len(chained)} clips without B-frames",
            times["chained"],
            threads,
            times["chained, decoded"],
            "at most 1.0",
            "nothing can be skipped; ours decodes in one thread",
        ),
        Measure(
            f"{COUNT} keyframes of {len(many)} clips, two workers",
            times["two"],
            "the same pictures, serial, threads AUTO",
            times["threaded"],
            "at most 0.8",
        ),
    ]
