"""Motion against the background: the camera's own is taken off, what moves by itself is left."""

import cv2
import numpy as np
import pytest

from pipeline.data.linking import iou
from pipeline.data.motion import Grey, MotionSettings, camera_motion, motion_boxes, moving, single_threaded
from pipeline.records import RgbImage
from tests.moving_patch import panned, texture


def _grey(rgb: RgbImage) -> Grey:
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)


@pytest.mark.parametrize(
    "true",
    [
        np.array([[1.0, 0.0, 5.0], [0.0, 1.0, -3.0], [0.0, 0.0, 1.0]]),
        np.array([[0.998, -0.03, 4.0], [0.03, 0.998, 1.0], [0.0, 0.0, 1.0]]),
        np.array([[1.02, 0.0, -3.0], [0.0, 1.02, -2.0], [1e-5, 0.0, 1.0]]),
    ],
    ids=["pan", "roll", "homography"],
)
def test_the_cameras_motion_is_found(true: np.ndarray) -> None:
    before = _grey(texture(320, 192, 3))
    warped = cv2.warpPerspective(before, true, (320, 192), borderMode=cv2.BORDER_REFLECT)
    after = np.asarray(warped, np.uint8)
    found = camera_motion(before, after)
    corners = np.array([[60, 40], [260, 40], [260, 150], [60, 150]], np.float64).reshape(-1, 1, 2)
    apart = cv2.perspectiveTransform(corners, found) - cv2.perspectiveTransform(corners, true)
    assert np.abs(apart).max() < 1


def test_pictures_that_tell_nothing_give_no_motion_and_no_box() -> None:
    flat = np.full((192, 320), 90, np.uint8)
    assert np.array_equal(camera_motion(flat, flat), np.eye(3))
    assert moving(flat, flat, MotionSettings()) == []
    assert motion_boxes([], MotionSettings()) == []
    tiny = np.zeros((16, 16, 3), np.uint8)
    assert motion_boxes([tiny] * 5, MotionSettings()) == []


def test_a_pan_alone_moves_nothing() -> None:
    pictures, _ = panned(10, patch=False)
    assert motion_boxes(pictures, MotionSettings()) == []


@pytest.mark.parametrize("growth_px", [0.0, 1.0], ids=["crossing", "looming"])
def test_a_patch_is_found_where_it_is(growth_px: float) -> None:
    pictures, boxes = panned(16, growth_px=growth_px)
    found = motion_boxes(pictures, MotionSettings(every_frames=1))
    assert all(0.5 <= one.score < 1 for one in found)
    frames = range(3, 16)
    best = [max(iou(one.box, boxes[at]) for one in found if one.frame_index == at) for at in frames]
    assert sum(overlap > 0.3 for overlap in best) >= 0.8 * len(best)


def test_boxes_are_in_pixels_of_the_frame_whatever_it_was_reduced_to() -> None:
    pictures, boxes = panned(8)
    large = [np.asarray(cv2.resize(picture, None, fx=2, fy=2), np.uint8) for picture in pictures]
    found = motion_boxes(large, MotionSettings(width_px=320, every_frames=1))
    at = max(one.frame_index for one in found)
    doubled = type(boxes[at])(
        *(2 * getattr(boxes[at], name) for name in ("x1_px", "y1_px", "x2_px", "y2_px"))
    )
    assert max(iou(one.box, doubled) for one in found if one.frame_index == at) > 0.3


def test_the_number_of_threads_changes_nothing() -> None:
    pictures, _ = panned(8)
    before = cv2.getNumThreads()
    found = []
    try:
        for threads in (1, 4):
            cv2.setNumThreads(threads)
            found.append(motion_boxes(pictures, MotionSettings()))
            assert cv2.getNumThreads() == threads
    finally:
        cv2.setNumThreads(before)
    assert found[0] == found[1] != []


def test_threads_are_given_back_after_an_error() -> None:
    before = cv2.getNumThreads()
    with pytest.raises(ZeroDivisionError), single_threaded():
        raise ZeroDivisionError
    assert cv2.getNumThreads() == before
