"""Keyframe extraction against a plain sequential decode of the same clips."""

from pathlib import Path

import av

from bench.timing import Measure, interleaved
from pipeline.video import read_keyframes


def plain_decode(path: Path, thread_type: str, threads: int) -> int:
    """Decode every frame and look at none."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = thread_type
        stream.codec_context.thread_count = threads
        return sum(1 for _ in container.decode(stream))


def measure(videos: list[Path]) -> list[Measure]:
    """All clips, 25 frames each; the floors use one decoder thread, and FFmpeg's own choice."""

    def ours() -> None:
        for path in videos:
            read_keyframes(path, path.stem, 25)

    def plain() -> None:
        for path in videos:
            plain_decode(path, "SLICE", 1)

    def threaded() -> None:
        for path in videos:
            plain_decode(path, "AUTO", 0)

    times = interleaved({"ours": ours, "plain": plain, "threaded": threaded})
    what = f"25 keyframes of {len(videos)} clips"
    return [
        Measure(what, times["ours"], "plain sequential decode, one thread", times["plain"], "at most 1.1"),
        Measure(what, times["ours"], "plain decode, threads AUTO", times["threaded"], "(later)"),
    ]
