"""COOOL annotations that cannot be understood: every fault at once, and nothing written."""

from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import FaultsError, InputError
from tests.test_coool_import import _import, _object, _write


def test_all_faults_come_together_and_nothing_is_written(tmp_path: Path) -> None:
    good = _object(1, 0, 0, 9, 9)
    content = {
        "v1": {
            -1: {},
            "x": {},
            True: {},
            3: {},
            "3": {},
            4: [good],
            5: {"challenge_object": {"a": good}},
            6: {"traffic_scenes": [good]},
            7: {
                "traffic_scene": [
                    good,
                    [1],
                    {"track_id": 1},
                    _object(1.5, 0, 0, 9, 9),
                    _object(None, 0, 0, 9, 9),
                ]
            },
            8: {
                "traffic_scene": [
                    _object("", 1, 2, 3),
                    _object(True, "1", 2, 3, 4),
                    _object("a\x1b", 1, 2, True, 4),
                ]
            },
        },
        "v2": [],
        "v3": None,
    }
    with pytest.raises(FaultsError) as caught:
        _import(_write(tmp_path / "a.pkl", content), tmp_path)
    places = [fault.file.split("a.pkl, video ")[1] for fault in caught.value.faults]
    eight = [f"v1, frame 8, traffic_scene[{n}]" for n in (0, 0, 1, 1, 2, 2)]
    assert places == [
        *("v1, frame -1", "v1, frame 'x'", "v1, frame True", "v1, frame '3'", "v1, frame 4"),
        *("v1, frame 5, challenge_object", "v1, frame 6, 'traffic_scenes'"),
        *(f"v1, frame 7, traffic_scene[{n}]" for n in (1, 2, 3, 4)),
        *eight,
        "v2",
    ]
    assert str(caught.value.faults[-1]) == (
        f"{tmp_path / 'a.pkl'}, video v2: found a list of 0; expected a dict of frames. "
        "Correct the annotations at their source."
    )
    assert "\x1b" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["a.pkl"]


def test_many_faults_are_counted(tmp_path: Path) -> None:
    content = {f"v{n}": {0: 1, 1: 2} for n in range(40)}
    with pytest.raises(FaultsError) as caught:
        _import(_write(tmp_path / "a.pkl", content), tmp_path)
    assert len(caught.value.faults) == 51 and caught.value.faults[-1].found == "30 more faults"


@pytest.mark.parametrize("key", [1, "../up", ".hidden", "a/b", "", "a\nb", None, "x" * 129])
def test_ids_that_cannot_name_a_file_are_refused(key: Any, tmp_path: Path) -> None:
    with pytest.raises(FaultsError, match="expected a text of at most 128"):
        _import(_write(tmp_path / "a.pkl", {key: {}}), tmp_path)


@pytest.mark.parametrize(
    "text", ["", "[", "[" * 100_000, "1", '{"v": {"1": {"traffic_scene": [1]}}}', '{"v": 1e999}']
)
def test_json_of_another_form_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=r"a\.json"):
        _import(tmp_path / "a.json", tmp_path)


def test_a_long_number_in_json_is_a_fault(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(
        '{"v": {"1": {"traffic_scene": [{"track_id": %s, "bbox": [0, 0, 1, %s]}]}}}' % (("9" * 400,) * 2)
    )
    with pytest.raises(FaultsError, match="2 faults found"):
        _import(tmp_path / "a.json", tmp_path)
