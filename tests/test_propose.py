"""Proposals from clips to pages: found, marked as such everywhere, never in place of annotations unasked."""

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import pytest
from typer.testing import CliRunner, Result

from pipeline.data import propose as proposing
from pipeline.data.keyboxes import COLUMNS, read_key_boxes
from pipeline.data.propose import (
    Proposed,
    ProposeJob,
    ProposeSettings,
    merged,
    propose_all,
    propose_clip,
    propose_one,
)
from pipeline.errors import FaultsError, InputError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.records import Box, Kind, TrackBox
from pipeline.table import metadata
from pipeline.tables import BOXES, SNIPPETS
from sitegen.cli import app
from sitegen.video_film import chips, tracks_text
from tests.clips import write_clip
from tests.moving_patch import share_found, write_panned
from tests.test_cli import coooler
from tests.tiny_detector import COLOURS, grid_network, write_network

FIRST = 8  # the first frames have nothing to be compared with, and a track begins with a sighting
TRUTH = "video_id,hazard_id,label,description\nv1,h1,Patch,A patch crosses the road\nv2,h1,,\n"


Clips: TypeAlias = tuple[Path, dict[str, list[Box]]]


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Clips:
    """Two clips in a folder, and where the patch is in each."""
    folder = tmp_path_factory.mktemp("clips")
    return folder, {name: write_panned(folder / f"{name}.mp4", seed) for name, seed in (("v1", 1), ("v2", 2))}


@pytest.fixture
def benchmark(tmp_path: Path, clips: Clips) -> Path:
    """A benchmark folder with those clips and no boxes."""
    shutil.copytree(clips[0], tmp_path / "videos")
    (tmp_path / "coooler.toml").write_text('name = "Unannotated"\n')
    (tmp_path / "truth.csv").write_text(TRUTH)
    return tmp_path


def _jobs(folder: Path, settings: ProposeSettings | None = None) -> list[ProposeJob]:
    return [
        ProposeJob(path.stem, path, settings or ProposeSettings())
        for path in sorted((folder / "videos").glob("*.mp4"))
    ]


def _annotated(video_id: str, kind: Kind = Kind.TRAFFIC) -> TrackBox:
    return TrackBox(video_id, 0, "1", kind, Box(1, 2, 30, 40))


def _propose(folder: Path, monkeypatch: pytest.MonkeyPatch, *options: str) -> Result:
    """The command in this process, in the folder."""
    monkeypatch.chdir(folder)
    return CliRunner().invoke(app, ["data", "propose", "--workers", "1", *options])


def _write(folder: Path, rows: Sequence[TrackBox], **marks: str) -> Path:
    BOXES.write(folder / "boxes.parquet", rows, marks)
    return folder / "boxes.parquet"


def test_from_clips_without_boxes_to_a_page_that_says_so(benchmark: Path, clips: Clips) -> None:
    refused = coooler(benchmark, "predict")
    assert refused.returncode == 1 and "coooler data propose" in refused.stderr
    made = coooler(benchmark, "data", "propose", "--json", "--workers", "1")
    assert made.returncode == 0, made.stderr
    said = json.loads(made.stdout)
    assert said["proposed_by"] == ["motion"]
    assert [one["video_id"] for one in said["videos"]] == ["v1", "v2"]
    rows = BOXES.read(benchmark / "boxes.parquet")
    assert {row.kind for row in rows} == {Kind.PROPOSED}
    assert metadata(benchmark / "boxes.parquet")["proposed_by"] == "motion"
    assert sorted(path.name for path in benchmark.iterdir() if "proposals" in path.name) == []
    for name, truth in clips[1].items():
        assert share_found(truth, [row for row in rows if row.video_id == name], FIRST) > 0.7

    ran = coooler(benchmark, "predict", "--out", "run", "--workers", "1")
    assert ran.returncode == 0, ran.stderr
    assert {row.track_box.kind for row in SNIPPETS.read(benchmark / "run" / "snippets.parquet")} == {
        Kind.PROPOSED
    }
    sent = coooler(benchmark, "submit", "run", "--name", "Embedded")
    assert sent.returncode == 0, sent.stderr
    built = coooler(benchmark, "build")
    assert built.returncode == 0, built.stderr
    page = (benchmark / "site" / "videos" / "v1.html").read_text(encoding="utf-8")
    assert "The tracks are proposals, found by motion: nobody annotated them." in page
    assert re.search(r"<dd>\d+ proposed by motion, not annotated</dd>", page)
    assert '<span class="key proposed">proposed tracks</span>' in page
    assert '<span class="key hazard">hazard tracks</span>' not in page
    assert re.search(r'alt="Frame \d+ at [^"]*: \d+ proposed boxe?s?', page)
    assert '<g class="proposed" data-track="p1">' in page
    assert '<span class="sr">Proposed </span>p1' in page
    assert "> Traffic<" not in page and "traffic box" not in page
    assert "p1 <span" in page and '<span class="key proposed">proposed</span>' in page


def test_tracks_are_counted_by_kind() -> None:
    proposed = TrackBox("v", 0, "p10", Kind.PROPOSED, Box(0, 0, 9, 9))
    other = TrackBox("v", 0, "p9", Kind.PROPOSED, Box(0, 0, 9, 9))
    tracks = chips([proposed, other], {})
    assert [track.track for track in tracks] == ["p9", "p10"]
    assert tracks_text(tracks, "detector,motion") == "2 proposed by a detector and motion, not annotated"
    assert tracks_text(tracks, "an oracle") == "2 proposed by a program, not annotated"
    mixed = chips([proposed, _annotated("v"), _annotated("v", Kind.CHALLENGE)], {})
    assert tracks_text(mixed) == "1 hazard, 0 traffic, 1 proposed"
    assert [track.proposed for track in mixed] == [False, True]
    assert tracks_text(chips([_annotated("v")], {})) == "0 hazard, 1 traffic"


def test_the_same_rows_whatever_the_workers_and_from_parts(benchmark: Path) -> None:
    jobs, parts = _jobs(benchmark), benchmark / "parts"
    alone = propose_all(jobs, benchmark / "other", SerialExecutor())
    assert [one.video_id for one in alone] == ["v1", "v2"] and not any(one.reused for one in alone)
    together = propose_all(jobs, parts, ProcessExecutor(2))
    assert [one.boxes for one in together] == [one.boxes for one in alone]
    again = propose_all(jobs, parts, SerialExecutor())
    assert all(one.reused for one in again)
    assert [(one.boxes, one.frames) for one in again] == [(one.boxes, one.frames) for one in alone]


def test_parts_that_do_not_hold_are_made_again(benchmark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []

    def quick(job: ProposeJob) -> Proposed:
        looked.append(job.video_id)
        return Proposed(job.video_id, 3, (TrackBox(job.video_id, 0, "p1", Kind.PROPOSED, Box(0, 0, 9, 9)),))

    monkeypatch.setattr(proposing, "propose_one", quick)
    parts = benchmark / "parts"
    propose_all(_jobs(benchmark), parts, SerialExecutor())
    (parts / "v1.parquet").write_bytes(b"PAR1 damaged")
    propose_all(_jobs(benchmark), parts, SerialExecutor())
    assert looked == ["v1", "v2", "v1"]
    propose_all(_jobs(benchmark, ProposeSettings(min_score=0.7)), parts, SerialExecutor())
    assert looked[3:] == ["v1", "v2"]
    write_clip(benchmark / "videos" / "v2.mp4", 5)
    propose_all(_jobs(benchmark, ProposeSettings(min_score=0.7)), parts, SerialExecutor())
    assert looked[5:] == ["v2"]


def test_a_broken_clip_is_said_and_the_others_go_on(benchmark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (benchmark / "videos" / "v1.mp4").write_bytes(b"no video")
    made = _propose(benchmark, monkeypatch)
    assert made.exit_code == 1 and "failed: v1" in made.output
    assert {row.video_id for row in BOXES.read(benchmark / "boxes.parquet")} == {"v2"}
    assert (benchmark / ".boxes.parquet.proposals" / "v2.parquet").is_file()
    write_panned(benchmark / "videos" / "v1.mp4")
    mended = _propose(benchmark, monkeypatch, "--replace", "--json")
    assert [one["reused"] for one in json.loads(mended.stdout)["videos"]] == [False, True]
    assert {row.video_id for row in BOXES.read(benchmark / "boxes.parquet")} == {"v1", "v2"}


def test_a_clip_that_failed_leaves_the_table_as_it_was(
    benchmark: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in (benchmark / "videos").iterdir():
        path.write_bytes(b"no video")
    table = _write(benchmark, [_annotated("v1")])
    before = table.read_bytes()
    assert _propose(benchmark, monkeypatch, "--replace").exit_code == 1
    assert table.read_bytes() == before


def test_annotations_are_not_touched_unasked(benchmark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = _write(benchmark, [_annotated("v1", Kind.CHALLENGE), _annotated("gone")], source="people")
    before = table.read_bytes()
    refused = _propose(benchmark, monkeypatch)
    assert isinstance(refused.exception, InputError)
    assert "2 annotated videos" in str(refused.exception) and "--missing" in str(refused.exception)
    assert table.read_bytes() == before
    added = _propose(benchmark, monkeypatch, "--missing", "--json")
    assert [one["video_id"] for one in json.loads(added.stdout)["videos"]] == ["v2"]
    rows = BOXES.read(table)
    assert [row for row in rows if row.video_id != "v2"] == [
        _annotated("gone"),
        _annotated("v1", Kind.CHALLENGE),
    ]
    assert {row.kind for row in rows if row.video_id == "v2"} == {Kind.PROPOSED}
    assert metadata(table)["source"] == "people" and metadata(table)["proposed_by"] == "motion"
    replaced = _propose(benchmark, monkeypatch, "--replace", "--only", "v1")
    assert replaced.exit_code == 0, replaced.output
    after = BOXES.read(table)
    assert {row.kind for row in after if row.video_id == "v1"} == {Kind.PROPOSED}
    assert [row for row in after if row.video_id in ("v2", "gone")] == [
        row for row in rows if row.video_id in ("v2", "gone")
    ]


def test_marks_name_every_method_in_the_table() -> None:
    old = TrackBox("a", 0, "p1", Kind.PROPOSED, Box(0, 0, 9, 9))
    marks = {"proposed_by": "motion", "schema_version": "1", "table": "boxes"}
    network = ProposeSettings("detector", Path("n.onnx"))
    assert merged([old], [Proposed("b")], network, marks) == ([old], {"proposed_by": "detector,motion"})
    assert merged([old], [Proposed("a")], network, marks) == ([], {"proposed_by": "detector"})
    assert merged([old], [Proposed("a", error="broken")], network, marks)[0] == [old]


def test_a_detector_gives_tracks_with_classes(benchmark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The grid sees colours: the textured background has cells of all of them, still and sure enough."""
    network = write_network(benchmark / "grid.onnx", grid_network(names=str(dict(enumerate(COLOURS)))))
    settings = ProposeSettings("detector", network)
    (job, _) = _jobs(benchmark, settings)
    outcome = propose_one(job)
    assert outcome.error == "" and outcome.frames == 30
    assert set(outcome.labels) <= set(COLOURS) and sum(outcome.labels.values()) == outcome.tracks > 0
    _, both = propose_clip(job.clip, ProposeSettings("both", network))
    labels = {track.label for track in both}
    assert labels & set(COLOURS)
    made = _propose(benchmark, monkeypatch, "--detector", "grid.onnx", "--method", "both", "--only", "v1")
    assert made.exit_code == 0, made.output
    assert metadata(benchmark / "boxes.parquet")["proposed_by"] == "detector,motion"


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--method", "magic"], 2, "expected motion, detector or both"),
        (["--method", "detector"], 2, "expected an ONNX file"),
        (["--method", "motion", "--detector", "x.onnx"], 2, "expected none"),
        (["--replace", "--missing"], 2, "expected one of them"),
        (["--detector", "x.onnx"], 1, "no such file"),
        (["--detector", "truth.csv"], 1, "no ONNX"),
        (["--only", "v9"], 1, "found no clip for v9"),
        (["--videos", "nowhere"], 1, "no such folder"),
        (["--detector", "x.onnx", "--names", "none.txt"], 1, "class names"),
    ],
)
def test_wrong_options_write_nothing(
    benchmark: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], code: int, said: str
) -> None:
    made = _propose(benchmark, monkeypatch, *options)
    assert made.exit_code == code
    assert said in (made.output if code == 2 else str(made.exception))
    assert code == 2 or isinstance(made.exception, InputError)
    assert sorted(path.name for path in benchmark.iterdir()) == ["coooler.toml", "truth.csv", "videos"]


def test_both_methods_need_a_detector(benchmark: Path) -> None:
    with pytest.raises(InputError, match="--detector"):
        propose_clip(benchmark / "videos" / "v1.mp4", ProposeSettings("both"))


def test_the_check_says_that_boxes_are_proposals(benchmark: Path) -> None:
    _write(benchmark, [TrackBox("v1", 0, "p1", Kind.PROPOSED, Box(0, 0, 9, 9)), _annotated("v2")])
    said = json.loads(coooler(benchmark, "data", "check", "--json").stdout)
    (note,) = [one for one in said["findings"] if one["kind"] == "proposed boxes"]
    assert (note["severity"], note["where"]) == ("note", ["v1"])


def test_a_key_box_is_an_annotation(tmp_path: Path) -> None:
    path = tmp_path / "keyboxes.csv"
    path.write_text(f"{','.join(COLUMNS)}\nv,1,proposed,0,0,0,9,9\n")
    with pytest.raises(FaultsError, match="challenge or traffic"):
        read_key_boxes(path)
