"""Round trips of every table, on unsorted rows, and files that are something else."""

import random
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import (
    Box,
    Exclusion,
    Item,
    Kind,
    Match,
    Parse,
    Prediction,
    Reaction,
    Reply,
    Snippet,
    Stage,
    StageOutput,
    TrackBox,
    TruthHazard,
    UsageRow,
    VideoFile,
    VideoOutcome,
)
from pipeline.scores import PairScore, VideoScore
from pipeline.table import SCHEMA_VERSION, Table, metadata
from pipeline.tables import PREDICTIONS, TABLES

_BOXES = [
    TrackBox("v2", 0, "1", Kind.TRAFFIC, Box(-3.5, 0, 10, 20.25)),
    TrackBox("v1", 12, "b", Kind.CHALLENGE, Box(1, 2, 3, 4)),
    TrackBox("v1", 12, "a", Kind.TRAFFIC, Box(1, 2, 3, 4)),
]
_ITEMS = (Item(1, "cat", "runs"), Item(2, "", "A dog, 'quoted' \"twice\"\nand 🐕."))

RECORDS: dict[str, list[Any]] = {
    "boxes": _BOXES,
    "truth": [
        TruthHazard("v2", "h1", "Cat", "A cat crosses.", "7", 3, 9),
        TruthHazard("v1", "h2", "Dog", "A dog sits."),
        TruthHazard("v1", "h1", "", ""),
    ],
    "predictions": [
        Prediction("v2", 2, "b"),
        Prediction("v2", 1, "a", "cat", ("1", "2"), (0, 5)),
        Prediction("v1", 1, "c", None, (), ()),
    ],
    "stages": [
        StageOutput("v1", Stage.AOS, 0, "A-LLM", "ff", Reply("x", "m", 0.5, 3, 4), _ITEMS, Parse.JSON),
        StageOutput("v1", Stage.RHS, 0, "T1-LLM", "ee", Reply("", "m"), (), Parse.FAILED),
        StageOutput("v1", Stage.SCENE, 1, "T1-VLM", "dd", Reply("y", "m"), _ITEMS, Parse.PROSE, 12),
        StageOutput("v1", Stage.SCENE, 0, "T1-VLM", "dc", Reply("y", "m"), _ITEMS, Parse.PROSE, 0),
    ],
    "snippets": [Snippet(_BOXES[0], Exclusion.TOO_LOW), Snippet(_BOXES[2], None), Snippet(_BOXES[1], None)],
    "matches": [
        Match("v1", 3, "2", "dog", 0.25, True, False),
        Match("v1", 3, "2", "cat", -0.5, False, True),
    ],
    "reactions": [Reaction("v2", None, 0.0), Reaction("v1", 31, 0.75, (0.5, 0.25, 0.125))],
    "outcomes": [
        VideoOutcome("v2", "v2.mp4", 0, 0.0, 0, 0, "broken"),
        VideoOutcome("v1", "v1.mp4", 300, 29.97, 1280, 720, "", "odd"),
    ],
    "video_files": [
        VideoFile("v2", "v2.mkv", 12, 0.0, 640, 360, "ff"),
        VideoFile("v1", "v1.mp4", 300, 29.97, 1280, 720, "ee"),
    ],
    "usage": [
        UsageRow("v1", "scene", "gpt", 25, 1_000, 20, 12.5, 0.001),
        UsageRow("v1", "aes", "", 1, None, None, None, None),
    ],
    "pairs": [PairScore("v2", 1, "h1", -0.25, 0.0), PairScore("v1", 2, "h1", 0.5, 0.5)],
    "videos": [
        VideoScore("v2", 0, 1, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False),
        VideoScore("v1", 3, 2, 1, 0.9, 0.1, 0.4, 0.5, 0.4, True),
    ],
}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)
def test_round_trip_sorts_and_bytes_depend_on_rows_alone(table: Table[Any], tmp_path: Path) -> None:
    records = RECORDS[table.name]
    path, other = tmp_path / "a.parquet", tmp_path / "b.parquet"
    table.write(path, records, {"config_sha256": "abc"})
    back = table.read(path)
    assert back == sorted(records, key=table.key)
    assert back != records  # the table above is unsorted on purpose
    table.write(other, random.Random(1).sample(records, len(records)), {"config_sha256": "abc"})
    assert path.read_bytes() == other.read_bytes()
    assert metadata(path) == {"config_sha256": "abc", "schema_version": SCHEMA_VERSION, "table": table.name}
    assert pq.ParquetFile(path).metadata.row_group(0).column(0).compression == "ZSTD"


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)
def test_empty_table_round_trips(table: Table[Any], tmp_path: Path) -> None:
    table.write(tmp_path / "a.parquet", [])
    assert table.read(tmp_path / "a.parquet") == []


_TEXT = st.text(st.characters(codec="utf-8"), max_size=30)


@given(
    st.lists(
        st.builds(
            Prediction,
            _TEXT,
            st.integers(1, 2**31 - 1),
            _TEXT,
            st.none() | _TEXT,
            st.lists(_TEXT, max_size=3).map(tuple),
            st.lists(st.integers(0, 2**31 - 1), max_size=3).map(tuple),
        ),
        max_size=8,
        unique_by=lambda p: (p.video_id, p.rank),
    )
)
def test_any_predictions_survive(predictions: list[Prediction]) -> None:
    rows = PREDICTIONS.to_arrow(predictions).to_pylist()
    assert [PREDICTIONS.from_row(row) for row in rows] == sorted(predictions, key=PREDICTIONS.key)


def test_wrong_columns_are_all_listed(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    pq.write_table(pa.table({"video_id": ["v"], "rank": ["one"]}), path)
    with pytest.raises(FaultsError) as caught:
        PREDICTIONS.read(path)
    assert {fault.column: fault.found for fault in caught.value.faults} == {
        "rank": "string",
        "description": "no such column",
        "label": "no such column",
        "track_ids": "no such column",
        "frame_indices": "no such column",
    }


def test_what_is_no_parquet_is_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    path.write_bytes(b"video_id,rank\n")
    with pytest.raises(FaultsError, match="expected a Parquet file"):
        PREDICTIONS.read(path)


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    PREDICTIONS.write(path, [Prediction("v", 1, "old")])
    before = path.read_bytes()
    with pytest.raises((pa.ArrowException, TypeError)):
        PREDICTIONS.write(path, [Prediction("v", 1, "new"), Prediction("v", "two", "x")])  # type: ignore[arg-type]
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.parquet"]
