"""Every fault in the rows of a truth or predictions file, with its place."""

import math
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.errors import FaultsError
from pipeline.records import TruthHazard
from sitegen.readers import read_predictions, read_truth
from tests.faulty import HAZARDS, HEAD, TRUTH_HEAD, faults, lines, places, write

WRONG_CSV: list[tuple[str, list[tuple[int | None, str | None, str]]]] = [
    ("v9,1,x\n", [(1, "video_id", "'v9'")]),
    ("v1,1,x\nv1,1,y\n", [(2, "rank", "rank '1' again in video 'v1' (first in row 1)")]),
    ("v1,0,x\n", [(1, "rank", "'0'")]),
    ("v1,-1,x\n", [(1, "rank", "'-1'")]),
    ("v1,1.5,x\n", [(1, "rank", "'1.5'")]),
    ("v1,one,x\n", [(1, "rank", "'one'")]),
    ("v1,,x\n", [(1, "rank", "an empty cell")]),
    ("v1,2147483648,x\n", [(1, "rank", "'2147483648'")]),
    (f"v1,{'9' * 5000},x\n", [(1, "rank", f"5,000 characters: '{'9' * 80}...'")]),
    ("v1,١,x\n", [(1, "rank", "'١'")]),
    ("v1,1,\n", [(1, "description", "an empty cell")]),
    ("v1,1,   \n", [(1, "description", "only blanks")]),
    ("v1,1,\u200b \u2060\n", [(1, "description", "'\\u200b \\u2060'")]),
    ("v1,1,nan\n", [(1, "description", "'nan'")]),
    ("v1,1,NaN\n", [(1, "description", "'NaN'")]),
    ("v1,1," + "x" * 2001 + "\n", [(1, "description", f"2,001 characters: '{'x' * 80}...'")]),
    ("v1,1," + "x" * 100_000 + "\n", [(1, "description", f"100,000 characters: '{'x' * 80}...'")]),
    ("v1,1," + "x" * 200_000 + "\n", [(1, "description", f"200,000 characters: '{'x' * 80}...'")]),
    ("v1,1,a\0b\n", [(1, "description", "a NUL character in 'a\\x00b'")]),
    ("v1,1\n", [(1, None, "2 cells")]),
    ("v1,1,x,y\n", [(1, None, "4 cells")]),
    ("v1,1,\u202ex\0\n", [(1, "description", "a NUL character in '\\u202ex\\x00'")]),
    (
        'v1,1,"two\nlines"\n\nv1,0,x\nv9,1,\nv2,1\nv1,1,z\n',
        [
            (2, "rank", "'0'"),
            (3, "video_id", "'v9'"),
            (3, "description", "an empty cell"),
            (4, None, "2 cells"),
            (5, "rank", "rank '1' again in video 'v1' (first in row 1)"),
        ],
    ),
]


@pytest.mark.parametrize(("body", "expected"), WRONG_CSV, ids=range(len(WRONG_CSV)))
def test_wrong_rows_of_a_csv(tmp_path: Path, body: str, expected: list[Any]) -> None:
    path = write(tmp_path, "p.csv", HEAD + body)
    assert faults(lambda: read_predictions(path, HAZARDS)) == expected


def test_a_caption_of_exactly_the_limit_is_right(tmp_path: Path) -> None:
    assert read_predictions(write(tmp_path, "p.csv", HEAD + "v1,1," + "x" * 2000)).predictions


def test_bytes_that_are_not_utf8(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD.encode() + b"v1,1,ok\nv1,2,caf\xe9\n\xff,3,x\n")
    assert faults(lambda: read_predictions(path)) == [
        (2, "description", "b'\\xe9', which is not UTF-8, in 'caf\\udce9'"),
        (3, "video_id", "b'\\xff', which is not UTF-8, in '\\udcff'"),
    ]


def test_an_unclosed_quote_is_one_fault_at_its_row(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD + 'v1,1,ok\nv1,2,"never closed\nv2,1,x\n')
    assert faults(lambda: read_predictions(path)) == [(2, None, "unexpected end of data")]


WRONG_JSONL: list[tuple[str, list[tuple[int | None, str | None, str]]]] = [
    ('{"video_id": "v1", "rank": 1, "description": NaN}', [(1, "description", "NaN")]),
    ('{"video_id": "v1", "rank": 1, "description": null}', [(1, "description", "nothing (null)")]),
    ('{"video_id": "v1", "rank": true, "description": "x"}', [(1, "rank", "True (bool)")]),
    ('{"video_id": "v1", "rank": 1e999, "description": "x"}', [(1, "rank", "inf (float)")]),
    ('{"video_id": "v1", "rank": [1], "description": "x"}', [(1, "rank", "[1] (list)")]),
    ('{"video_id": "v1", "rank": 1, "description": {"a": 1}}', [(1, "description", "{'a': 1} (dict)")]),
    ('{"video_id": 1.5, "rank": 1, "description": "x"}', [(1, "video_id", "1.5 (float)")]),
    (
        '{"video_id": "v1", "rank": 1, "description": "\\ud800"}',
        [(1, "description", "b'\\xed\\xa0\\x80', which is not UTF-8, in '\\ud800'")],
    ),
    (
        '{"video_id": "v1", "rank": 1, "description": "x", "track_ids": 3, "frame_indices": [-1]}',
        [(1, "track_ids", "3 (int)"), (1, "frame_indices", "-1 (int)")],
    ),
    (
        '{"video_id": "v1", "rank": 1, "description": "x", "track_ids": [null, []], "label": NaN}',
        [(1, "label", "NaN"), (1, "track_ids", "nothing (null)")],
    ),
]


@pytest.mark.parametrize(("line", "expected"), WRONG_JSONL, ids=range(len(WRONG_JSONL)))
def test_wrong_values_in_json_lines(tmp_path: Path, line: str, expected: list[Any]) -> None:
    path = write(tmp_path, "p.jsonl", line + "\n")
    assert faults(lambda: read_predictions(path, HAZARDS)) == expected


def test_mixed_halves_of_surrogates_are_a_fault(tmp_path: Path) -> None:
    line = '{"video_id": "v1", "rank": 1, "description": "\\udc80\\ud800"}\n'
    assert places(lambda: read_predictions(write(tmp_path, "p.jsonl", line))) == [(1, "description")]


def test_deeply_nested_json(tmp_path: Path) -> None:
    for depth in range(900, 1000, 3):
        line = '{"video_id": "v1", "rank": 1, "description": ' + "[" * depth + "]" * depth + "}"
        path = write(tmp_path, "p.jsonl", line)
        assert [row for row, _ in places(lambda path=path: read_predictions(path))] == [1]  # type: ignore[misc]


def test_an_object_without_keys(tmp_path: Path) -> None:
    path = write(tmp_path, "p.jsonl", "{}\n")
    assert places(lambda: read_predictions(path)) == [
        (None, "video_id"),
        (None, "rank"),
        (None, "description"),
    ]


def test_bad_json_lines_come_with_their_numbers(tmp_path: Path) -> None:
    good = b'{"video_id": "v1", "rank": %d, "description": "x"}\n'
    deep = b'{"a":' + b"[" * 200_000
    big = b'{"rank": ' + b"9" * 5000 + b"}"
    lines = [good % 1, b"{oops}\n", b"\n", b"[1]\n", b'{"a": "\xff"}\n', deep + b"\n", big + b"\n", good % 2]
    path = write(tmp_path, "p.jsonl", b"".join(lines))
    assert places(lambda: read_predictions(path)) == [(2, None), (4, None), (5, None), (6, None), (7, None)]


def test_a_key_missing_in_one_line_is_a_fault_of_that_line(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "p.jsonl",
        '{"video_id": "v1", "rank": 1, "description": "x"}\n{"video_id": "v1", "rank": 2}',
    )
    assert faults(lambda: read_predictions(path)) == [(2, "description", "nothing (null)")]


def test_wrong_values_in_parquet(tmp_path: Path) -> None:
    table = pa.table(
        {
            "video_id": ["v1", "v1", None, "v1", "v9"],
            "rank": [1.0, math.nan, 2.5, None, 3.0],
            "description": ["x", None, "", "nan", "x" * 2001],
            "frame_indices": pa.array([[1], [None], [], None, [-3]]),
        }
    )
    pq.write_table(table, tmp_path / "p.parquet")
    assert faults(lambda: read_predictions(tmp_path / "p.parquet", HAZARDS)) == [
        (2, "rank", "NaN"),
        (2, "description", "nothing (null)"),
        (2, "frame_indices", "nothing (null)"),
        (3, "video_id", "nothing (null)"),
        (3, "rank", "2.5 (float)"),
        (3, "description", "an empty cell"),
        (4, "rank", "nothing (null)"),
        (4, "description", "'nan'"),
        (5, "video_id", "'v9'"),
        (5, "description", f"2,001 characters: '{'x' * 80}...'"),
        (5, "frame_indices", "-3 (int)"),
    ]


def test_wrong_types_in_parquet(tmp_path: Path) -> None:
    bad = pa.array([b"ok", b"caf\xe9"], pa.binary())
    table = pa.table(
        {
            "video_id": pa.array([b"v1", b"v2"], pa.binary()),
            "rank": pa.array([1, 2**62], pa.timestamp("us")),
            "description": pa.Array.from_buffers(pa.string(), 2, bad.buffers()),
            "track_ids": pa.array([[{"a": 1}], []]),
        }
    )
    pq.write_table(table, tmp_path / "p.parquet", store_schema=False)
    assert places(lambda: read_predictions(tmp_path / "p.parquet")) == [
        (1, "video_id"),
        (1, "rank"),
        (1, "track_ids"),
        (2, "video_id"),
        (2, "rank"),
        (2, "description"),
    ]


def test_columns_that_are_missing_come_together_with_the_rest(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", "Video ID,rank,caption\nv1,0,x\n")
    found = faults(lambda: read_predictions(path))
    assert [fault[:2] for fault in found] == [(None, "video_id"), (None, "description"), (1, "rank")]
    with pytest.raises(FaultsError, match="Rename 'Video ID' to 'video_id'"):
        read_predictions(path)


@pytest.mark.parametrize("sign", [";", "\t", "|"])
def test_other_delimiters_are_named(tmp_path: Path, sign: str) -> None:
    path = write(tmp_path, "p.csv", (HEAD + "v1,1,x\n").replace(",", sign))
    assert faults(lambda: read_predictions(path))[0][2].endswith("between the cells")


def test_a_column_given_twice(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", "video_id,rank,rank,description\nv1,1,2,x\n")
    assert faults(lambda: read_predictions(path)) == [(None, "rank", "2 columns of this name")]
    columns = [pa.array(["v1"]), pa.array([1]), pa.array([2]), pa.array(["x"])]
    pq.write_table(
        pa.table(columns, names=["video_id", "rank", "rank", "description"]), tmp_path / "p.parquet"
    )
    assert places(lambda: read_predictions(tmp_path / "p.parquet")) == [(None, None)]


def test_faults_beyond_a_thousand_are_counted(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD + "v1,0,\n" * 1500)
    found = faults(lambda: read_predictions(path))
    assert len(found) == 1001
    assert found[:2] == [(1, "rank", "'0'"), (1, "description", "an empty cell")]
    assert found[-1] == (None, None, "2,000 more faults")


def test_a_near_miss_is_suggested(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD + "video_001,1,x\n")
    with pytest.raises(FaultsError, match="Did you mean 'video_0001'"):
        read_predictions(path, [TruthHazard("video_0001", "1", "x", "x")])


def test_keys_given_twice_in_a_json_line(tmp_path: Path) -> None:
    good = '{"video_id": "v1", "rank": 1, "description": "x"}'
    twice = '{"video_id": "v1", "rank": 2, "rank": 2, "description": "x"}'
    path = write(tmp_path, "p.jsonl", f"{good}\n{twice}\n")
    assert faults(lambda: read_predictions(path)) == [(2, None, "the key 'rank' twice in one object")]


def test_faults_of_a_csv_name_the_line_where_their_row_starts(tmp_path: Path) -> None:
    body = 'v1,1,"two\nlines"\n\nv1,0,"three\r\nlong\rlines"\nv9,2,x\nv2,1\n'
    path = write(tmp_path, "p.csv", HEAD + body)
    assert [row for row, _ in places(lambda: read_predictions(path, HAZARDS))] == [2, 3, 4]
    assert lines(lambda: read_predictions(path, HAZARDS)) == [5, 8, 9]


def test_a_broken_csv_names_the_line_where_the_row_starts(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", HEAD + '\nv1,1,"a\nb"\nv1,2,"never\nclosed\n')
    assert places(lambda: read_predictions(path)) == [(2, None)]
    assert lines(lambda: read_predictions(path)) == [5]


def test_lines_of_json_lines_are_their_rows_and_parquet_has_none(tmp_path: Path) -> None:
    path = write(tmp_path, "p.jsonl", '\n{"video_id": "v1", "rank": 0, "description": "x"}\n[1]\n')
    assert lines(lambda: read_predictions(path)) == [2, 3]
    pq.write_table(pa.table({"video_id": ["v1"], "rank": [0], "description": ["x"]}), tmp_path / "p.parquet")
    assert lines(lambda: read_predictions(tmp_path / "p.parquet")) == [None]


WRONG_TRUTH: list[tuple[str, list[tuple[int | None, str | None]]]] = [
    ("", [(None, None)]),
    ("v1,1,cat,A cat.\nv1,1,dog,A dog.\n", [(2, "hazard_id")]),
    ("v1,1,cat,A cat.\nv1,2,,\n", [(2, "description")]),
    ("v1,,,\nv1,,,\n", [(1, "description"), (2, "description")]),
    ("v1,1,cat,\n", [(1, "description")]),
    ("v1,,cat,A cat.\n", [(1, "hazard_id")]),
    ("v1,1,cat,nan\n", [(1, "description")]),
    ("../v1,1,cat,A cat.\n", [(1, "video_id")]),
    (".v1,1,cat,A cat.\n", [(1, "video_id")]),
    ("a/b,1,cat,A cat.\n", [(1, "video_id")]),
    ("v 1,1,cat,A cat.\n", [(1, "video_id")]),
    ("ü,1,cat,A cat.\n", [(1, "video_id")]),
    (",1,cat,A cat.\n", [(1, "video_id")]),
    (f"{'v' * 129},1,cat,A cat.\n", [(1, "video_id")]),
    ("v1,1,cat,A cat.\nV1,1,cat,A cat.\n", [(2, "video_id")]),
    (f"v1,1,cat,{'x' * 2001}\nv2,1,{'x' * 2001},A cat.\n", [(1, "description"), (2, "label")]),
]


@pytest.mark.parametrize(("body", "expected"), WRONG_TRUTH, ids=range(len(WRONG_TRUTH)))
def test_wrong_truth(tmp_path: Path, body: str, expected: list[Any]) -> None:
    path = write(tmp_path, "t.csv", TRUTH_HEAD + body)
    assert places(lambda: read_truth(path)) == expected


def test_frames_of_a_truth_hazard_must_be_in_order(tmp_path: Path) -> None:
    head = "video_id,hazard_id,label,description,track_id,first_frame,last_frame\n"
    path = write(tmp_path, "t.csv", head + "v1,1,c,x,7,5,4\nv2,1,c,x,7,5,5\nv3,1,c,x,,-1,\nv4,1,c,x,,5,\n")
    assert places(lambda: read_truth(path)) == [(1, "last_frame"), (3, "first_frame")]


def test_truth_without_columns(tmp_path: Path) -> None:
    path = write(tmp_path, "t.csv", "video_id,caption\nv1,x\n")
    assert places(lambda: read_truth(path)) == [(None, "hazard_id"), (None, "label"), (None, "description")]
