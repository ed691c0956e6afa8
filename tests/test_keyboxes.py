"""Boxes from key boxes: straight lines, rounding, the frame's edge, and every fault of a table."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.data.keyboxes import COLUMNS, interpolate, read_key_boxes
from pipeline.errors import FaultsError, InputError
from pipeline.records import Box, Kind, TrackBox

SIZE = {"v": (100, 80)}


def _key(frame: int, *sides: float, track: str = "1") -> TrackBox:
    return TrackBox("v", frame, track, Kind.TRAFFIC, Box(*sides))


def _write(path: Path, *rows: str) -> Path:
    path.write_text("\n".join([",".join(COLUMNS), *rows]) + "\n")
    return path


def test_sides_move_in_straight_lines_by_hand() -> None:
    made = interpolate([_key(10, 0, 10, 20, 30), _key(14, 40, 12, 60, 33)], SIZE)
    assert [box.frame_index for box in made] == [10, 11, 12, 13, 14]
    assert [box.box for box in made[1:4]] == [
        Box(10.0, 10.5, 30.0, 30.8),  # 30.75 rounds to the even 30.8
        Box(20.0, 11.0, 40.0, 31.5),
        Box(30.0, 11.5, 50.0, 32.2),  # 32.25 to the even 32.2
    ]


def test_the_frame_cuts_off_and_what_is_outside_is_left_out() -> None:
    made = interpolate([_key(0, -30, -10, -10, 50), _key(4, 90, 20, 110, 90)], SIZE)
    assert [box.frame_index for box in made] == [1, 2, 3, 4]
    assert made[0].box == Box(0.0, 0.0, 20.0, 60.0)
    assert made[-1].box == Box(90.0, 20.0, 100.0, 80.0)
    assert not any(str(side).startswith("-") for box in made for side in (box.box.x1_px, box.box.y1_px))


def test_a_side_that_rounds_to_nothing_is_a_plain_zero() -> None:
    (made,) = interpolate([_key(0, -0.04, -0.04, 20, 30)], SIZE)
    assert (str(made.box.x1_px), str(made.box.y1_px)) == ("0.0", "0.0")


def test_a_track_of_one_key_box_has_one_box_and_order_does_not_matter() -> None:
    keys = [_key(3, 1, 2, 3, 4), _key(9, 5, 5, 9, 9, track="2"), _key(7, 5, 5, 8, 8, track="2")]
    assert interpolate(keys, SIZE) == interpolate(keys[::-1], SIZE)
    found = [(box.track_id, box.frame_index) for box in interpolate(keys, SIZE)]
    assert found == [("1", 3), ("2", 7), ("2", 8), ("2", 9)]


def test_a_video_without_a_size_is_told() -> None:
    with pytest.raises(InputError, match="no frame size of v"):
        interpolate([_key(0, 0, 0, 1, 1)], {})


@given(st.lists(st.tuples(*[st.integers(0, 1000)] * 4), min_size=2, max_size=6), st.integers(1, 9))
def test_key_boxes_on_the_grid_come_out_as_they_are(corners: list[tuple[int, ...]], step: int) -> None:
    keys = [
        _key(place * step, x / 10, y / 10, (x + w + 1) / 10, (y + h + 1) / 10)
        for place, (x, y, w, h) in enumerate(corners)
    ]
    made = {box.frame_index: box.box for box in interpolate(keys, {"v": (300, 300)})}
    assert len(made) == (len(keys) - 1) * step + 1
    assert all(made[key.frame_index] == key.box for key in keys)


def test_every_fault_of_a_table_is_told(tmp_path: Path) -> None:
    path = _write(
        tmp_path / "keys.csv",
        "v,1,challenge,0,0,0,10,10",
        "v,1,challenge,0,0,0,10,10",
        "v,1,traffic,5,0,0,10,10",
        ",1,car,-1,nan,1e9,x,10",
        "v,2,traffic,5,10,0,10,10",
        "v,2,traffic,5",
        "v,3,traffic,0,0,0,10,10",
        "v,3,traffic,999999999,0,0,10,10",
    )
    with pytest.raises(FaultsError) as found:
        read_key_boxes(path)
    places = [(fault.row, fault.column) for fault in found.value.faults]
    sides = ["x1_px", "y1_px", "x2_px"]
    assert places == [
        (2, "frame_index"),
        (3, "kind"),
        *[(4, name) for name in ("video_id", "kind", "frame_index", *sides)],
        (5, "x2_px"),
        *[(6, name) for name in (*sides, "y2_px")],
        (None, "frame_index"),
    ]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"video_id,track_id\nv,1\n", b'video_id\n"a'])
def test_what_is_no_table_of_key_boxes_is_told(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "keys.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"keys\.csv"):
        read_key_boxes(path)
    with pytest.raises(InputError, match="no such file"):
        read_key_boxes(tmp_path / "other.csv")
