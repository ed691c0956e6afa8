"""The H.264 that we write: frames, rate, times and colours as given, and the same bytes every time."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from av.video.reformatter import VideoReformatter
from hypothesis import given
from hypothesis import strategies as st

from pipeline.data.encode import EXACT, Colour, even_size, write_h264
from pipeline.errors import OutsideError
from pipeline.records import RgbImage
from pipeline.video import upright

SIZE = (64, 48)


def moving(count: int, size: tuple[int, int] = SIZE) -> list[RgbImage]:
    """Smooth coloured pictures that change from frame to frame, of (width, height)."""
    rows, columns = np.mgrid[: size[1], : size[0]].astype(np.float64)
    made = []
    for index in range(count):
        waves = [np.sin(columns / 9 + index / 4), np.cos(rows / 7 - index / 5), np.sin((rows + columns) / 11)]
        made.append(np.rint(128 + 90 * np.stack(waves, -1)).astype(np.uint8))
    return made


def read(path: Path) -> tuple[list[av.VideoFrame], av.VideoStream]:
    with av.open(str(path)) as container:
        return list(container.decode(video=0)), container.streams.video[0]


@pytest.mark.parametrize("rate", ["25", "30000/1001", "24000/1001", "12", "2997/100", "1000", "1/2"])
def test_the_rate_is_kept_to_the_last_digit(tmp_path: Path, rate: str) -> None:
    path = tmp_path / "a.mp4"
    assert write_h264(path, moving(20), rate=Fraction(rate), size=SIZE, preset="ultrafast") == 20
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == Fraction(rate)
        assert stream.frames == 20
        assert stream.duration * stream.time_base == 20 / Fraction(rate)
        times = [frame.pts * frame.time_base for frame in container.decode(stream)]
        assert times == [index / Fraction(rate) for index in range(20)]


def test_times_that_vary_are_kept(tmp_path: Path) -> None:
    pts, base = [0, 40, 41, 130, 131, 500, 1000], Fraction(1, 1000)
    path = tmp_path / "a.mp4"
    write_h264(path, moving(7), rate=Fraction(7), size=SIZE, pts=pts, time_base=base)
    frames, _ = read(path)
    assert [frame.pts * frame.time_base for frame in frames] == [at * base for at in pts]


def test_browsers_can_play_it_before_it_is_whole(tmp_path: Path) -> None:
    """4:2:0, one video stream, and the index before the pictures."""
    path = tmp_path / "a.mp4"
    write_h264(path, moving(5), rate=Fraction(25), size=SIZE)
    with av.open(str(path)) as container:
        assert [stream.type for stream in container.streams] == ["video"]
        context = container.streams.video[0].codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
    data = path.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_the_same_bytes_every_time_and_no_date(tmp_path: Path) -> None:
    for name in "ab":
        write_h264(tmp_path / f"{name}.mp4", moving(12), rate=Fraction(25), size=SIZE)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


TAGS = [Colour(), Colour(1, 1, 1), Colour(6, 6, 6), Colour(5, 6, 5), Colour(9, 1, 9)]


@pytest.mark.parametrize("colour", TAGS)
def test_colours_come_back_and_are_no_darker(tmp_path: Path, colour: Colour) -> None:
    path = tmp_path / "a.mp4"
    given_frames = moving(6)
    write_h264(path, given_frames, rate=Fraction(25), size=SIZE, crf=1, colour=colour)
    frames, stream = read(path)
    assert Colour.of(stream.codec_context) == colour
    reformatter = VideoReformatter()
    found = np.stack([upright(frame, reformatter, EXACT) for frame in frames]).astype(float)
    change = found - np.stack(given_frames)
    assert np.abs(change.mean((0, 1, 2))).max() < 0.4
    assert np.abs(change).mean() < 2


def test_unknown_colour_codes_count_as_unspecified() -> None:
    class Context:
        color_primaries, color_trc, colorspace = 3, 200, 14

    assert Colour.of(Context()) == Colour()


def test_decoded_frames_are_taken_as_they_are(tmp_path: Path) -> None:
    """Once more through the encoder: the numbers of a frame are not converted, so little is lost."""
    first, second = tmp_path / "a.mp4", tmp_path / "b.mp4"
    write_h264(first, moving(9), rate=Fraction(25), size=SIZE, crf=10)
    write_h264(second, read(first)[0], rate=Fraction(25), size=SIZE, crf=1)
    for before, after in zip(read(first)[0], read(second)[0], strict=True):
        change = before.to_ndarray().astype(float) - after.to_ndarray()
        assert np.abs(change).mean() < 1


@given(st.integers(1, 9000), st.integers(1, 9000))
def test_even_size_adds_at_most_one(width: int, height: int) -> None:
    wide, high = even_size((width, height))
    assert wide % 2 == high % 2 == 0
    assert 0 <= wide - width <= 1 and 0 <= high - height <= 1


@pytest.mark.parametrize("size", [(63, 47), (64, 47), (63, 48)])
def test_an_odd_size_gets_its_last_row_and_column_again(tmp_path: Path, size: tuple[int, int]) -> None:
    path = tmp_path / "a.mp4"
    pictures = moving(3, size)
    write_h264(path, pictures, rate=Fraction(25), size=size, crf=1)
    frames, stream = read(path)
    assert (stream.width, stream.height) == (64, 48)
    found = frames[0].to_ndarray(format="rgb24").astype(float)
    assert np.abs(found[: size[1], : size[0]] - pictures[0]).mean() < 4
    assert np.abs(found[-1] - found[-2]).mean() < 12


def test_the_shape_of_pixels_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    write_h264(path, moving(3), rate=Fraction(25), size=SIZE, sample_aspect=Fraction(4, 3))
    assert read(path)[1].sample_aspect_ratio == Fraction(4, 3)


def test_wrong_frames_leave_no_file_and_no_trace(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(b"as it was")
    rate, base = Fraction(25), Fraction(1, 9)
    calls = [
        lambda: write_h264(path, [], rate=rate, size=SIZE),
        lambda: write_h264(path, [*moving(2), *moving(1, (62, 48))], rate=rate, size=SIZE),
        lambda: write_h264(path, moving(3), rate=rate, size=SIZE, pts=[0, 1], time_base=base),
        lambda: write_h264(path, moving(3), rate=rate, size=SIZE, pts=[0, 2, 2], time_base=base),
    ]
    for call in calls:
        with pytest.raises(ValueError, match="expected"):
            call()
    wide = [np.zeros((2, 20_000, 3), np.uint8)]
    with pytest.raises(OutsideError, match="20000x2 px cannot be written"):
        write_h264(path, wide, rate=rate, size=(20_000, 2))
    assert [(found.name, found.read_bytes()) for found in tmp_path.iterdir()] == [("a.mp4", b"as it was")]
