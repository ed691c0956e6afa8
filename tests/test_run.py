"""Runs over real clips with the real embedded agents: broken files, resuming, same bytes."""

import json
import shutil
from pathlib import Path

import pytest

from pipeline.config import FrameSettings, RunConfig, Track2Settings
from pipeline.errors import FaultsError, InputError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.places import Place
from pipeline.records import Box, Kind, Stage, TrackBox
from pipeline.run import RUN_TABLES, RunReport, VideoRun, find_videos, predict
from pipeline.table import metadata
from pipeline.tables import BOXES, OUTCOMES, PREDICTIONS, STAGES
from tests.clips import write_clip

DEMO = Path(__file__).parent.parent / "demo"
# Few frames and questions: these tests are about the run, the demo runs the full setting.
QUICK = RunConfig(frames=FrameSettings(count=4), track2=Track2Settings(queries=3))


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    """Two of the demo's clips."""
    folder = tmp_path / "videos"
    folder.mkdir()
    for path in sorted((DEMO / "videos").glob("*.mp4"))[:2]:
        shutil.copy(path, folder / path.name)
    return folder


def _boxes() -> list[TrackBox]:
    return BOXES.read(DEMO / "boxes.parquet")


def _predict(folder: Path, out: Path, config: RunConfig = QUICK, workers: int = 1) -> RunReport:
    executor = ProcessExecutor(workers) if workers > 1 else SerialExecutor()
    return predict(_found(folder), _boxes(), config, Place(str(out)), executor)


def _found(folder: Path) -> list[Place]:
    return find_videos(Place(str(folder)))


def _bytes(out: Path) -> dict[str, bytes]:
    return {table.name: (out / f"{table.name}.parquet").read_bytes() for table in RUN_TABLES}


def test_a_broken_video_is_recorded_and_the_run_goes_on(clips: Path, tmp_path: Path) -> None:
    (clips / "broken.mp4").write_bytes(b"no video")
    (clips / "empty.mp4").write_bytes(b"")
    write_clip(clips / "short.mp4", 3)
    report = _predict(clips, tmp_path / "run")
    outcomes = {outcome.video_id: outcome for outcome in OUTCOMES.read(tmp_path / "run" / "outcomes.parquet")}
    assert len(outcomes) == 5
    assert "not readable as a video" in outcomes["broken"].error
    assert "empty" in outcomes["empty"].error
    assert (outcomes["short"].error, outcomes["short"].frame_count) == ("", 3)
    assert {outcome.video_id for outcome in report.failed} == {"broken", "empty"}
    stages = STAGES.read(tmp_path / "run" / "stages.parquet")
    assert {output.video_id for output in stages} == set(outcomes) - {"broken", "empty"}


def test_a_second_run_takes_up_what_is_done(clips: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    first = _predict(clips, out)
    whole = _bytes(out)
    assert first.reused == 0
    # As if stopped after the first video: the second's part is not vouched for.
    second_id = first.outcomes[1].video_id
    (out / "parts" / second_id / "outcomes.parquet").unlink()
    for table in RUN_TABLES:
        (out / f"{table.name}.parquet").unlink()
    again = _predict(clips, out)
    assert again.reused == 1
    assert _bytes(out) == whole
    assert _predict(clips, out).reused == 2


def test_a_damaged_part_is_made_again(clips: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    first = _predict(clips, out)
    whole = _bytes(out)
    (out / "parts" / first.outcomes[0].video_id / "stages.parquet").write_bytes(b"damaged")
    assert _predict(clips, out).reused == 1
    assert _bytes(out) == whole


def test_other_settings_boxes_or_clips_are_run_again(clips: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    _predict(clips, out)
    assert _predict(clips, out, QUICK.model_copy(update={"seed": 1})).reused == 0
    _predict(clips, out)
    first, second = _found(clips)
    moved = [*_boxes(), TrackBox(Path(first.name).stem, 0, "new", Kind.TRAFFIC, Box(0, 0, 50, 50))]
    assert predict([first, second], moved, QUICK, Place(str(out)), SerialExecutor()).reused == 1
    write_clip(clips / second.name, 30, (640, 360))
    assert predict([first, second], moved, QUICK, Place(str(out)), SerialExecutor()).reused == 1


def test_same_bytes_in_one_process_and_in_two(clips: Path, tmp_path: Path) -> None:
    _predict(clips, tmp_path / "one")
    _predict(clips, tmp_path / "two", workers=2)
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "two")


def test_the_tables_say_what_made_them(clips: Path, tmp_path: Path) -> None:
    _predict(clips, tmp_path / "run")
    marks = metadata(tmp_path / "run" / "predictions.parquet")
    assert marks["config_sha256"] == QUICK.sha256
    assert json.loads(marks["config"]) == QUICK.model_dump(mode="json")
    assert "baseline" in marks["agents"]


def test_all_stages_are_recorded_and_the_clips_differ(clips: Path, tmp_path: Path) -> None:
    _predict(clips, tmp_path / "run")
    outputs = STAGES.read(tmp_path / "run" / "stages.parquet")
    videos = sorted({output.video_id for output in outputs})
    for video_id in videos:
        stages = [output.stage for output in outputs if output.video_id == video_id]
        assert [stages.count(stage) for stage in Stage] == [4, 1, 3, 3, 1, 1, 1]
    scenes = [
        [
            output.reply.text
            for output in outputs
            if (output.video_id, output.stage) == (video_id, Stage.SCENE)
        ]
        for video_id in videos
    ]
    assert scenes[0] != scenes[1]
    predictions = PREDICTIONS.read(tmp_path / "run" / "predictions.parquet")
    aos = {output.video_id: output.items for output in outputs if output.stage is Stage.AOS}
    assert [p.description for p in predictions] == [item.description for v in videos for item in aos[v]]


def test_progress_is_told_of_each_video(clips: Path, tmp_path: Path) -> None:
    seen: list[VideoRun] = []
    predict(_found(clips), _boxes(), QUICK, Place(str(tmp_path / "run")), SerialExecutor(), done=seen.append)
    assert [run.video_id for run in seen] == [Path(clip.name).stem for clip in _found(clips)]


def test_one_video_alone_keeps_what_is_there_of_the_others(clips: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    (clips / "broken.mp4").write_bytes(b"no video")
    whole = _predict(clips, out)
    shutil.copy(clips / whole.outcomes[1].file, clips / "broken.mp4")
    seen: list[VideoRun] = []
    found = _found(clips)
    predict(found, _boxes(), QUICK, Place(str(out)), SerialExecutor(), only=["broken"], done=seen.append)
    assert {run.video_id: run.reused for run in seen} == {
        "broken": False,
        "demo_0001": True,
        "demo_0002": True,
    }
    assert not any(outcome.error for outcome in OUTCOMES.read(out / "outcomes.parquet"))
    with pytest.raises(InputError, match="nobody"):
        predict(found, _boxes(), QUICK, Place(str(out)), SerialExecutor(), only=["nobody"])


def test_clips_and_run_folder_behind_a_url(clips: Path, tmp_path: Path) -> None:
    import fsspec

    memory = fsspec.filesystem("memory")
    for path in sorted(clips.iterdir()):
        memory.pipe_file(f"/far/clips/{path.name}", path.read_bytes())
    far, out = Place("memory://far/clips"), Place("memory://far/run")
    first = predict(find_videos(far), _boxes(), QUICK, out, SerialExecutor())
    assert (first.reused, len(first.failed)) == (0, 0)
    assert predict(find_videos(far), _boxes(), QUICK, out, SerialExecutor()).reused == 2
    _predict(clips, tmp_path / "near")
    near = _bytes(tmp_path / "near")
    assert {name: (out / f"{name}.parquet").read() for name in near} == near


def test_names_that_are_no_ids_are_all_listed(tmp_path: Path) -> None:
    for name in ("good.mp4", "two words.mp4", "ünïcode.mp4", "good.mkv", "notes.txt"):
        (tmp_path / name).write_bytes(b"x")
    with pytest.raises(FaultsError) as caught:
        _found(tmp_path)
    assert len(caught.value.faults) == 3


def test_no_folder_and_no_videos(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        _found(tmp_path / "nowhere")
    with pytest.raises(InputError, match="found no video file"):
        _found(tmp_path)
