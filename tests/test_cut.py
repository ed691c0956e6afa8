"""Cutting clips: which frames, exactly; the same bytes again; what is wrong with a plan."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from pipeline.data.cut import CutJob, chosen_frames, cut_clip
from pipeline.data.decode import read_header
from pipeline.data.plan import ClipPlan, Plan, find_sources, read_plan
from pipeline.errors import ConfigError, InputError
from pipeline.files import sha256_file
from tests.clips import GREY_STEP, grey_index, write_clip

NTSC = Fraction(30000, 1001)

PLAN = """
fps_hz = {fps}
width_px = 32
height_px = 24
preset = "veryfast"
[[sources]]
file = "raw.mp4"
sha256 = "{sha256}"
[[clips]]
video_id = "a"
source = "raw.mp4"
start_s = {start}
frames = {frames}
crf = 4
"""


def _plan(folder: Path, raw: Path, fps: str = "25", start: str = "0.0", frames: int = 10) -> Plan:
    path = folder / "plan.toml"
    path.write_text(PLAN.format(fps=fps, sha256=sha256_file(raw), start=start, frames=frames))
    return read_plan(path)


def _write_ntsc(path: Path, count: int) -> Path:
    """Flat grey frames at 29.97 a second; frame i is grey i * GREY_STEP."""
    with av.open(str(path), "w") as output:
        stream = output.add_stream("libx264", rate=NTSC)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.options = {"crf": "4", "threads": "1"}
        for index in range(count):
            rgb = np.full((48, 64, 3), index * GREY_STEP, np.uint8)
            output.mux(stream.encode(av.VideoFrame.from_ndarray(rgb, format="rgb24")))
        output.mux(stream.encode())
    return path


def _shown(path: Path) -> list[int]:
    with av.open(str(path)) as clip:
        return [grey_index(frame.to_ndarray(format="rgb24")) for frame in clip.decode(video=0)]


def _cut(plan: Plan, raw: Path, target: Path) -> list[int]:
    result = cut_clip(CutJob(plan.clips[0], plan, raw, target))
    assert (result.error, result.frames) == ("", plan.clips[0].frames)
    return _shown(target)


def test_the_same_rate_takes_frame_for_frame_from_the_start() -> None:
    seconds = [Fraction(i, 25) for i in range(40)]
    assert chosen_frames(seconds, Fraction(8, 25), Fraction(25), 5) == (8, 9, 10, 11, 12)
    # A start between two frames: the clip begins with the next one, and none is shown twice.
    assert chosen_frames(seconds, Fraction(33, 100), Fraction(25), 4) == (9, 10, 11, 12)


def test_a_lower_rate_leaves_frames_out_and_a_higher_one_repeats_them_by_hand() -> None:
    ntsc = [i / NTSC for i in range(40)]
    # i * 25 / 29.97 = 0, .834, 1.668, 2.503, 3.337, 4.171, 5.005, 5.839, 6.674: 0 1 2 3 3 4 5 6 7 rounded.
    assert chosen_frames(ntsc, Fraction(0), Fraction(25), 8) == (0, 1, 2, 4, 5, 6, 7, 8)
    # i * 25 / 10 = 0, 2.5, 5, ...; half is rounded up, so frame 1 comes at 3.
    slow = [Fraction(i, 10) for i in range(10)]
    assert chosen_frames(slow, Fraction(0), Fraction(25), 7) == (0, 0, 0, 1, 1, 2, 2)


def test_a_source_that_ends_early_is_refused() -> None:
    seconds = [Fraction(i, 25) for i in range(10)]
    assert chosen_frames(seconds, Fraction(0), Fraction(25), 10) == tuple(range(10))
    for start, count in ((Fraction(0), 11), (Fraction(1), 1)):
        with pytest.raises(ValueError, match=r"ends at 0\.400 s"):
            chosen_frames(seconds, start, Fraction(25), count)


@pytest.mark.parametrize(("start", "first"), [("0.0", 0), ("0.48", 12), ("1.2", 30)])
def test_a_clip_begins_where_the_plan_says(tmp_path: Path, start: str, first: int) -> None:
    raw = write_clip(tmp_path / "raw.mp4", 45)
    plan = _plan(tmp_path, raw, start=start)
    assert _cut(plan, raw, tmp_path / "a.mp4") == list(range(first, first + 10))
    with av.open(str(tmp_path / "a.mp4")) as clip:
        stream = clip.streams.video[0]
        assert (stream.frames, stream.average_rate) == (10, 25)
        assert (stream.width, stream.height) == (32, 24)


def test_29_97_to_25_shows_the_frames_of_the_definition(tmp_path: Path) -> None:
    raw = _write_ntsc(tmp_path / "raw.mp4", 50)
    plan = _plan(tmp_path, raw, start="0.5", frames=20)
    # The first frame from 0.5 s is 15; frame k is the last whose (time - 0.5) * 25 is below k + 1/2.
    places = {i: (i / NTSC - Fraction(1, 2)) * 25 for i in range(50) if i / NTSC >= Fraction(1, 2)}
    definition = [max(i for i, place in places.items() if place < k + Fraction(1, 2)) for k in range(20)]
    assert _cut(plan, raw, tmp_path / "a.mp4") == definition
    assert definition[0] == 15


def test_the_same_plan_gives_the_same_bytes(tmp_path: Path) -> None:
    raw = write_clip(tmp_path / "raw.mp4", 30)
    plan = _plan(tmp_path, raw)
    for name in ("one.mp4", "two.mp4"):
        _cut(plan, raw, tmp_path / name)
    assert (tmp_path / "one.mp4").read_bytes() == (tmp_path / "two.mp4").read_bytes()


def test_a_clip_that_cannot_be_cut_is_said_and_leaves_nothing(tmp_path: Path) -> None:
    raw = write_clip(tmp_path / "raw.mp4", 5)
    plan, out = _plan(tmp_path, raw), tmp_path / "out"
    out.mkdir()
    result = cut_clip(CutJob(plan.clips[0], plan, raw, out / "a.mp4"))
    assert "a: " in result.error
    assert "ends at 0.200 s; expected at least 0.400 s" in result.error
    (tmp_path / "broken.mp4").write_bytes(b"no video")
    broken = cut_clip(CutJob(plan.clips[0], plan, tmp_path / "broken.mp4", out / "a.mp4"))
    assert "not readable as a video" in broken.error
    assert list(out.iterdir()) == []


def test_sources_are_known_by_their_hash(tmp_path: Path) -> None:
    raw = write_clip(tmp_path / "raw.mp4", 12)
    plan = _plan(tmp_path, raw)
    assert find_sources(plan, tmp_path) == {"raw.mp4": raw}
    raw.write_bytes(raw.read_bytes() + b"\0")
    with pytest.raises(InputError, match=r"1 of 1 raw videos.*\n.*found SHA-256"):
        find_sources(plan, tmp_path)
    raw.unlink()
    with pytest.raises(InputError, match="no such file"):
        find_sources(plan, tmp_path)
    with pytest.raises(InputError, match="--sources"):
        find_sources(plan, None)
    missing = plan.model_copy(update={"package": "coooler_no_such_package"})
    with pytest.raises(InputError, match="coooler_no_such_package"):
        find_sources(missing, None)


SECOND = 'crf = 4\n[[clips]]\nvideo_id = "A"\nsource = "raw.mp4"\nstart_s = 0\nframes = 1'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('video_id = "a"', 'video_id = "../a"', "clips.0.video_id"),
        ('file = "raw.mp4"', 'file = "/etc/passwd"', "sources.0.file"),
        ("width_px = 32", "width_px = 33", "width_px"),
        ("crf = 4", "crf = 99\nspeed = 3", "clips.0.speed"),
        ("crf = 4", SECOND, "2 times"),
        ('source = "raw.mp4"', 'source = "other.mp4"', "no source other.mp4"),
        ("frames = 10", "frames = 0", "clips.0.frames"),
        ("fps_hz = 25", "fps_hz = [", "not readable as TOML"),
    ],
)
def test_a_wrong_plan_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "plan.toml"
    text = PLAN.format(fps=25, sha256="0" * 64, start="0.0", frames=10)
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=said.replace(".", r"\.")):
        read_plan(path)


def test_start_times_are_exact() -> None:
    clip = ClipPlan(video_id="a", source="raw.mp4", start_s="36.92", frames=1)
    assert clip.start == Fraction(923, 25)


def test_a_header_without_a_rate_or_times_is_read(tmp_path: Path) -> None:
    header = read_header(write_clip(tmp_path / "raw.h264", 12, container="h264"))
    assert header.times == ()
    assert header.rate_hz > 0
