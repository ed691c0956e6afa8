"""Small real H.264 clips that tests write themselves; every frame carries its own index."""

from collections.abc import Sequence
from pathlib import Path

import av
import numpy as np

GREY_STEP = 4  # frame i is grey i * GREY_STEP, far enough apart to survive compression


def write_clip(
    path: Path,
    frame_count: int,
    size: tuple[int, int] = (64, 48),
    container: str | None = None,
    gop: int = 12,
    b_frames: int = 2,
    pictures: Sequence[np.ndarray] | None = None,
    faststart: bool = False,
) -> Path:
    """Write `frame_count` flat grey frames (or `pictures`, RGB) as H.264; gives the path back."""
    options = {"movflags": "faststart"} if faststart else {}
    with av.open(str(path), "w", format=container, options=options) as output:
        stream = output.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = size[0], size[1], "yuv420p"
        stream.options = {"g": str(gop), "bf": str(b_frames), "crf": "10", "threads": "1"}
        for index in range(frame_count):
            if pictures is not None:
                rgb = pictures[index]
            else:
                rgb = np.full((size[1], size[0], 3), index * GREY_STEP % 256, np.uint8)
            output.mux(stream.encode(av.VideoFrame.from_ndarray(rgb, format="rgb24")))
        output.mux(stream.encode())
    return path


def grey_index(rgb: np.ndarray) -> int:
    """The index that a flat grey frame carries (for clips of at most 64 frames)."""
    return round(float(rgb.mean()) / GREY_STEP)
