"""Files that are damaged, hostile, or something else than a table."""

import bz2
import io
import json
import lzma
import pickle
import tarfile
import tempfile
import time
import zipfile
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import Prediction
from pipeline.tables import PREDICTIONS
from sitegen import formats, sheets, texts
from sitegen.checks import show, visible
from sitegen.readers import read_predictions, read_truth
from tests.faulty import HEAD, faults, places, write


def _zip(name: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, HEAD)
    return buffer.getvalue()


def _tar() -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        archive.addfile(tarfile.TarInfo("p.csv"))
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
    ("p.csv.bz2", bz2.compress(HEAD.encode()), "a bzip2 archive"),
    ("p.csv.xz", lzma.compress(HEAD.encode()), "an xz archive"),
    ("p.7z", b"7z\xbc\xaf\x27\x1c" + bytes(50), "a 7-Zip archive"),
    ("p.tar", _tar(), "a tar archive"),
    ("p.csv", _zip("xl/workbook.xml"), "an Excel workbook (.xlsx)"),
    ("p.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(100), "an old Excel workbook (.xls)"),
    ("p.pkl", pickle.dumps([1]), "a Python pickle"),
    ("p.csv", HEAD.encode("utf-16"), "text in UTF-16"),
    ("p.csv", bytes(range(20)) * 10, "binary data"),
]


@pytest.mark.parametrize(("name", "content", "found"), WRONG_FILES, ids=[row[2] for row in WRONG_FILES])
def test_files_that_are_something_else(tmp_path: Path, name: str, content: str | bytes, found: str) -> None:
    path = write(tmp_path, name, content)
    assert faults(lambda: read_predictions(path)) == [(None, None, found)]
    assert faults(lambda: read_truth(path)) == [(None, None, found)]


@pytest.mark.parametrize("name", ["p.csv.bz2", "p.csv.xz", "p.7z", "p.tar"])
def test_other_archives_are_to_be_unpacked(tmp_path: Path, name: str) -> None:
    content = next(content for other, content, _ in WRONG_FILES if other == name)
    with pytest.raises(FaultsError, match="Unpack it first"):
        read_predictions(write(tmp_path, name, content))


def test_damaged_parquet(tmp_path: Path) -> None:
    whole = _parquet()
    for number, data in enumerate(
        [whole[:-20], whole[:8], whole[:4] + bytes(200) + whole[204:], b"PAR1" * 5]
    ):
        path = write(tmp_path, f"{number}.parquet", data)
        (fault,) = faults(partial(read_predictions, path))
        assert fault[2].startswith("a damaged Parquet file"), number


def test_no_file_folder_and_odd_paths(tmp_path: Path) -> None:
    assert faults(lambda: read_predictions(tmp_path / "none.csv")) == [(None, None, "no such file")]
    assert faults(lambda: read_predictions(tmp_path)) == [(None, None, "a folder")]
    odd = "something that is not a regular file"
    assert faults(lambda: read_predictions(Path("/dev/null"))) == [(None, None, odd)]
    assert places(lambda: read_predictions(tmp_path / ("x" * 5000))) == [(None, None)]
    assert places(lambda: read_predictions(Path("a\0b"))) == [(None, None)]


def test_bounds_on_bytes_and_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "MAX_BYTES", 5 * 2**20)
    path = write(tmp_path, "p.csv", HEAD + "x" * (5 * 2**20))
    assert places(lambda: read_predictions(path)) == [(None, None)]
    monkeypatch.setattr(texts, "MAX_ROWS", 2)
    rows = [Prediction("v1", rank, "x") for rank in (1, 2, 3)]
    PREDICTIONS.write(tmp_path / "p.parquet", rows)
    write(tmp_path, "p.csv", HEAD + "".join(f"{row.video_id},{row.rank},x\n" for row in rows))
    lines = [json.dumps({"video_id": "v1", "rank": row.rank, "description": "x"}) for row in rows]
    write(tmp_path, "p.jsonl", "\n".join(lines))
    for name in ("p.csv", "p.jsonl", "p.parquet"):
        read = partial(read_predictions, tmp_path / name)
        assert faults(read) == [(None, None, "more than 2 rows")]


def test_a_small_parquet_that_unpacks_to_a_huge_one(tmp_path: Path) -> None:
    rows = 200_000
    caption = pa.array(["x" * 100_000])
    table = pa.table(
        {
            "video_id": pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), pa.array(["v1"])),
            "rank": pa.array(range(1, rows + 1)),
            "description": pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), caption),
        }
    )  # 20 GB as plain text
    pq.write_table(table, tmp_path / "p.parquet", compression="zstd")
    assert (tmp_path / "p.parquet").stat().st_size < 20 * 2**20
    found = faults(lambda: read_predictions(tmp_path / "p.parquet"))
    assert len(found) == 1001
    assert found[0][:2] == (1, "description")
    assert found[-1] == (None, None, "199,000 more faults")


def test_a_parquet_with_too_many_list_items(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheets, "MAX_LIST_BYTES", 1_000)
    rows = [Prediction("v1", rank, "x", None, (), (7,) * 100) for rank in range(1, 11)]
    PREDICTIONS.write(tmp_path / "p.parquet", rows)
    assert places(lambda: read_predictions(tmp_path / "p.parquet")) == [(None, None)]


@settings(deadline=None)
@given(st.text(max_size=100))
def test_visible_text_is_one_printable_line(text: str) -> None:
    for shown in (visible(text), show(text)):
        assert "\n" not in shown
        assert not set(shown) & set("\u202e\u2066\u200f\u2028\0\x1b")
        shown.encode()


@settings(deadline=None)
@given(st.binary(max_size=300), st.sampled_from(["p.csv", "p.jsonl", "p.parquet", "p"]))
def test_any_bytes_are_read_or_refused_with_faults(data: bytes, name: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder), name, data)
        for read in (read_predictions, read_truth):
            try:
                read(path)
            except FaultsError as error:
                assert error.faults


@settings(deadline=None)
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=4))
def test_damaged_parquet_is_read_or_refused_with_faults(place: int, patch: bytes) -> None:
    data = bytearray(_parquet())
    place %= len(data)
    data[place : place + len(patch)] = patch
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder), "p", bytes(data))
        try:
            read_predictions(path)
        except FaultsError as error:
            assert error.faults


def test_many_rows_in_seconds(tmp_path: Path) -> None:
    n = 300_000
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
    assert time.process_time() - start < 10  # about 1 s; the bound is for a busy machine
