"""`coooler data restore`: better pictures, the clip otherwise as it was, resumable, past broken clips."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from av.video.reformatter import VideoReformatter

from bench.degrade import degraded, psnr
from pipeline.data.decode import decoded, read_header
from pipeline.data.denoise import UnsharpMask
from pipeline.data.encode import EXACT, write_h264
from pipeline.data.restore import ERASING, RestoreSettings, read_timeline, restore_clip
from pipeline.data.restore_all import restore_all
from pipeline.data.restore_record import RestoreJob
from pipeline.errors import InputError, VideoError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.records import RgbImage
from pipeline.video import upright

ROOT = Path(__file__).parent.parent
SIZE = (192, 108)
FAST = RestoreSettings(preset="ultrafast")


def pictures(path: Path) -> list[RgbImage]:
    reformatter = VideoReformatter()
    return [upright(frame, reformatter, EXACT) for frame in decoded(path)]


@pytest.fixture(scope="module")
def clean() -> list[RgbImage]:
    """Fourteen frames over a demo clip, made smaller."""
    reformatter = VideoReformatter()
    frames = islice(decoded(ROOT / "demo" / "videos" / "demo_0003.mp4"), 0, 112, 8)
    full = [upright(frame, reformatter, EXACT) for frame in frames]
    return [np.asarray(cv2.resize(rgb, SIZE, interpolation=cv2.INTER_AREA), np.uint8) for rgb in full]


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory, clean: list[RgbImage]) -> Path:
    """Three clips, spoilt in different ways, and one that is none."""
    folder = tmp_path_factory.mktemp("clips") / "videos"
    folder.mkdir()
    ways = {"a": ("blur", "noise", "logo"), "b": ("noise",), "c": ("logo",)}
    for name, kinds in ways.items():
        spoilt = (degraded(rgb, kinds, seed) for seed, rgb in enumerate(clean))
        write_h264(folder / f"{name}.mp4", spoilt, rate=Fraction(25), size=SIZE, crf=8)
    (folder / "d.mp4").write_bytes(b"this is no video" * 40)
    return folder


def jobs(videos: Path, out: Path, settings: RestoreSettings = FAST, names: str = "abc") -> list[RestoreJob]:
    return [RestoreJob(videos / f"{name}.mp4", out, settings, None) for name in names]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def coooler(*arguments: object, code: int = 0) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "sitegen.cli", "data", "restore", *map(str, arguments)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == code, ran.stderr
    assert "Traceback" not in ran.stderr
    return ran


def test_restoring_a_spoilt_piece_of_a_demo_clip_brings_it_nearer_to_the_clean_one(
    videos: Path, tmp_path: Path, clean: list[RgbImage]
) -> None:
    made = restore_clip(videos / "a.mp4", tmp_path, FAST)
    before = [psnr(*pair) for pair in zip(pictures(videos / "a.mp4"), clean, strict=True)]
    after = [psnr(*pair) for pair in zip(pictures(tmp_path / "a.mp4"), clean, strict=True)]
    assert all(b > a for a, b in zip(before, after, strict=True))
    assert np.mean(after) > np.mean(before) + 1
    assert [(step["step"], step["method"]) for step in made.steps] == [
        ("watermark", ERASING),
        ("denoise", "OpenCV non-local means"),
        ("deblur", "unsharp mask"),
    ]


def test_a_box_that_is_given_is_filled_and_nothing_else_is_touched(videos: Path, tmp_path: Path) -> None:
    made = restore_clip(videos / "c.mp4", tmp_path, RestoreSettings(("watermark",), crf=1), [(8, 4, 100, 30)])
    assert made.steps[0]["settings"]["boxes_px"] == [[8, 4, 100, 30]]
    mask = cv2.imread(str(tmp_path / "restoration" / "c.mask.png"), cv2.IMREAD_GRAYSCALE)
    assert mask is not None and (mask[4:30, 8:100] == 255).all() and np.count_nonzero(mask) == 26 * 92
    for before, after in zip(pictures(videos / "c.mp4"), pictures(tmp_path / "c.mp4"), strict=True):
        change = np.abs(before.astype(int) - after)
        assert change[40:].mean() < 1.5
        assert change[4:30, 8:100].mean() > 5


def test_the_same_bytes_whatever_the_workers_and_the_originals_as_they_were(
    videos: Path, tmp_path: Path
) -> None:
    before = contents(videos)
    one = restore_all(jobs(videos, tmp_path / "one", names="ac"), SerialExecutor())
    two = restore_all(jobs(videos, tmp_path / "two", names="ca"), ProcessExecutor(2))
    assert one == two and [outcome.video_id for outcome in one] == ["a", "c"]
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    assert not any(outcome.error for outcome in one)
    assert contents(videos) == before
    record = json.loads((tmp_path / "one" / "restoration" / "a.restore.json").read_text())
    assert set(record["files_sha256"]) | {"restoration/a.restore.json"} == {
        name for name in contents(tmp_path / "one") if Path(name).name.startswith("a.")
    }


def test_only_what_changed_is_done_again(videos: Path, tmp_path: Path) -> None:
    source, out = tmp_path / "videos", tmp_path / "out"
    shutil.copytree(videos, source)

    def reused(settings: RestoreSettings) -> dict[str, bool]:
        found = restore_all(jobs(source, out, settings, "bc"), SerialExecutor())
        assert not any(outcome.error for outcome in found)
        return {outcome.video_id: outcome.reused for outcome in found}

    sharp = RestoreSettings(("deblur",), preset="ultrafast")
    assert reused(sharp) == {"b": False, "c": False}
    whole = contents(out)
    assert reused(sharp) == {"b": True, "c": True}
    (out / "b.mp4").write_bytes(whole["b.mp4"][:-1])
    assert reused(sharp) == {"b": False, "c": True}
    (out / "restoration" / "c.after.webp").unlink()
    assert reused(sharp) == {"b": True, "c": False}
    (out / "restoration" / "c.restore.json").write_text('{"files_sha256": {"../videos/c.mp4": "0"}}')
    (out / ".b.mp4.abc.tmp").write_bytes(b"left by a kill")
    assert reused(sharp) == {"b": True, "c": False}
    assert contents(out) == whole
    shutil.copy(source / "c.mp4", source / "b.mp4")
    assert reused(sharp) == {"b": False, "c": True}
    assert reused(RestoreSettings(("watermark",), preset="ultrafast")) == {"b": False, "c": False}
    assert (out / "restoration" / "b.mask.png").exists()
    assert reused(sharp) == {"b": False, "c": False}
    assert not (out / "restoration" / "b.mask.png").exists()  # what another run's settings made is gone


def test_killed_on_the_way_and_run_again(videos: Path, tmp_path: Path) -> None:
    """SIGKILL to the command alone: its workers end too, and the next run makes what a quiet one makes."""
    noise = RestoreSettings(("denoise",), preset="ultrafast")
    options: list[object] = [
        "--videos",
        videos,
        "--workers",
        2,
        "--preset",
        "ultrafast",
        "--steps",
        "denoise",
    ]
    options += [word for name in "ab" for word in ("--only", name)]
    command = [sys.executable, "-m", "sitegen.cli", "data", "restore", *map(str, options)]
    out = tmp_path / "killed"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT}
    with subprocess.Popen([*command, "--out", str(out)], **quiet) as run:
        progress = out / "restoration" / ".progress"
        while not (progress.exists() and progress.stat().st_size):
            assert run.poll() is None, "it ended before it began"
            time.sleep(0.01)
        workers = children(run.pid)
        os.kill(run.pid, signal.SIGKILL)
    while any(map(alive, workers)):  # it ends: a worker that goes on would be a fault, and the test hang
        time.sleep(0.05)
    records = list((out / "restoration").glob("*.restore.json"))
    assert len(records) < 2
    for folder in (out, tmp_path / "quiet"):
        found = restore_all(jobs(videos, folder, noise, "ab"), SerialExecutor())
        assert not any(outcome.error for outcome in found)
    assert contents(out) == contents(tmp_path / "quiet")


def children(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in found]


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_broken_clip_is_said_and_the_others_are_done(videos: Path, tmp_path: Path) -> None:
    options = ["--json", "--steps", "deblur", "--preset", "ultrafast"]
    ran = coooler("--videos", videos, "--out", tmp_path / "out", *options, code=1)
    found = {video["video_id"]: video for video in json.loads(ran.stdout)["videos"]}
    assert [name for name, video in found.items() if video["error"]] == ["d"]
    assert "d.mp4: not readable as a video" in found["d"]["error"]
    assert "failed: d:" in ran.stderr
    assert sorted(path.name for path in (tmp_path / "out").glob("*.mp4")) == ["a.mp4", "b.mp4", "c.mp4"]


def test_folders_that_must_not_be_written_to(videos: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(videos)
    assert "another one (--out)" in coooler("--videos", videos, "--out", link, code=1).stderr
    others = tmp_path / "others"
    shutil.copytree(videos, others)
    with pytest.raises(InputError, match="not restored"):
        restore_all(jobs(videos, others), SerialExecutor())
    assert contents(others) == contents(videos)


def turned(path: Path, target: Path) -> Path:
    """The clip with a header that says: show it turned by a quarter."""
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 40
    quarter = [0, 0x10000, 0, 0xFFFF0000, 0, 0, 0, 0, 0x40000000]
    data[at : at + 36] = b"".join(value.to_bytes(4, "big") for value in quarter)
    target.write_bytes(data)
    return target


def test_a_turned_clip_comes_out_upright(videos: Path, tmp_path: Path) -> None:
    source = turned(videos / "c.mp4", tmp_path / "t.mp4")
    restore_clip(source, tmp_path / "out", RestoreSettings((), crf=4))
    found, expected = pictures(tmp_path / "out" / "t.mp4"), pictures(source)
    assert found[0].shape == expected[0].shape == (*SIZE, 3)
    assert np.abs(found[3].astype(int) - expected[3]).mean() < 2
    assert next(decoded(tmp_path / "out" / "t.mp4")).rotation == 0


def test_times_of_a_varying_rate_and_of_milliseconds(clean: list[RgbImage], tmp_path: Path) -> None:
    uneven = [0, 40, 70, 200, 210, 400]
    source = tmp_path / "v.mp4"
    base = Fraction(1, 1000)
    write_h264(source, clean[:6], rate=Fraction(25), size=SIZE, pts=uneven, time_base=base)
    restore_clip(source, tmp_path / "out", RestoreSettings((), preset="ultrafast"))
    assert read_header(tmp_path / "out" / "v.mp4").seconds == [at * base for at in uneven]

    ragged = tmp_path / "m.mp4"  # 29.97 frames a second as Matroska has it, in whole milliseconds
    pts = [round(index * 1001 / 30) for index in range(14)]
    write_h264(ragged, clean, rate=Fraction(30000, 1001), size=SIZE, pts=pts, time_base=base)
    timeline = read_timeline(ragged, read_header(ragged))
    assert (timeline.frames, timeline.pts) == (14, None)


def test_an_odd_size_and_sound(clean: list[RgbImage], tmp_path: Path) -> None:
    source = tmp_path / "s.mkv"
    with av.open(str(source), "w") as output:
        video: Any = output.add_stream("ffv1", rate=Fraction(30000, 1001))
        video.width, video.height, video.pix_fmt = 101, 75, "bgr0"
        sound = output.add_stream("aac", rate=16000)
        for rgb in clean[:5]:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb[:75, :101]), format="rgb24")
            output.mux(video.encode(frame))
        quiet = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        quiet.sample_rate = 16000
        output.mux(sound.encode(quiet))
        output.mux(video.encode())
        output.mux(sound.encode())
    made = restore_clip(source, tmp_path / "out", RestoreSettings((), crf=4))
    with av.open(str(tmp_path / "out" / "s.mp4")) as container:
        assert [stream.type for stream in container.streams] == ["video"]
        assert container.streams.video[0].average_rate == Fraction(30000, 1001)
    found = pictures(tmp_path / "out" / "s.mp4")
    assert (len(found), found[0].shape) == (5, (76, 102, 3))
    assert np.abs(found[2][:75, :101].astype(int) - clean[2][:75, :101]).mean() < 6
    assert made.timeline.notes == ("an odd size: 101x75 px became 102x76, as H.264 4:2:0 asks for",)


def test_a_clip_cut_short_is_noted_and_one_without_frames_refused(videos: Path, tmp_path: Path) -> None:
    data = (videos / "b.mp4").read_bytes()
    (tmp_path / "cut.mp4").write_bytes(data[: len(data) // 2])
    timeline = read_timeline(tmp_path / "cut.mp4", read_header(tmp_path / "cut.mp4"))
    assert 0 < timeline.frames < 14
    (tmp_path / "none.mp4").write_bytes(data[: data.index(b"mdat") + 4])
    with pytest.raises(VideoError):
        restore_clip(tmp_path / "none.mp4", tmp_path / "out", FAST)
    assert not (tmp_path / "out").exists()


def test_a_clip_that_changes_meanwhile_gets_no_record(
    videos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "videos"
    shutil.copytree(videos, source)
    sharpen = UnsharpMask.__call__

    def write_meanwhile(self: UnsharpMask, rgb: RgbImage) -> RgbImage:
        with (source / "c.mp4").open("ab") as clip:
            clip.write(b"more")
        return sharpen(self, rgb)

    monkeypatch.setattr(UnsharpMask, "__call__", write_meanwhile)
    settings = RestoreSettings(("deblur",), preset="ultrafast")
    (found,) = restore_all(jobs(source, tmp_path / "out", settings, "c"), SerialExecutor())
    assert "changed meanwhile" in found.error
    assert not (tmp_path / "out" / "restoration" / "c.restore.json").exists()


def test_a_file_of_the_folder_is_no_network(videos: Path, tmp_path: Path) -> None:
    settings = RestoreSettings(denoise_model=videos / "d.mp4")
    with pytest.raises(InputError, match="no ONNX model"):
        restore_all(jobs(videos, tmp_path / "out", settings), SerialExecutor())
    assert not (tmp_path / "out").exists()
