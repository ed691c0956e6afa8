"""Truth and prediction files: three formats, one content; and everything that can be wrong with them."""

import gzip
import io
import json
import math
import pickle
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS, TRUTH
from sitegen import checks, formats, sheets
from sitegen.checks import show, visible
from sitegen.readers import read_predictions, read_truth

HAZARDS = [
    TruthHazard("v1", "1", "cat", "A cat crosses the road."),
    TruthHazard("v2", "1", "dog", "A dog crosses the road."),
    TruthHazard("v3", "", "", ""),
]
HEAD = "video_id,rank,description\n"
TRUTH_HEAD = "video_id,hazard_id,label,description\n"


def _faults(read: Callable[[], object]) -> list[tuple[int | None, str | None, str]]:
    with pytest.raises(FaultsError) as caught:
        read()
    for fault in caught.value.faults:
        assert fault.expected
        assert fault.mend
        assert str(fault).isprintable()
    return [(fault.row, fault.column, fault.found) for fault in caught.value.faults]


def _places(read: Callable[[], object]) -> list[tuple[int | None, str | None]]:
    return [fault[:2] for fault in _faults(read)]


def _write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


# --- what is right -------------------------------------------------------------------------------

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
    read = read_predictions(_write(tmp_path, "p.csv", CSV))
    assert (read.predictions, read.source_format, read.warnings) == (EXPECTED, "csv", ())


def test_csv_with_byte_order_mark_blanks_and_windows_line_ends(tmp_path: Path) -> None:
    text = "\ufeff" + 'video_id, rank ,description\r\nv1 , 1, "not quoted"\r\n'.replace('"', "")
    read = read_predictions(_write(tmp_path, "p.csv", text))
    assert read.predictions == (Prediction("v1", 1, "not quoted"),)


def test_jsonl(tmp_path: Path) -> None:
    text = "\n\n".join(json.dumps(row, ensure_ascii=False) for row in JSONL)
    read = read_predictions(_write(tmp_path, "p.jsonl", text))
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
    line = _write(tmp_path, "p.jsonl", '{"video_id": 7, "rank": 1, "description": "x"}')
    for path in (tmp_path / "p.parquet", line):
        assert read_predictions(path).predictions == (Prediction("7", 1, "x"),)


@pytest.mark.parametrize("name", ["p", "p.txt", "p.CSV", "p.data"])
def test_endings_that_name_no_other_format_do_not_matter(tmp_path: Path, name: str) -> None:
    assert read_predictions(_write(tmp_path, name, CSV)).predictions == EXPECTED


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
    assert read_predictions(_write(tmp_path, "p.csv", text)).predictions[0].track_ids == track_ids


def test_truth_in_three_formats(tmp_path: Path) -> None:
    truth = [
        TruthHazard("a.b", "1", "cat", "A cat.", "7", 0, 9),
        TruthHazard("a.b", "2", "", "A dog."),
        TruthHazard("c", "", "", ""),
    ]
    TRUTH.write(tmp_path / "t.parquet", truth)
    csv = "description,label,hazard_id,video_id,track_id,first_frame,last_frame\n,,,c,,,\nA dog.,,2,a.b,,,\n"
    _write(tmp_path, "t.csv", csv + "A cat.,cat,1,a.b,7,0,9\n")
    rows = [{name: getattr(row, name) for name in TruthHazard.__slots__} for row in truth]
    _write(tmp_path, "t.jsonl", "\n".join(json.dumps(row) for row in rows[::-1]))
    for name in ("t.parquet", "t.csv", "t.jsonl"):
        assert read_truth(tmp_path / name) == truth, name


def test_missing_videos_and_unknown_columns_are_warnings(tmp_path: Path) -> None:
    text = "video_id,rank,description,score,\u202eevil\nv2,1,x,0.9,1\n"
    read = read_predictions(_write(tmp_path, "p.csv", text), HAZARDS)
    assert read.warnings == (
        "Ignored unknown columns: score, \\u202eevil.",
        "1 of 2 videos with a hazard have no prediction and count as 0: v1.",
    )


def test_header_only_is_a_submission_that_predicts_nothing(tmp_path: Path) -> None:
    PREDICTIONS.write(tmp_path / "p.parquet", [])
    for path in (_write(tmp_path, "p.csv", HEAD), tmp_path / "p.parquet"):
        read = read_predictions(path, HAZARDS)
        assert read.predictions == ()
        assert read.warnings[0] == "The file holds no prediction."
        assert "v1, v2" in read.warnings[1]


TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=30)
CAPTION = TEXT.map(str.strip).filter(lambda text: text and text.lower() != "nan")
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


@given(RECORDS)
def test_round_trip_through_every_format(predictions: list[Prediction]) -> None:
    import csv

    expected = tuple(sorted(predictions, key=lambda row: (row.video_id, row.rank)))
    rows = [{name: getattr(row, name) for name in Prediction.__slots__} for row in predictions]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        PREDICTIONS.write(folder / "p.parquet", predictions)
        _write(folder, "p.jsonl", "\n".join(json.dumps(row) for row in rows))
        buffer = io.StringIO(newline="")
        writer = csv.DictWriter(buffer, Prediction.__slots__)
        writer.writeheader()
        for row in rows:
            writer.writerow(
                {**row, "track_ids": json.dumps(row["track_ids"]), "frame_indices": row["frame_indices"]}
            )
        _write(
            folder,
            "p.csv",
            buffer.getvalue().replace("(", "[").replace(",)", "]") if False else buffer.getvalue(),
        )
        for path in sorted(folder.iterdir()):
            assert read_predictions(path).predictions == expected, path.name


# --- what is wrong -------------------------------------------------------------------------------

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
    path = _write(tmp_path, "p.csv", HEAD + body)
    assert _faults(lambda: read_predictions(path, HAZARDS)) == expected


def test_a_caption_of_exactly_the_limit_is_right(tmp_path: Path) -> None:
    assert read_predictions(_write(tmp_path, "p.csv", HEAD + "v1,1," + "x" * 2000)).predictions


def test_bytes_that_are_not_utf8(tmp_path: Path) -> None:
    path = _write(tmp_path, "p.csv", HEAD.encode() + b"v1,1,ok\nv1,2,caf\xe9\n\xff,3,x\n")
    assert _faults(lambda: read_predictions(path)) == [
        (2, "description", "b'\\xe9', which is not UTF-8, in 'caf\\udce9'"),
        (3, "video_id", "b'\\xff', which is not UTF-8, in '\\udcff'"),
    ]


def test_an_unclosed_quote_is_one_fault_at_its_row(tmp_path: Path) -> None:
    path = _write(tmp_path, "p.csv", HEAD + 'v1,1,ok\nv1,2,"never closed\nv2,1,x\n')
    assert _faults(lambda: read_predictions(path)) == [(2, None, "unexpected end of data")]


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
    path = _write(tmp_path, "p.jsonl", line + "\n")
    assert _faults(lambda: read_predictions(path, HAZARDS)) == expected


def test_bad_json_lines_come_with_their_numbers(tmp_path: Path) -> None:
    good = b'{"video_id": "v1", "rank": %d, "description": "x"}\n'
    deep = b'{"a":' + b"[" * 200_000
    big = b'{"rank": ' + b"9" * 5000 + b"}"
    lines = [good % 1, b"{oops}\n", b"\n", b"[1]\n", b'{"a": "\xff"}\n', deep + b"\n", big + b"\n", good % 2]
    path = _write(tmp_path, "p.jsonl", b"".join(lines))
    assert _places(lambda: read_predictions(path)) == [(2, None), (4, None), (5, None), (6, None), (7, None)]


def test_a_key_missing_in_one_line_is_a_fault_of_that_line(tmp_path: Path) -> None:
    path = _write(
        tmp_path,
        "p.jsonl",
        '{"video_id": "v1", "rank": 1, "description": "x"}\n{"video_id": "v1", "rank": 2}',
    )
    assert _faults(lambda: read_predictions(path)) == [(2, "description", "nothing (null)")]


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
    assert _faults(lambda: read_predictions(tmp_path / "p.parquet", HAZARDS)) == [
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
            "rank": pa.array([1, 2**62], pa.timestamp("s")),
            "description": pa.Array.from_buffers(pa.string(), 2, bad.buffers()),
            "track_ids": pa.array([[{"a": 1}], []]),
        }
    )
    pq.write_table(table, tmp_path / "p.parquet", store_schema=False)
    assert _places(lambda: read_predictions(tmp_path / "p.parquet")) == [
        (1, "video_id"),
        (1, "rank"),
        (1, "track_ids"),
        (2, "video_id"),
        (2, "rank"),
        (2, "description"),
    ]


def test_columns_that_are_missing_come_together_with_the_rest(tmp_path: Path) -> None:
    path = _write(tmp_path, "p.csv", "Video ID,rank,caption\nv1,0,x\n")
    faults = _faults(lambda: read_predictions(path))
    assert [fault[:2] for fault in faults] == [(None, "video_id"), (None, "description"), (1, "rank")]
    with pytest.raises(FaultsError, match="Rename 'Video ID' to 'video_id'"):
        read_predictions(path)


@pytest.mark.parametrize("sign", [";", "\t", "|"])
def test_other_delimiters_are_named(tmp_path: Path, sign: str) -> None:
    path = _write(tmp_path, "p.csv", (HEAD + "v1,1,x\n").replace(",", sign))
    assert _faults(lambda: read_predictions(path))[0][2].endswith("between the cells")


def test_a_column_given_twice(tmp_path: Path) -> None:
    path = _write(tmp_path, "p.csv", "video_id,rank,rank,description\nv1,1,2,x\n")
    assert _faults(lambda: read_predictions(path)) == [(None, "rank", "2 columns of this name")]
    columns = [pa.array(["v1"]), pa.array([1]), pa.array([2]), pa.array(["x"])]
    pq.write_table(
        pa.table(columns, names=["video_id", "rank", "rank", "description"]), tmp_path / "p.parquet"
    )
    assert _places(lambda: read_predictions(tmp_path / "p.parquet")) == [(None, None)]


def _zip(name: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, HEAD)
    return buffer.getvalue()


def _parquet() -> bytes:
    buffer = io.BytesIO()
    pq.write_table(pa.table({"video_id": ["v1"], "rank": [1], "description": ["x"]}), buffer)
    return buffer.getvalue()


LINE = '{"video_id": "v1", "rank": 1, "description": "x"}\n'
WRONG_FILES: list[tuple[str, str | bytes, str]] = [
    ("p.csv", b"", "an empty file"),
    ("p.parquet", b"", "an empty file"),
    ("p.jsonl", b" \n\n", "an empty file"),
    ("p.csv", _parquet(), "what looks like a Parquet file"),
    ("p.parquet", HEAD + "v1,1,x\n", "what looks like a CSV file"),
    ("p.parquet", LINE, "what looks like a JSON Lines file"),
    ("p.jsonl", HEAD + "v1,1,x\n", "what looks like a CSV file"),
    ("p.csv", LINE, "what looks like a JSON Lines file"),
    ("p.json", "[" + LINE + "]", "a JSON list"),
    ("p.csv", "<html><body>404</body></html>", "an HTML or XML file"),
    ("p.csv", gzip.compress(HEAD.encode()), "a gzip archive"),
    ("p.csv.gz", gzip.compress(HEAD.encode()), "a gzip archive"),
    ("p.zip", _zip("p.csv"), "a zip archive"),
    ("p.csv", _zip("xl/workbook.xml"), "an Excel workbook (.xlsx)"),
    ("p.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(100), "an old Excel workbook (.xls)"),
    ("p.pkl", pickle.dumps([1]), "a Python pickle"),
    ("p.csv", HEAD.encode("utf-16"), "text in UTF-16"),
    ("p.csv", bytes(range(20)) * 10, "binary data"),
]


@pytest.mark.parametrize(("name", "content", "found"), WRONG_FILES, ids=[row[2] for row in WRONG_FILES])
def test_files_that_are_something_else(tmp_path: Path, name: str, content: str | bytes, found: str) -> None:
    path = _write(tmp_path, name, content)
    assert _faults(lambda: read_predictions(path)) == [(None, None, found)]
    assert _faults(lambda: read_truth(path)) == [(None, None, found)]


def test_archives_are_to_be_unpacked(tmp_path: Path) -> None:
    with pytest.raises(FaultsError, match="Unpack it first"):
        read_predictions(_write(tmp_path, "p.csv.gz", gzip.compress(b"x")))


def test_damaged_parquet(tmp_path: Path) -> None:
    whole = _parquet()
    for number, data in enumerate(
        [whole[:-20], whole[:8], whole[:4] + bytes(200) + whole[204:], b"PAR1" * 5]
    ):
        path = _write(tmp_path, f"{number}.parquet", data)
        (fault,) = _faults(lambda path=path: read_predictions(path))  # type: ignore[misc]
        assert fault[2].startswith("a damaged Parquet file"), number


def test_no_file_folder_and_odd_paths(tmp_path: Path) -> None:
    assert _faults(lambda: read_predictions(tmp_path / "none.csv")) == [(None, None, "no such file")]
    assert _faults(lambda: read_predictions(tmp_path)) == [(None, None, "a folder")]
    odd = "something that is not a regular file"
    assert _faults(lambda: read_predictions(Path("/dev/null"))) == [(None, None, odd)]
    assert _places(lambda: read_predictions(tmp_path / ("x" * 5000))) == [(None, None)]
    assert _places(lambda: read_predictions(Path("a\0b"))) == [(None, None)]


def test_bounds_on_bytes_and_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "MAX_BYTES", 5 * 2**20)
    path = _write(tmp_path, "p.csv", HEAD + "x" * (5 * 2**20))
    assert _places(lambda: read_predictions(path)) == [(None, None)]
    monkeypatch.setattr(sheets, "MAX_ROWS", 2)
    rows = [("v1", 1, "a"), ("v1", 2, "b"), ("v1", 3, "c")]
    PREDICTIONS.write(tmp_path / "p.parquet", [Prediction(*row) for row in rows])
    _write(tmp_path, "p.csv", HEAD + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
    _write(
        tmp_path,
        "p.jsonl",
        "".join(json.dumps(dict(zip(HEAD.strip().split(","), row))) + "\n" for row in rows),
    )  # noqa: B905
    for name in ("p.csv", "p.jsonl", "p.parquet"):
        assert _faults(lambda name=name: read_predictions(tmp_path / name)) == [
            (None, None, "more than 2 rows")
        ]  # type: ignore[misc]


def test_a_small_parquet_that_unpacks_to_a_huge_one(tmp_path: Path) -> None:
    rows = 1_000_000
    caption = pa.array(["x" * 100_000])
    table = pa.table(
        {
            "video_id": pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), pa.array(["v1"])),
            "rank": pa.array(range(1, rows + 1)),
            "description": pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), caption),
        }
    )  # 100 GB as plain text
    pq.write_table(table, tmp_path / "p.parquet", compression="zstd")
    assert (tmp_path / "p.parquet").stat().st_size < 20 * 2**20
    faults = _faults(lambda: read_predictions(tmp_path / "p.parquet"))
    assert len(faults) == 1001
    assert faults[0][:2] == (1, "description")
    assert faults[-1] == (None, None, "999,000 more faults")


def test_a_parquet_with_too_many_list_items(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheets, "MAX_VALUES", 10)
    PREDICTIONS.write(tmp_path / "p.parquet", [Prediction("v1", 1, "x", None, ("1",) * 11)])
    assert _places(lambda: read_predictions(tmp_path / "p.parquet")) == [(None, None)]


def test_faults_beyond_a_thousand_are_counted(tmp_path: Path) -> None:
    path = _write(tmp_path, "p.csv", HEAD + "v1,0,\n" * 1500)
    faults = _faults(lambda: read_predictions(path))
    assert len(faults) == 1001
    assert faults[:2] == [(1, "rank", "'0'"), (1, "description", "an empty cell")]
    assert faults[-1] == (None, None, "2,000 more faults")


def test_a_near_miss_is_suggested(tmp_path: Path) -> None:
    path = _write(tmp_path, "p.csv", HEAD + "video_001,1,x\n")
    with pytest.raises(FaultsError, match="Did you mean 'video_0001'"):
        read_predictions(path, [TruthHazard("video_0001", "1", "x", "x")])


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


@pytest.mark.parametrize(("body", "places"), WRONG_TRUTH, ids=range(len(WRONG_TRUTH)))
def test_wrong_truth(tmp_path: Path, body: str, places: list[Any]) -> None:
    path = _write(tmp_path, "t.csv", TRUTH_HEAD + body)
    assert _places(lambda: read_truth(path)) == places


def test_frames_of_a_truth_hazard_must_be_in_order(tmp_path: Path) -> None:
    head = "video_id,hazard_id,label,description,track_id,first_frame,last_frame\n"
    path = _write(tmp_path, "t.csv", head + "v1,1,c,x,7,5,4\nv2,1,c,x,7,5,5\nv3,1,c,x,,-1,\nv4,1,c,x,,5,\n")
    assert _places(lambda: read_truth(path)) == [(1, "last_frame"), (3, "first_frame")]


def test_truth_without_columns(tmp_path: Path) -> None:
    path = _write(tmp_path, "t.csv", "video_id,caption\nv1,x\n")
    assert _places(lambda: read_truth(path)) == [(None, "hazard_id"), (None, "label"), (None, "description")]


@given(st.text(max_size=100))
def test_visible_text_is_one_printable_line(text: str) -> None:
    for shown in (visible(text), show(text)):
        assert "\n" not in shown
        assert not set(shown) & set("\u202e\u2066\u200f\u2028\0\x1b")
        shown.encode()


@given(st.binary(max_size=300), st.sampled_from(["p.csv", "p.jsonl", "p.parquet", "p"]))
def test_any_bytes_are_read_or_refused_with_faults(data: bytes, name: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = _write(Path(folder), name, data)
        for read in (read_predictions, read_truth):
            try:
                read(path)
            except FaultsError as error:
                assert error.faults


@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=4))
def test_damaged_parquet_is_read_or_refused_with_faults(place: int, patch: bytes) -> None:
    data = bytearray(_parquet())
    place %= len(data)
    data[place : place + len(patch)] = patch
    with tempfile.TemporaryDirectory() as folder:
        path = _write(Path(folder), "p", bytes(data))
        try:
            read_predictions(path)
        except FaultsError as error:
            assert error.faults


def test_a_million_rows_in_seconds(tmp_path: Path) -> None:
    n = 1_000_000
    table = pa.table(
        {
            "video_id": [f"v{row // 50}" for row in range(n)],
            "rank": [row % 50 + 1 for row in range(n)],
            "description": [f"A cat with number {row * 7 % 300_000} crosses the road" for row in range(n)],
        }
    )
    pq.write_table(table, tmp_path / "p.parquet")
    start = time.process_time()
    read = read_predictions(tmp_path / "p.parquet")
    assert len(read.predictions) == n
    assert time.process_time() - start < 20  # about 3 s; the bound is for a busy machine
