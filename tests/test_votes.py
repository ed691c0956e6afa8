"""Files of votes: every fault told, stored once, the last vote counts, old captions kept apart."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.errors import FaultsError, InputError
from pipeline.records import TruthHazard
from pipeline.tables import TRUTH
from sitegen import ledger
from sitegen.evaluate import truth_sha256
from sitegen.judgements import Vote
from sitegen.ledger import Entry
from sitegen.readers import read_truth
from sitegen.votes import import_votes, load_votes

OLD, NEW, OTHER = "0" * 64, "1" * 64, "2" * 64
NAME = "Small <b>benchmark</b>"


def entry(slug: str, digest: str, event: ledger.Event = "add") -> Entry:
    return Entry(event=event, slug=slug, name=slug, date="2026-01-02", predictions_sha256=digest)


@pytest.fixture
def benchmark(tmp_path: Path) -> Benchmark:
    (tmp_path / "coooler.toml").write_text(f'name = "{NAME}"\ntruth = "truth.parquet"\n', encoding="utf-8")
    rows = [TruthHazard(f"v{n}", "h1", "Cat", f"Cat number {n} crosses the road") for n in range(1, 4)]
    TRUTH.write(tmp_path / "truth.parquet", rows)
    (tmp_path / "submissions").mkdir()
    ledger.append(tmp_path / "submissions", [entry("one", OLD), entry("two", OTHER)])
    return open_benchmark(tmp_path)


def vote(video_id: str = "v1", left: str = "one", right: str = "two", choice: str = "left") -> dict[str, Any]:
    digests = {"one": OLD, "two": OTHER}
    return {
        "video_id": video_id,
        "left": left,
        "right": right,
        "choice": choice,
        "left_predictions_sha256": digests.get(left, OLD),
        "right_predictions_sha256": digests.get(right, OLD),
    }


def content(here: Benchmark, *votes: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {
        "format": "coooler-votes",
        "version": 1,
        "benchmark": NAME,
        "truth_sha256": truth_sha256(read_truth(here.truth))[:12],
        "voter": "",
        "seed": 7,
        "revision": len(votes),
        "votes": list(votes),
        **changes,
    }


def write(path: Path, value: object) -> Path:
    path.write_text(json.dumps(value), encoding="utf-8")
    return path


def stored(benchmark: Benchmark) -> dict[str, tuple[bytes, int]]:
    files = sorted((benchmark.root / "votes").glob("*"))
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


def test_import_and_load(benchmark: Benchmark, tmp_path: Path) -> None:
    file = write(tmp_path / "mine.json", content(benchmark, vote("v2", "two", "one", "tie"), vote("v1")))
    report = import_votes(benchmark, [file])
    assert (report.votes, report.counted, report.replaced, report.apart) == (2, 2, 0, 0)
    assert [path.name for path in report.stored] == list(stored(benchmark)) and report.known == ()
    assert stored(benchmark)[report.stored[0].name][0] == file.read_bytes()
    assert len(report.stored[0].stem) == 16
    votes = load_votes(benchmark)
    assert votes.apart == 0
    assert votes.current == (
        Vote(7, "v1", "one", "two", "left", OLD, OTHER),
        Vote(7, "v2", "two", "one", "tie", OTHER, OLD),
    )
    before = stored(benchmark)
    again = import_votes(benchmark, [file, file])
    assert (again.stored, again.known) == ((), report.stored) and again.counted == 2
    assert stored(benchmark) == before


def test_no_votes_at_all(benchmark: Benchmark) -> None:
    assert load_votes(benchmark).current == ()


def test_every_fault_of_every_file_and_nothing_stored(benchmark: Benchmark, tmp_path: Path) -> None:
    wrong = [
        vote("v9"),
        vote(left="three"),
        vote(right="one"),
        vote(choice="both"),
        {**vote(), "left_predictions_sha256": "f" * 64},
        {**vote(), "video_id": 3},
        {**vote(), "note": "<script>"},
        "left",
    ]
    files = [
        write(tmp_path / "good.json", content(benchmark, vote())),
        write(tmp_path / "wrong.json", content(benchmark, *wrong)),
        write(tmp_path / "other.json", content(benchmark, vote(), benchmark="Else", truth_sha256="a" * 12)),
        write(tmp_path / "seed.json", content(benchmark, vote("v8"), seed=2**32, voter="x" * 81)),
        tmp_path / "missing.json",
    ]
    with pytest.raises(FaultsError) as caught:
        import_votes(benchmark, files)
    told = [(Path(fault.file).name, fault.row, fault.column) for fault in caught.value.faults]
    assert sorted(told, key=str) == sorted(
        [
            ("wrong.json", 1, "video_id"),
            ("wrong.json", 2, "left"),
            ("wrong.json", 3, "right"),
            ("wrong.json", 4, "choice"),
            ("wrong.json", 5, "left_predictions_sha256"),
            ("wrong.json", 6, "video_id"),
            ("wrong.json", 7, "note"),
            ("wrong.json", 8, None),
            ("other.json", None, "benchmark"),
            ("other.json", None, "truth_sha256"),
            ("seed.json", None, "seed"),
            ("seed.json", None, "voter"),
            ("seed.json", 1, "video_id"),
            ("missing.json", None, None),
        ],
        key=str,
    )
    assert stored(benchmark) == {}


HOSTILE: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "deep": lambda: b"[" * 100_000,
    "deep votes": lambda: b'{"votes":' + b"[" * 5_000 + b"]" * 5_000 + b"}",
    "not utf-8": lambda: b'{"format": "\xff"}',
    "a list": lambda: b"[]",
    "a number": lambda: b"1" * 5_000,
    "nan": lambda: b'{"seed": NaN}',
    "many keys": lambda: b"{" + b",".join(b'"k%d": 0' % n for n in range(50_000)) + b"}",
    "many votes": lambda: b'{"votes": [' + b"{}," * 100_000 + b"{}]}",
    "large": lambda: b'{"voter": "' + b"x" * (9 * 2**20) + b'"}',
    "surrogate": lambda: b'{"voter": "\\ud800"}',
    "a pickle": lambda: b"\x80\x04\x95\x0b\x00\x00\x00\x00\x00\x00\x00\x8c\x07builtins\x94.",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files(benchmark: Benchmark, tmp_path: Path, name: str) -> None:
    file = tmp_path / "hostile.json"
    file.write_bytes(HOSTILE[name]())
    with pytest.raises(FaultsError) as caught:
        import_votes(benchmark, [file])
    assert len(str(caught.value)) < 1_000_000
    assert all(str(fault).isprintable() for fault in caught.value.faults)
    assert stored(benchmark) == {}


def test_of_two_votes_on_the_same_captions_the_last_counts(benchmark: Benchmark, tmp_path: Path) -> None:
    twice = content(benchmark, vote(choice="left"), vote("v1", "two", "one", "left"))
    report = import_votes(benchmark, [write(tmp_path / "twice.json", twice)])
    assert (report.votes, report.counted, report.replaced) == (2, 1, 1)
    (one,) = load_votes(benchmark).current
    assert (one.left, one.choice) == ("two", "left")


@pytest.mark.parametrize("turned", [False, True])
def test_of_two_files_of_one_voter_the_later_revision_counts(
    benchmark: Benchmark, tmp_path: Path, turned: bool
) -> None:
    early = write(tmp_path / "b.json", content(benchmark, vote(choice="left"), vote("v2"), revision=2))
    late = write(tmp_path / "a.json", content(benchmark, vote(choice="tie"), revision=9))
    other = write(tmp_path / "c.json", content(benchmark, vote(choice="right"), seed=8, revision=1))
    for file in [late, early, other] if turned else [other, early, late]:
        import_votes(benchmark, [file])
    found = {(one.voter, one.video_id): one.choice for one in load_votes(benchmark).current}
    assert found == {(7, "v1"): "tie", (7, "v2"): "left", (8, "v1"): "right"}
    report = import_votes(benchmark, [early])
    assert (report.votes, report.counted, report.replaced, report.stored) == (2, 1, 1, ())


@pytest.mark.parametrize("event", ["replace", "withdraw"])
def test_votes_on_captions_that_are_gone_are_kept_apart(
    benchmark: Benchmark, tmp_path: Path, event: ledger.Event
) -> None:
    file = write(tmp_path / "mine.json", content(benchmark, vote(), vote("v2")))
    ledger.append(benchmark.submissions, [entry("one", NEW if event == "replace" else OLD, event)])
    report = import_votes(benchmark, [file])
    assert (report.votes, report.counted, report.apart) == (2, 0, 2)
    assert load_votes(benchmark) == replace(load_votes(benchmark), current=(), apart=2)
    of_then = load_votes(benchmark, {"one": OLD, "two": OTHER})
    assert len(of_then.current) == 2 and of_then.apart == 0


def test_votes_under_another_truth_are_kept_apart(benchmark: Benchmark, tmp_path: Path) -> None:
    import_votes(benchmark, [write(tmp_path / "mine.json", content(benchmark, vote()))])
    TRUTH.write(benchmark.truth, [TruthHazard("v1", "h1", "Dog", "A dog")])
    assert (load_votes(benchmark).current, load_votes(benchmark).apart) == ((), 1)


def test_a_stored_file_that_was_changed_is_told(benchmark: Benchmark, tmp_path: Path) -> None:
    report = import_votes(benchmark, [write(tmp_path / "mine.json", content(benchmark, vote()))])
    write(report.stored[0], content(benchmark, vote(choice="right")))
    with pytest.raises(InputError, match="changed by hand"):
        load_votes(benchmark)
