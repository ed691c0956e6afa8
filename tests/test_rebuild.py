"""The demo from its raw videos: boxes and clips are those that are committed, byte for byte."""

import json
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipeline.data.cut import CutJob, cut_clip
from pipeline.data.keyboxes import read_key_boxes
from pipeline.data.plan import find_sources, read_plan
from pipeline.data.rebuild import FileCheck, Verdict, cut_all, rebuild
from pipeline.errors import InputError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.files import sha256_file
from pipeline.tables import BOXES
from sitegen.cli import app
from tests.clips import write_clip

DEMO = Path(__file__).parent.parent / "demo"

PLAN = """
fps_hz = 25
width_px = 32
height_px = 24
preset = "veryfast"
key_boxes = "keyboxes.csv"
[[sources]]
file = "raw.mp4"
sha256 = "{sha256}"
"""
CLIP = """
[[clips]]
video_id = "{name}"
source = "raw.mp4"
start_s = {start}
frames = 10
"""
KEYS = """video_id,track_id,kind,frame_index,x1_px,y1_px,x2_px,y2_px
a,1,challenge,0,0,0,9,9
a,1,challenge,4,4,4,12,12
"""


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """A plan of two clips, its raw video in `raw/`, and nothing made yet."""
    (tmp_path / "raw").mkdir()
    raw = write_clip(tmp_path / "raw" / "raw.mp4", 40)
    clips = CLIP.format(name="a", start="0.0") + CLIP.format(name="b", start="0.6")
    (tmp_path / "plan.toml").write_text(PLAN.format(sha256=sha256_file(raw)) + clips)
    (tmp_path / "keyboxes.csv").write_text(KEYS)
    return tmp_path / "plan.toml"


def _rebuild(plan: Path, *, replace: bool) -> dict[str, FileCheck]:
    checks = rebuild(plan, plan.parent / "raw", SerialExecutor(), lambda: None, replace=replace)
    return {check.file: check for check in checks}


def test_the_demos_boxes_are_made_from_its_key_boxes(tmp_path: Path) -> None:
    out = tmp_path / "boxes.parquet"
    command = ["data", "boxes", str(DEMO / "keyboxes.csv"), "--out", str(out)]
    result = CliRunner().invoke(app, [*command, "--videos", str(DEMO / "videos"), "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["boxes"] == 3169
    assert out.read_bytes() == (DEMO / "boxes.parquet").read_bytes()
    tracks = {(box.video_id, box.track_id) for box in BOXES.read(out)}
    assert tracks == {(key.video_id, key.track_id) for key in read_key_boxes(DEMO / "keyboxes.csv")}


@pytest.mark.parametrize("video_id", ["demo_0002", "demo_0009"])  # 29.97 frames a second, and 25
def test_the_demos_clips_are_cut_from_the_raw_videos(tmp_path: Path, video_id: str) -> None:
    plan = read_plan(DEMO / "plan.toml")
    sources = find_sources(plan, None)
    clip = next(clip for clip in plan.clips if clip.video_id == video_id)
    result = cut_clip(CutJob(clip, plan, sources[clip.source], tmp_path / clip.file))
    assert result.error == ""
    assert (tmp_path / clip.file).read_bytes() == (DEMO / "videos" / clip.file).read_bytes()


def test_the_demos_plan_has_every_clip_and_no_other() -> None:
    plan = read_plan(DEMO / "plan.toml")
    there = sorted(path.name for path in (DEMO / "videos").iterdir())
    assert sorted(clip.file for clip in plan.clips) == there
    spans = sorted((clip.source, clip.start, clip.start + clip.frames / plan.rate) for clip in plan.clips)
    for (source, _, end), (other, start, _) in pairwise(spans):
        assert source != other or end <= start  # no two clips share a moment


def test_a_rebuild_makes_what_is_missing_and_then_finds_it_the_same(plan: Path) -> None:
    assert {check.verdict for check in _rebuild(plan, replace=False).values()} == {Verdict.MISSING}
    assert not (plan.parent / "videos").exists()
    _rebuild(plan, replace=True)
    assert sorted(path.name for path in (plan.parent / "videos").iterdir()) == ["a.mp4", "b.mp4"]
    assert {check.verdict for check in _rebuild(plan, replace=False).values()} == {Verdict.SAME}
    assert [box.box.x1_px for box in BOXES.read(plan.parent / "boxes.parquet")] == [0, 1, 2, 3, 4]


def test_another_encoding_is_alike_and_another_part_of_the_video_is_not(plan: Path) -> None:
    _rebuild(plan, replace=True)
    videos, other = plan.parent / "videos", plan.parent / "other"
    good = (videos / "a.mp4").read_bytes()
    other.mkdir()
    faster = read_plan(plan).model_copy(update={"preset": "ultrafast"})
    sources = {"raw.mp4": plan.parent / "raw" / "raw.mp4"}
    cut_all(faster, sources, other, SerialExecutor(), lambda: None, ["a"])
    shutil.copy(other / "a.mp4", videos / "a.mp4")
    shutil.copy(videos / "a.mp4", videos / "c.mp4")
    (videos / "b.mp4").write_bytes(good)
    boxes = BOXES.read(plan.parent / "boxes.parquet")
    BOXES.write(plan.parent / "boxes.parquet", boxes[1:])
    found = _rebuild(plan, replace=False)
    assert {name: check.verdict for name, check in found.items()} == {
        "videos/a.mp4": Verdict.ALIKE,
        "videos/b.mp4": Verdict.DIFFERENT,
        "videos/c.mp4": Verdict.EXTRA,
        "boxes.parquet": Verdict.DIFFERENT,
    }
    assert found["boxes.parquet"].note == "1 rows differ"
    (videos / "b.mp4").write_bytes(b"broken")
    BOXES.write(plan.parent / "boxes.parquet", boxes, {"other": "mark"})
    found = _rebuild(plan, replace=True)
    assert found["videos/b.mp4"].verdict is Verdict.DIFFERENT
    assert found["boxes.parquet"].verdict is Verdict.ALIKE
    assert (videos / "a.mp4").read_bytes() == good
    assert (videos / "c.mp4").exists()


def test_the_command_exits_1_on_a_difference_and_prints_the_verdicts(plan: Path) -> None:
    command = ["data", "rebuild", str(plan), "--sources", str(plan.parent / "raw"), "--workers", "1"]
    missing = CliRunner().invoke(app, [*command, "--check"])
    assert missing.exit_code == 1
    assert "videos/a.mp4: not there" in missing.stdout
    assert CliRunner().invoke(app, command).exit_code == 0
    same = CliRunner().invoke(app, [*command, "--check", "--json"])
    assert same.exit_code == 0
    assert {one["verdict"] for one in json.loads(same.stdout)["files"]} == {"same bytes"}


def test_nothing_changes_when_something_cannot_be_made(plan: Path) -> None:
    text = plan.read_text()
    plan.write_text(text + CLIP.format(name="c", start="1.5") + CLIP.format(name="d", start="9.0"))
    with pytest.raises(InputError, match="2 of 4 clips could not be cut") as found:
        _rebuild(plan, replace=True)
    assert "c: " in str(found.value)
    assert "d: " in str(found.value)
    plan.write_text(text)
    (plan.parent / "keyboxes.csv").write_text(KEYS.replace("challenge,4", "challenge,10"))
    with pytest.raises(InputError, match="track 1 of a at frame 10"):
        _rebuild(plan, replace=True)
    assert not (plan.parent / "videos").exists()


def test_workers_do_not_change_the_bytes(plan: Path) -> None:
    sources, read = {"raw.mp4": plan.parent / "raw" / "raw.mp4"}, read_plan(plan)
    for name, executor in (("one", SerialExecutor()), ("two", ProcessExecutor(2))):
        cut_all(read, sources, plan.parent / name, executor, lambda: None)
    for clip in read.clips:
        one, two = (plan.parent / name / clip.file for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()
    with pytest.raises(InputError, match="no clip z"):
        cut_all(read, sources, plan.parent / "x", SerialExecutor(), lambda: None, ["z"])
