"""Verification by hand: size limits, the per-row percentile, and what the AOS is tied to."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.config import VerifySettings
from pipeline.records import Box, Exclusion, Frame, Item, Kind, RgbImage, TrackBox
from pipeline.verify import detected, exclusion, verify

PAPER = VerifySettings()


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        (Box(0, 0, 200, 200), None),
        (Box(0, 0, 174.9, 300), Exclusion.TOO_NARROW),
        (Box(0, 0, 300, 174.9), Exclusion.TOO_LOW),
        (Box(0, 0, 175, 200), Exclusion.AREA_TOO_SMALL),  # 35,000 px² exactly: "<=" excludes it
        (Box(0, 0, 175, 200.1), None),
        (Box(1300, 0, 1500, 200), Exclusion.OUTSIDE_FRAME),
        (Box(-300, 0, 0, 200), Exclusion.OUTSIDE_FRAME),
        (Box(-100, 0, 200, 200), None),
    ],
)
def test_size_limits_of_the_paper(box: Box, expected: Exclusion | None) -> None:
    assert exclusion(box, 1280, 720, PAPER) is expected


def test_limits_scale_with_the_frame_when_asked() -> None:
    scaled = VerifySettings(reference_width_px=1280)
    assert exclusion(Box(0, 0, 100, 100), 640, 360, PAPER) is Exclusion.TOO_NARROW
    assert exclusion(Box(0, 0, 100, 100), 640, 360, scaled) is None
    assert exclusion(Box(0, 0, 87, 120), 640, 360, scaled) is Exclusion.TOO_NARROW
    assert exclusion(Box(0, 0, 87.5, 100), 640, 360, scaled) is Exclusion.AREA_TOO_SMALL


def test_top_percent_by_hand() -> None:
    row = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1]], np.float32)
    # 11 entries: the 90th percentile is the 10th smallest, 1.0.
    assert detected(row, 10).tolist() == [[False] * 9 + [True, True]]
    assert detected(np.array([[0.3, 0.2, 0.1]], np.float32), 10).tolist() == [[True, False, False]]
    assert detected(np.array([[0.5, 0.5]], np.float32), 10).tolist() == [[True, True]]
    assert detected(np.array([[-0.5]], np.float32), 10).tolist() == [[True]]
    assert detected(np.zeros((0, 3), np.float32), 10).shape == (0, 3)


@given(st.lists(st.floats(-1, 1, width=32), min_size=1, max_size=40), st.floats(1, 100))
def test_the_best_of_a_row_is_always_detected(row: list[float], top_percent: float) -> None:
    flags = detected(np.array([row], np.float32), top_percent)[0]
    assert flags[int(np.argmax(row))]


class TableMatcher:
    """Gives the cosines of a table by the crop's first pixel."""

    name = "table"

    def __init__(self, rows: dict[int, list[float]]) -> None:
        self._rows = rows

    def cosines(self, crops: Sequence[RgbImage], labels: Sequence[str]) -> NDArray[np.float32]:
        return np.array([self._rows[int(picture[0, 0, 0])] for picture in crops], np.float32)


def _frame(index: int, *tracks: tuple[str, Box, int]) -> Frame:
    rgb = np.zeros((100, 100, 3), np.uint8)
    boxes = []
    for track_id, box, grey in tracks:
        rgb[int(box.y1_px) : int(box.y2_px), int(box.x1_px) : int(box.x2_px)] = grey
        boxes.append(TrackBox("v", index, track_id, Kind.TRAFFIC, box))
    return Frame("v", index, 0.0, rgb, tuple(boxes))


def test_groups_tie_the_anomaly_to_its_tracks_and_frames() -> None:
    limits = VerifySettings(min_width_px=20, min_height_px=20, min_area_px2=400)
    frames = [
        _frame(0, ("car", Box(0, 0, 30, 30), 1), ("cat", Box(50, 50, 90, 90), 2)),
        _frame(5, ("cat", Box(50, 50, 90, 90), 2), ("tiny", Box(0, 0, 5, 30), 3)),
    ]
    cos = [Item(1, "Cat", "A cat runs."), Item(2, "car", "A car stands.")]
    aos = [Item(1, "cat", "A cat runs across the road.")]
    matcher = TableMatcher({1: [0.1, 0.9], 2: [0.8, 0.2]})
    found = verify("v", frames, cos, aos, matcher, limits)
    assert [(s.track_box.track_id, s.excluded) for s in found.snippets] == [
        ("car", None),
        ("cat", None),
        ("cat", None),
        ("tiny", Exclusion.TOO_NARROW),
    ]
    flagged = {(m.frame_index, m.track_id, m.label) for m in found.matches if m.detected}
    assert flagged == {(0, "car", "car"), (0, "cat", "Cat"), (5, "cat", "Cat")}
    assert {m.label for m in found.matches if m.in_aos} == {"Cat"}
    (prediction,) = found.predictions
    assert prediction.description == "A cat runs across the road."
    assert (prediction.rank, prediction.track_ids, prediction.frame_indices) == (1, ("cat",), (0, 5))


def test_nothing_to_verify_still_predicts_what_the_aos_says() -> None:
    found = verify("v", [], [], [Item(1, "", "A cat.")], TableMatcher({}), PAPER)
    assert (found.snippets, found.matches) == ((), ())
    assert [(p.description, p.label, p.track_ids) for p in found.predictions] == [("A cat.", None, ())]
