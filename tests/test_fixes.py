"""Corrected copies: what is mended, what is said of it, and that no caption is invented or lost."""

import gzip
import json
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen.fixes import Fixed, fixed
from sitegen.readers import ReadOptions, read_predictions
from tests.faulty import HAZARDS, HEAD, faults, write

Rows = list[tuple[str, int, str]]


def read_again(folder: Path, copy: Fixed) -> Rows:
    """What a corrected copy says."""
    path = write(folder, f"copy.{copy.ending}", copy.data)
    return [(row.video_id, row.rank, row.description) for row in read_predictions(path, HAZARDS).predictions]


def test_a_file_that_needs_nothing(tmp_path: Path) -> None:
    files = {
        "p.csv": (HEAD + "\nv1,1,a\r\n").encode(),
        "p.jsonl": b'{"rank":1.0,  "video_id": "v1", "description": "a"}\n',
        "p.parquet": PREDICTIONS.to_bytes([Prediction("v1", 1, "a")]),
    }
    for name, content in files.items():
        path = write(tmp_path, name, content)
        assert fixed(path, HAZARDS) == Fixed(content, name[2:], ())
    packed = write(tmp_path, "p.csv.gz", gzip.compress(files["p.csv"]))
    assert fixed(packed, HAZARDS) == Fixed(files["p.csv"], "csv", ())


def test_all_mends_in_a_csv(tmp_path: Path) -> None:
    text = '\ufeffVideo ID, caption ,score\n V1 ," a ""cat"", running ",0.1\nv1,"a ""cat"", running",0.2\n'
    path = write(tmp_path, "p.csv", text + "v1,b,1\nv2,x,2\nv1,c,\n")
    copy = fixed(path, HAZARDS)
    assert copy.notes == (
        "Took away the byte order mark at the start.",
        "Renamed the column 'Video ID' to 'video_id'.",
        "Renamed the column 'caption' to 'description'.",
        "Took surrounding spaces from the names of 1 column.",
        "Wrote video_id in the truth's upper and lower case in 1 row.",
        "Took surrounding spaces from description in 1 row.",
        "Removed 1 row that repeats an equal row.",
        "Added the column 'rank': the captions of each video in file order, in 4 rows.",
    )
    assert copy.data.decode() == (
        'video_id,description,score,rank\nv1,"a ""cat"", running",0.1,1\nv1,b,1,2\nv2,x,2,1\nv1,c,,3\n'
    )
    assert read_again(tmp_path, copy) == [
        ("v1", 1, 'a "cat", running'),
        ("v1", 2, "b"),
        ("v1", 3, "c"),
        ("v2", 1, "x"),
    ]
    assert fixed(write(tmp_path, "again.csv", copy.data), HAZARDS).notes == ()
    assert fixed(path, HAZARDS) == copy


def test_only_the_lines_that_need_it_change_in_json_lines(tmp_path: Path) -> None:
    kept = '{"video_id":"v2",  "rank": 1e0, "description": "caf\\u00e9"}'
    text = f'{kept}\n\n{{"video_id": "v1 ", "rank": 1, "description": "é", "x": [NaN]}}\r\n{kept}\n{{oops\n'
    copy = fixed(write(tmp_path, "p.jsonl", text), HAZARDS)
    assert copy.notes == (
        "Took surrounding spaces from video_id in 1 row.",
        "Removed 1 row that repeats an equal row.",
    )
    assert copy.data.decode() == (
        f'{kept}\n\n{{"video_id": "v1", "rank": 1, "description": "é", "x": [NaN]}}\r\n{{oops\n'
    )


def test_columns_and_ranks_in_json_lines(tmp_path: Path) -> None:
    text = '{"Video-ID": "v1", "caption": "a"}\n{"Video-ID": "v1", "caption": "b"}\n'
    copy = fixed(write(tmp_path, "p.jsonl", text), HAZARDS)
    assert read_again(tmp_path, copy) == [("v1", 1, "a"), ("v1", 2, "b")]
    assert len(copy.notes) == 3


def test_all_mends_in_parquet(tmp_path: Path) -> None:
    columns = {"Video": ["V1", " v1", "v2"], "caption": ["a", "a ", "b"], "score": [1, 2, 3]}
    table = pa.table({**columns, "track_ids": [["7"], ["7"], None]})
    pq.write_table(table.replace_schema_metadata({"config_sha256": "a" * 64}), tmp_path / "p.parquet")
    copy = fixed(tmp_path / "p.parquet", HAZARDS)
    assert copy.notes[-3:] == (
        "Removed 1 row that repeats an equal row.",
        "Added the column 'rank': the captions of each video in file order, in 2 rows.",
        "Left out the columns that are not read: score.",
    )
    read = read_predictions(write(tmp_path, "copy.parquet", copy.data), HAZARDS)
    assert read.predictions == (Prediction("v1", 1, "a", None, ("7",)), Prediction("v2", 1, "b"))
    assert read.config_sha256 == "a" * 64
    assert fixed(tmp_path / "copy.parquet", HAZARDS).notes == ()


def test_a_small_parquet_of_huge_texts_is_mended_in_little_memory(tmp_path: Path) -> None:
    rows = 100_000
    caption = pa.DictionaryArray.from_arrays(
        pa.array([0] * rows, pa.int32()), pa.array([" " + "x" * 100_000])
    )
    table = pa.table({"video_id": ["v1"] * rows, "rank": range(1, rows + 1), "description": caption})
    pq.write_table(table, tmp_path / "p.parquet")  # 10 GB as plain text
    copy = fixed(tmp_path / "p.parquet", HAZARDS)
    assert copy.notes == (f"Took surrounding spaces from description in {rows:,} rows.",)
    assert len(copy.data) < 20 * 2**20


NOT_SAFE: list[str] = [
    "video_id,rank,description\nv1,1,a\nv1,1,b\n",
    "video_id,rank,description\nv9,1,a\nv1,x,b\nv1,2,\nv1,3,   \n",
    "video_id,rank,caption,Caption\nv1,1,a,b\n",
    "video_id,rank,rank,description\nv1,1,1,a\n",
    'video_id,rank,description\nV1,1,a\nv1,1,"b\n',
    "video_id;rank;description\nV1;1;a\n",
]


@pytest.mark.parametrize("text", NOT_SAFE)
def test_what_is_not_safe_stays_as_it_was(tmp_path: Path, text: str) -> None:
    path = write(tmp_path, "p.csv", text)
    assert fixed(path, HAZARDS) == Fixed(text.encode(), "csv", ())
    assert faults(lambda: read_predictions(path, HAZARDS))


def test_faults_that_stay_are_found_in_the_copy(tmp_path: Path) -> None:
    copy = fixed(write(tmp_path, "p.csv", "Video_id,description\n v1,a\nv9,b\nv1,c,d\n"), HAZARDS)
    again = write(tmp_path, "copy.csv", copy.data)
    assert [fault[:2] for fault in faults(lambda: read_predictions(again, HAZARDS))] == [
        (None, "rank"),
        (2, "video_id"),
        (3, None),
    ]


def test_ids_by_map_and_by_number(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD + "a,1,x\nb,1,y\n")
    copy = fixed(path, HAZARDS, ReadOptions(video_map={"a": "v2", "b": "V1"}))
    assert read_again(tmp_path, copy) == [("v1", 1, "y"), ("v2", 1, "x")]
    numbers = fixed(write(tmp_path, "n.csv", HEAD + "1,1,x\n2,1,y\n"), HAZARDS)
    assert read_again(tmp_path, numbers) == [("v1", 1, "x"), ("v2", 1, "y")]
    assert numbers.notes == (
        "Wrote the truth's video_id for the file's, by the map or by number, in 2 rows.",
    )


def test_two_ids_do_not_become_one_video(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD + "a,1,x\nv1,2,y\n")
    assert fixed(path, HAZARDS, ReadOptions(video_map={"a": "v1"})).notes == ()
    number = write(tmp_path, "n.csv", HEAD + "1,1,x\n01,2,y\n")
    copy = fixed(number, HAZARDS)
    assert b"01,2,y" in copy.data


def test_an_outside_format_becomes_our_csv(tmp_path: Path) -> None:
    text = json.dumps({"V1": ["", "['a, \"b\"', 'c\\rd']"], "v2": ["", '["e"]']})
    copy = fixed(write(tmp_path, "r.json", text), HAZARDS)
    assert copy.notes == (
        "Wrote 3 predictions of results of the paper's scripts (JSON) as a CSV file with our columns.",
        "Wrote video_id in the truth's upper and lower case in 2 rows.",
    )
    assert read_again(tmp_path, copy) == [("v1", 1, 'a, "b"'), ("v1", 2, "c\rd"), ("v2", 1, "e")]
    wrong = '{"v1": ["", 7]}'
    assert fixed(write(tmp_path, "w.json", wrong), HAZARDS) == Fixed(wrong.encode(), "json", ())


def test_what_is_no_predictions_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FaultsError):
        fixed(write(tmp_path, "p.csv", "<html>"), HAZARDS)
    with pytest.raises(FaultsError):
        fixed(tmp_path / "none.csv", HAZARDS)


BLANKS = st.sampled_from(["", " ", "\t", "  "])
TRUTH = [TruthHazard(video, "1", "x", "x") for video in ("v1", "Ab", "c.d")]


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(["v1", "V1", "ab", "Ab", "C.D"]), BLANKS, st.text(max_size=5)),
        min_size=1,
        max_size=8,
    )
)
def test_captions_are_neither_invented_nor_lost(rows: list[tuple[str, str, str]]) -> None:
    records = [
        {"video_id": blank + video, "rank": number, "description": f"{blank}{text}x{blank}"}
        for number, (video, blank, text) in enumerate(rows, start=1)
    ]
    captions = [str(record["description"]).strip() for record in records]
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder), "p.jsonl", "\n".join(json.dumps(record) for record in records) + "\n#")
        copy = fixed(path, TRUTH)
        kept = [json.loads(line) for line in copy.data.split(b"\n")[:-1] if line]
        assert [record["description"].strip() for record in kept] == captions
        assert {record["video_id"] for record in kept} <= {"v1", "Ab", "c.d"}
        assert fixed(write(Path(folder), "q.jsonl", copy.data), TRUTH).notes == ()
