"""Boxes drawn into clips: where and in which colours, and the clip otherwise as it was."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from typer.testing import CliRunner

from pipeline.data.overlay import HAZARD, OTHER, OverlayJob, draw_boxes, overlay_clip
from pipeline.records import Box, Kind, TrackBox
from pipeline.tables import BOXES
from sitegen.cli import app
from tests.clips import write_clip

GREY = np.full((96, 160, 3), 90, np.uint8)


def _box(*sides: float, kind: Kind = Kind.TRAFFIC, track: str = "1", frame: int = 0) -> TrackBox:
    return TrackBox("a", frame, track, kind, Box(*sides))


def test_lines_lie_on_the_box_and_hazards_are_thicker() -> None:
    boxes = [_box(20, 30, 60, 70), _box(90, 30, 130, 70, kind=Kind.CHALLENGE)]
    drawn = draw_boxes(GREY, boxes, {}, names=False)
    assert tuple(drawn[50, 20]) == OTHER
    assert tuple(drawn[30, 40]) == OTHER
    assert tuple(drawn[50, 19]) == (0, 0, 0)
    assert tuple(drawn[50, 40]) == (90, 90, 90)
    count = {colour: int((drawn == colour).all(axis=2).sum()) for colour in (OTHER, HAZARD)}
    assert count[HAZARD] > 2 * count[OTHER]
    assert (GREY == 90).all()  # the frame that was given is as it was


def test_a_hazard_is_drawn_on_top_whatever_the_order() -> None:
    boxes = [_box(20, 30, 60, 70, kind=Kind.CHALLENGE), _box(20, 30, 60, 70, track="2")]
    one, other = draw_boxes(GREY, boxes, {}), draw_boxes(GREY, boxes[::-1], {})
    assert (one == other).all()
    assert tuple(one[50, 20]) == HAZARD


def test_words_are_legible_on_any_ground() -> None:
    for ground in (0, 128, 255):
        drawn = draw_boxes(np.full((96, 160, 3), ground, np.uint8), [_box(20, 40, 60, 70)], {"1": "car"})
        words = drawn[20:38, 20:60].astype(int)
        assert words.max() > 200
        assert words.min() < 30
        assert (draw_boxes(GREY, [_box(20, 40, 60, 70)], {"1": "car"}, names=False)[20:37] == 90).all()


@pytest.mark.parametrize(
    "box",
    [
        _box(float("nan"), 0, 10, 10),
        _box(0, 0, float("inf"), 10),
        _box(200, 0, 300, 10),
        _box(-50, -50, -1, -1),
        _box(50, 50, 20, 20),
    ],
)
def test_what_is_no_box_in_the_frame_is_not_drawn(box: TrackBox) -> None:
    assert (draw_boxes(GREY, [box], {}) == GREY).all()


@pytest.mark.parametrize("track", ["\u202eevil\n", "标签" * 200, "\0", "", "a" * 10_000, "\ud800"])
def test_hostile_ids_are_drawn_as_text(track: str) -> None:
    drawn = draw_boxes(GREY, [_box(-1e300, -1e300, 1e300, 60, track=track)], {track: "<b>\x1b[0m"})
    assert drawn.shape == GREY.shape


def _times(path: Path) -> tuple[list[Fraction], Fraction | None, tuple[int, int]]:
    with av.open(str(path)) as clip:
        stream = clip.streams.video[0]
        times = [Fraction(frame.pts) * frame.time_base for frame in clip.decode(video=0)]
        return times, stream.average_rate, (stream.width, stream.height)


def test_the_clip_keeps_its_frames_times_and_size_and_gets_the_boxes(tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "a.mp4", 20, size=(160, 96), pictures=[GREY] * 20)
    boxes = (_box(20, 30, 60, 70, frame=5, kind=Kind.CHALLENGE), _box(20, 30, 60, 70, frame=99))
    result = overlay_clip(OverlayJob("a", clip, tmp_path / "out" / "a.mp4", boxes, names=False))
    assert (result.error, result.frames, result.boxes) == ("", 20, 1)
    assert _times(tmp_path / "out" / "a.mp4") == _times(clip)
    with av.open(str(tmp_path / "out" / "a.mp4")) as made:
        assert made.streams.video[0].codec_context.name == "h264"
        assert made.streams.video[0].codec_context.pix_fmt == "yuv420p"
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in made.decode(video=0)]
    assert abs(pictures[4] - 90).max() < 12
    assert abs(pictures[5][50, 20] - HAZARD).max() < 30
    assert abs(pictures[6] - 90).max() < 12


def test_a_clip_of_odd_times_keeps_them(tmp_path: Path) -> None:
    path, steps = tmp_path / "a.mkv", [0, 40, 80, 200, 240, 500]
    with av.open(str(path), "w") as output:
        stream = output.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for time in steps:
            frame = av.VideoFrame.from_ndarray(GREY, format="rgb24")
            frame.pts, frame.time_base = time, Fraction(1, 1000)
            output.mux(stream.encode(frame))
        output.mux(stream.encode())
    result = overlay_clip(OverlayJob("a", path, tmp_path / "o.mp4", ()))
    assert result.error == ""
    assert _times(tmp_path / "o.mp4")[0] == [Fraction(time, 1000) for time in steps]


def test_a_stream_without_times_is_drawn_at_its_rate(tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "a.ts", 12, size=(160, 96), container="h264")
    result = overlay_clip(OverlayJob("a", clip, tmp_path / "o.mp4", ()))
    assert (result.error, result.frames) == ("", 12)


def test_the_command_draws_the_kinds_that_were_asked_for_and_tells_broken_clips(tmp_path: Path) -> None:
    (tmp_path / "videos").mkdir()
    clip = write_clip(tmp_path / "videos" / "a.mp4", 4, size=(160, 96), pictures=[GREY] * 4)
    (tmp_path / "videos" / "b.mp4").write_bytes(b"no video")
    hazard = _box(20, 30, 60, 70, kind=Kind.CHALLENGE)
    BOXES.write(tmp_path / "boxes.parquet", [hazard, _box(90, 30, 130, 70, track="2")])
    (tmp_path / "truth.csv").write_text(
        "video_id,hazard_id,label,description,track_id\na,h1,Car,A car stops.,1\n"
    )
    base = [
        "data",
        "overlay",
        "--videos",
        str(tmp_path / "videos"),
        "--boxes",
        str(tmp_path / "boxes.parquet"),
    ]
    base += ["--truth", str(tmp_path / "truth.csv"), "--workers", "1", "--out"]
    result = CliRunner().invoke(app, [*base, str(tmp_path / "out"), "--kinds", "challenge"])
    assert result.exit_code == 1
    assert "failed: b:" in result.output
    assert "1 boxes in 1 clips" in result.output
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.mp4"]
    with av.open(str(tmp_path / "out" / "a.mp4")) as made:
        first = next(made.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    assert abs(first[20:80, 85:135] - 90).max() < 12
    before = clip.read_bytes()
    same = CliRunner().invoke(app, [*base, str(tmp_path / "videos"), "--only", "a"])
    assert same.exit_code != 0
    assert clip.read_bytes() == before
    assert CliRunner().invoke(app, [*base, str(tmp_path / "o"), "--kinds", "cars"]).exit_code == 2
