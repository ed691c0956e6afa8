"""Submissions on disk and their ledger: whole or not there, checked when read, never forgotten."""

import hashlib
import json
import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import FaultsError, InputError
from pipeline.records import Item, Parse, Prediction, Reply, Stage, StageOutput
from pipeline.tables import PREDICTIONS, STAGES
from sitegen import ledger
from sitegen.readers import read_predictions
from sitegen.submissions import load_all, withdraw
from tests.submitting import CSV, Bench


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """An empty one."""
    return Bench(tmp_path)


def _stages(path: Path, text: str = "a cat") -> Path:
    item = Item(1, "cat", "")
    STAGES.write(
        path, [StageOutput("v1", Stage.AOS, 0, "A-LLM", "0" * 64, Reply(text, "m"), (item,), Parse.JSON)]
    )
    return path


def test_stored_and_loaded(bench: Bench) -> None:
    folder = bench.submit()
    assert folder == bench.folder / "team-a"
    assert sorted(path.name for path in folder.iterdir()) == [
        "original.csv",
        "predictions.parquet",
        "submission.toml",
    ]
    assert (folder / "original.csv").read_text() == CSV
    (stored,) = load_all(bench.folder)
    submission = stored.submission
    assert (submission.name, submission.authors, submission.date) == ("Team A", "Ann", "2026-01-02")
    assert (submission.source_format, stored.agents, stored.has_stages) == ("csv", "none", False)
    assert submission.predictions == (Prediction("v1", 1, "A cat."), Prediction("v2", 1, "A dog."))
    assert stored.original_sha256 == hashlib.sha256(CSV.encode()).hexdigest()
    assert (
        stored.predictions_sha256 == hashlib.sha256((folder / "predictions.parquet").read_bytes()).hexdigest()
    )
    assert not [path for path in bench.folder.iterdir() if path.name.startswith(".")]


def test_an_empty_folder_holds_none(tmp_path: Path) -> None:
    assert load_all(tmp_path / "none") == []


def test_extras_and_configuration_are_kept(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "predictions.parquet"
    PREDICTIONS.write(path, [Prediction("v1", 1, "A cat.")], {"config_sha256": "c" * 64})
    extras = {"stages": _stages(tmp_path / "s.parquet")}
    bench.submit(read=read_predictions(path), original=path, extras=extras)
    (stored,) = load_all(bench.folder)
    assert (stored.extras, stored.has_stages, stored.config_sha256) == (("stages",), True, "c" * 64)
    assert (stored.folder / "original.parquet").read_bytes() == path.read_bytes()


def test_the_same_again_changes_nothing(bench: Bench) -> None:
    folder = bench.submit()
    before = {path: path.stat().st_mtime_ns for path in bench.folder.rglob("*")}
    assert bench.submit(date="2026-05-05") == folder
    assert bench.submit(replace=True) == folder
    assert {path: path.stat().st_mtime_ns for path in bench.folder.rglob("*")} == before
    assert bench.events() == [("add", "team-a")]


@pytest.mark.parametrize("change", [{"content": CSV + "v3,1,x\n"}, {"authors": "Bob"}, {"agents": "gpt"}])
def test_other_content_only_replaces_when_asked(bench: Bench, change: dict[str, str]) -> None:
    bench.submit()
    with pytest.raises(InputError, match="already, with other content"):
        bench.submit(**change)
    assert bench.events() == [("add", "team-a")]
    bench.submit(replace=True, **change)
    assert bench.events() == [("add", "team-a"), ("replace", "team-a")]
    (stored,) = load_all(bench.folder)
    assert len(stored.submission.predictions) == (3 if "content" in change else 2)


def test_new_extras_replace(bench: Bench, tmp_path: Path) -> None:
    bench.submit(extras={"stages": _stages(tmp_path / "s.parquet")})
    bench.submit(extras={"stages": _stages(tmp_path / "s.parquet", "two cats")}, replace=True)
    (stored,) = load_all(bench.folder)
    assert STAGES.read(stored.folder / "stages.parquet")[0].reply.text == "two cats"
    bench.submit(replace=True)
    assert not load_all(bench.folder)[0].has_stages


def test_two_names_with_one_slug(bench: Bench) -> None:
    bench.submit("Team A")
    with pytest.raises(InputError, match="'Team-A' shortens to 'team-a', as does 'Team A'"):
        bench.submit("Team-A", replace=True)


WRONG = [
    ({"name": ""}, "name"),
    ({"name": "   "}, "name"),
    ({"name": "x" * 81}, "name"),
    ({"name": "a\u202eb"}, "formatting character"),
    ({"name": "a\nb"}, "control"),
    ({"name": "東京"}, "no letter"),
    ({"url": "javascript:alert(1)"}, "web address"),
    ({"url": "https://a b"}, "web address"),
    ({"date": "yesterday"}, "date"),
    ({"date": "2026-02-30"}, "date"),
    ({"authors": "x" * 501}, "authors"),
    ({"extras": {"scores": Path("x")}}, "Extra table 'scores' is unknown"),
]


@pytest.mark.parametrize(("change", "message"), WRONG, ids=range(len(WRONG)))
def test_wrong_values_write_nothing(bench: Bench, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        bench.submit(**change)
    assert not bench.folder.exists() or not list(bench.folder.iterdir())


def test_all_wrong_values_come_together(bench: Bench) -> None:
    with pytest.raises(InputError, match=r"(?s)3 wrong value.*name.*url.*date"):
        bench.submit(name="", url="ftp://x", date="1")


def test_an_extra_that_is_no_table(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "s.parquet").write_bytes(b"PAR1")
    with pytest.raises(FaultsError):
        bench.submit(extras={"stages": tmp_path / "s.parquet"})
    assert bench.events() == []


def test_a_file_that_changed_after_it_was_read(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text(CSV)
    read = read_predictions(path)
    path.write_text(CSV + "v3,1,x\n")
    with pytest.raises(InputError, match="changed after it was read"):
        bench.submit(read=read, original=path)
    assert load_all(bench.folder) == []


def test_withdrawn_and_submitted_again(bench: Bench) -> None:
    bench.submit()
    bench.submit("Other")
    withdraw(bench.folder, "Team A", "trained on the \u202etruth", "2026-02-01")
    assert [stored.slug for stored in load_all(bench.folder)] == ["other"]
    last = ledger.read(bench.folder)[-1]
    assert (last.event, last.name, last.reason) == ("withdraw", "Team A", "trained on the \\u202etruth")
    with pytest.raises(InputError, match="withdrawn already"):
        withdraw(bench.folder, "team-a", "again", "2026-02-01")
    bench.submit()
    assert [stored.slug for stored in load_all(bench.folder)] == ["other", "team-a"]
    assert [event for event, _ in bench.events()] == ["add", "add", "withdraw", "add"]


def test_withdrawals_that_make_no_sense(bench: Bench) -> None:
    bench.submit()
    for name in ("nobody", "", "..", "/"):
        with pytest.raises(InputError, match="Those there are: team-a"):
            withdraw(bench.folder, name, "why", "2026-02-01")
    with pytest.raises(InputError, match="reason"):
        withdraw(bench.folder, "team-a", "  ", "2026-02-01")
    with pytest.raises(InputError, match="date"):
        withdraw(bench.folder, "team-a", "why", "soon")
    assert bench.events() == [("add", "team-a")]


def test_the_ledger_is_a_chain(bench: Bench) -> None:
    for name in ("A", "B", "C"):
        bench.submit(name)
    path = bench.folder / ledger.FILE_NAME
    lines = path.read_bytes().splitlines()
    assert json.loads(lines[0])["previous"] == "0" * 64
    for before, after in pairwise(lines):
        assert json.loads(after)["previous"] == hashlib.sha256(before).hexdigest()
    assert list(json.loads(lines[0])) == [
        "event",
        "slug",
        "name",
        "date",
        "predictions_sha256",
        "original_sha256",
        "reason",
        "signature",
        "besm",
        "sam",
        "detection_rate",
        "hazard_recall",
        "previous",
    ]
    path.write_bytes(b"\n".join([lines[0].replace(b'"A"', b'"Z"'), *lines[1:]]) + b"\n")
    with pytest.raises(InputError, match="line 2: found previous"):
        load_all(bench.folder)
    with pytest.raises(InputError, match="line 2: found previous"):
        bench.submit("D")
    assert not (bench.folder / "d").exists()
    path.write_bytes(b"{}\n")
    with pytest.raises(InputError, match="line 1: not a ledger entry"):
        load_all(bench.folder)


def test_a_failure_leaves_what_was_there(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.submit()

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(ledger, "append", fail)
    with pytest.raises(OSError, match="disk full"):
        bench.submit(content=CSV + "v3,1,x\n", replace=True)
    with pytest.raises(OSError, match="disk full"):
        bench.submit("New")
    assert [len(stored.submission.predictions) for stored in load_all(bench.folder)] == [2]
    assert sorted(os.listdir(bench.folder)) == ["ledger.jsonl", "team-a"]  # noqa: PTH208


def test_submissions_at_the_same_time_all_reach_the_ledger(bench: Bench) -> None:
    names = [f"Team {number}" for number in range(8)]
    benches = []
    for name in names:
        root = bench.root / name
        root.mkdir()
        other = Bench(root)
        other.folder = bench.folder
        benches.append(other)
    with ThreadPoolExecutor(len(names)) as pool:
        list(pool.map(Bench.submit, benches, names))
    assert sorted(slug for _, slug in bench.events()) == [f"team-{number}" for number in range(8)]
    assert len(load_all(bench.folder)) == 8
