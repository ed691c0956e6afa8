"""Files as other benchmarks write them (PAPER, section 4), read without a hand; and what is wrong in them."""

import csv
import io
import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import Prediction, TruthHazard
from sitegen import checks
from sitegen.readers import ReadOptions, read_predictions
from tests.faulty import faults, lines, places, write


def coool_header(first: int = 0, slots: int = 23) -> str:
    """The header of COOOL results, a space after every comma."""
    pairs = (f"Hazard_Track_{slot}, Hazard_Name_{slot}" for slot in range(first, first + slots))
    return ", ".join(["ID", "Driver_State_Changed", *pairs]) + "\n"


COUNTS = ("Bicyclists/Scooters", "animals involved", "pedestrians involved", "vehicles involved")
COLUMNS_2COOOL = (
    "video",
    "Incident window start frame",
    "Incident Detection",
    "Crash Severity",
    "Ego-car involved",
    "Label",
    *(f"Number of {what}" for what in COUNTS),
    "Caption Before Incident",
    "Reason of Incident",
)


def of_2coool(captions: Sequence[tuple[object, str]]) -> str:
    """A 2COOOL file with these videos and captions."""
    target = io.StringIO()
    writer = csv.writer(target)
    writer.writerow(COLUMNS_2COOOL)
    writer.writerows(
        [video, 30, 1, 2, 0, "animal", 0, 1, 0, 1, text, f"Why {text}"] for video, text in captions
    )
    return target.getvalue()


def test_the_official_coool_sample(tmp_path: Path) -> None:
    """Its header counts 0..22 in 48 cells; its rows have 4, with a space after every comma."""
    header = coool_header()
    assert header.count(",") == 47
    rows = [
        f"video_{video:04d}_{frame}, False, {video % 5}, "
        + ("a deer crossing the road" if frame < 40 else "deer")
        for video in range(1, 201)
        for frame in range(300)
    ]
    path = write(tmp_path, "results.csv", header + "\n".join(rows) + "\n")
    start = time.process_time()
    read = read_predictions(path)
    assert time.process_time() - start < 8  # about 0.2 s; the bound is for a busy machine
    assert (read.source_format, read.ending, read.warnings) == ("coool", "csv", ())
    assert len(read.predictions) == 400
    assert read.predictions[:2] == (
        Prediction("video_0001", 1, "deer", None, ("1",), tuple(range(40, 300))),
        Prediction("video_0001", 2, "a deer crossing the road", None, ("1",), tuple(range(40))),
    )


def test_a_2coool_file_of_661_videos(tmp_path: Path) -> None:
    text = of_2coool([(video, f"A car, number {video}, brakes") for video in range(1, 662)])
    truth = [TruthHazard(f"video_{video:04d}", "1", "car", "A car brakes.") for video in range(1, 662)]
    read = read_predictions(write(tmp_path, "submission.csv", text), truth)
    assert (read.source_format, read.ending, len(read.predictions)) == ("2coool", "csv", 661)
    assert read.predictions[0] == Prediction("video_0001", 1, "A car, number 1, brakes")
    assert read.warnings == ("Took video '1' as 'video_0001', and 660 more by their numbers.",)


def test_coool_captions_by_video_and_track(tmp_path: Path) -> None:
    rows = (
        "a_b_10,False,7,cat,8,dog running\n"
        "a_b_2,False,7,cat, , \n"
        "a_b_3,True,7,cat sits,, a bird \n"
        'a_b_4,False,7.0, "cat",8,dog running\n'
        "c_0\n"
        "c_1,False,7,\n"
        "d_0,False,,\n"
        "\n"
        "e_1,False,7,cat,7,cat\n"
    )
    read = read_predictions(write(tmp_path, "r.csv", coool_header(1, 22) + rows))
    assert read.predictions == (
        Prediction("a_b", 1, "cat", None, ("7",), (2, 4, 10)),
        Prediction("a_b", 2, "dog running", None, ("8",), (4, 10)),
        Prediction("a_b", 3, "cat sits", None, ("7",), (3,)),
        Prediction("a_b", 4, "a bird", None, (), (3,)),
        Prediction("e", 1, "cat", None, ("7",), (1,)),
    )
    assert read.warnings == ("1 track in a frame has no caption and thus no prediction.",)


@pytest.mark.parametrize(("first", "slots"), [(0, 22), (1, 22), (0, 23), (1, 23), (1, 1)])
def test_coool_headers(tmp_path: Path, first: int, slots: int) -> None:
    rows = "v_0,False" + ", , " * (slots - 1) + ", 5, the last slot ,\n"
    for header in (coool_header(first, slots), coool_header(first, slots).replace(", ", ",").upper()):
        read = read_predictions(write(tmp_path, "r.csv", "\ufeff" + header + rows))
        assert read.predictions == (Prediction("v", 1, "the last slot", None, ("5",), (0,)),)


WRONG_COOOL: list[tuple[str, list[tuple[int | None, str | None]]]] = [
    ("v_0,False,7\n", [(1, "Hazard_Track_0")]),
    ("v_0,False,7,cat, running\n", [(1, "Hazard_Track_1")]),
    ("v_0,False" + ",1,x" * 24 + "\n", [(1, None)]),
    ("v_0,False,1,x\nv_1,False,1,x\nv_0,True,1,x\nv_00,True,1,x\n", [(3, "ID"), (4, "ID")]),
    ("v0,False,1,x\nv_x,False,1,x\n_0,False,1,x\n,False\nv_-1,F\n", [(row, "ID") for row in range(1, 6)]),
    ("v_99999999999,False\nv_2147483648,False\n", [(1, "ID"), (2, "ID")]),
    ("../x_1,False,1,x\n../x_2,False,1,x\n", [(1, "ID")]),
    (f"v_0,False,{'7' * 129},cat,8,{'x' * 2001}\n", [(1, "Hazard_Track_0"), (1, "Hazard_Name_1")]),
    ("v_0,False,7,nan\nv_1,False,7,ca\0t\n", [(1, "Hazard_Name_0"), (2, "Hazard_Name_0")]),
    ('v_0,False,7,cat\nv_1,False,8,"dog\n', [(2, None)]),
]


@pytest.mark.parametrize(("rows", "expected"), WRONG_COOOL, ids=range(len(WRONG_COOOL)))
def test_wrong_coool_rows(tmp_path: Path, rows: str, expected: list[Any]) -> None:
    path = write(tmp_path, "results.csv", coool_header() + rows)
    assert places(lambda: read_predictions(path)) == expected
    assert lines(lambda: read_predictions(path)) == [row + 1 for row, _ in expected]


@pytest.mark.parametrize(
    "header",
    [
        coool_header(2),
        coool_header(1, 24),
        coool_header().replace("Name_3", "Name_4"),
        "ID, Hazard_Track_1\n",
    ],
)
def test_wrong_coool_headers(tmp_path: Path, header: str) -> None:
    path = write(tmp_path, "results.csv", header + "v_0, False, 1, x\n")
    assert places(lambda: read_predictions(path)) == [(None, None)]


def test_a_coool_caption_in_too_many_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sitegen.coool.MAX_LIST_ITEMS", 2)
    path = write(tmp_path, "r.csv", coool_header() + "v_0,F,1,x\nv_1,F,1,x\nv_2,F,1,x\n")
    assert places(lambda: read_predictions(path)) == [(1, "Hazard_Name_0")]


def test_an_unknown_coool_video_is_one_fault(tmp_path: Path) -> None:
    path = write(tmp_path, "r.csv", coool_header() + "v1_0, F, 1, x\nv9_0, F\nv9_1, F, 1, x\n")
    truth = [TruthHazard("v1", "1", "x", "x")]
    assert faults(lambda: read_predictions(path, truth)) == [(2, "ID", "'v9'")]


def test_the_caption_column_of_2coool(tmp_path: Path) -> None:
    path = write(tmp_path, "s.csv", of_2coool([("2.0", "a"), (3, " "), (1, " b ")]))
    read = read_predictions(path)
    assert read.predictions == (Prediction("1", 1, "b"), Prediction("2", 1, "a"))
    assert read.warnings == ("1 row has no text in 'Caption Before Incident' and thus no prediction.",)
    options = ReadOptions(caption_column="reason of incident")
    assert read_predictions(path, None, options).predictions[0] == Prediction("1", 1, "Why  b")
    with pytest.raises(
        FaultsError, match="column Why: found no such column, but the columns video, Incident"
    ):
        read_predictions(path, None, ReadOptions("2coool", "Why"))
    other = write(tmp_path, "o.csv", "video,My words\n5,a cat\n")
    options = ReadOptions(caption_column="My words")
    assert read_predictions(other, None, options).predictions == (Prediction("5", 1, "a cat"),)


def test_wrong_2coool_rows(tmp_path: Path) -> None:
    good = of_2coool([(1, "a"), (1, "b"), ("", "c"), (4, "x" * 2001), (5, "nan"), ("a/b", "d")])
    path = write(tmp_path, "s.csv", good + "7,1\n")
    assert places(lambda: read_predictions(path)) == [
        (2, "video"),
        (3, "video"),
        (4, "Caption Before Incident"),
        (5, "Caption Before Incident"),
        (6, "video"),
        (7, None),
    ]


IDS = st.from_regex(checks.SAFE_ID, fullmatch=True)
WORDS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=30).map(str.strip)
CAPTIONS = WORDS.filter(
    lambda text: any(char.isprintable() and not char.isspace() for char in text) and text.lower() != "nan"
)
SAID = st.dictionaries(IDS, st.lists(CAPTIONS, min_size=1, max_size=4), min_size=1, max_size=4)


@settings(deadline=None)
@given(SAID)
def test_captions_come_back_from_every_format(said: dict[str, list[str]]) -> None:
    header = [name.strip() for name in coool_header().split(",")]
    frames = [
        [f"{video}_{frame}", False, frame, text] for video in said for frame, text in enumerate(said[video])
    ]
    first = [[video, 0, 0, 0, 0, "", 0, 0, 0, 0, texts[0], ""] for video, texts in said.items()]
    target: dict[str, io.StringIO] = {}
    tables: dict[str, list[list[Any]]] = {
        "coool": [[*header], *frames],
        "2coool": [[*COLUMNS_2COOOL], *first],
    }
    for name, rows in tables.items():
        target[name] = io.StringIO(newline="")
        csv.writer(target[name]).writerows(rows)
    lists = {video: ["", texts] for video, texts in said.items()}
    entries = [{"image_id": video, "caption": text} for video, texts in said.items() for text in texts]
    files = {
        "coool": target["coool"].getvalue(),
        "2coool": target["2coool"].getvalue(),
        "scripts": json.dumps({video: [cos, json.dumps(texts)] for video, (cos, texts) in lists.items()}),
        "coco": json.dumps(entries, ensure_ascii=False),
    }
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            read = read_predictions(write(Path(folder), name, content), None, ReadOptions(name))
            found: dict[str, list[str]] = {}
            for row in read.predictions:
                found.setdefault(row.video_id, []).append(row.description)
            expected = {video: texts[:1] for video, texts in said.items()} if name == "2coool" else said
            assert found == expected, name
