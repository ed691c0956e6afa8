"""Which frames are looked at, and getting them out of a file, exactly and in one pass.

A header's frame count is only a claim, so it is never used to choose the frames.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError, InvalidDataError
from av.video.reformatter import VideoReformatter

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


def open_clip(path: Path) -> InputContainer:
    """A local file, open for decoding. Raises VideoError when it is none that holds video."""
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


def upright(
    frame: av.VideoFrame, reformatter: VideoReformatter, interpolation: int | None = None
) -> RgbImage:
    """A decoded frame as RGB (H, W, 3), turned as the file says it is to be shown."""
    # One thread: FFmpeg would cut each frame in stripes, and waking threads costs more than a conversion.
    made = reformatter.reformat(frame, format="rgb24", interpolation=interpolation, threads=1)
    picture = np.asarray(made.to_ndarray(), np.uint8)
    turns = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(picture, turns)) if turns else picture


@dataclass(frozen=True, slots=True)
class _Index:
    """What a file's packets say without decoding: `order` maps a presentation time to its frame."""

    packets: int
    order: Mapping[int, int]
    claimed: int
    fps_hz: float

    @property
    def is_sound(self) -> bool:
        """Whether every packet has a presentation time of its own."""
        return len(self.order) == self.packets


@dataclass(frozen=True, slots=True)
class _Decoded:
    """What decoding found; `rgb` holds (time in s, picture) of the wanted frames."""

    rgb: dict[int, tuple[float, RgbImage]]
    total: int
    broken_packets: int


class _Reader:
    """Takes frames of one size, and the pictures of those that are wanted."""

    def __init__(self, path: Path, wanted: Collection[int]) -> None:
        self.rgb: dict[int, tuple[float, RgbImage]] = {}
        self._path = path
        self._wanted = wanted
        self._size: tuple[int, int] | None = None
        # One for all frames: each new one would set up the colour conversion again.
        self._reformatter = VideoReformatter()

    def take(self, index: int, frame: av.VideoFrame) -> None:
        found = (frame.width, frame.height)
        if self._size is None:
            self._size = found
        if found != self._size:
            raise VideoError(
                f"{self._path}: the frame size changes from {self._size[0]}x{self._size[1]} to "
                f"{found[0]}x{found[1]} px at frame {index}; boxes are in pixels of one size. "
                "Re-encode the clip."
            )
        if max(found) > MAX_SIDE_PX:
            raise VideoError(f"{self._path}: frames of {found[0]}x{found[1]} px are too large.")
        if index in self._wanted:
            self.rgb[index] = (frame.time or 0.0, upright(frame, self._reformatter))


def _read_index(path: Path) -> _Index:
    with open_clip(path) as container:
        stream = container.streams.video[0]
        rate = stream.average_rate or stream.guessed_rate
        times = [packet.pts for packet in container.demux(stream) if packet.size]
        known = sorted({time for time in times if time is not None})
        order = {time: index for index, time in enumerate(known)}
        return _Index(len(times), order, stream.frames, float(rate) if rate else 0.0)


def _decode_wanted(path: Path, index: _Index, wanted: Collection[int]) -> _Decoded | None:
    """Decode what the wanted frames need and no more; None when the file is not what it seems.

    Frames that no other frame refers to are skipped by the decoder unless they are wanted.
    """
    reader = _Reader(path, wanted)
    with open_clip(path) as container:
        stream = container.streams.video[0]
        context = stream.codec_context
        context.thread_count = 1
        try:
            for packet in container.demux(stream):
                place = None if packet.pts is None else index.order.get(packet.pts)
                skippable = packet.size and place is not None and place not in wanted
                context.skip_frame = "NONREF" if skippable else "DEFAULT"
                for frame in packet.decode():
                    at = None if frame.pts is None else index.order.get(frame.pts)
                    if at is None or frame.is_corrupt:
                        return None
                    reader.take(at, frame)
        except InvalidDataError:
            return None
    return _Decoded(reader.rgb, index.packets, 0) if len(reader.rgb) == len(wanted) else None


def _decode_all(path: Path, wanted: Collection[int]) -> _Decoded:
    """Decode everything there is, past damaged places, and count the frames as they come."""
    reader = _Reader(path, wanted)
    total = broken = 0
    with open_clip(path) as container:
        stream = container.streams.video[0]
        # One decoder thread: clips run in parallel, and the frames are the same anyway.
        stream.codec_context.thread_count = 1
        for packet in container.demux(stream):
            try:
                frames = packet.decode()
            except InvalidDataError:
                broken += 1
                continue
            for frame in frames:
                reader.take(total, frame)
                total += 1
    return _Decoded(reader.rgb, total, broken)


def read_keyframes(path: Path, video_id: str, count: int = 25) -> Keyframes:
    """The `count` frames of `frame_indices`, exact, in one sequential pass over the file.

    Packets are counted first (without decoding), since a header's frame count is only a claim.
    A file whose packets cannot be trusted (no times, damage) is decoded whole, and the frames are
    chosen from what comes out. Raises VideoError when the file is missing, empty, not decodable,
    or changes its frame size.
    """
    try:
        index = _read_index(path)
        indices = frame_indices(index.packets, count)
        decoded = _decode_wanted(path, index, set(indices)) if index.is_sound else None
        if decoded is None:
            decoded = _decode_all(path, set(indices))
            if decoded.total != index.packets:
                indices = frame_indices(decoded.total, count)
                decoded = _decode_all(path, set(indices))
    except FFmpegError as error:
        raise VideoError(f"{path}: decoding failed: {error}. Copy the file again.") from error
    if decoded.total == 0:
        raise VideoError(f"{path}: it holds no frame that can be decoded. Copy the file again.")
    notes = []
    if index.claimed and index.claimed != decoded.total:
        notes.append(f"the header claims {index.claimed} frames, {decoded.total} were decoded")
    if decoded.broken_packets:
        notes.append(f"{decoded.broken_packets} packets could not be decoded")
    fps_hz = index.fps_hz
    if not 0 < fps_hz < 10_000:
        fps_hz = 0.0
        notes.append("the header states no frame rate")
    start_s, first = decoded.rgb[indices[0]]
    height_px, width_px = first.shape[:2]
    frames = tuple(
        Frame(video_id, at, max(0.0, decoded.rgb[at][0] - start_s), decoded.rgb[at][1]) for at in indices
    )
    video = Video(video_id, path, decoded.total, fps_hz, width_px, height_px)
    return Keyframes(video, frames, "; ".join(notes))


def probe(path: Path, video_id: str) -> Video:
    """Frame count, frame rate and upright frame size of a file, decoding as little as that takes.

    The packets are counted; a file whose packets cannot be trusted is decoded whole. The size is the
    first frame's: what the header states is only a claim. Raises VideoError as `read_keyframes` does,
    except that damage behind the first frame may go unseen.
    """
    try:
        index = _read_index(path)
        with open_clip(path) as container:
            container.streams.video[0].codec_context.thread_count = 1
            reader = _Reader(path, {0})
            for frame in container.decode(video=0):
                reader.take(0, frame)
                break
        total = index.packets if index.is_sound else _decode_all(path, ()).total
    except FFmpegError as error:
        raise VideoError(f"{path}: decoding failed: {error}. Copy the file again.") from error
    if not reader.rgb or not total:
        raise VideoError(f"{path}: it holds no frame that can be decoded. Copy the file again.")
    height_px, width_px = reader.rgb[0][1].shape[:2]
    fps_hz = index.fps_hz if 0 < index.fps_hz < 10_000 else 0.0
    return Video(video_id, path, total, fps_hz, width_px, height_px)


def crop(rgb: RgbImage, box: Box) -> RgbImage | None:
    """The part of a frame (H, W, 3) inside `box`, rounded outwards to whole pixels.

    Cut off at the frame's edges; None when nothing of the box lies inside the frame.
    """
    height_px, width_px = rgb.shape[:2]
    x1, y1 = max(0, int(np.floor(box.x1_px))), max(0, int(np.floor(box.y1_px)))
    x2, y2 = min(width_px, int(np.ceil(box.x2_px))), min(height_px, int(np.ceil(box.y2_px)))
    if x1 >= x2 or y1 >= y2:
        return None
    return rgb[y1:y2, x1:x2]
