"""Logos and time stamps drawn over pictures by the tests, which so know every pixel of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.records import RgbImage

WHITE, YELLOW, RED = (255, 255, 255), (255, 220, 0), (230, 40, 40)


@dataclass(frozen=True, slots=True)
class Overlay:
    """What is drawn: its colour, and its coverage (H, W; 0 to 1) on the frame of an index."""

    name: str
    colour: tuple[int, int, int]
    coverage: Callable[[int, int, int], NDArray[Any]]


def words(text: str | Callable[[int], str], x: float, y: float, size: float, thick: int = 1) -> Any:
    """Text (or that of a frame's index); its baseline begins at x, y (shares), its size is for 640 px."""

    def coverage(height: int, width: int, index: int) -> NDArray[Any]:
        canvas = np.zeros((height, width), np.uint8)
        said = text if isinstance(text, str) else text(index)
        place, scale = (round(x * width), round(y * height)), width / 640
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(canvas, said, place, font, size * scale, 255, max(1, ceil(thick * scale)), cv2.LINE_AA)
        return canvas / 255.0

    return coverage


def ellipse(x: float, y: float, rx: float, ry: float, thick: int, inside: str = "") -> Any:
    """An ellipse around x, y with the radii rx, ry (all shares of the width), filled when `thick` is -1."""

    def coverage(height: int, width: int, index: int) -> NDArray[Any]:
        canvas = np.zeros((height, width), np.uint8)
        centre, radii = (round(x * width), round(y * width)), (round(rx * width), round(ry * width))
        cv2.ellipse(canvas, centre, radii, 0, 0, 360, 255, thick, cv2.LINE_AA)
        if inside:
            start = (centre[0] - round(radii[0] * 0.6), centre[1] + round(radii[1] * 0.3))
            font, size = cv2.FONT_HERSHEY_SIMPLEX, width * rx / 45
            cv2.putText(canvas, inside, start, font, size, 255, 1, cv2.LINE_AA)
        return canvas / 255.0

    return coverage


def clock(index: int) -> str:
    """A time stamp whose seconds change."""
    return f"2023-05-14 12:34:{index * 6 // 25 % 60:02d}"


def clock_and_speed(index: int) -> str:
    """A time stamp with more digits that change, and change fast."""
    return f"2023/05/14 12:34:{index % 60:02d} {40 + index % 17} km/h"


OVERLAYS = (
    Overlay("text, top left", WHITE, words("COOOL CAM", 0.02, 0.083, 0.7, 2)),
    Overlay("text, top right", WHITE, words("DriveCam", 0.78, 0.09, 0.8, 2)),
    Overlay("small text, top right", WHITE, words("DashCam HD", 0.83, 0.067, 0.45)),
    Overlay("text, bottom left above the bonnet", WHITE, words("CH1 VIOFO", 0.02, 0.89, 0.6, 2)),
    Overlay("text on the bonnet", WHITE, words("CH1 VIOFO", 0.4, 0.98, 0.5, 1)),
    Overlay("ring with text, top right", WHITE, ellipse(0.914, 0.06, 0.062, 0.037, 2, "TV")),
    Overlay("filled ellipse, top left", RED, ellipse(0.078, 0.063, 0.047, 0.031, -1)),
    Overlay("time stamp, bottom left", WHITE, words(clock, 0.02, 0.89, 0.55)),
    Overlay("time stamp, bottom right, yellow", YELLOW, words(clock, 0.64, 0.89, 0.55)),
    Overlay("time stamp and speed, top left", WHITE, words(clock_and_speed, 0.016, 0.06, 0.5)),
)


def laid_over(frames: Sequence[RgbImage], overlay: Overlay, alpha: float) -> list[RgbImage]:
    """The frames with an overlay of the opacity `alpha`."""
    colour = np.array(overlay.colour, np.float64)
    made = []
    for index, frame in enumerate(frames):
        share = alpha * overlay.coverage(frame.shape[0], frame.shape[1], index)[..., None]
        made.append(np.round(frame * (1 - share) + share * colour).astype(np.uint8))
    return made


def drawn_on(frames: Sequence[RgbImage], overlay: Overlay) -> NDArray[np.bool_]:
    """Every pixel (H, W) that the overlay touches visibly on one of the frames."""
    touched = np.zeros(frames[0].shape[:2], np.bool_)
    for index, frame in enumerate(frames):
        touched |= overlay.coverage(frame.shape[0], frame.shape[1], index) > 0.2
    return touched
