"""Which frames are looked at, and getting them out of a file, exactly and in one pass.

A header's frame count is only a claim, so it is never used to choose the frames.
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError, InvalidDataError

from pipeline.errors import VideoError
from pipeline.records import Box, Frame, RgbImage, Video

MAX_SIDE_PX = 16_384

# A clip is a local file: a playlist disguised as one must not make FFmpeg open anything else.
_LOCAL_ONLY = {"protocol_whitelist": "file"}

av.logging.set_level(None)  # broken clips are reported by us, once


@dataclass(frozen=True, slots=True)
class Keyframes:
    """The sampled frames of a video; `note` says what was odd about the file, or is empty."""

    video: Video
    frames: tuple[Frame, ...]
    note: str


def frame_indices(total: int, count: int = 25) -> tuple[int, ...]:
    """Indices of `count` frames at equal interval out of `total` (paper: N = 25).

    `round(i * total / count)` for i = 0 .. count-1; all frames when there are fewer than
    `count` (ours). Strictly increasing, each in 0 .. total-1.
    """
    if total < 0 or count < 1:
        raise ValueError(f"found total {total} and count {count}; expected total >= 0 and count >= 1")
    if total <= count:
        return tuple(range(total))
    return tuple(round(i * total / count) for i in range(count))


def _open(path: Path) -> InputContainer:
    if not path.is_file():
        raise VideoError(f"{path}: no such file; expected a video.")
    if path.stat().st_size == 0:
        raise VideoError(f"{path}: the file is empty; expected a video. Copy it again.")
    try:
        container = av.open(f"file:{path.resolve()}", options=_LOCAL_ONLY)
    except (FFmpegError, ValueError, OSError) as error:
        raise VideoError(
            f"{path}: not readable as a video ({error.__class__.__name__}); expected a file that FFmpeg "
            "reads. It may be broken or not a video: copy it again or convert it."
        ) from error
    if not container.streams.video:
        container.close()
        raise VideoError(f"{path}: found no video stream; expected one. Is it a sound file?")
    return container


@dataclass(frozen=True, slots=True)
class _Pass:
    """What one decode to the end found; `rgb` holds (time in s, picture) of the wanted frames."""

    rgb: dict[int, tuple[float, RgbImage]]
    total: int
    broken_packets: int


def _decode(path: Path, wanted: Collection[int]) -> _Pass:
    with _open(path) as container:
        stream = container.streams.video[0]
        # One decoder thread: clips run in parallel, and the frames are the same anyway.
        stream.codec_context.thread_count = 1
        rgb: dict[int, tuple[float, RgbImage]] = {}
        size: tuple[int, int] | None = None
        total = broken = 0
        for packet in container.demux(stream):
            try:
                frames = packet.decode()
            except InvalidDataError:
                broken += 1
                continue
            for frame in frames:
                found = (frame.width, frame.height)
                if size is None:
                    size = found
                if found != size:
                    raise VideoError(
                        f"{path}: the frame size changes from {size[0]}x{size[1]} to {found[0]}x{found[1]} "
                        f"px at frame {total}; boxes are in pixels of one size. Re-encode the clip."
                    )
                if max(found) > MAX_SIDE_PX:
                    raise VideoError(f"{path}: frames of {found[0]}x{found[1]} px are too large.")
                if total in wanted:
                    picture = np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
                    turns = round(frame.rotation / 90) % 4
                    upright = np.ascontiguousarray(np.rot90(picture, turns)) if turns else picture
                    rgb[total] = (frame.time or 0.0, upright)
                total += 1
        return _Pass(rgb, total, broken)


def _count_packets(path: Path) -> tuple[int, int, float]:
    """Packets that carry video, frames by the header (0: not stated), fps (0: not stated)."""
    with _open(path) as container:
        stream = container.streams.video[0]
        rate = stream.average_rate or stream.guessed_rate
        packets = sum(1 for packet in container.demux(stream) if packet.size)
        return packets, stream.frames, float(rate) if rate else 0.0


def read_keyframes(path: Path, video_id: str, count: int = 25) -> Keyframes:
    """The `count` frames of `frame_indices`, exact, in one sequential decode.

    Packets are counted first (without decoding), since a header's frame count is only a claim;
    a second decode happens only when packets and decoded frames differ. Raises VideoError when
    the file is missing, empty, not decodable, or changes its frame size.
    """
    try:
        packets, claim, fps_hz = _count_packets(path)
        indices = frame_indices(packets, count)
        decoded = _decode(path, set(indices))
        if decoded.total != packets:
            indices = frame_indices(decoded.total, count)
            decoded = _decode(path, set(indices))
    except FFmpegError as error:
        raise VideoError(f"{path}: decoding failed: {error}. Copy the file again.") from error
    if decoded.total == 0:
        raise VideoError(f"{path}: it holds no frame that can be decoded. Copy the file again.")
    notes = []
    if claim and claim != decoded.total:
        notes.append(f"the header claims {claim} frames, {decoded.total} were decoded")
    if decoded.broken_packets:
        notes.append(f"{decoded.broken_packets} packets could not be decoded")
    if not 0 < fps_hz < 10_000:
        fps_hz = 0.0
        notes.append("the header states no frame rate")
    start_s, first = decoded.rgb[indices[0]]
    height_px, width_px = first.shape[:2]
    frames = tuple(
        Frame(video_id, index, max(0.0, decoded.rgb[index][0] - start_s), decoded.rgb[index][1])
        for index in indices
    )
    video = Video(video_id, path, decoded.total, fps_hz, width_px, height_px)
    return Keyframes(video, frames, "; ".join(notes))


def crop(rgb: RgbImage, box: Box, context: float = 0.0) -> RgbImage | None:
    """The part of a frame (H, W, 3) inside `box`, grown by `context` of its size on every side.

    Cut off at the frame's edges; None when nothing of the box lies inside the frame.
    """
    height_px, width_px = rgb.shape[:2]
    grow_x, grow_y = context * box.width_px, context * box.height_px
    x1 = max(0, int(np.floor(box.x1_px - grow_x)))
    y1 = max(0, int(np.floor(box.y1_px - grow_y)))
    x2 = min(width_px, int(np.ceil(box.x2_px + grow_x)))
    y2 = min(height_px, int(np.ceil(box.y2_px + grow_y)))
    if x1 >= x2 or y1 >= y2:
        return None
    return rgb[y1:y2, x1:x2]
