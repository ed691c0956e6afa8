"""The desk that annotators share: saves, conflicts, merges, the truth that follows, two processes."""

import json
import multiprocessing
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from pipeline.errors import InputError
from pipeline.records import TruthHazard
from pipeline.table import metadata
from pipeline.tables import TRUTH
from sitegen.annotate_desk import Desk, StaleError, UnknownVideoError
from sitegen.annotate_journal import journal_path
from sitegen.evaluate import truth_sha256
from sitegen.readers import read_truth
from tests.annotating import state


def desk_of(path: Path, **more: Any) -> Desk:
    return Desk("Roads", ["v", "w"], path / "annotations", path / "truth.parquet", **more)


def save(
    desk: Desk, author: str, *hazards: dict[str, Any], merge: bool = False, **more: Any
) -> dict[str, Any]:
    seen = more.pop("seen", {})
    video_id = more.pop("video_id", "v")
    return desk.save(video_id, author, merge, {**state(*hazards, **more), "seen": seen})


SPOKEN = {"label": "Car", "description": "A car cuts in"}


def test_a_save_is_in_the_journal_and_in_the_truth(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    told = save(desk, "ada", {**SPOKEN, "track_id": "7", "first_frame": 3, "last_frame": 9})
    assert (told["revision"], told["finished"], told["problems"]) == (1, True, [])
    told = save(desk, "ada", SPOKEN, {"label": "Dog"}, video_id="w", session="t")
    assert (told["finished"], told["problems"]) == (False, ["Hazard 2 has no description."])
    rows = read_truth(desk.out)
    assert rows == [TruthHazard("v", "h1", "Car", "A car cuts in", "7", 3, 9)]
    (row,) = pq.read_table(desk.out).to_pylist()
    assert (row["author"], len(row["saved_at"])) == ("ada", 20)
    assert metadata(desk.out)["written_by"] == "coooler data annotate"
    again = desk_of(tmp_path)
    assert again.state("w", "ada", merge=False) == desk.state("w", "ada", merge=False)
    overview = [(one.mine, one.others, one.state, one.hazards) for one in again.overview("bob")]
    assert overview == [("todo", 1, "one", "Car"), ("todo", 0, "none", "")]


def test_author_and_time_do_not_change_the_truths_hash(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    save(desk, "ada", SPOKEN)
    plain = TRUTH.read(desk.out)
    TRUTH.write(tmp_path / "plain.parquet", plain)
    assert truth_sha256(read_truth(desk.out)) == truth_sha256(read_truth(tmp_path / "plain.parquet"))
    lines = [
        json.dumps({**row, "saved_at": "x", "author": None}) for row in pq.read_table(desk.out).to_pylist()
    ]
    (tmp_path / "t.jsonl").write_text("\n".join(lines))
    assert read_truth(tmp_path / "t.jsonl") == plain


def test_a_save_that_comes_again_is_stored_once(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    first = save(desk, "ada", SPOKEN, sequence=3)
    assert save(desk, "ada", SPOKEN, sequence=3) == first
    assert save(desk, "ada", no_hazard=True, sequence=2) == first
    # The answer to the first was lost: the page goes on from the state it knew.
    assert save(desk, "ada", SPOKEN, SPOKEN, sequence=4)["revision"] == 2
    assert len(journal_path(tmp_path / "annotations", "ada").read_bytes().splitlines()) == 2


def test_a_save_from_an_old_state_is_refused_with_the_new_one(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    save(desk, "ada", SPOKEN)
    with pytest.raises(StaleError) as caught:
        save(desk, "ada", no_hazard=True, session="other window")
    assert caught.value.current == desk.state("v", "ada", merge=False)
    told = save(desk, "ada", no_hazard=True, session="other window", base=1)
    assert told["revision"] == 2
    # The first window comes back: its old save is known, a new one is of an old state.
    assert save(desk, "ada", SPOKEN)["revision"] == 1
    with pytest.raises(StaleError):
        save(desk, "ada", SPOKEN, sequence=2, base=1)


def test_a_merge_counts_and_its_maker_is_named(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    save(desk, "ada", SPOKEN)
    save(desk, "bob", no_hazard=True)
    assert pq.read_table(desk.out).num_rows == 0
    others = desk.state("v", "bob", merge=True)["others"]
    assert [(one["author"], one["revision"], one["finished"]) for one in others] == [
        ("ada", 1, True),
        ("bob", 1, True),
    ]
    save(desk, "bob", SPOKEN, merge=True, seen={"ada": 1, "bob": 1})
    assert pq.read_table(desk.out).column("author").to_pylist() == ["bob"]
    assert desk.overview("ada")[0].state == "merged"
    save(desk, "ada", no_hazard=True, session="t", base=1)
    assert desk.overview("ada")[0].state == "changed"


def test_a_truth_to_begin_with_is_imported_once(tmp_path: Path) -> None:
    start = [TruthHazard("v", "a", "Car", "A car"), TruthHazard("gone", "1", "", "")]
    for _ in range(2):
        desk = desk_of(tmp_path)
        desk.take_truth(start)
        desk.write_truth()
    assert len(journal_path(tmp_path / "annotations", "imported").read_bytes().splitlines()) == 2
    assert [(row.video_id, row.hazard_id) for row in read_truth(desk.out)] == [("gone", "h1"), ("v", "a")]
    assert desk.state("v", "ada", merge=False)["imported"]["hazards"][0]["label"] == "Car"
    assert desk.authors() == []


def test_another_truth_file_is_left_alone(tmp_path: Path) -> None:
    other = tmp_path / "truth.parquet"
    TRUTH.write(other, [TruthHazard("v", "1", "Cat", "A cat")])
    before = other.read_bytes()
    notices: list[str] = []
    desk = desk_of(tmp_path, notice=notices.append)
    with pytest.raises(InputError, match="--replace"):
        desk.write_truth()
    assert save(desk, "ada", SPOKEN)["revision"] == 1
    assert other.read_bytes() == before
    assert len(notices) == 1
    desk_of(tmp_path, replace=True).write_truth()
    assert read_truth(other)[0].label == "Car"


def test_unknown_videos_and_foreign_names_are_refused(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    with pytest.raises(UnknownVideoError):
        save(desk, "ada", SPOKEN, video_id="../v")
    for author in ("", "../ada", "Ada", "merged"):
        with pytest.raises(InputError):
            save(desk, author, SPOKEN)
    assert not (tmp_path / "annotations").exists()


def _write_many(path: Path, author: str, count: int) -> None:
    desk = desk_of(path)
    for sequence in range(1, count + 1):
        save(desk, author, SPOKEN, video_id="v", sequence=sequence, session=author)
        save(
            desk, "both", SPOKEN, video_id="v" if author == "ada" else "w", sequence=sequence, session=author
        )


def test_two_processes_write_beside_each_other(tmp_path: Path) -> None:
    desk = desk_of(tmp_path)
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write_many, args=(tmp_path, name, 15)) for name in ("ada", "bob")]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(30)
        assert writer.exitcode == 0
    assert desk.authors() == ["ada", "bob", "both"]  # it was open all the while
    assert [desk.state(video, "both", merge=False)["revision"] for video in ("v", "w")] == [15, 15]
    lines = journal_path(tmp_path / "annotations", "both").read_bytes().splitlines()
    assert len(lines) == 30
    rows = pq.read_table(tmp_path / "truth.parquet").to_pylist()
    assert [(row["video_id"], row["author"]) for row in rows] == [("v", "ada+bob+both"), ("w", "both")]
