"""`export coool`: the rules of the format, and our own reader gives the captions back."""

import csv
import io
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from pipeline.data.hazard_tracks import HazardTrack
from pipeline.errors import FaultsError, InputError
from pipeline.records import Box, Kind, Match, Prediction, TrackBox, VideoOutcome
from pipeline.table import metadata
from pipeline.tables import BOXES, MATCHES, OUTCOMES, PREDICTIONS, REACTIONS
from sitegen.cli_export import export
from sitegen.coool_write import HEADER, NAME_CHARS, SLOTS, results_csv, short_name
from sitegen.readers import read_predictions
from tests.clips import write_clip


def _hazard(track: str, name: str, frames: tuple[int, ...], label: str = "") -> HazardTrack:
    return HazardTrack("v1", track, name, label, frames, 1, 0.5)


def _rows(data: bytes) -> list[list[str]]:
    return list(csv.reader(io.StringIO(data.decode())))


def test_the_format_by_hand() -> None:
    tracks = {"v1": [_hazard("7", "A big, black dog runs", (1, 2)), _hazard("3", "Fog", (2,))]}
    written = results_csv({"v2": 1, "v1": 3}, tracks, {"v1": 2, "v2": None})
    header, *rows = _rows(written.data)
    assert header[:6] == [
        "ID", "Driver_State_Changed", "Hazard_Track_1", "Hazard_Name_1", "Hazard_Track_2", "Hazard_Name_2",
    ]  # fmt: skip
    assert header[-2:] == ["Hazard_Track_22", "Hazard_Name_22"] and len(header) == 46
    assert [row[:6] for row in rows] == [
        ["v1_0", "False", "", "", "", ""],
        ["v1_1", "False", "7", "A big black dog runs", "", ""],
        ["v1_2", "True", "7", "A big black dog runs", "3", "Fog"],
        ["v2_0", "False", "", "", "", ""],
    ]
    assert {len(row) for row in rows} == {46}
    assert (written.rows, written.crowded, written.odd_tracks) == (4, 0, 0)


def test_at_most_22_hazards_the_first_of_them() -> None:
    tracks = {"v1": [_hazard(str(track), f"thing {track}", (0,)) for track in range(30)]}
    written = results_csv({"v1": 1}, tracks, {})
    assert _rows(written.data)[1][2::2] == [str(track) for track in range(SLOTS)]
    assert written.crowded == 1


def test_a_label_may_be_the_name_and_something_always_is() -> None:
    hazard = _hazard("1", "A dog sits", (0,), "Dog")
    assert _rows(results_csv({"v1": 1}, {"v1": [hazard]}, {}, "label").data)[1][3] == "Dog"
    assert _rows(results_csv({"v1": 1}, {"v1": [_hazard("a", ",", (0,))]}, {}).data)[1][3] == "hazard"
    assert results_csv({"v1": 1}, {"v1": [_hazard("a", "x", (0,))]}, {}).odd_tracks == 1


def test_too_many_frames_are_refused() -> None:
    with pytest.raises(InputError, match="expected at most 2,000,000 rows"):
        results_csv({"v1": 2**31 - 1}, {}, {})


@pytest.mark.parametrize(
    ("text", "short"),
    [
        ("A cat", "A cat"),
        ("A cat crosses the road in front of the vehicle", "A cat crosses the road in front of"),
        ("x" * 50, "x" * 35),
        ("  one,two\n\tthree\x00 ", "one two three"),
        ("nan", ""),
        (",,,", ""),
        ("123456789 123456789 123456789 12345 6", "123456789 123456789 123456789 12345"),
    ],
)
def test_names_are_cut_at_a_words_end(text: str, short: str) -> None:
    assert short_name(text) == short


_TEXT = st.text(st.characters(codec="utf-8"), min_size=1, max_size=60)


@given(st.lists(_TEXT, min_size=1, max_size=5), st.integers(0, 5))
def test_our_reader_gives_back_what_was_written(names: list[str], changed: int) -> None:
    import tempfile

    tracks = [_hazard(str(place), name, tuple(range(place, 6))) for place, name in enumerate(names)]
    written = results_csv({"v1": 6}, {"v1": tracks}, {"v1": changed})
    for row in _rows(written.data)[1:]:
        assert not any("," in cell or len(cell) > NAME_CHARS for cell in row[3::2])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "results.csv"
        path.write_bytes(written.data)
        read = read_predictions(path)
    assert read.source_format == "coool"
    assert [(one.track_ids, one.frame_indices) for one in read.predictions] == [
        ((track.track_id,), track.frame_indices) for track in tracks
    ]
    said = [short_name(name) or "hazard" for name in names]
    assert [one.description for one in read.predictions] == said


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run of two clips and a broken one, in a benchmark folder."""
    (tmp_path / "coooler.toml").write_text('name = "Tests"\n')
    (tmp_path / "videos").mkdir()
    for video in ("v1", "v2"):
        write_clip(tmp_path / "videos" / f"{video}.mp4", 4)
    box = Box(0, 0, 30, 30)
    BOXES.write(tmp_path / "boxes.parquet", [TrackBox("v1", at, "7", Kind.CHALLENGE, box) for at in (1, 2)])
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").write_text("{}\n")
    OUTCOMES.write(
        run / "outcomes.parquet",
        [
            VideoOutcome("v1", "v1.mp4", 4, 25.0, 64, 48, ""),
            VideoOutcome("v2", "v2.mp4", 4, 25.0, 64, 48, ""),
            VideoOutcome("v3", "v3.mp4", 0, 0.0, 0, 0, "broken"),
        ],
    )
    PREDICTIONS.write(
        run / "predictions.parquet",
        [
            Prediction("v1", 1, "A cat crosses the road, slowly", "cat", ("7",), (1,)),
            Prediction("v2", 1, "Fog", "fog"),
        ],
    )
    MATCHES.write(run / "matches.parquet", [Match("v1", 1, "7", "cat", 0.3, True, True)])
    monkeypatch.chdir(tmp_path)
    return run


def _export(*arguments: str) -> Result:
    return CliRunner().invoke(export, ["coool", *arguments, "--workers", "1"])


def test_a_run_becomes_a_file_that_our_reader_reads(run: Path) -> None:
    result = _export("run", "--json")
    assert result.exit_code == 0
    said = json.loads(result.stdout)
    assert (said["videos"], said["rows"], said["hazards"], said["reactions"]) == (2, 8, 1, 0)
    assert [warning.split()[0] for warning in said["warnings"]] == ["1", "1"]  # no frames; tied to no track
    (caption,) = read_predictions(Path("results.csv")).predictions
    assert caption == Prediction("v1", 1, "A cat crosses the road slowly", None, ("7",), (1, 2))
    assert tuple(_rows(Path("results.csv").read_bytes())[0]) == HEADER


def test_reactions_are_kept_and_found_again_when_a_clip_changes(run: Path) -> None:
    _export("run", "--out", "a.csv")
    kept = run / "reactions.parquet"
    assert [reaction.video_id for reaction in REACTIONS.read(kept)] == ["v1", "v2"]
    before = kept.stat().st_mtime_ns
    _export("run", "--out", "b.csv")
    assert kept.stat().st_mtime_ns == before
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    key = metadata(kept)["inputs_sha256"]
    write_clip(Path("videos/v2.mp4"), 5)
    _export("run", "--out", "c.csv")
    assert metadata(kept)["inputs_sha256"] != key
    kept.write_bytes(b"PAR1 broken")
    assert _export("run", "--out", "d.csv").exit_code == 0
    assert len(REACTIONS.read(kept)) == 2


def test_a_folder_that_is_no_run_is_not_added_to(run: Path) -> None:
    (run / "run.json").unlink()
    assert _export("run").exit_code == 0
    assert not (run / "reactions.parquet").exists()


def test_reactions_may_be_given_as_either_table(run: Path) -> None:
    Path("given.csv").write_text("video_id,changed_at_frame\nv1,2\nv2,\n")
    assert _export("run", "--reactions", "given.csv").exit_code == 0
    states = [row[1] for row in _rows(Path("results.csv").read_bytes())[1:]]
    assert states == ["False", "False", "True", "True"] + ["False"] * 4
    assert not (run / "reactions.parquet").exists()
    _export("run", "--out", "own.csv")
    assert _export("run", "--reactions", "run/reactions.parquet", "--out", "same.csv").exit_code == 0
    assert Path("own.csv").read_bytes() == Path("same.csv").read_bytes()


def test_a_broken_clip_is_said_and_nothing_is_kept(run: Path) -> None:
    Path("videos/v2.mp4").write_bytes(b"no video")
    result = _export("run")
    assert result.exit_code == 0
    assert "no reaction looked for in v2" in result.stderr
    assert not (run / "reactions.parquet").exists()
    Path("videos/v1.mp4").write_bytes(b"no video")
    assert _export("run").exit_code == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "expected a run folder"),
        (["run", "--boxes", "nope.parquet"], "expected the `boxes` table"),
        (["run", "--videos", "empty"], "found no video file"),
        (["run", "--videos", "other"], "found no clip of v1, v2"),
        (["run", "--out", "videos"], "is a folder"),
        (["run", "--out", "coooler.toml/x.csv"], "cannot be written"),
        (["run", "--reactions", "nope.csv"], "no such file"),
    ],
)
def test_wrong_input_is_one_message_and_writes_nothing(run: Path, arguments: list[str], said: str) -> None:
    Path("empty").mkdir()
    Path("other").mkdir()
    write_clip(Path("other/w.mp4"), 2)
    result = _export(*arguments)
    assert isinstance(result.exception, InputError)
    assert said in str(result.exception)
    assert not Path("results.csv").exists()


def test_a_damaged_table_is_a_fault_and_a_wrong_choice_a_usage_error(run: Path) -> None:
    assert _export("run", "--names", "x").exit_code == 2
    (run / "matches.parquet").write_bytes(b"x")
    assert isinstance(_export("run").exception, FaultsError)
    assert not Path("results.csv").exists()
