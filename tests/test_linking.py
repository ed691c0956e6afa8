"""Boxes linked to tracks: by hand, and by properties that hold for any boxes."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.data.linking import Candidate, LinkSettings, distinct, iou, link, named
from pipeline.records import Box, Kind

SHORT = LinkSettings(min_sightings=2)


def _at(x_px: float, side_px: float = 20.0, y_px: float = 10.0) -> Box:
    return Box(x_px, y_px, x_px + side_px, y_px + side_px)


def _run(
    start_px: float, step_px: float, frames: range, score: float = 0.6, label: str = ""
) -> list[Candidate]:
    return [Candidate(at, _at(start_px + step_px * at), score, label) for at in frames]


def test_iou_by_hand() -> None:
    assert iou(_at(0), _at(0)) == 1
    assert iou(_at(0), _at(10)) == pytest.approx(1 / 3)
    assert iou(_at(0), _at(20)) == 0
    assert iou(_at(0, 0.0), _at(0, 0.0)) == 0


def test_two_things_that_pass_keep_their_tracks() -> None:
    seen = _run(0, 8, range(15)) + [Candidate(at, _at(120 - 8 * at, y_px=25), 0.6) for at in range(15)]
    tracks = link(seen, SHORT)
    assert [track.sightings for track in tracks] == [15, 15]
    assert [track.boxes[-1][1].x1_px for track in tracks] == [112, 8]


def test_a_fast_thing_is_followed_once_its_speed_is_known() -> None:
    """Steps grow to more than its own width: no two boxes overlap any more, but the prediction does."""
    places = [0.0]
    for at in range(12):
        places.append(places[-1] + min(8 + 2 * at, 24))
    (track,) = link([Candidate(at, _at(x), 0.5) for at, x in enumerate(places)], SHORT)
    assert track.sightings == len(places)


def test_a_gap_is_interpolated_and_a_longer_one_ends_the_track() -> None:
    seen = _run(0, 2, range(4)) + _run(0, 2, range(8, 12))
    (track,) = link(seen, LinkSettings(min_sightings=3, max_gap_frames=5))
    assert [at for at, _ in track.boxes] == list(range(12))
    assert all(box.x1_px == pytest.approx(2 * at) for at, box in track.boxes)
    assert track.sightings == 8
    first, second = link(seen, LinkSettings(min_sightings=3, max_gap_frames=4))
    assert (first.boxes[-1][0], second.boxes[0][0]) == (3, 8)


def test_short_tracks_and_other_labels_are_not_linked() -> None:
    assert link(_run(0, 1, range(4)), LinkSettings(min_sightings=5)) == []
    seen = _run(0, 1, range(4), label="car") + _run(0, 1, range(4, 8), label="dog")
    assert [track.label for track in link(seen, SHORT)] == ["car", "dog"]


def test_of_tracks_on_one_another_the_better_is_kept() -> None:
    strong, weak = _run(0, 1, range(10), 0.9), [Candidate(at, _at(at + 2), 0.6, "x") for at in range(10)]
    assert [track.score for track in link(strong + weak, SHORT)] == [pytest.approx(0.9)]
    (kept,) = distinct(link(strong, SHORT), SHORT, sure=link(weak, SHORT))
    assert kept.label == "x"


def test_the_best_are_kept_when_there_are_too_many() -> None:
    seen = [c for n in range(5) for c in _run(100.0 * n, 0, range(4), 0.5 + n / 10)]
    tracks = link(seen, LinkSettings(min_sightings=2, max_tracks=2))
    assert [track.boxes[0][1].x1_px for track in tracks] == [300, 400]


def test_proposals_are_named_in_order() -> None:
    rows = named("v", link(_run(50, 0, range(3)) + _run(0, 0, range(2, 5)), SHORT))
    assert {row.track_id for row in rows if row.box.x1_px == 50} == {"p1"}
    assert {row.track_id for row in rows if row.box.x1_px == 0} == {"p2"}
    assert {row.kind for row in rows} == {Kind.PROPOSED}


@given(
    st.lists(
        st.builds(
            lambda at, x, score: Candidate(at, _at(x), score),
            st.integers(0, 12),
            st.floats(0, 80),
            st.floats(0.1, 1),
        ),
        max_size=30,
    ),
    st.randoms(use_true_random=False),
)
def test_any_boxes_in_any_order(seen: list[Candidate], chance: random.Random) -> None:
    """One box a frame and track, no frame left out, every end a sighting; the order changes nothing."""
    tracks = link(seen, SHORT)
    mixed = list(seen)
    chance.shuffle(mixed)
    assert link(mixed, SHORT) == tracks
    places = {(one.frame_index, one.box) for one in seen}
    for track in tracks:
        frames = [at for at, _ in track.boxes]
        assert frames == list(range(frames[0], frames[-1] + 1))
        assert {track.boxes[0], track.boxes[-1]} <= places
        assert track.sightings >= SHORT.min_sightings
