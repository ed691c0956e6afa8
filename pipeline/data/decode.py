"""Every frame of a clip, in order, one at a time: for tools that need more than the keyframes."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.container import InputContainer
from av.error import FFmpegError, InvalidDataError

from pipeline.data.encode import Colour
from pipeline.errors import VideoError
from pipeline.video import MAX_SIDE_PX, open_clip


@dataclass(frozen=True, slots=True)
class ClipHeader:
    """What a file says of itself without decoding.

    `times` are the packets' presentation times in units of `time_base_s`, rising, from the first one
    on; empty when some packet has none of its own, as in a raw stream. `rate_hz` is 25 when the file
    states none.
    """

    rate_hz: Fraction
    time_base_s: Fraction
    times: tuple[int, ...]
    colour: Colour
    sample_aspect: Fraction

    @property
    def seconds(self) -> list[Fraction]:
        """The presentation times in seconds, as they stand in the file."""
        return [time * self.time_base_s for time in self.times]


def read_header(path: Path) -> ClipHeader:
    """Rate, times and colours of a clip. Raises VideoError when it is not readable."""
    with open_clip(path) as container:
        stream = container.streams.video[0]
        rate = Fraction(stream.average_rate or stream.guessed_rate or 25)
        try:
            found = [packet.pts for packet in container.demux(stream) if packet.size]
        except FFmpegError as error:
            raise VideoError(f"{path}: reading failed: {error}. Copy the file again.") from error
        times = sorted({time for time in found if time is not None})
        return ClipHeader(
            rate if 0 < rate < 10_000 else Fraction(25),
            Fraction(stream.time_base or 1 / rate),
            tuple(times) if len(times) == len(found) else (),
            Colour.of(stream.codec_context),
            Fraction(stream.sample_aspect_ratio or 1),
        )


def decoded(path: Path) -> Generator[av.VideoFrame, None, None]:
    """The frames of a clip as they come out of the decoder, past damaged places.

    Raises VideoError when there is none, when the size changes on the way, or when reading fails.
    """
    size: tuple[int, int] | None = None
    with open_clip(path) as container:
        stream = container.streams.video[0]
        # One decoder thread: clips run in parallel, and the frames are the same anyway.
        stream.codec_context.thread_count = 1
        for frame in _frames(path, container, stream):
            found = (frame.width, frame.height)
            size = size or found
            if found != size or max(found) > MAX_SIDE_PX:
                raise VideoError(
                    f"{path}: found a frame of {found[0]}x{found[1]} px after {size[0]}x{size[1]}; expected "
                    f"one size, at most {MAX_SIDE_PX} px a side. Re-encode the clip."
                )
            yield frame
    if size is None:
        raise VideoError(f"{path}: it holds no frame that can be decoded. Copy the file again.")


def size_of(path: Path) -> tuple[int, int]:
    """Width and height of a clip as it is shown, in px, told by its first frame. Raises as `decoded` does."""
    frames = decoded(path)
    first = next(frames)
    frames.close()
    return (first.height, first.width) if round(first.rotation / 90) % 2 else (first.width, first.height)


def _frames(path: Path, container: InputContainer, stream: Any) -> Iterator[av.VideoFrame]:
    try:
        for packet in container.demux(stream):
            try:
                frames = packet.decode()
            except InvalidDataError:
                continue
            yield from frames
    except FFmpegError as error:
        raise VideoError(f"{path}: decoding failed: {error}. Copy the file again.") from error
