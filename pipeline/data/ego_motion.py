"""How fast what a dashcam sees grows, frame by frame: a stand-in for the vehicle's own speed (ours).

Driving ahead, everything that stands still grows around the point that is driven to, by speed over
distance: the scene's expansion, in 1/s. It is measured on corners tracked by optical flow (pyramidal
Lucas-Kanade: only textured places count, as an empty road or sky has no motion to measure) as the median
change of the distances between them. Distances do not change when the camera turns, so bends and a
shaking camera count little. Corners in boxes are left out: other road users move by themselves.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
from av.video.reformatter import VideoReformatter
from numpy.typing import NDArray

from pipeline.data.decode import decoded, read_header
from pipeline.records import Box, TrackBox

Real: TypeAlias = NDArray[np.float64]
Grey: TypeAlias = NDArray[np.uint8]  # (H, W)

WIDTH_PX = 320  # of the frames that are looked at; small, as the median needs many corners, not fine ones
MAX_CORNERS = 120
LEAST_CORNERS = 12
LEAST_DISTANCE_PX = 12.0  # nearer pairs say more about rounding than about growth
LEAST_BACK_PX = 0.5  # a corner tracked there and back must return this near
BAND = (0.15, 0.85)  # of the height: bonnet below, and stamped dates above and below, never move
AHEAD = (1 / 3, 2 / 3)  # of the width: tracks whose centre is there are ahead

_QUALITY = 0.01  # of the best corner
_SPACING_PX = 6.0
_WINDOW_PX = (15, 15)


@dataclass(frozen=True, slots=True)
class Motion:
    """Growth in 1/s from each frame to the next but for the first, which has none: both (n,), NaN unknown.

    `flow_hz` is of the scene outside the boxes, `boxes_hz` of the tracks ahead (their sides).
    """

    fps_hz: float
    flow_hz: Real
    boxes_hz: Real


def measure(clip: Path, boxes: Sequence[TrackBox]) -> Motion:
    """The motion in a clip, every frame decoded once. Raises VideoError when it cannot be."""
    by_frame: dict[int, dict[str, Box]] = {}
    for row in boxes:
        by_frame.setdefault(row.frame_index, {})[row.track_id] = row.box
    fps_hz = float(read_header(clip).rate_hz)
    flow, closing = [np.nan], [np.nan]
    before: Grey | None = None
    for index, (grey, scale) in enumerate(_greys(clip)):
        if before is not None:
            there, here = by_frame.get(index - 1, {}), by_frame.get(index, {})
            flow.append(fps_hz * growth(*_corners(before, grey, there.values(), scale)))
            closing.append(fps_hz * closing_of(there, here, grey.shape[1] / scale))
        before = grey
    return Motion(fps_hz, np.array(flow), np.array(closing))


def growth(before: Real, after: Real) -> float:
    """Logarithm of the median change of the distances between points, (P, 2) px each; NaN for too few."""
    if len(before) < LEAST_CORNERS:
        return float("nan")
    first, second = np.triu_indices(len(before), 1)
    old = np.linalg.norm(before[first] - before[second], axis=1)
    new = np.linalg.norm(after[first] - after[second], axis=1)
    apart = (old >= LEAST_DISTANCE_PX) & (new > 0)
    return float(np.log(np.median(new[apart] / old[apart]))) if apart.any() else float("nan")


def closing_of(before: Mapping[str, Box], after: Mapping[str, Box], width_px: float) -> float:
    """Logarithm of the median growth of the sides of the tracks ahead in two frames; NaN without any."""
    grown = []
    for track in sorted(before.keys() & after.keys()):
        old, new = before[track], after[track]
        centre = (new.x1_px + new.x2_px) / 2 / width_px
        if AHEAD[0] <= centre <= AHEAD[1] and old.area_px2 > 0 and new.area_px2 > 0:
            grown.append(0.5 * np.log(new.area_px2 / old.area_px2))
    return float(np.median(grown)) if grown else float("nan")


def _greys(clip: Path) -> Iterator[tuple[Grey, float]]:
    """The frames as small upright grey pictures, and how much smaller they are than the frames."""
    reformatter = VideoReformatter()
    for frame in decoded(clip):
        width = min(WIDTH_PX, frame.width)
        height = max(1, round(frame.height * width / frame.width))
        made = reformatter.reformat(frame, width=width, height=height, format="gray", threads=1)
        small = made.to_ndarray()
        yield np.ascontiguousarray(np.rot90(small, round(frame.rotation / 90) % 4)), width / frame.width


def _corners(before: Grey, after: Grey, boxes: Any, scale: float) -> tuple[Real, Real]:
    """Corners of a frame and where they are in the next, (P, 2) px each."""
    height, width = before.shape
    mask = np.zeros_like(before)
    mask[round(BAND[0] * height) : round(BAND[1] * height)] = 255
    for box in boxes:
        sides = np.array([box.x1_px, box.y1_px, box.x2_px, box.y2_px]) * scale
        x1, y1, x2, y2 = np.clip(sides, 0, [width, height, width, height])
        mask[int(y1) : int(np.ceil(y2)), int(x1) : int(np.ceil(x2))] = 0
    found: Any = cv2.goodFeaturesToTrack(before, MAX_CORNERS, _QUALITY, _SPACING_PX, mask=mask)
    if found is None:
        return np.empty((0, 2)), np.empty((0, 2))
    there, kept = _tracked(before, after, found)
    back, kept_back = _tracked(after, before, there)
    start, end, again = (np.asarray(part, np.float64).reshape(-1, 2) for part in (found, there, back))
    good = kept & kept_back & (np.linalg.norm(again - start, axis=1) <= LEAST_BACK_PX)
    return start[good], end[good]


def _tracked(before: Grey, after: Grey, points: Any) -> tuple[Any, NDArray[np.bool_]]:
    """Where points (P, 1, 2) of one picture are in another, and which of them were found there."""
    guess: Any = None
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, points, guess, winSize=_WINDOW_PX, maxLevel=3)
    return there, np.asarray(found).ravel() == 1
