"""Clips cut from raw videos by a plan: the same bytes every time, for one build of the encoder."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import floor
from pathlib import Path

import av
from av.filter import Graph

from pipeline.data.decode import decoded, read_header
from pipeline.data.encode import write_h264
from pipeline.data.plan import ClipPlan, Plan
from pipeline.errors import CooolerError, VideoError


@dataclass(frozen=True, slots=True)
class CutJob:
    """A clip to cut: from which file, into which, and how."""

    clip: ClipPlan
    plan: Plan
    source: Path
    target: Path


@dataclass(frozen=True, slots=True)
class Cut:
    """What became of a clip; `error` is empty when it was cut."""

    video_id: str
    frames: int
    error: str = ""


def chosen_frames(
    seconds: Sequence[Fraction], start: Fraction, rate: Fraction, count: int
) -> tuple[int, ...]:
    """Which frames of a source the `count` frames of a clip show.

    From `start` on, each source frame falls where its time, rounded (half up) to the clip's rate, is;
    the clip begins with the first of them, and between two the earlier one is shown. So sources with
    more frames lose some, those with fewer have some repeated. `seconds` rise. Raises ValueError when the
    source ends before the clip does.
    """
    first = bisect_left(seconds, start)
    usual = (seconds[-1] - seconds[0]) / (len(seconds) - 1) if len(seconds) > 1 else 1 / rate
    if first == len(seconds) or seconds[-1] + usual <= start + (count - 1) / rate:
        end = float(seconds[-1] + usual) if seconds else 0.0
        raise ValueError(f"it ends at {end:.3f} s; expected at least {float(start + count / rate):.3f} s")
    half = Fraction(1, 2)
    begin = floor((seconds[first] - start) * rate + half)
    limits = (start + (begin + k + half) / rate for k in range(count))
    return tuple(bisect_left(seconds, limit) - 1 for limit in limits)


def cut_clip(job: CutJob) -> Cut:
    """Cut one clip. What is wrong with it is said, not raised, so that the others go on."""
    clip, plan = job.clip, job.plan
    try:
        header = read_header(job.source)
        if not header.times:
            raise VideoError(f"{job.source}: found frames without times. Remux it into an MP4.")
        try:
            wanted = chosen_frames(header.seconds, clip.start, plan.rate, clip.frames)
        except ValueError as error:
            raise VideoError(f"{job.source}: {error}. Mend start_s or frames.") from error
        times = [header.times[index] for index in wanted]
        count = write_h264(
            job.target,
            pictures(job.source, times, plan.size_px),
            rate=plan.rate,
            size=plan.size_px,
            crf=clip.crf,
            preset=plan.preset,
            colour=header.colour,
        )
    except CooolerError as error:
        return Cut(clip.video_id, 0, f"{clip.video_id}: {error}")
    return Cut(clip.video_id, count)


def pictures(source: Path, times: Sequence[int], size_px: tuple[int, int]) -> Iterator[av.VideoFrame]:
    """The frames with these presentation times (rising, may repeat), scaled to (width, height) px.

    Lanczos, with the scaler's exact arithmetic: its fast one differs between processors. Raises
    VideoError for a frame that cannot be decoded.
    """
    graph: Graph | None = None
    place = 0
    for frame in decoded(source):
        if place == len(times):
            return
        if frame.pts != times[place] or frame.is_corrupt:
            continue
        graph = graph or _scaler(frame, size_px)
        graph.vpush(frame)
        scaled = graph.vpull()
        while place < len(times) and times[place] == frame.pts:
            yield scaled
            place += 1
    if place < len(times):
        raise VideoError(f"{source}: found no whole frame at time {times[place]}. Copy the file again.")


def _scaler(frame: av.VideoFrame, size_px: tuple[int, int]) -> Graph:
    graph = Graph()
    source = graph.add(
        "buffer",
        f"video_size={frame.width}x{frame.height}:pix_fmt={frame.format.name}:time_base={frame.time_base}"
        f":pixel_aspect=1/1:colorspace={int(frame.colorspace)}:range={int(frame.color_range)}",
    )
    scale = graph.add("scale", f"{size_px[0]}:{size_px[1]}:flags=lanczos+accurate_rnd+bitexact")
    sink = graph.add("buffersink")
    source.link_to(scale)
    scale.link_to(sink)
    graph.configure()
    return graph
