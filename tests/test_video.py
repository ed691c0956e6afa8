"""Frames: the rule, exactness against a plain decode, and files that lie or are broken."""

from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import VideoError
from pipeline.records import Box
from pipeline.video import crop, frame_indices, read_keyframes
from tests.clips import grey_index, write_clip


def test_papers_example_takes_every_twelfth_frame() -> None:
    assert frame_indices(300, 25) == tuple(range(0, 300, 12))


@pytest.mark.parametrize(
    ("total", "count", "expected"),
    [(0, 25, ()), (1, 25, (0,)), (25, 25, tuple(range(25))), (3, 5, (0, 1, 2)), (10, 4, (0, 2, 5, 8))],
)
def test_frame_indices_by_hand(total: int, count: int, expected: tuple[int, ...]) -> None:
    assert frame_indices(total, count) == expected


@given(st.integers(0, 100_000), st.integers(1, 200))
def test_frame_indices_are_increasing_and_inside(total: int, count: int) -> None:
    indices = frame_indices(total, count)
    assert len(indices) == min(total, count)
    assert all(a < b for a, b in pairwise(indices))
    assert all(0 <= index < total for index in indices)


@pytest.mark.parametrize(("gop", "b_frames"), [(1, 0), (12, 2), (250, 3)])
def test_frames_are_those_of_a_full_decode(tmp_path: Path, gop: int, b_frames: int) -> None:
    path = write_clip(tmp_path / "a.mp4", 60, gop=gop, b_frames=b_frames)
    with av.open(str(path)) as container:
        every = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    found = read_keyframes(path, "a", 25)
    assert [frame.index for frame in found.frames] == list(frame_indices(60, 25))
    for frame in found.frames:
        np.testing.assert_array_equal(frame.rgb, every[frame.index])
        assert grey_index(frame.rgb) == frame.index
        assert frame.time_s == pytest.approx(frame.index / 25)
    assert (found.video.frame_count, found.video.fps_hz) == (60, 25)
    assert (found.video.width_px, found.video.height_px) == (64, 48)
    assert found.note == ""


def test_pictures_do_not_depend_on_how_many_threads_convert_colours(tmp_path: Path) -> None:
    pictures = list(np.random.default_rng(2).integers(0, 256, (8, 362, 642, 3), dtype=np.uint8))
    path = write_clip(tmp_path / "a.mp4", 8, (642, 362), pictures=pictures)
    with av.open(str(path)) as container:
        for frame, found in zip(container.decode(video=0), read_keyframes(path, "a").frames, strict=True):
            for threads in (0, 1, 2, 5):
                every = frame.reformat(format="rgb24", threads=threads).to_ndarray()
                np.testing.assert_array_equal(found.rgb, every)


def test_shorter_than_n_gives_all_frames(tmp_path: Path) -> None:
    found = read_keyframes(write_clip(tmp_path / "a.mp4", 7), "a", 25)
    assert [grey_index(frame.rgb) for frame in found.frames] == list(range(7))


def test_header_that_claims_too_many_frames(tmp_path: Path) -> None:
    """A file cut off in its media data: the index in front still lists all the frames."""
    pictures = list(np.random.default_rng(0).integers(0, 256, (60, 120, 160, 3), dtype=np.uint8))
    whole = write_clip(tmp_path / "whole.mp4", 60, (160, 120), pictures=pictures, faststart=True)
    data = whole.read_bytes()
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(data[: len(data) * 6 // 10])
    found = read_keyframes(cut, "cut", 25)
    assert 25 < found.video.frame_count < 60
    assert [frame.index for frame in found.frames] == list(frame_indices(found.video.frame_count, 25))
    assert "header claims 60 frames" in found.note


def test_no_frame_count_in_the_header(tmp_path: Path) -> None:
    found = read_keyframes(write_clip(tmp_path / "a.ts", 40, container="mpegts"), "a", 25)
    assert found.video.frame_count == 40
    assert [grey_index(frame.rgb) for frame in found.frames] == list(frame_indices(40, 25))


def test_changing_size_is_an_error_that_says_where(tmp_path: Path) -> None:
    first = write_clip(tmp_path / "1.ts", 20, (64, 48), "mpegts")
    second = write_clip(tmp_path / "2.ts", 20, (96, 64), "mpegts")
    path = tmp_path / "both.ts"
    path.write_bytes(first.read_bytes() + second.read_bytes())
    with pytest.raises(VideoError, match="64x48 to 96x64 px at frame 20"):
        read_keyframes(path, "both")


def test_damage_in_the_middle_is_survived_or_said(tmp_path: Path) -> None:
    pictures = list(np.random.default_rng(1).integers(0, 256, (40, 120, 160, 3), dtype=np.uint8))
    path = write_clip(tmp_path / "a.mp4", 40, (160, 120), pictures=pictures, faststart=True)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 20_000] = bytes(20_000)
    path.write_bytes(data)
    found = read_keyframes(path, "a", 25)
    assert len(found.frames) == min(25, found.video.frame_count)
    assert found.video.frame_count == 40 or found.note


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"", "the file is empty"),
        (b"not a video at all" * 100, "not readable as a video"),
        (b"#EXTM3U\n#EXTINF:9,\nhttp://127.0.0.1:9/x.ts\n", "not readable as a video"),
    ],
)
def test_what_is_no_video_is_an_error(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "x.mp4"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(VideoError, match=message):
        read_keyframes(path, "x")


def test_sound_without_pictures_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as output:
        stream = output.add_stream("aac", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 8000
        output.mux(stream.encode(frame))
        output.mux(stream.encode())
    with pytest.raises(VideoError, match="no video stream"):
        read_keyframes(path, "sound")


def test_crop_by_hand() -> None:
    rgb = np.arange(10 * 20 * 3, dtype=np.uint8).reshape(10, 20, 3)
    cut = crop(rgb, Box(2.2, 3.0, 5.5, 6.0))
    assert cut is not None
    np.testing.assert_array_equal(cut, rgb[3:6, 2:6])
    outside = crop(rgb, Box(-5, -5, 3, 2))
    assert outside is not None
    assert outside.shape == (2, 3, 3)
    assert crop(rgb, Box(25, 0, 30, 5)) is None
