"""What moves in a clip against its surroundings: boxes for clips that nobody annotated. Source: ours.

The camera's own motion between two frames is a homography, fitted to sparse features and taken off; dense
optical flow finds what is left. A homography holds for a turning camera and for a plane, so before a camera
that drives forward everything near still moves, and what drives along with it hardly does. So a pixel is
held against the mean flow around it: what stands out moves by itself, or is much nearer than what is behind.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.linking import Candidate, iou
from pipeline.records import Box, RgbImage

Grey = NDArray[np.uint8]

_SEED = 7  # of OpenCV's RANSAC
_LEAST_FEATURES = 12
_RANSAC_PX = 1.5
_MAD_TO_SIGMA = 1.4826
_SAME_IOU = 0.7


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Sizes are shares of the frame's, so that they hold for every clip.

    Frames are reduced to `width_px`; every `every_frames`th is compared with the one `gap_frames` before
    it. The flow around a pixel is the mean over squares of `surroundings` (shares of the width); the
    difference from it is divided by 1 + `parallax` times that mean in px, for what is near is uneven. What
    then exceeds `least_px` and the median by `sigmas` robust standard deviations is moving; so are the
    parts of it that exceed `levels` times as much. Of each, the `per_frame` strongest components are kept.
    """

    width_px: int = 480
    gap_frames: int = 3
    every_frames: int = 2
    features: int = 400
    surroundings: tuple[float, ...] = (0.1, 0.27)
    parallax: float = 0.3
    least_px: float = 0.5
    sigmas: float = 1.0
    levels: tuple[float, ...] = (1.0, 1.7, 3.0)
    min_side: float = 0.02
    min_area: float = 0.0008
    max_area: float = 0.35
    per_frame: int = 12


@contextmanager
def single_threaded() -> Iterator[None]:
    """OpenCV in one thread: dense flow is cut into stripes by threads, and its result depends on them."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def motion_boxes(frames: Iterable[RgbImage], settings: MotionSettings) -> list[Candidate]:
    """What moves in the frames of a clip, (H, W, 3) each; boxes are in the frames' pixels.

    The first `gap_frames` frames have nothing to be compared with.
    """
    found: list[Candidate] = []
    past: deque[Grey] = deque(maxlen=settings.gap_frames)
    with single_threaded():
        for index, rgb in enumerate(frames):
            grey = _reduced(rgb, settings.width_px)
            if len(past) == settings.gap_frames and index % settings.every_frames == 0:
                scale_x, scale_y = rgb.shape[1] / grey.shape[1], rgb.shape[0] / grey.shape[0]
                for box, score in moving(past[0], grey, settings):
                    full = Box(
                        box.x1_px * scale_x, box.y1_px * scale_y, box.x2_px * scale_x, box.y2_px * scale_y
                    )
                    found.append(Candidate(index, full, score))
            past.append(grey)
    return found


def moving(before: Grey, after: Grey, settings: MotionSettings) -> list[tuple[Box, float]]:
    """Boxes of what moved between two pictures (H, W), in pixels of `after`, the strongest first.

    Scores are in [0.5, 1): a motion of just the threshold has 0.5, of three times as much 0.75. Boxes may
    lie in one another, but no two are nearly the same.
    """
    flow, known = residual_flow(before, after, settings.features)
    if not known.any():
        return []
    found: list[tuple[Box, float]] = []
    for share in settings.surroundings:
        strength = _standing_out(flow, known, max(3, round(share * after.shape[1])), settings.parallax)
        middle = float(np.median(strength[known]))
        spread = _MAD_TO_SIGMA * float(np.median(np.abs(strength[known] - middle)))
        limit = max(settings.least_px, middle + settings.sigmas * spread)
        for level in settings.levels:
            mask = np.where(known & (strength > limit * level), 255, 0).astype(np.uint8)
            mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, _disc(3)), np.uint8)
            mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(5)), np.uint8)
            found += _components(mask, strength, limit, settings)
    found.sort(key=lambda pair: (-pair[1], pair[0].x1_px, pair[0].y1_px, pair[0].x2_px, pair[0].y2_px))
    kept: list[tuple[Box, float]] = []
    for box, score in found:
        if all(iou(box, other) <= _SAME_IOU for other, _ in kept):
            kept.append((box, score))
    return kept


def _standing_out(
    flow: NDArray[np.float32], known: NDArray[np.bool_], side_px: int, parallax: float
) -> NDArray[np.float32]:
    """How far each pixel's flow is from the mean of the known flow around it, (H, W)."""
    square = (side_px, side_px)
    weight = known.astype(np.float32)
    total = cv2.blur(flow * weight[..., None], square, borderType=cv2.BORDER_REFLECT)
    mean = total / np.maximum(cv2.blur(weight, square, borderType=cv2.BORDER_REFLECT), 1e-3)[..., None]
    difference = flow - mean
    out = np.hypot(difference[..., 0], difference[..., 1])
    out /= 1 + parallax * np.hypot(mean[..., 0], mean[..., 1])
    return np.asarray(out, np.float32)


def residual_flow(
    before: Grey, after: Grey, features: int = 400
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Dense flow (H, W, 2) from `after` back to `before` without the camera's, in px, and where it is known.

    A pixel is not known where the camera had not looked before.
    """
    height, width = after.shape
    to_after = camera_motion(before, after, features)
    warped = cv2.warpPerspective(before, to_after, (width, height), borderMode=cv2.BORDER_REPLICATE)
    known = cv2.warpPerspective(np.full(before.shape, 255, np.uint8), to_after, (width, height))
    dense = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = dense.calc(after, warped, None)  # type: ignore[call-overload]
    return np.asarray(flow, np.float32), cv2.erode(known, _disc(9)) == 255


def camera_motion(before: Grey, after: Grey, features: int = 400) -> NDArray[np.float64]:
    """The homography (3, 3) from `before` to `after` that most features agree on.

    An affine similarity where no sound homography is found, the identity where the pictures show too
    little to tell.
    """
    corners = cv2.goodFeaturesToTrack(before, features, 0.01, 7)
    if corners is None or len(corners) < _LEAST_FEATURES:
        return np.eye(3)
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, None)  # type: ignore[call-overload]
    back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None)  # type: ignore[call-overload]
    came_back = np.linalg.norm((back - corners).reshape(-1, 2), axis=1) < 1
    sure = (found.ravel() == 1) & (returned.ravel() == 1) & came_back
    if int(sure.sum()) < _LEAST_FEATURES:
        return np.eye(3)
    cv2.setRNGSeed(_SEED)
    matrix, inliers = cv2.findHomography(corners[sure], there[sure], cv2.RANSAC, _RANSAC_PX)
    if matrix is not None and inliers.sum() >= _LEAST_FEATURES and _is_sound(matrix, before.shape):
        return np.asarray(matrix, np.float64)
    cv2.setRNGSeed(_SEED)
    partial, _ = cv2.estimateAffinePartial2D(
        corners[sure], there[sure], method=cv2.RANSAC, ransacReprojThreshold=_RANSAC_PX
    )
    affine = np.eye(3) if partial is None else np.vstack([partial, [0.0, 0.0, 1.0]])
    return affine if _is_sound(affine, before.shape) else np.eye(3)


def _is_sound(matrix: NDArray[np.float64], shape: tuple[int, ...]) -> bool:
    """Whether a camera could have moved so: no corner of the picture goes further than half its width."""
    height, width = shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64)
    if not np.isfinite(matrix).all():
        return False
    moved = cv2.perspectiveTransform(corners.reshape(-1, 1, 2), matrix).reshape(-1, 2)
    return bool((np.abs(moved - corners) < width / 2).all())  # NaN is no sound place either


def _components(
    mask: Grey, strength: NDArray[np.float32], limit: float, settings: MotionSettings
) -> list[tuple[Box, float]]:
    height, width = mask.shape
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    found = []
    for number, (x, y, wide, high, area) in enumerate(stats.tolist()):
        share = area / (height * width)
        big_enough = share >= settings.min_area and min(wide, high) >= settings.min_side * width
        if number and big_enough and share <= settings.max_area:
            part = labels[y : y + high, x : x + wide] == number
            strong = float(strength[y : y + high, x : x + wide][part].mean())
            found.append((Box(float(x), float(y), float(x + wide), float(y + high)), strong))
    found.sort(key=lambda pair: (-pair[1], pair[0].x1_px, pair[0].y1_px))
    return [
        (box, max(strong, limit) / (max(strong, limit) + limit))
        for box, strong in found[: settings.per_frame]
    ]


def _reduced(rgb: RgbImage, width_px: int) -> Grey:
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    if grey.shape[1] > width_px:
        high = max(16, round(grey.shape[0] * width_px / grey.shape[1]))
        grey = cv2.resize(grey, (width_px, high), interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8)


def _disc(side_px: int) -> Grey:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side_px, side_px)), np.uint8)
