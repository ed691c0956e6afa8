"""Writing H.264 that browsers play: the same bytes for the same frames, in rate, size and times as asked.

MP4 with the index in front, 4:2:0, limited range, one encoder thread, no sound. 4:2:0 has no odd
sides: an odd picture gets its last row or column once more, at the bottom or right, so that
coordinates stay as they are (ours).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError
from av.video.reformatter import ColorRange, Interpolation, VideoReformatter

from pipeline.errors import OutsideError
from pipeline.files import replacing
from pipeline.records import RgbImage

PRESETS = (
    "ultrafast",
    "superfast",
    "veryfast",
    "faster",
    "fast",
    "medium",
    "slow",
    "slower",
    "veryslow",
)
MAX_CRF = 51

# What ITU-T H.273 calls unspecified. FFmpeg and browsers then assume a matrix, the same for source and copy.
UNSPECIFIED = 2
# H.273's matrix codes that FFmpeg's scaler knows, and its codes for them.
_SCALER_MATRICES = {1: 1, 4: 4, 5: 5, 6: 5, 7: 7, 9: 9}
_PRIMARIES = frozenset({1, 4, 5, 6, 7, 9})
_TRANSFERS = frozenset({1, 4, 5, 6, 7, 13, 14, 15})
# For both ways between RGB and 4:2:0: without these the scaler cuts off fractions, and every passage
# makes a picture one level darker.
EXACT = (
    Interpolation.BICUBIC
    | Interpolation.ACCURATE_RND
    | Interpolation.FULL_CHR_H_INT
    | Interpolation.BITEXACT  # the same on every processor
)


@dataclass(frozen=True, slots=True)
class Colour:
    """Codes of ITU-T H.273: how numbers become colours. Range is not among them: always limited."""

    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED

    @classmethod
    def of(cls, context: Any) -> "Colour":
        """That of a video's codec context, each code unspecified where it is none that we can write."""
        return cls(
            context.color_primaries if context.color_primaries in _PRIMARIES else UNSPECIFIED,
            context.color_trc if context.color_trc in _TRANSFERS else UNSPECIFIED,
            context.colorspace if context.colorspace in _SCALER_MATRICES else UNSPECIFIED,
        )


UNTAGGED = Colour()


def even_size(size_px: tuple[int, int]) -> tuple[int, int]:
    """The (width, height) that a picture of `size_px` has in 4:2:0."""
    return size_px[0] + size_px[0] % 2, size_px[1] + size_px[1] % 2


def write_h264(
    path: Path,
    frames: Iterable[RgbImage | av.VideoFrame],
    *,
    rate: Fraction,
    size: tuple[int, int],
    crf: int = 18,
    preset: str = "medium",
    pts: Sequence[int] | None = None,
    time_base: Fraction | None = None,
    colour: Colour = UNTAGGED,
    sample_aspect: Fraction = Fraction(1),
) -> int:
    """Write frames of `size` (width, height in px) to an MP4, whole or not at all; gives their number.

    Frame i is shown at i / `rate` s or, with `pts` (one a frame, rising), at `pts[i] * time_base`.
    Pictures are uint8 (H, W, 3) or frames of PyAV of any format. Raises ValueError when a frame has
    another size, when there is none, or when `pts` are too few or do not rise, and OutsideError when
    the file cannot be written.
    """
    base = time_base or 1 / rate
    timed = ((frame, at, index) for index, (frame, at) in enumerate(_times(frames, pts)))
    count = 0
    with replacing(path) as temporary:
        try:
            with av.open(
                str(temporary),
                "w",
                format="mp4",
                options={"movflags": "+faststart", "fflags": "+bitexact"},
            ) as output:
                stream = output.add_stream("libx264", rate=rate)
                _set_up(stream, even_size(size), base, colour, sample_aspect)
                stream.options = {
                    "crf": str(crf),
                    "preset": preset,
                    "threads": "1",
                    "flags": "+bitexact",
                    "x264-params": "cpu-independent=1",
                }
                convert = _Converter(size, colour)
                for frame, at, index in timed:
                    picture = convert(frame, index)
                    picture.pts, picture.time_base = at, base
                    output.mux(stream.encode(picture))
                    count += 1
                if count:
                    output.mux(stream.encode())
        except FFmpegError as error:
            raise OutsideError(
                f"{path}: H.264 of {size[0]}x{size[1]} px cannot be written ({error}). "
                "Is the disk full, or the size beyond what the encoder takes?"
            ) from error
        if not count:
            raise ValueError(f"{path}: found no frame; expected at least one")
    return count


def _times(
    frames: Iterable[RgbImage | av.VideoFrame], pts: Sequence[int] | None
) -> Iterator[tuple[RgbImage | av.VideoFrame, int]]:
    last: int | None = None
    for index, frame in enumerate(frames):
        if pts is not None and index >= len(pts):
            raise ValueError(f"found more than {len(pts)} frames; expected one for each of pts")
        at = index if pts is None else pts[index]
        if last is not None and at <= last:
            raise ValueError(f"frame {index}: found pts {at} after {last}; expected rising times")
        last = at
        yield frame, at


def _set_up(
    stream: Any, size: tuple[int, int], base: Fraction, colour: Colour, sample_aspect: Fraction
) -> None:
    stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
    context = stream.codec_context
    context.time_base = base
    context.sample_aspect_ratio = sample_aspect
    context.color_range = ColorRange.MPEG
    context.color_primaries, context.color_trc = colour.primaries, colour.transfer
    context.colorspace = colour.matrix


class _Converter:
    """Pictures of one size as 4:2:0 frames."""

    def __init__(self, size: tuple[int, int], colour: Colour) -> None:
        self._size = size
        self._matrix = _SCALER_MATRICES.get(colour.matrix)
        self._reformatter = VideoReformatter()

    def __call__(self, frame: RgbImage | av.VideoFrame, index: int) -> av.VideoFrame:
        if isinstance(frame, av.VideoFrame):
            found = (frame.width, frame.height)
        else:
            found = (frame.shape[1], frame.shape[0])
        if found != self._size:
            raise ValueError(f"frame {index}: found {found[0]}x{found[1]} px; expected {self._size}")
        odd = found != even_size(found)
        if odd or not isinstance(frame, av.VideoFrame):
            rgb: Any = frame.to_ndarray(format="rgb24") if isinstance(frame, av.VideoFrame) else frame
            if odd:
                rgb = np.pad(rgb, ((0, found[1] % 2), (0, found[0] % 2), (0, 0)), mode="edge")
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb), format="rgb24")
        made = self._reformatter.reformat(
            frame,
            format="yuv420p",
            interpolation=EXACT,
            dst_colorspace=self._matrix,
            dst_color_range=ColorRange.MPEG,
            threads=1,
        )
        made.pict_type = 0  # the encoder chooses; a decoded frame carries that of its source
        return made
