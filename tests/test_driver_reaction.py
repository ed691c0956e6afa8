"""The driver's reaction: cuts against every possible cutting, and real clips that zoom, brake or stand."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.data.driver_reaction import (
    MAX_FRAMES,
    ReactionJob,
    change_points,
    find_reaction,
    find_reactions,
    reaction_in,
    signal_of,
)
from pipeline.data.ego_motion import Motion, closing_of, growth, measure
from pipeline.errors import VideoError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.records import Box, Kind, TrackBox
from pipeline.tables import BOXES
from tests.clips import write_clip

DEMO = Path(__file__).parent.parent / "demo"
SIZE = (160, 96)
FAST = 0.02  # growth from frame to frame; at 25 frames a second 0.5 1/s
NAN = float("nan")


def _pictures(growths: Sequence[float], shift_px: float = 0.0) -> list[np.ndarray]:
    """A textured wall that comes nearer by `growths`, seen by a camera that also turns."""
    noise = np.random.default_rng(0).integers(0, 256, (960, 1600)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 5)
    wall = np.clip((soft - soft.mean()) / soft.std() * 50 + 128, 0, 255).astype(np.uint8)
    made = []
    for frame, total in enumerate(np.cumsum(growths)):
        zoom = 0.25 * np.exp(total)
        x, y = SIZE[0] / 2 - zoom * 800 + shift_px * frame, SIZE[1] / 2 - zoom * 480
        grey = cv2.warpAffine(wall, np.array([[zoom, 0, x], [0, zoom, y]]), SIZE, flags=cv2.INTER_AREA)
        made.append(np.repeat(grey[:, :, np.newaxis], 3, axis=2))
    return made


def _clip(folder: Path, growths: Sequence[float], **more: float) -> Path:
    return write_clip(folder / "v1.mp4", len(growths), SIZE, pictures=_pictures(growths, **more))


def _reaction(clip: Path, boxes: tuple[TrackBox, ...] = ()) -> tuple[int | None, float]:
    reacted = find_reaction(ReactionJob("v1", clip, boxes))
    assert not reacted.error
    return reacted.reaction.frame_index, reacted.reaction.score


@pytest.mark.parametrize("turn_px", [0.0, 1.0])
def test_a_car_that_stops_is_found_where_it_stops(tmp_path: Path, turn_px: float) -> None:
    clip = _clip(tmp_path, [FAST] * 25 + [0.0] * 20, shift_px=turn_px)
    frame, score = _reaction(clip)
    assert frame is not None and abs(frame - 25) <= 2
    assert score > 0.9


def test_a_car_that_brakes_slowly_is_found_while_it_brakes(tmp_path: Path) -> None:
    growths = [FAST] * 20 + list(np.linspace(FAST, 0.004, 12)) + [0.004] * 15
    frame, score = _reaction(_clip(tmp_path, growths))
    assert frame is not None and 12 <= frame <= 32
    assert 0.5 <= score < 1


@pytest.mark.parametrize(
    "growths",
    [[FAST] * 45, [0.0] * 40, [0.0] * 20 + [FAST] * 20, [FAST] * 20 + [0.8 * FAST] * 20],
    ids=["steady", "standing", "starting", "a little slower"],
)
def test_no_reaction(tmp_path: Path, growths: list[float]) -> None:
    assert _reaction(_clip(tmp_path, growths)) == (None, 0.0)


def test_the_signal_is_the_growth_in_a_second(tmp_path: Path) -> None:
    motion = measure(_clip(tmp_path, [FAST] * 12), [])
    assert motion.fps_hz == 25
    assert np.isnan(motion.flow_hz[0]) and np.isnan(motion.boxes_hz).all()
    assert np.allclose(motion.flow_hz[1:], 25 * FAST, atol=0.05)


def test_what_is_in_a_box_does_not_count_and_stands_in_where_nothing_else_is(tmp_path: Path) -> None:
    clip = _clip(tmp_path, [FAST] * 12)
    whole = [
        TrackBox("v1", frame, "1", Kind.TRAFFIC, Box(-920 - frame, -50 - frame, 1080 + frame, 500 + frame))
        for frame in range(12)
    ]
    motion = measure(clip, whole)
    assert np.isnan(motion.flow_hz).all()
    assert (motion.boxes_hz[1:] > 0).all()
    assert (signal_of(motion) > 0).all()
    odd = [TrackBox("v1", 3, "1", Kind.TRAFFIC, Box(1e9, 1e9, -1e9, -1e9))]
    assert np.isfinite(measure(clip, odd).flow_hz[1:]).all()


def test_flat_pictures_and_short_clips_have_no_motion(tmp_path: Path) -> None:
    assert _reaction(write_clip(tmp_path / "flat.mp4", 40)) == (None, 0.0)
    assert _reaction(write_clip(tmp_path / "one.mp4", 1)) == (None, 0.0)


def test_a_broken_clip_has_a_reason(tmp_path: Path) -> None:
    path = tmp_path / "broken.mp4"
    path.write_bytes(b"no video")
    found = find_reactions([ReactionJob("v1", path, ())], SerialExecutor())
    assert found[0].reaction.frame_index is None
    assert "not readable as a video" in found[0].error


def test_the_demo_has_the_same_reactions_in_a_process() -> None:
    boxes = BOXES.read(DEMO / "boxes.parquet")
    jobs = [
        ReactionJob(clip.stem, clip, tuple(box for box in boxes if box.video_id == clip.stem))
        for clip in sorted((DEMO / "videos").glob("*.mp4"))[:2]
    ]
    told: list[None] = []
    found = find_reactions(jobs, SerialExecutor(), lambda: told.append(None))
    assert not any(one.error for one in found) and len(told) == 2
    assert [len(one.reaction.signal_hz) for one in found] == [150, 150]
    assert find_reactions(jobs[:1], ProcessExecutor(1)) == found[:1]


def test_growth_by_hand() -> None:
    grid = np.array([[x, y] for x in (0.0, 50.0, 100.0, 150.0) for y in (0.0, 50.0, 100.0)])
    assert growth(grid, 1.1 * grid + 7) == pytest.approx(np.log(1.1))
    assert np.isnan(growth(grid[:11], grid[:11]))
    assert np.isnan(growth(grid * 0.01, grid))


def test_closing_of_the_tracks_ahead_by_hand() -> None:
    small, large = Box(140, 0, 160, 10), Box(130, 0, 170, 20)
    assert closing_of({"a": small}, {"a": large}, 300) == pytest.approx(np.log(2))
    assert np.isnan(closing_of({"a": small}, {"b": large}, 300))
    assert np.isnan(closing_of({"a": small}, {"a": large}, 3_000))  # at the left
    assert np.isnan(closing_of({"a": Box(150, 5, 150, 5)}, {"a": large}, 300))


def test_gaps_are_closed_and_single_frames_do_not_count() -> None:
    flow = np.array([NAN, 1, NAN, 1, 9, 1, 1, 1, 1, 1], float)
    assert signal_of(Motion(25, flow, np.full(10, NAN))).tolist() == [1.0] * 10
    assert signal_of(Motion(25, np.full(10, NAN), np.full(10, NAN))).tolist() == [0.0] * 10
    boxes = np.array([NAN] + [2.0] * 9)
    assert signal_of(Motion(25, np.full(10, NAN), boxes)).tolist() == [2.0] * 10


def test_a_fall_in_steps_begins_with_the_first() -> None:
    signal = np.repeat([1.0, 0.8, 0.6, 0.3], 30)
    assert reaction_in(signal, 25) == (30, pytest.approx(0.7))
    up = np.repeat([1.0, 0.8, 0.9, 0.3], 30)
    assert reaction_in(up, 25) == (90, pytest.approx(1 - 0.3 / 0.9))
    assert reaction_in(np.repeat([0.04, 0.0], 30), 25) == (None, 0.0)  # it hardly moved
    assert reaction_in(np.repeat([1.0, -0.5], 30), 25) == (30, 1.0)


def test_noise_is_no_reaction_and_does_not_hide_one() -> None:
    noise = np.random.default_rng(1).normal(0, 0.1, 300)
    assert reaction_in(1 + noise, 25) == (None, 0.0)
    frame, _ = reaction_in(np.repeat([1.0, 0.2], 150) + noise, 25)
    assert frame is not None and abs(frame - 150) <= 2


def test_too_many_frames_are_refused() -> None:
    with pytest.raises(VideoError, match="expected at most 30,000"):
        reaction_in(np.zeros(MAX_FRAMES + 1), 25)


@given(
    st.lists(st.sampled_from([0.0, 1.0, 1.5, 4.0]), min_size=2, max_size=9),
    st.sampled_from([0.1, 1.0, 5.0]),
    st.sampled_from([1, 2]),
)
def test_the_cuts_are_the_best_there_are(values: list[float], price: float, least: int) -> None:
    signal = np.array(values)

    def cost(cuts: Sequence[int]) -> float:
        parts = np.split(signal, list(cuts))
        if min(len(part) for part in parts) < least:
            return float("inf")
        return sum(float(((part - part.mean()) ** 2).sum()) for part in parts) + price * len(cuts)

    inside = range(1, len(signal))
    best = min(cost(cuts) for count in range(len(signal)) for cuts in combinations(inside, count))
    assert cost(change_points(signal, price, least)) == pytest.approx(best, abs=1e-9)
