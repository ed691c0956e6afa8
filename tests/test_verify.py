"""Verification by hand: size limits, the per-row percentile, and what the AOS is tied to."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.config import VerifySettings
from pipeline.records import Box, Exclusion, Frame, Item, Kind, RgbImage, TrackBox
from pipeline.verify import detected, enlarged, exclusion, exclusion_counts, rescue_counts, verify

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


class RememberingMatcher:
    """Keeps the crops that it was shown; every cosine is 0."""

    name = "remembering"

    def __init__(self) -> None:
        self.crops: list[RgbImage] = []

    def cosines(self, crops: Sequence[RgbImage], labels: Sequence[str]) -> NDArray[np.float32]:
        self.crops += crops
        return np.zeros((len(crops), len(labels)), np.float32)


def _road() -> RgbImage:
    """A frame of 640 x 360 px whose red is the column / 3 and whose green is the row / 2."""
    y, x = np.mgrid[:360, :640]
    return np.stack([x // 3, y // 2, np.full_like(x, 9)], axis=-1).astype(np.uint8)


def test_a_small_crop_is_a_square_of_its_surroundings_enlarged() -> None:
    made = enlarged(_road(), Box(300, 100, 340, 120), context=0.25, min_side_px=240)
    assert made is not None and made.shape == (240, 240, 3)
    # 40 x 20 px, grown by a quarter of 40 on both ends: columns 290 to 350 and rows 80 to 140.
    source = _road()[80:140, 290:350].astype(int)
    for channel in range(2):
        assert abs(int(made[:, :, channel].min()) - source[:, :, channel].min()) <= 1
        assert abs(int(made[:, :, channel].max()) - source[:, :, channel].max()) <= 1
    assert np.unique(made[:, :, 2]).tolist() == [9]


def test_a_crop_that_is_large_enough_is_only_padded() -> None:
    made = enlarged(_road(), Box(100, 50, 200, 60), context=0.0, min_side_px=100)
    assert made is not None and np.array_equal(made, _road()[5:105, 100:200])


def test_beyond_the_frame_its_edge_is_repeated() -> None:
    road = _road()
    made = enlarged(road, Box(-50, 330, 60, 400), context=0.0, min_side_px=16)
    # 60 x 30 px of the box are inside; the square of 60 ends 15 rows below the frame.
    assert made is not None and made.shape == (60, 60, 3)
    assert np.array_equal(made[:45], road[315:, :60])
    assert np.array_equal(made[45:], np.repeat(road[-1:, :60], 15, axis=0))
    corner = enlarged(road, Box(0, 0, 10, 10), context=1.0, min_side_px=16)
    assert corner is not None and corner.shape == (30, 30, 3)
    assert np.array_equal(corner[:11, :11], np.broadcast_to(road[0, 0], (11, 11, 3)))
    assert np.array_equal(corner[10:, 10:], road[:20, :20])


@pytest.mark.parametrize(
    "box",
    [
        Box(10, 10, 13.9, 60),
        Box(10, 10, 60, 13.9),
        Box(-100, 10, 3, 60),  # 3 px of it are inside
        Box(700, 10, 800, 60),
        Box(60, 60, 10, 10),
        Box(float("nan"), 0, 50, 50),
    ],
)
def test_what_is_too_small_to_be_a_picture_stays_out(box: Box) -> None:
    assert enlarged(_road(), box, 0.25, 224) is None


@given(st.tuples(*[st.floats(-2000, 2000)] * 4), st.floats(0, 4), st.integers(16, 300), st.integers(1, 60))
def test_enlarging_never_fails(
    sides: tuple[float, float, float, float], context: float, least: int, height: int
) -> None:
    made = enlarged(np.zeros((height, 40, 3), np.uint8), Box(*sides), context, least)
    assert made is None or (made.shape[0] == made.shape[1] >= least and made.shape[2] == 3)


def test_upscale_rescues_small_snippets_and_they_are_counted() -> None:
    boxes = {
        "large": Box(0, 0, 200, 200),
        "narrow": Box(300, 50, 340, 300),
        "low": Box(300, 50, 500, 90),
        "lean": Box(0, 0, 176, 178),
        "speck": Box(50, 50, 53, 53),
        "gone": Box(700, 0, 900, 200),
    }
    tracks = tuple(TrackBox("v", 0, name, Kind.TRAFFIC, box) for name, box in boxes.items())
    frame = Frame("v", 0, 0.0, _road(), tracks)
    cos = [Item(1, "cat", "A cat.")]

    def run(limits: VerifySettings) -> tuple[dict[str, Exclusion | None], RememberingMatcher]:
        matcher = RememberingMatcher()
        found = verify("v", [frame], cos, [], matcher, limits)
        counts = exclusion_counts(found.snippets)
        rescued = rescue_counts(found.snippets, 640, 360, limits)
        assert list(counts) == list(rescued) == list(Exclusion)
        assert len(found.matches) == len(matcher.crops) == len(boxes) - sum(counts.values())
        assert sum(rescued.values()) == (3 if limits.upscale else 0)
        return {s.track_box.track_id: s.excluded for s in found.snippets}, matcher

    reasons, plain = run(PAPER)
    assert reasons == {
        "large": None,
        "narrow": Exclusion.TOO_NARROW,
        "low": Exclusion.TOO_LOW,
        "lean": Exclusion.AREA_TOO_SMALL,
        "speck": Exclusion.TOO_NARROW,
        "gone": Exclusion.OUTSIDE_FRAME,
    }
    upscaled, matcher = run(VerifySettings(upscale=True))
    assert upscaled == reasons | {"narrow": None, "low": None, "lean": None}
    assert np.array_equal(matcher.crops[0], plain.crops[0])  # what was compared before is as it was
    assert [crop.shape for crop in matcher.crops[1:]] == [(375, 375, 3), (300, 300, 3), (267, 267, 3)]
