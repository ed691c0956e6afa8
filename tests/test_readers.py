"""Truth and prediction files that are right: three formats, one content."""

import csv
import io
import json
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS, TRUTH
from sitegen import checks
from sitegen.readers import ReadOptions, read_predictions, read_truth, read_video_map
from tests.faulty import HAZARDS, HEAD, faults, places, write

EXPECTED = (
    Prediction("v1", 1, 'A "quoted", cat\nruns', "cat", ("7", "a b"), (0, 12)),
    Prediction("v1", 2, "NA"),
    Prediction("v2", 1, "Катя 🐈 None", None, (), (3,)),
)
CSV = (
    "video_id,rank,description,label,track_ids,frame_indices\n"
    "v2,1,Катя 🐈 None,,,3\n"
    "v1,2,NA,,,\n"
    "\n"
    'v1,1,"A ""quoted"", cat\nruns",cat,"[""7"", ""a b""]",0;12\n'
)
JSONL = [
    {"video_id": "v2", "rank": 1, "description": "Катя 🐈 None", "frame_indices": [3], "label": None},
    {"video_id": "v1", "rank": 2.0, "description": "  NA  ", "track_ids": []},
    {
        "video_id": "v1",
        "rank": 1,
        "description": 'A "quoted", cat\nruns',
        "label": "cat",
        "track_ids": [7, "a b"],
        "frame_indices": [0, 12],
    },
]


def test_csv(tmp_path: Path) -> None:
    read = read_predictions(write(tmp_path, "p.csv", CSV))
    assert (read.predictions, read.source_format, read.warnings) == (EXPECTED, "csv", ())


def test_csv_with_byte_order_mark_blanks_and_windows_line_ends(tmp_path: Path) -> None:
    text = "\ufeff" + 'video_id, rank ,description\r\nv1 , 1, "not quoted"\r\n'.replace('"', "")
    read = read_predictions(write(tmp_path, "p.csv", text))
    assert read.predictions == (Prediction("v1", 1, "not quoted"),)


def test_jsonl(tmp_path: Path) -> None:
    text = "\n\n".join(json.dumps(row, ensure_ascii=False) for row in JSONL)
    read = read_predictions(write(tmp_path, "p.jsonl", text))
    assert (read.predictions, read.source_format, read.warnings) == (EXPECTED, "jsonl", ())


def test_parquet_of_the_pipeline(tmp_path: Path) -> None:
    PREDICTIONS.write(tmp_path / "p.parquet", EXPECTED, {"config_sha256": "a" * 64})
    read = read_predictions(tmp_path / "p.parquet")
    assert (read.predictions, read.source_format, read.warnings) == (EXPECTED, "parquet", ())
    assert read.config_sha256 == "a" * 64


def test_config_hash_must_be_a_hash(tmp_path: Path) -> None:
    PREDICTIONS.write(tmp_path / "p.parquet", EXPECTED, {"config_sha256": "<script>"})
    assert read_predictions(tmp_path / "p.parquet").config_sha256 == ""


@pytest.mark.parametrize(
    ("ids", "ranks", "texts"),
    [
        (pa.string(), pa.int64(), pa.large_string()),
        (pa.large_string(), pa.uint8(), pa.string()),
        (pa.dictionary(pa.int32(), pa.string()), pa.float64(), pa.dictionary(pa.int8(), pa.string())),
    ],
)
def test_parquet_of_other_writers(
    tmp_path: Path, ids: pa.DataType, ranks: pa.DataType, texts: pa.DataType
) -> None:
    table = pa.table(
        {
            "rank": pa.array([2, 1]).cast(ranks),
            "video_id": pa.array(["v1", "v1"]).cast(ids),
            "description": pa.array(["b", "a"]).cast(texts),
        }
    )
    pq.write_table(table, tmp_path / "p.parquet", row_group_size=1)
    read = read_predictions(tmp_path / "p.parquet")
    assert read.predictions == (Prediction("v1", 1, "a"), Prediction("v1", 2, "b"))


def test_whole_number_ids_become_text(tmp_path: Path) -> None:
    pq.write_table(pa.table({"video_id": [7], "rank": [1], "description": ["x"]}), tmp_path / "p.parquet")
    line = write(tmp_path, "p.jsonl", '{"video_id": 7, "rank": 1, "description": "x"}')
    for path in (tmp_path / "p.parquet", line):
        assert read_predictions(path).predictions == (Prediction("7", 1, "x"),)


@pytest.mark.parametrize("name", ["p", "p.txt", "p.CSV", "p.data"])
def test_endings_that_name_no_other_format_do_not_matter(tmp_path: Path, name: str) -> None:
    assert read_predictions(write(tmp_path, name, CSV)).predictions == EXPECTED


@pytest.mark.parametrize(
    ("cell", "track_ids"),
    [
        ("", ()),
        ("7", ("7",)),
        ("7;8", ("7", "8")),
        ("7 8", ("7", "8")),
        ('"7, 8"', ("7", "8")),
        ('"[7, 8]"', ("7", "8")),
        ("\"['7', '8']\"", ("7", "8")),
        ("[]", ()),
        ("[7 8]", ("7", "8")),
    ],
)
def test_lists_in_a_csv_cell(tmp_path: Path, cell: str, track_ids: tuple[str, ...]) -> None:
    text = f"video_id,rank,description,track_ids\nv1,1,x,{cell}\n"
    assert read_predictions(write(tmp_path, "p.csv", text)).predictions[0].track_ids == track_ids


@pytest.mark.parametrize(("name", "ending"), [("p.csv", "csv"), ("p.jsonl", "jsonl"), ("p", "csv")])
def test_the_ending_is_that_of_the_content(tmp_path: Path, name: str, ending: str) -> None:
    content = CSV if ending == "csv" else json.dumps(JSONL[0])
    assert read_predictions(write(tmp_path, name, content)).ending == ending


def test_a_format_can_be_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path, "p.data", CSV)
    assert read_predictions(path, None, ReadOptions("csv")).predictions == EXPECTED
    wrong = {
        "parquet": "what looks like a CSV file",
        "jsonl": "what looks like a CSV file",
        "coool": "a header with 'video_id' among its columns",
        "coco": "what looks like a CSV file",
        "yaml": "no format 'yaml'",
    }
    for name, found in wrong.items():
        assert faults(partial(read_predictions, path, None, ReadOptions(name))) == [(None, None, found)]
    assert places(partial(read_predictions, path, None, ReadOptions("2coool"))) == [
        (None, "video"),
        (None, "Caption Before Incident"),
    ]


def test_a_caption_column_is_only_for_2coool(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", CSV)
    options = ReadOptions(caption_column="description")
    assert places(lambda: read_predictions(path, None, options)) == [(None, None)]


ROWS = "video_id,rank,description\n"
NUMBERED = [TruthHazard(f"video_{number:04d}", "1", "x", "x") for number in (1, 2, 173)]


def test_numbers_are_taken_as_the_ids_that_end_in_them(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", ROWS + "1,1,a\n1,2,b\n173,1,c\n0002,1,d\n")
    read = read_predictions(path, NUMBERED)
    assert [(row.video_id, row.description) for row in read.predictions] == [
        ("video_0001", "a"),
        ("video_0001", "b"),
        ("video_0002", "d"),
        ("video_0173", "c"),
    ]
    assert read.warnings == ("Took video '1' as 'video_0001', and 2 more by their numbers.",)
    alone = read_predictions(write(tmp_path, "a.csv", ROWS + "2,1,a\n"), NUMBERED)
    assert alone.warnings[0] == "Took video '2' as 'video_0002' by its number."


def test_numbers_are_not_guessed_at(tmp_path: Path) -> None:
    mixed = write(tmp_path, "mixed.csv", ROWS + "1,1,a\nvideo_0002,1,b\n")
    assert places(lambda: read_predictions(mixed, NUMBERED)) == [(1, "video_id")]
    two = [TruthHazard("a_1", "1", "x", "x"), TruthHazard("b_01", "1", "x", "x")]
    ambiguous = write(tmp_path, "two.csv", ROWS + "1,1,a\n")
    with pytest.raises(FaultsError, match="2 ids end in this number, such as 'a_1' and 'b_01'"):
        read_predictions(ambiguous, two)
    same = write(tmp_path, "same.csv", ROWS + "1,1,a\n01,2,b\n")
    assert places(lambda: read_predictions(same, NUMBERED)) == [(2, "video_id")]
    unknown = write(tmp_path, "unknown.csv", ROWS + "1,1,a\n7,1,b\n-1,1,c\n")
    assert places(lambda: read_predictions(unknown, NUMBERED)) == [(2, "video_id"), (3, "video_id")]
    assert read_predictions(unknown).warnings == ()


def test_a_map_renames_the_ids_of_a_file(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", ROWS + " clip a ,1,a\nvideo_0002,1,b\n")
    options = ReadOptions(video_map={"clip a": "video_0173"})
    for truth in (NUMBERED, None):
        read = read_predictions(path, truth, options)
        assert [row.video_id for row in read.predictions] == ["video_0002", "video_0173"]
    wrong = ReadOptions(video_map={"clip a": "nowhere"})
    with pytest.raises(FaultsError, match="' clip a ', by the map 'nowhere'"):
        read_predictions(path, NUMBERED, wrong)
    unsafe = ReadOptions(video_map={"clip a": "../x"})
    assert faults(lambda: read_predictions(path, None, unsafe)) == [(1, "video_id", "'../x'")]
    merged = ReadOptions(video_map={"clip a": "video_0002"})
    assert places(lambda: read_predictions(path, NUMBERED, merged)) == [(2, "video_id")]


def test_a_map_in_two_formats(tmp_path: Path) -> None:
    expected = {"a b": "video_0001", "2": "v.2"}
    assert read_video_map(write(tmp_path, "m.csv", "file_id,video_id\na b,video_0001\n2, v.2\n")) == expected
    swapped = "\ufeffVideo_ID, File_ID\r\nvideo_0001,a b\r\nv.2,2\r\n"
    assert read_video_map(write(tmp_path, "s.csv", swapped)) == expected
    assert read_video_map(write(tmp_path, "m.json", json.dumps(expected, indent=1))) == expected


WRONG_MAPS: list[tuple[str, list[tuple[int | None, str | None]]]] = [
    ("file_id,video_id\na,v1\na,v2\n", [(2, "file_id")]),
    ("file_id,video_id\na,v1\nb,v1\n", [(2, "video_id")]),
    ("file_id,video_id\n,v1\nb,\nc,../x\n", [(1, "file_id"), (2, "video_id"), (3, "video_id")]),
    ("file_id,video_id\na,v1,x\n", [(1, None)]),
    ("file_id,video_id\n", [(None, None)]),
    ("a,v1\nb,v2\n", [(None, None)]),
    ('file_id,video_id\na,"v1\n', [(1, None)]),
    ("", [(None, None)]),
    ('{"a": "v1", "a": "v2"}', [(2, None)]),
    ('{"a": "v1", "b": "v1"}', [(2, None)]),
    ('{"a": null, "b": ["v"], "": "v2"}', [(1, None), (2, None), (3, None)]),
    ("{}", [(None, None)]),
    ('["a"]', [(None, None)]),
    ('{"a": ', [(None, None)]),
    ("[" * 100_000, [(None, None)]),
]


@pytest.mark.parametrize(("content", "expected"), WRONG_MAPS, ids=range(len(WRONG_MAPS)))
def test_wrong_maps(tmp_path: Path, content: str, expected: list[Any]) -> None:
    assert places(lambda: read_video_map(write(tmp_path, "map", content))) == expected


def test_truth_in_three_formats(tmp_path: Path) -> None:
    truth = [
        TruthHazard("a.b", "1", "cat", "A cat.", "7", 0, 9),
        TruthHazard("a.b", "2", "", "A dog."),
        TruthHazard("c", "", "", ""),
    ]
    TRUTH.write(tmp_path / "t.parquet", truth)
    csv = "description,label,hazard_id,video_id,track_id,first_frame,last_frame\n,,,c,,,\nA dog.,,2,a.b,,,\n"
    write(tmp_path, "t.csv", csv + "A cat.,cat,1,a.b,7,0,9\n")
    rows = [{name: getattr(row, name) for name in TruthHazard.__slots__} for row in truth]
    write(tmp_path, "t.jsonl", "\n".join(json.dumps(row) for row in rows[::-1]))
    for name in ("t.parquet", "t.csv", "t.jsonl"):
        assert read_truth(tmp_path / name) == truth, name


def test_missing_videos_and_unknown_columns_are_warnings(tmp_path: Path) -> None:
    text = "video_id,rank,description,score,\u202eevil\nv2,1,x,0.9,1\n"
    read = read_predictions(write(tmp_path, "p.csv", text), HAZARDS)
    assert read.warnings == (
        "Ignored unknown columns: score, \\u202eevil.",
        "1 of 2 videos with a hazard have no prediction and count as 0: v1.",
    )


def test_header_only_is_a_submission_that_predicts_nothing(tmp_path: Path) -> None:
    PREDICTIONS.write(tmp_path / "p.parquet", [])
    for path in (write(tmp_path, "p.csv", HEAD), tmp_path / "p.parquet"):
        read = read_predictions(path, HAZARDS)
        assert read.predictions == ()
        assert read.warnings[0] == "The file holds no prediction."
        assert "v1, v2" in read.warnings[1]


TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=30)
CAPTION = TEXT.map(str.strip).filter(
    lambda text: any(char.isprintable() and not char.isspace() for char in text) and text.lower() != "nan"
)
IDS = st.from_regex(checks.SAFE_ID, fullmatch=True)
RECORDS = st.lists(
    st.builds(
        Prediction,
        IDS,
        st.integers(1, 2**31 - 1),
        CAPTION,
        st.none() | CAPTION,
        st.lists(CAPTION.filter(lambda text: len(text) < 100), max_size=3).map(tuple),
        st.lists(st.integers(0, 2**31 - 1), max_size=3).map(tuple),
    ),
    min_size=1,
    max_size=6,
    unique_by=lambda row: (row.video_id, row.rank),
)


@settings(deadline=None)
@given(RECORDS)
def test_round_trip_through_every_format(predictions: list[Prediction]) -> None:
    expected = tuple(sorted(predictions, key=lambda row: (row.video_id, row.rank)))
    rows = [{name: getattr(row, name) for name in Prediction.__slots__} for row in predictions]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        PREDICTIONS.write(folder / "p.parquet", predictions)
        write(folder, "p.jsonl", "\n".join(json.dumps(row) for row in rows))
        buffer = io.StringIO(newline="")
        writer = csv.DictWriter(buffer, Prediction.__slots__)
        writer.writeheader()
        for row in rows:
            lists = {name: json.dumps(row[name]) for name in ("track_ids", "frame_indices")}
            writer.writerow({**row, **lists})
        write(folder, "p.csv", buffer.getvalue())
        for path in sorted(folder.iterdir()):
            assert read_predictions(path).predictions == expected, path.name
