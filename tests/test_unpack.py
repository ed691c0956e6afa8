"""Packed files: gz, zst and zips of one file, bounded, and what is refused."""

import gzip
import io
import tempfile
import zipfile
from functools import partial
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.files import sha256_of
from pipeline.records import Prediction
from pipeline.tables import PREDICTIONS
from sitegen import formats
from sitegen.readers import read_predictions, read_truth
from tests.faulty import HEAD, TRUTH_HEAD, faults, lines, places, write

CSV = (HEAD + "v1,1,A cat.\n").encode()
ROWS = (Prediction("v1", 1, "A cat."),)
CONTENTS = {
    "csv": CSV,
    "jsonl": b'{"video_id": "v1", "rank": 1, "description": "A cat."}\n',
    "json": b'[{"image_id": "v1", "caption": "A cat."}]',
    "parquet": PREDICTIONS.to_bytes(ROWS),
}


def zst(data: bytes) -> bytes:
    """Packed with zstd."""
    packed: bytes = pa.compress(data, "zstd", asbytes=True)
    return packed


def zipped(*entries: tuple[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip of these names and contents."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, data in entries:
            archive.writestr(zipfile.ZipInfo(name), data, method)
    return buffer.getvalue()


@pytest.mark.parametrize("ending", CONTENTS)
@pytest.mark.parametrize("packing", ["gz", "zst", "zip"])
def test_each_format_in_each_packing(tmp_path: Path, ending: str, packing: str) -> None:
    content = CONTENTS[ending]
    packed = {"gz": gzip.compress(content), "zst": zst(content), "zip": zipped((f"p.{ending}", content))}[
        packing
    ]
    for name in (f"p.{ending}.{packing}", "p", "p.bin"):
        read = read_predictions(write(tmp_path, name, packed))
        assert read.predictions == ROWS
        assert read.ending == f"{ending}.{packing}"
        assert read.sha256 == sha256_of(packed)


def test_a_packed_truth(tmp_path: Path) -> None:
    text = (TRUTH_HEAD + "v1,1,cat,A cat.\n").encode()
    assert len(read_truth(write(tmp_path, "t.csv.gz", gzip.compress(text)))) == 1


def test_names_that_say_packed_where_nothing_is(tmp_path: Path) -> None:
    assert read_predictions(write(tmp_path, "p.csv.gz", CSV)).ending == "csv"
    assert read_predictions(write(tmp_path, "p.csv", gzip.compress(CSV))).ending == "csv.gz"
    wrong = gzip.compress(CSV)
    found = "what looks like a CSV file"
    assert faults(lambda: read_predictions(write(tmp_path, "p.parquet.gz", wrong))) == [(None, None, found)]
    inner = zipped(("p.parquet", CSV))
    assert faults(lambda: read_predictions(write(tmp_path, "p.zip", inner))) == [(None, None, found)]


def test_faults_in_packed_files_have_the_lines_of_the_file_inside(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv.gz", gzip.compress(CSV + b"v1,0,x\n"))
    assert lines(lambda: read_predictions(path)) == [3]


def test_gzip_and_zstd_in_several_parts(tmp_path: Path) -> None:
    for pack in (gzip.compress, zst):
        data = pack(HEAD.encode()) + pack(b"") + pack(b"v1,1,A cat.\n")
        assert read_predictions(write(tmp_path, "p", data)).predictions == ROWS


def test_what_comes_beside_the_one_file_of_a_zip(tmp_path: Path) -> None:
    data = zipped(
        ("run/", b""),
        ("run/p.csv", CSV),
        ("run/.DS_Store", b"x"),
        ("__MACOSX/run/._p.csv", b"\0\0"),
    )
    assert read_predictions(write(tmp_path, "p.zip", data)).predictions == ROWS


LINK = zipfile.ZipInfo("p.csv")
LINK.create_system = 3
LINK.external_attr = 0o120777 << 16


def link() -> bytes:
    """A zip of a symbolic link."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(LINK, "/etc/passwd")
    return buffer.getvalue()


def encrypted() -> bytes:
    """A zip whose file is marked as encrypted, in both places."""
    data = bytearray(zipped(("p.csv", CSV)))
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    return bytes(data)


WRONG: list[tuple[str, bytes, str]] = [
    ("two", zipped(("a.csv", CSV), ("b.csv", CSV)), "a zip archive of 2 files: 'a.csv', 'b.csv'"),
    ("none", zipped(("a/", b"")), "a zip archive of 0 files"),
    ("empty", zipped(), "a zip archive of 0 files"),
    ("many", zipped(*((f"{n}.csv", b"") for n in range(1_001))), "a zip archive of more than 1,000 files"),
    ("parents", zipped(("../p.csv", CSV)), "the name '../p.csv' in a zip archive, which leads out of it"),
    ("absolute", zipped(("/p.csv", CSV)), "the name '/p.csv' in a zip archive, which leads out of it"),
    ("drive", zipped(("C:/p.csv", CSV)), "the name 'C:/p.csv' in a zip archive, which leads out of it"),
    ("hidden", zipped(("..\u202e/p", CSV), ("q", CSV)), "a zip archive of 2 files: '..\\u202e/p', 'q'"),
    ("link", link(), "the link 'p.csv' in a zip archive"),
    ("encrypted", encrypted(), "an encrypted zip archive"),
    ("lzma", zipped(("p.csv", CSV), method=zipfile.ZIP_LZMA), "a zip archive packed with method 14"),
    ("workbook", zipped(("docs/x.xml", b"x"), ("xl/workbook.xml", b"x")), "an Excel workbook (.xlsx)"),
    ("gz-in-gz", gzip.compress(gzip.compress(CSV)), "a gzip archive in a gzip archive"),
    ("zip-in-zst", zst(zipped(("p.csv", CSV))), "a zip archive in a zstd archive"),
    ("gz-in-zip", zipped(("p.csv.gz", gzip.compress(CSV))), "a gzip archive in a zip archive"),
    ("nothing-in-gz", gzip.compress(b" \n"), "an empty file"),
    ("nothing-in-zip", zipped(("p.csv", b"")), "an empty file"),
]


@pytest.mark.parametrize(("name", "data", "found"), WRONG, ids=[name for name, _, _ in WRONG])
def test_what_is_not_unpacked(tmp_path: Path, name: str, data: bytes, found: str) -> None:
    before = sorted(tmp_path.parent.rglob("*"))
    path = write(tmp_path, "p", data)
    assert faults(lambda: read_predictions(path)) == [(None, None, found)]
    assert sorted(tmp_path.parent.rglob("*")) == sorted([*before, path])


DAMAGED: dict[str, bytes] = {
    "gz-cut": gzip.compress(CSV)[:-9],
    "gz-sum": gzip.compress(CSV)[:-8] + bytes(8),
    "gz-sign": b"\x1f\x8b",
    "gz-more": gzip.compress(CSV) + b"more",
    "zst-cut": zst(CSV)[:-3],
    "zst-window": b"\x28\xb5\x2f\xfd\x00\xff\x01\x00\x00",
    "zip-cut": zipped(("p.csv", CSV))[:-30],
    "zip-sum": zipped(("p.csv", CSV), method=zipfile.ZIP_STORED).replace(b"A cat", b"A dog", 1),
    "zip-no-name": zipped(("p.csv", CSV)).replace(b"\x05\0\0\0", b"\0\0\0\0"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_archives(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, "p", DAMAGED[name])
    ((row, column, found),) = faults(lambda: read_predictions(path))
    assert (row, column) == (None, None)
    assert "that cannot be unpacked" in found


@pytest.mark.parametrize("packing", ["gz", "zst", "zip", "zip-that-lies"])
def test_bombs_are_not_unpacked_to_their_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, packing: str
) -> None:
    monkeypatch.setattr(formats, "MAX_BYTES", 3 * 2**20)
    bomb = CSV + bytes(4 * 2**20)
    one = zipped(("p.csv", bomb))
    size = len(bomb).to_bytes(4, "little")
    data = {
        "gz": gzip.compress(CSV) + gzip.compress(bytes(2**20)) * 1_000,
        "zst": zst(CSV) + zst(bytes(2**20)) * 1_000,
        "zip": one,
        "zip-that-lies": one.replace(size, (100).to_bytes(4, "little")),
    }
    path = write(tmp_path, "p", data[packing])
    ((_, _, found),) = faults(lambda: read_predictions(path))
    if packing == "zip-that-lies":  # the zip's own sizes stop it, whichever way
        assert "unpack" in found
    else:
        assert found.endswith("archive that unpacks to more than 3 MB")


@settings(deadline=None)
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=4), st.sampled_from(["gz", "zst", "zip"]))
def test_damaged_archives_are_read_or_refused(place: int, patch: bytes, packing: str) -> None:
    data = bytearray({"gz": gzip.compress(CSV), "zst": zst(CSV), "zip": zipped(("p.csv", CSV))}[packing])
    place %= len(data)
    data[place : place + len(patch)] = patch
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder), "p", bytes(data))
        try:
            read_predictions(path)
        except FaultsError:
            assert places(partial(read_predictions, path))
