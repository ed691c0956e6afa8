"""Journals of annotators: what is read back, what counts, and the truth file."""

import resource
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError, InputError
from sitegen.annotate_journal import append, journal_path, read_journals
from sitegen.annotate_records import Record, Said, author_of, read_state
from sitegen.annotate_truth import counting, truth_of, write_truth
from sitegen.readers import read_truth
from tests.annotating import state

CAR = Said("h1", "Car", "A car cuts in", "7", 3, 9)
DOG = Said("h2", "Dog", "A dog runs\nacross", None)
HALF = Said("h1", "Car", "")


def record(author: str, *hazards: Said, revision: int = 1, **more: Any) -> Record:
    plain = Record(
        "v", hazards, not hazards, revision, author, f"2026-01-0{revision}T00:00:00Z", "s", revision
    )
    return replace(plain, **more)


def test_what_is_appended_is_read_back(tmp_path: Path) -> None:
    path = journal_path(tmp_path, "ada")
    hard = Said("h1", "Käfer\r", 'Ein "\u2028" \\ \x85 Käfer', None, 0, 0)
    records = [
        record("ada", CAR, DOG),
        record("ada", hard, revision=2, video_id="w"),
        record("ada", revision=2),
    ]
    append(path, "ada", records[:2])
    append(path, "ada", records[2:])
    journals, notices = read_journals(tmp_path)
    assert journals["ada"].latest == {"v": records[2], "w": records[1]}
    assert notices == []
    assert path.read_bytes() == b"".join(one.line() for one in records)


@pytest.mark.parametrize("cut", [1, 30, -2])
def test_a_torn_last_line_is_left_out_with_a_notice_and_makes_room(tmp_path: Path, cut: int) -> None:
    path = journal_path(tmp_path, "ada")
    append(path, "ada", [record("ada", CAR)])
    with path.open("ab") as file:
        file.write(record("ada", DOG, revision=2).line()[:cut])
    journals, notices = read_journals(tmp_path)
    assert journals["ada"].latest["v"] == record("ada", CAR)
    assert len(notices) == 1
    assert str(path) in notices[0]
    append(path, "ada", [record("ada", revision=2)])
    journals, notices = read_journals(tmp_path)
    assert journals["ada"].latest["v"] == record("ada", revision=2)
    assert notices == []


def test_a_whole_last_line_without_its_end_counts(tmp_path: Path) -> None:
    path = journal_path(tmp_path, "ada")
    path.write_bytes(record("ada", CAR).line().rstrip())
    assert read_journals(tmp_path)[0]["ada"].latest["v"] == record("ada", CAR)
    append(path, "ada", [record("ada", DOG, revision=2, video_id="w")])
    assert sorted(read_journals(tmp_path)[0]["ada"].latest) == ["v", "w"]


def test_a_full_disk_leaves_the_journal_as_it_was(tmp_path: Path) -> None:
    path = journal_path(tmp_path, "ada")
    append(path, "ada", [record("ada", CAR)])
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, limits[1]))
    try:
        with pytest.raises(OSError, match="large"):
            append(path, "ada", [record("ada", DOG, revision=2)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "line",
    [
        b"{not json}\n",
        b"[]\n",
        b"\xff\n",
        record("bob", CAR).line(),
        record("ada", CAR, revision=-1).line(),
        record("ada", CAR, video_id="../v").line(),
        record("ada", CAR, CAR).line(),
        b"[" * 100_000 + b"\n",
    ],
)
def test_a_damaged_line_is_a_fault_with_its_file_and_line(tmp_path: Path, line: bytes) -> None:
    path = journal_path(tmp_path, "ada")
    path.write_bytes(record("ada", CAR).line() + line + record("ada", DOG, revision=2).line())
    with pytest.raises(FaultsError) as caught:
        read_journals(tmp_path)
    (fault,) = caught.value.faults
    assert (fault.file, fault.row) == (str(path), 2)


def test_a_journal_needs_an_authors_name(tmp_path: Path) -> None:
    (tmp_path / "Ada B.jsonl").write_bytes(record("ada", CAR).line())
    with pytest.raises(FaultsError, match="Ada B"):
        read_journals(tmp_path)


@pytest.mark.parametrize("name", ["", "  ", "merged", "Imported", "…", "\0"])
def test_names_that_cannot_be_an_author(name: str) -> None:
    with pytest.raises(InputError, match="author"):
        author_of(name)
    assert author_of("Ada Lovelace") == "ada-lovelace"


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("label", 7),
        ("label", "x" * 2_001),
        ("description", "\0"),
        ("description", "\ud800"),
        ("hazard_id", ""),
        ("track_id", 7),
        ("first_frame", -1),
        ("first_frame", True),
        ("last_frame", 1.5),
        ("last_frame", 2**31),
        ("more", 1),
    ],
)
def test_states_that_cannot_be_stored(place: str, value: Any) -> None:
    data = state({"label": "Car", "description": "A car cuts in"})
    read_state(data)
    data["hazards"][0][place] = value
    with pytest.raises(InputError):
        read_state(data)


# What counts.


def test_one_annotator_counts_and_an_unfinished_state_does_not() -> None:
    assert counting("v", {}).standing == "none"
    assert counting("v", {"ada": record("ada", HALF)}).standing == "none"
    both_said = record("ada", CAR, no_hazard=True)
    backwards = record("ada", replace(CAR, first_frame=9, last_frame=3))
    assert counting("v", {"ada": both_said}).standing == counting("v", {"ada": backwards}).standing == "none"
    found = counting("v", {"ada": record("ada", CAR), "bob": record("bob", HALF)})
    assert (found.standing, found.author) == ("one", "ada")


def test_annotators_who_say_the_same_are_both_named() -> None:
    again = record(
        "bob", replace(DOG, hazard_id="x"), replace(CAR, description=" A car  cuts in "), revision=2
    )
    found = counting("v", {"bob": again, "ada": record("ada", CAR, DOG)})
    assert (found.standing, found.author, found.saved_at) == ("agree", "ada+bob", again.saved_at)
    assert counting("v", {"ada": record("ada"), "bob": record("bob", CAR)}).standing == "differ"
    assert counting("v", {"ada": record("ada"), "bob": record("bob", CAR)}).record is None


def test_what_was_imported_counts_until_someone_finished_the_video() -> None:
    start = record("imported", DOG)
    found = counting("v", {"imported": start, "ada": record("ada", HALF)})
    assert (found.standing, found.author) == ("imported", "imported")
    found = counting("v", {"imported": start, "ada": record("ada", CAR)})
    assert (found.standing, found.author) == ("one", "ada")


@pytest.mark.parametrize(
    ("seen", "standing"),
    [({"ada": 1, "bob": 2}, "merged"), ({"ada": 1, "bob": 1}, "changed"), ({}, "changed")],
)
def test_a_merge_counts_and_later_words_are_told(seen: dict[str, int], standing: str) -> None:
    said = {
        "ada": record("ada", CAR),
        "bob": record("bob", DOG, revision=2),
        "imported": record("imported"),
        "merged": record("cy", DOG, seen=seen),
    }
    found = counting("v", said)
    assert (found.standing, found.author, found.record) == (standing, "cy", said["merged"])
    unfinished = {**said, "merged": record("cy", HALF, seen=seen)}
    assert counting("v", unfinished).standing == "differ"


@settings(max_examples=40)
@given(st.lists(st.tuples(st.text(max_size=12), st.text(max_size=12)), max_size=3))
def test_whatever_is_finished_is_a_truth_that_can_be_read(texts: list[tuple[str, str]]) -> None:
    data = state(*({"label": label, "description": text} for label, text in texts), no_hazard=not texts)
    try:
        hazards, no_hazard = read_state(data)
    except InputError:
        return
    said = Record("v", hazards, no_hazard, 1, "ada", "", "s", 1)
    with TemporaryDirectory() as folder:
        append(Path(folder) / "ada.jsonl", "ada", [said])
        assert read_journals(Path(folder))[0]["ada"].latest == {"v": said}
        counted = counting("v", {"ada": said})
        path = Path(folder) / "truth.parquet"
        if counted.record and write_truth(path, [counted]):
            assert read_truth(path) == truth_of(counted)
            assert len(truth_of(counted)) == max(1, len(texts))
