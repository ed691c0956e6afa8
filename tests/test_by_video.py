"""A table by video is what the whole table says, however its file is cut and ordered."""

import pickle
from itertools import groupby, pairwise
from pathlib import Path
from unittest.mock import patch

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import by_video
from pipeline.by_video import ByVideo, Later
from pipeline.errors import InputError
from pipeline.records import Match, Parse, Reply, Snippet, Stage, StageOutput, VideoOutcome
from pipeline.tables import MATCHES, OUTCOMES, SNIPPETS, STAGES
from sitegen.gathered import Records
from sitegen.hiding import words_only
from sitegen.run_records import read_records
from tests.faulty import faults

ROWS = [
    Match(f"v{video}", frame, "t", "cat", 0.5, True, False)
    for video in range(5)
    for frame in range(video + 1)
]
BY_VIDEO = {video: tuple(rows) for video, rows in groupby(ROWS, lambda row: row.video_id)}


def write(path: Path, rows: list[Match], cuts: list[int]) -> Path:
    """The rows in their order, in row groups that end at these rows."""
    with pq.ParquetWriter(path, MATCHES.schema) as writer:
        for start, stop in pairwise([0, *cuts, len(rows)]):
            part = [MATCHES.to_row(row) for row in rows[start:stop]]
            writer.write_table(pa.Table.from_pylist(part, MATCHES.schema))
    return path


@given(
    cuts=st.lists(st.integers(0, len(ROWS)), max_size=6).map(sorted),
    group=st.integers(1, 20),
    asked=st.lists(st.sampled_from(sorted(BY_VIDEO))),
    order=st.one_of(st.just(ROWS), st.permutations(ROWS)),
)
def test_it_is_what_the_table_says(
    tmp_path_factory: pytest.TempPathFactory,
    cuts: list[int],
    group: int,
    asked: list[str],
    order: list[Match],
) -> None:
    path = write(tmp_path_factory.mktemp("table") / "matches.parquet", order, cuts)
    expected = {video: tuple(row for row in order if row.video_id == video) for video in BY_VIDEO}
    with patch.object(by_video, "ROW_GROUP", group), patch.object(by_video, "_BATCH_ROWS", 3):
        found = ByVideo(MATCHES, path)
        assert [found[video] for video in asked] == [expected[video] for video in asked]
        assert list(found.items()) == sorted(expected.items())
        some = ByVideo(MATCHES, path, {"v1", "v9"})
        assert dict(some) == {"v1": expected["v1"]} and len(some) == 1


def test_only_the_groups_around_a_video_are_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "m.parquet", ROWS, list(range(1, len(ROWS))))
    with patch.object(by_video, "ROW_GROUP", 4):
        found = ByVideo(MATCHES, path)
        assert len(found._rows) == 0
        for video in found:
            assert found[video] == BY_VIDEO[video] and len(found._rows) <= 5
        with pytest.raises(KeyError):
            found["v9"]


def test_the_repr_tells_of_another_content(tmp_path: Path) -> None:
    one, same, other = (tmp_path / name for name in ("a", "b", "c"))
    MATCHES.write(one, ROWS)
    MATCHES.write(same, ROWS)
    MATCHES.write(other, ROWS[1:])
    found = [repr(ByVideo(MATCHES, path)) for path in (one, same, other)]
    assert found[0] == found[1] != found[2]


def test_what_is_damaged_is_found_before_anything_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "m.parquet"
    MATCHES.write(path, ROWS)
    whole = path.read_bytes()
    path.write_bytes(whole[:-9])
    ((row, column, _),) = faults(lambda: ByVideo(MATCHES, path))
    assert (row, column) == (None, None)
    path.write_bytes(whole[:20] + bytes(40) + whole[60:])
    ((row, column, _),) = faults(lambda: ByVideo(MATCHES, path))
    assert (row, column) == (None, None)
    with pytest.raises(InputError, match="cosine"):
        pq.write_table(pa.table({"video_id": ["v"]}), path)
        ByVideo(MATCHES, path)
    table = MATCHES.to_arrow(ROWS)
    ids = pa.array([None, *table.column("video_id").to_pylist()[1:]], pa.string())
    pq.write_table(pa.table([ids, *table.columns[1:]], names=table.column_names), path)
    assert faults(lambda: ByVideo(MATCHES, path)) == [(None, None, "a row without video")]


def test_a_row_that_is_no_record_is_told(tmp_path: Path) -> None:
    path = tmp_path / "stages.parquet"
    output = StageOutput(
        "v", Stage.RHS, 0, "p", "s", Reply("x", "m", None, None, None), (), next(iter(Parse)), None
    )
    rows = [STAGES.to_row(output), STAGES.to_row(output) | {"stage": "nonsense"}]
    pq.write_table(pa.Table.from_pylist(rows, STAGES.schema), path)
    ((row, _, found),) = faults(lambda: ByVideo(STAGES, path)["v"])
    assert row == 2 and "nonsense" in found


def test_a_file_that_changes_is_not_mixed_up(tmp_path: Path) -> None:
    path = tmp_path / "m.parquet"
    MATCHES.write(path, ROWS)
    found = ByVideo(MATCHES, path)
    MATCHES.write(path, ROWS[1:])
    with pytest.raises(InputError, match="changed while it was read"):
        found["v1"]


def test_later_is_the_tuple(tmp_path: Path) -> None:
    MATCHES.write(tmp_path / "m.parquet", ROWS)
    found = ByVideo(MATCHES, tmp_path / "m.parquet")
    later = Later(found, "v3")
    assert bool(later) and found._last is None  # nothing was read for that
    assert (len(later), tuple(later), later[0], later[-2:]) == (4, BY_VIDEO["v3"], ROWS[6], tuple(ROWS[8:10]))
    assert pickle.loads(pickle.dumps(later)) == BY_VIDEO["v3"]
    assert not Later(found, "v9") and tuple(Later(found, "v9")) == ()


def test_the_records_of_a_run_and_those_without_tracks(tmp_path: Path) -> None:
    outcomes = [VideoOutcome(f"v{n}", "f", 1, 1.0, 2, 2, "", "") for n in (1, 7)]
    MATCHES.write(tmp_path / "matches.parquet", ROWS)
    OUTCOMES.write(tmp_path / "outcomes.parquet", outcomes)
    SNIPPETS.write(tmp_path / "snippets.parquet", list[Snippet]())
    records = read_records(tmp_path)
    assert list(records) == [*BY_VIDEO, "v7"] and "v8" not in records and records.get("v8") is None
    assert records["v1"].read() == Records(matches=BY_VIDEO["v1"], outcome=outcomes[0])
    assert records["v7"].read() == Records(outcome=outcomes[1])
    hidden = words_only(records)
    assert list(hidden) == list(records) and hidden["v1"].read() == Records(outcome=outcomes[0])
    assert hidden["v2"].read() == Records() and repr(hidden) != repr(records)
    assert not read_records(tmp_path / "none")
