"""A folder of Parquet shards: one table, read as the one file with the same rows."""

import hashlib
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen import formats, sheets, texts
from sitegen.checks import Faults
from sitegen.readers import ReadOptions, read_given, read_predictions, read_sharded
from sitegen.sandbox import read_apart
from sitegen.shards import read_shards
from tests.faulty import faults, files

ROWS = [
    Prediction(f"v{number % 4}", number // 4 + 1, "A cat", "cat", ("7",), (number,)) for number in range(9)
]
HAZARDS = [TruthHazard(f"v{number}", "1", "cat", "A cat") for number in range(5)]


def write_shards(folder: Path, *shards: list[Prediction]) -> Path:
    for number, rows in enumerate(shards):
        PREDICTIONS.write(folder / f"part-{number}.parquet", rows, {"config_sha256": "a" * 64})
    return folder


@settings(max_examples=20)
@given(cuts=st.lists(st.integers(0, 9), max_size=3).map(sorted), order=st.permutations(ROWS))
def test_shards_are_one_table(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[int], order: list[Prediction]
) -> None:
    folder = tmp_path_factory.mktemp("shards")
    ends = [0, *cuts, 9]
    write_shards(folder, *(order[a:b] for a, b in pairwise(ends)))
    one = folder.parent / "one.parquet"
    PREDICTIONS.write(one, ROWS, {"config_sha256": "a" * 64})
    read, expected = read_sharded(folder, HAZARDS), read_predictions(one, HAZARDS)
    assert (read.predictions, read.warnings) == (expected.predictions, expected.warnings)
    assert (read.source_format, read.ending, read.config_sha256) == ("parquet", "parquet", "a" * 64)


def test_the_hash_is_of_names_and_bytes_in_order(tmp_path: Path) -> None:
    write_shards(tmp_path, ROWS[5:], ROWS[:5])
    (tmp_path / "_SUCCESS").touch()
    (tmp_path / "_metadata").write_bytes(b"x")
    (tmp_path / ".part-0.parquet.crc").write_bytes(b"x")
    names = ["part-0.parquet", "part-1.parquet"]
    lines = [f"{hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    read = read_given(tmp_path)
    assert read.sha256 == hashlib.sha256("".join(lines).encode()).hexdigest()
    assert read_apart(tmp_path, None) == read


def test_a_fault_names_the_shard_and_its_row(tmp_path: Path) -> None:
    write_shards(tmp_path, ROWS[:3], [*ROWS[3:5], ROWS[1], Prediction("v9", 1, "A dog")])

    def read() -> object:
        return read_sharded(tmp_path, HAZARDS)

    # Rows are sorted as they are written: v0, v1, v3 and v9.
    assert files(read) == [str(tmp_path / "part-1.parquet")] * 2
    again = f"rank '1' again in video 'v1' (first in row 2 of {tmp_path / 'part-0.parquet'})"
    assert faults(read) == [(2, "rank", again), (4, "video_id", "'v9'")]


def test_what_is_no_table_of_shards(tmp_path: Path) -> None:
    def read(folder: Path) -> list[tuple[int | None, str | None, str]]:
        return faults(lambda: read_sharded(folder))

    empty, odd, folders, damaged = (tmp_path / name for name in ("empty", "odd", "folders", "damaged"))
    empty.mkdir()
    (empty / "_SUCCESS").touch()
    assert read(empty) == [(None, None, "no Parquet file in it")]
    write_shards(odd, ROWS)
    (odd / "notes.txt").write_text("video_id,rank,description\n")
    assert read(odd) == [(None, None, "what looks like a CSV file")]
    assert files(lambda: read_sharded(odd)) == [str(odd / "notes.txt")]
    (folders / "year=2026").mkdir(parents=True)
    assert read(folders) == [(None, None, "a folder")]
    write_shards(damaged, ROWS, ROWS)
    whole = (damaged / "part-1.parquet").read_bytes()
    (damaged / "part-1.parquet").write_bytes(whole[:-9])
    ((_, _, found),) = read(damaged)
    assert found.startswith("a damaged Parquet file")
    assert files(lambda: read_sharded(damaged)) == [str(damaged / "part-1.parquet")]
    assert faults(lambda: read_sharded(odd, None, ReadOptions("csv"))) == [(None, None, "a folder")]


def test_links_out_of_the_folder(tmp_path: Path) -> None:
    outside = tmp_path / "secret.parquet"
    PREDICTIONS.write(outside, ROWS)
    folder = write_shards(tmp_path / "shards", ROWS)
    (folder / "part-1.parquet").symlink_to(outside)
    assert faults(lambda: read_sharded(folder)) == [(None, None, "a link out of the folder")]
    (folder / "part-1.parquet").unlink()
    (folder / "part-0.parquet").rename(folder / ".data")
    (folder / "part-0.parquet").symlink_to(".data")
    assert len(read_sharded(folder).predictions) == 9


@pytest.mark.parametrize(
    ("module", "name", "limit", "found"),
    [
        (texts, "MAX_ROWS", 8, "more than 8 rows"),
        (formats, "MAX_BYTES", 3_000, "more than 0 MB"),
        (sheets, "MAX_LIST_BYTES", 65, "lists of 18 items"),
        (sheets, "MAX_UNPACKED_BYTES", 800, "bytes, unpacked"),
    ],
)
def test_bounds_hold_for_the_sum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: object, name: str, limit: int, found: str
) -> None:
    write_shards(tmp_path, ROWS[:5], ROWS[5:])
    monkeypatch.setattr(module, name, limit)
    ((row, column, said),) = faults(lambda: read_sharded(tmp_path))
    assert (row, column) == (None, None) and found in said


def test_a_shard_that_changes_is_not_mixed_up(tmp_path: Path) -> None:
    read = read_shards(write_shards(tmp_path, ROWS[:5], ROWS[5:]), Faults("shards"))
    whole = {path.name: path.read_bytes() for path in sorted(tmp_path.iterdir())}
    assert dict(read.contents()) == whole
    PREDICTIONS.write(tmp_path / "part-1.parquet", ROWS)
    assert files(lambda: list(read.contents())) == ["shards/part-1.parquet"]
