"""COOOL annotations into tables: each oddity by values computed by hand, all faults at once, bad input."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.data.coool_checks import check_against, check_tracks
from pipeline.data.coool_import import ImportReport, import_coool
from pipeline.data.coool_pickle import Oddity, read_video
from pipeline.records import Box, Kind, TrackBox, VideoFile
from pipeline.table import metadata
from pipeline.tables import BOXES, VIDEO_FILES
from tests.clips import write_clip
from tests.coool_case import annotations, as_numpy
from tests.test_cli import coooler


def _write(path: Path, content: Any, protocol: int = 4) -> Path:
    path.write_bytes(pickle.dumps(content, protocol))
    return path


def _import(source: Path, out: Path, videos: Path | None = None, workers: int = 1) -> ImportReport:
    return import_coool(source, out / "boxes.parquet", videos, workers=workers, said=lambda *_: None)


def _object(track_id: Any, *bbox: Any) -> dict[str, Any]:
    return {"track_id": track_id, "bbox": list(bbox)}


def _found(video: Any, **of_file: int) -> list[tuple[Oddity, int | None, str | None]]:
    boxes = read_video("v", video)
    assert not boxes.wrong
    findings = [*boxes.findings, *check_tracks(boxes)]
    if of_file:
        file = VideoFile("v", "v.mp4", of_file["frames"], 30.0, of_file["width"], of_file["height"], "")
        findings += check_against(boxes, file)
    return [(one.oddity, one.frame_index, one.track_id) for one in findings]


def _traffic(frames: dict[Any, list[Any]]) -> dict[Any, Any]:
    return {frame: {"traffic_scene": objects} for frame, objects in frames.items()}


def test_two_hundred_videos_come_in_whole(tmp_path: Path) -> None:
    content = annotations(200, 12, 3)
    report = _import(_write(tmp_path / "a.pkl", as_numpy(content)), tmp_path)
    # 11 of 12 frames have 3 objects, one of them the challenge's.
    assert (report.annotated_videos, report.annotated_frames) == (200, 2400)
    assert (report.boxes, report.challenge_boxes, report.tracks) == (200 * 33, 200 * 11, 600)
    assert not report.counts and report.missing_videos is None
    expected = [
        TrackBox(video, frame, str(entry["track_id"]), kind, Box(*map(float, np.float32(entry["bbox"]))))
        for video, frames in content.items()
        for frame, lists in frames.items()
        for name, kind in (("challenge_object", Kind.CHALLENGE), ("traffic_scene", Kind.TRAFFIC))
        for entry in (lists or {}).get(name, ())
    ]
    path, other = tmp_path / "boxes.parquet", tmp_path / "other.parquet"
    BOXES.write(other, reversed(expected))
    assert BOXES.read(path) == BOXES.read(other)
    assert pq.read_schema(path).equals(pq.read_schema(other)) and metadata(path) == metadata(other)
    assert pq.ParquetFile(path).num_row_groups == 200
    assert not (tmp_path / "videos.parquet").exists()


@pytest.mark.parametrize(
    ("entry", "row"),
    [
        (_object(5, 1, 2, 3, 4), ("5", Box(1, 2, 3, 4))),
        (_object("5", 1.5, 2, 3, 4), ("5", Box(1.5, 2, 3, 4))),
        (_object(5.0, 1, 2, 3, 4), ("5", Box(1, 2, 3, 4))),
        (_object(np.int64(5), 1, 2, 3, 4), ("5", Box(1, 2, 3, 4))),
        (_object(np.str_("5"), 1, 2, 3, 4), ("5", Box(1, 2, 3, 4))),
        (_object(np.array(5), 1, 2, 3, 4), ("5", Box(1, 2, 3, 4))),
        (_object(-1, -3.5, -2, 3, 4), ("-1", Box(-3.5, -2, 3, 4))),
        ({"track_id": "ä b", "bbox": (1, 2, 3, 4)}, ("ä b", Box(1, 2, 3, 4))),
        ({"track_id": 1, "bbox": np.array([1, 2, 3, 4], ">i2")}, ("1", Box(1, 2, 3, 4))),
        (
            {"track_id": 1, "bbox": [np.float32(0.1), 2, np.array(3), 4]},
            ("1", Box(float(np.float32(0.1)), 2, 3, 4)),
        ),
        (_object(1, 3, 4, 1, 2), ("1", Box(1, 2, 3, 4))),
    ],
)
@pytest.mark.parametrize("frame", [7, "7", "007", np.int32(7), 7.0])
def test_every_way_to_write_a_box(entry: Any, row: Any, frame: Any, tmp_path: Path) -> None:
    source = _write(tmp_path / "a.pkl", {"v": {frame: {"challenge_object": [entry]}}}, 5)
    _import(source, tmp_path)
    assert BOXES.read(tmp_path / "boxes.parquet") == [TrackBox("v", 7, row[0], Kind.CHALLENGE, row[1])]


@pytest.mark.parametrize(
    ("bbox", "oddity", "kept"),
    [
        ((float("nan"), 0, 1, 1), Oddity.NOT_FINITE, 0),
        ((0, 0, float("inf"), 1), Oddity.NOT_FINITE, 0),
        ((0, 0, 1_000_001, 1), Oddity.NOT_FINITE, 0),
        ((5, 0, 5, 9), Oddity.DEGENERATE, 0),
        ((9, 4, 5, 4), Oddity.DEGENERATE, 0),
        ((9, 0, 5, 9), Oddity.REORDERED, 1),
    ],
)
def test_odd_boxes(bbox: Any, oddity: Oddity, kept: int) -> None:
    video = _traffic({3: [_object("a", *bbox)]})
    assert _found(video) == [(oddity, 3, "a")]
    assert len(read_video("v", video).track_ids) == kept


def test_a_track_twice_in_a_frame_keeps_the_challenges_box() -> None:
    video = {
        0: {
            "traffic_scene": [_object("5", 0, 0, 9, 9), _object(5, 1, 1, 9, 9)],
            "challenge_object": [_object(5, 2, 2, 9, 9)],
        }
    }
    boxes = read_video("v", video)
    assert boxes.track_ids == ["5"] and boxes.boxes_px.tolist() == [[2, 2, 9, 9]] and boxes.is_challenge.all()
    assert [(one.oddity, one.detail) for one in boxes.findings] == [
        (Oddity.MIXED_IDS, "2 boxes as a number, 1 as text"),
        (Oddity.REPEATED, "0, 0, 9, 9"),
        (Oddity.REPEATED, "1, 1, 9, 9"),
    ]


def test_tracks_that_jump() -> None:
    # 10 px sides: 20 px are two of them, which is allowed; 20.1 are not. After a gap, any way is allowed.
    at = {0: 0.0, 1: 20.0, 2: 40.1, 4: 200.0, 19: 0.0}
    video = _traffic(
        {frame: [_object("a", x, 0, x + 10, 10), _object("b", 500, 0, 510, 10)] for frame, x in at.items()}
    )
    assert _found(video) == [(Oddity.JUMP, 2, "a")]
    later = _traffic(
        {0: [_object("a", 0, 0, 10, 10)], 16: [_object("a", 0, 0, 10, 10)], 33: [_object("a", 0, 0, 10, 10)]}
    )
    assert _found(later) == [(Oddity.GAP, 16, "a"), (Oddity.GAP, 33, "a")]
    # Four times the area is allowed, more is not, either way.
    sizes = _traffic({n: [_object("a", 0, 0, side, side)] for n, side in enumerate((10, 20, 41, 41, 20))})
    assert _found(sizes) == [(Oddity.RESIZE, 2, "a"), (Oddity.RESIZE, 4, "a")]


def test_boxes_and_frames_against_the_video() -> None:
    video = _traffic(
        {
            0: [_object("in", 0, 0, 64, 48), _object("left", -1, 0, 9, 9), _object("gone", -9, 0, 0, 9)],
            2: [_object("low", 0, 48, 9, 60)],
            4: [],
            5: [],
        }
    )
    assert _found(video, frames=4, width=64, height=48) == [
        (Oddity.OUTSIDE, 0, "gone"),
        (Oddity.OUTSIDE, 2, "low"),
        (Oddity.PARTLY_OUTSIDE, 0, "left"),
        (Oddity.BEYOND_END, 4, None),
        (Oddity.NOT_ANNOTATED, 1, None),
    ]
    boxes = read_video("v", video)
    details = [one.detail for one in check_against(boxes, VideoFile("v", "", 4, 30.0, 64, 48, ""))]
    assert details[-2:] == ["2 frames, 4 to 5; the video has 4", "2 of 4 frames, the first is 1"]
    assert _found({}, frames=3, width=9, height=9) == [(Oddity.NOT_ANNOTATED, 0, None)]
    assert _found(_traffic({0: [], 1: []}), frames=2, width=9, height=9) == []
    assert _found(_traffic({0: []}), frames=2, width=9, height=9) == [(Oddity.NOT_ANNOTATED, 1, None)]


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    folder = tmp_path / "clips"
    folder.mkdir()
    for name, frames in (("v1", 5), ("v2", 8), ("v4", 5)):
        write_clip(folder / f"{name}.mp4", frames)
    (folder / "v5.mp4").write_bytes(b"no video at all")
    return folder


CLIPPED = {
    "v1": _traffic({n: [_object(1, 60, 40, 70, 50)] for n in range(6)}),
    "v2": _traffic({n: [_object(1, 0, 0, 9, 9)] for n in range(8)}),
    "v3": _traffic({0: [_object(1, 0, 0, 9, 9)]}),
    "v5": {},
}


def test_annotations_and_clips_are_joined(clips: Path, tmp_path: Path) -> None:
    source = _write(tmp_path / "a.pkl", CLIPPED)
    outs = [tmp_path / "one", tmp_path / "two"]
    reports = [_import(source, out, clips, workers) for workers, out in enumerate(outs, start=1)]
    one, two = ({path.name: path.read_bytes() for path in out.iterdir()} for out in outs)
    assert one == two and sorted(one) == ["boxes.parquet", "import-report.json", "videos.parquet"]
    files = VIDEO_FILES.read(outs[0] / "videos.parquet")
    assert [(f.video_id, f.file, f.frame_count, f.fps_hz, f.width_px, f.height_px) for f in files] == [
        ("v1", "v1.mp4", 5, 25.0, 64, 48),
        ("v2", "v2.mp4", 8, 25.0, 64, 48),
        ("v4", "v4.mp4", 5, 25.0, 64, 48),
    ]
    report = reports[0]
    assert report.missing_videos == ["v3"] and report.videos_without_annotations == ["v4"]
    assert report.unreadable is not None and list(report.unreadable) == ["v5"]
    assert str(tmp_path) not in (outs[0] / "import-report.json").read_text()
    told = json.loads((outs[0] / "import-report.json").read_text())["findings"]
    assert {name: found["count"] for name, found in told.items()} == {"partly_outside": 6, "beyond_end": 1}
    assert told["beyond_end"]["listed"] == [
        {
            "video_id": "v1",
            "frame_index": 5,
            "track_id": None,
            "detail": "1 frames, 5 to 5; the video has 5",
        }
    ]


def test_the_command(clips: Path, tmp_path: Path) -> None:
    _write(tmp_path / "a.pkl", CLIPPED)
    run = coooler(tmp_path, "data", "import-coool", "a.pkl", "--videos", "clips")
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[0] == (
        "15 boxes (0 of challenge objects) of 3 tracks in 15 frames of 4 videos -> boxes.parquet"
    )
    assert "1 annotated videos without a clip: v3" in lines and "1 clips that cannot be read: v5" in lines
    before = (tmp_path / "boxes.parquet").read_bytes()
    run = coooler(tmp_path, "data", "import-coool", "a.pkl")
    assert run.returncode == 1 and "--replace" in run.stderr and "Traceback" not in run.stderr
    run = coooler(tmp_path, "data", "import-coool", "a.pkl", "--replace", "--json")
    assert run.returncode == 0 and json.loads(run.stdout)["missing_videos"] is None
    assert (tmp_path / "boxes.parquet").read_bytes() == before


def test_a_hostile_pickle_leaves_a_benchmark_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "coooler.toml").write_text('boxes = "data/b.parquet"\n')
    (tmp_path / "a.pkl").write_bytes(b"cposix\nsystem\n(S'touch pwned'\ntR.")
    run = coooler(tmp_path, "data", "import-coool", "a.pkl")
    assert run.returncode == 1 and "found the global posix.system at byte 0" in run.stderr
    assert "Traceback" not in run.stderr and "Nothing of it was executed" in run.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.pkl", "coooler.toml"]
    (tmp_path / "a.json").write_text(json.dumps({"v1": {"3": {"traffic_scene": [_object(1, 0, 0, 9, 9)]}}}))
    run = coooler(tmp_path, "data", "import-coool", "a.json")
    assert run.returncode == 0, run.stderr
    assert [(row.frame_index, row.track_id) for row in BOXES.read(tmp_path / "data" / "b.parquet")] == [
        (3, "1")
    ]
