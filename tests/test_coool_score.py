"""COOOL's three figures, by hand; what a results file says and does not say; the command."""

import json
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from pipeline.errors import FaultsError, InputError
from pipeline.records import TruthHazard
from sitegen.cli_files import score
from sitegen.coool_results import FrameSay, Results, frame_counts, read_results
from sitegen.coool_score import CooolScore, coool_score, named
from sitegen.driver_states import read_driver_states
from tests.clips import write_clip

HEADER = "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1,Hazard_Track_2,Hazard_Name_2\n"
CAT = TruthHazard("v1", "h1", "Cat", "A cat crosses", "7", 1, 2)
DOG = TruthHazard("v1", "h2", "Dog", "A dog sits", "8", 2, 3)
FOG = TruthHazard("v2", "h1", "Fog", "Fog hides the road")
NONE = TruthHazard("v3", "h1", "", "")

Says = dict[str, dict[int, FrameSay]]


def _score(says: Says, truth: list[TruthHazard], states: dict[str, int | None], **counts: int) -> CooolScore:
    return coool_score(Results(says, "", ()), truth, states, counts)


def _means(result: CooolScore) -> dict[str, float]:
    return {name: round(figure.value, 9) for name, figure in result.figures.items()}


def test_hazards_and_names_of_several_tracks_by_hand() -> None:
    """Five frames; known 0: none, 1: cat, 2: cat and dog, 3: dog, 4: none."""
    says = {
        0: FrameSay(False),
        1: FrameSay(False, ("7", "9"), ("a cat", "a bird")),  # 1 of max(1, 2)
        2: FrameSay(False, ("7",), ("two dogs",)),  # 1 of max(2, 1)
        3: FrameSay(False, ("8",), ("cat",)),  # track right, name wrong
        4: FrameSay(False, ("8",)),  # a track too many; no name is none
    }
    result = _score({"v1": says}, [CAT, DOG], {}, v1=5)
    assert _means(result) == {"hazards": (0.5 + 0.5 + 1 + 0) / 4, "names": round((0.5 + 0.5 + 0) / 3, 9)}
    assert (result.figures["hazards"].frames, result.figures["names"].frames) == (4, 3)
    assert result.macro == pytest.approx((0.5 + 1 / 3) / 2)


def test_driver_state_by_hand() -> None:
    says = {frame: FrameSay(frame >= 3) for frame in range(10)}
    truth = [TruthHazard(video, "h1", "", "") for video in ("v1", "v2", "v3")]
    result = _score({"v1": says, "v2": says, "v3": says}, truth, {"v1": 5, "v2": None}, v1=10, v2=10, v3=10)
    assert _means(result) == {"driver_state": (0.8 + 0.3) / 2}
    assert result.macro == pytest.approx(0.55)
    assert result.figures["driver_state"].videos == 2
    assert [video.mean("driver_state") for video in result.videos] == [0.8, 0.3, None]


def test_videos_count_alike_whatever_their_length_and_frames_alike_beside_it() -> None:
    truth = [TruthHazard(video, "h1", "", "") for video in ("v1", "v2")]
    result = _score({}, truth, {"v1": None, "v2": 0}, v1=9, v2=1)
    figure = result.figures["driver_state"]
    assert (figure.value, figure.per_frame, figure.frames) == (0.5, 0.9, 10)


def test_a_hazard_without_a_track_gives_no_figure_for_tracks() -> None:
    says = {"v2": {0: FrameSay(False, ("1",), ("thick fog",)), 1: FrameSay(False)}}
    result = _score(says, [FOG], {}, v2=2)
    assert _means(result) == {"names": 0.5}
    assert result.videos[0].mean("hazards") is None


def test_without_hazard_silence_counts_in_no_mean_and_a_false_alarm_is_nought() -> None:
    assert _score({}, [NONE], {}, v3=4) == _score({"v3": {0: FrameSay(False)}}, [NONE], {}, v3=4)
    assert _score({}, [NONE], {}, v3=4).macro is None
    assert _means(_score({"v3": {1: FrameSay(False, ("1",), ("x",))}}, [NONE], {}, v3=4)) == {
        "hazards": 0.0,
        "names": 0.0,
    }


def test_the_truth_itself_is_perfect_and_nothing_is_nought() -> None:
    says = {
        1: FrameSay(False, ("7",), ("Cat",)),
        2: FrameSay(True, ("8", "7"), ("Dog", "Cat")),
        3: FrameSay(True, ("8",), ("Dog",)),
    }
    states = {"v1": 2}
    assert _score({"v1": says}, [CAT, DOG], states, v1=4).macro == 1.0
    assert _means(_score({}, [CAT, DOG], states, v1=4)) == {"driver_state": 0.5, "hazards": 0.0, "names": 0.0}


def test_a_track_given_twice_counts_once_and_is_one_too_many() -> None:
    result = _score({"v1": {1: FrameSay(False, ("7", "7"))}}, [CAT], {}, v1=2)
    assert _means(result)["hazards"] == 0.5


@pytest.mark.parametrize(
    ("known", "predicted", "right"),
    [
        (("Cat",), ("a CAT, running",), 1),
        (("Cats",), ("cat",), 1),
        (("Cat",), ("category",), 0),
        (("A car on the road",), ("the man on a mat",), 0),  # only words that say nothing are shared
        (("Cat",), (34 * "x" + " cat",), 0),  # beyond the 35th character
        (("Cat", "Cat"), ("cat",), 1),
        (("Cat",), ("cat", "cat"), 1),
        (("Cat", "Cat dog"), ("cat", "dog"), 2),
        (("Cat dog", "Cat"), ("cat", "dog"), 2),  # the first must give way
        (("Überholer",), ("überholer",), 1),
        ((), ("cat",), 0),
        (("Cat",), (), 0),
    ],
)
def test_names_by_hand(known: tuple[str, ...], predicted: tuple[str, ...], right: int) -> None:
    assert named(known, predicted) == right


_NAMES = st.lists(st.sampled_from(["cat", "dog", "cat dog", "bird", "the"]), max_size=4).map(tuple)


@given(_NAMES, _NAMES)
def test_the_order_of_names_changes_nothing(known: tuple[str, ...], predicted: tuple[str, ...]) -> None:
    assert named(known, predicted) == named(known[::-1], predicted[::-1]) <= min(len(known), len(predicted))


def _file(folder: Path, *rows: str) -> Path:
    path = folder / "results.csv"
    path.write_text(HEADER + "".join(f"{row}\n" for row in rows))
    return path


def test_a_file_as_it_is_read(tmp_path: Path) -> None:
    path = _file(
        tmp_path, "v1_0,False", "v1_1, true, 7.0, cat, , ", "v1_3,,8,,,", "v2_0,1,,dog,9,bird", "v2_1,0"
    )
    results = read_results(path, [CAT, FOG], {})
    assert results.videos == {
        "v1": {0: FrameSay(False), 1: FrameSay(True, ("7",), ("cat",)), 3: FrameSay(False, ("8",))},
        "v2": {0: FrameSay(True, ("9",), ("dog", "bird")), 1: FrameSay(False)},
    }
    assert results.warnings[0] == "1 row has no driver state, taken as False."
    assert "goes back to False in 2 videos" in results.warnings[1]


def test_every_fault_of_a_file_is_told(tmp_path: Path) -> None:
    path = _file(tmp_path, "v1_0,perhaps", "v9_0,True", "v1_0,True", "x,True")
    with pytest.raises(FaultsError) as error:
        read_results(path, [CAT], {})
    assert [fault.column for fault in error.value.faults] == ["Driver_State_Changed", "ID", "ID", "ID"]


def test_a_file_that_is_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("video_id,rank,description\nv1,1,A cat\n")
    with pytest.raises(FaultsError, match="Write the header as the challenge does"):
        read_results(path, [CAT], {})


def test_lengths_come_from_clips_else_from_what_is_said() -> None:
    results = Results({"v1": {0: FrameSay(False), 7: FrameSay(True)}}, "", ())
    counts, warnings = frame_counts(results, [CAT, FOG, NONE], {"v2": 4}, {"v1": 5})
    assert counts == {"v1": 5, "v2": 5, "v3": 1}
    assert warnings[0].startswith("No clip of v2, v3:")
    assert warnings[1:] == [
        "10 frames have no row: no hazard, state False.",
        "1 row is past the end of a clip and not looked at.",
    ]
    huge = Results({"v1": {2**31 - 1: FrameSay(False)}}, "", ())
    with pytest.raises(InputError, match="Is a frame number wrong"):
        frame_counts(huge, [CAT], {}, {})


def test_driver_states_are_read_and_their_faults_told(tmp_path: Path) -> None:
    path = tmp_path / "driver_states.csv"
    path.write_text("video_id,changed_at_frame\nv1,12\nv2,\n")
    assert read_driver_states(path) == {"v1": 12, "v2": None}
    path.write_text("video_id,changed_at_frame\nv1,-1\nv1,3\n../v,2\nv9,1\n")
    with pytest.raises(FaultsError) as error:
        read_driver_states(path, {"v1"})
    assert [(fault.row, fault.column) for fault in error.value.faults] == [
        (1, "changed_at_frame"),
        (2, "video_id"),
        (3, "video_id"),
        (4, "video_id"),
    ]
    path.write_text("video,frame\nv1,1\n")
    with pytest.raises(FaultsError, match="changed_at_frame"):
        read_driver_states(path)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A benchmark folder of one clip of five frames and one without a clip."""
    (tmp_path / "coooler.toml").write_text('name = "Tests"\n')
    (tmp_path / "truth.csv").write_text(
        "video_id,hazard_id,label,description,track_id,first_frame,last_frame\n"
        "v1,h1,Cat,A cat crosses,7,1,2\nv2,h1,,,,,\n"
    )
    (tmp_path / "videos").mkdir()
    write_clip(tmp_path / "videos" / "v1.mp4", 5)
    _file(tmp_path, "v1_0,False", "v1_1,True,7,cat", "v1_2,True", "v1_3,True", "v1_4,True", "v2_0,False")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _run(*arguments: str) -> tuple[int, str, BaseException | None]:
    app = typer.Typer()
    app.command()(score)
    result = CliRunner().invoke(app, ["--coool", *arguments])
    return result.exit_code, result.stdout, result.exception


def test_the_command_says_what_has_no_truth(folder: Path) -> None:
    code, output, _ = _run("results.csv", "--json")
    said = json.loads(output)
    assert code == 0
    assert said["no_truth"] == ["driver_state"]
    assert "driver_state" not in said["figures"]
    assert said["macro_average"] == 0.5
    assert said["videos"][0] == {"video_id": "v1", "driver_state": None, "hazards": 0.5, "names": 0.5}
    assert [warning[:13] for warning in said["warnings"]] == ["No clip of v2"]
    assert "driver state   no truth for it" in _run("results.csv")[1]


def test_the_command_takes_driver_states_beside_the_truth_or_given(folder: Path) -> None:
    (folder / "driver_states.csv").write_text("video_id,changed_at_frame\nv1,2\n")
    said = json.loads(_run("results.csv", "--json")[1])
    assert said["figures"]["driver_state"] == {"value": 0.8, "per_frame": 0.8, "videos": 1, "frames": 5}
    assert said["macro_average"] == pytest.approx((0.8 + 0.5 + 0.5) / 3)
    (folder / "other.csv").write_text("video_id,changed_at_frame\nv1,1\n")
    said = json.loads(_run("results.csv", "--json", "--driver-truth", "other.csv")[1])
    assert said["figures"]["driver_state"]["value"] == 1.0
    (folder / "other.csv").write_text("video_id,changed_at_frame\nv8,1\n")
    assert isinstance(_run("results.csv", "--driver-truth", "other.csv")[2], FaultsError)


def test_options_of_the_challenge_need_it(folder: Path) -> None:
    app = typer.Typer()
    app.command()(score)
    result = CliRunner().invoke(app, ["results.csv", "--driver-truth", "other.csv"])
    assert result.exit_code == 2
