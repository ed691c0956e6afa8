"""Predictions behind a URL are read, checked and stored as the same bytes at a path are."""

import http.server
import json
import threading
import uuid
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem
from fsspec.registry import known_implementations
from typer.testing import CliRunner

from pipeline.errors import OutsideError
from pipeline.records import Prediction
from pipeline.tables import OUTCOMES, PREDICTIONS, STAGES
from sitegen import formats, shards
from sitegen.cli import app
from sitegen.fetched import fetched
from tests.faulty import faults, files

ROWS = [Prediction(f"v{number}", 1, text) for number, text in enumerate(["A cat", "A dog", "A deer"])]
CSV = "video_id,rank,description\n" + "".join(f"{row.video_id},1,{row.description}\n" for row in ROWS)


@pytest.fixture
def url() -> Iterator[str]:
    """An empty folder in memory."""
    where = f"memory://{uuid.uuid4()}"
    yield where
    system = MemoryFileSystem()
    if system.exists(where):
        system.rm(where, recursive=True)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A benchmark folder to run commands in, with `mine.csv` and `shards/`."""
    (tmp_path / "coooler.toml").write_text('name = "Tests"\n')
    truth = "".join(f"{row.video_id},1,x,{row.description}\n" for row in ROWS)
    (tmp_path / "truth.csv").write_text("video_id,hazard_id,label,description\n" + truth)
    (tmp_path / "mine.csv").write_text(CSV)
    for number in range(2):
        PREDICTIONS.write(tmp_path / "shards" / f"part-{number}.parquet", ROWS[number * 2 :][:2])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put(url: str, path: Path) -> None:
    """Put a file, or all files of a folder, where the URL says."""
    for one in path.iterdir() if path.is_dir() else [path]:
        fsspec.filesystem("memory").pipe_file(f"{url}/{one.name}" if path.is_dir() else url, one.read_bytes())


def coooler(*words: str) -> tuple[int, str, str]:
    """Run a command in this process, which is where the files in memory are: code, output, errors."""
    run = CliRunner().invoke(app, list(words))
    if isinstance(run.exception, Exception):
        return run.exception.exit_code, run.stdout, str(run.exception)  # type: ignore[attr-defined]
    return run.exit_code, run.stdout, run.stderr


@pytest.mark.parametrize("name", ["mine.csv", "shards"])
@pytest.mark.parametrize("scheme", ["memory", "file"])
def test_commands_say_of_a_url_what_they_say_of_a_path(home: Path, url: str, name: str, scheme: str) -> None:
    there = f"{url}/{name}" if scheme == "memory" else f"file://{home / name}"
    put(f"{url}/{name}", home / name)
    said, same = (json.loads(coooler("check", where, "--json")[1]) for where in (there, name))
    assert said.pop("file") == there and same.pop("file") == name
    assert said == same and said["predictions"] == 3
    assert coooler("score", there, "--json") == coooler("score", name, "--json")
    assert coooler("compare", there, name, "--json")[0] == 0
    for where in (there, name):  # the same again changes nothing
        assert coooler("submit", where, "--name", "Mine", "--date", "2026-01-01")[0] == 0
    assert len((home / "submissions" / "ledger.jsonl").read_text().splitlines()) == 1


def test_a_run_folder_behind_a_url_brings_its_records(home: Path, url: str) -> None:
    for folder in (home / "run", home / "plain"):
        PREDICTIONS.write(folder / "predictions.parquet", ROWS, {"agents": "an agent"})
        STAGES.write(folder / "stages.parquet", [])
        OUTCOMES.write(folder / "outcomes.parquet", [])
        (folder / "notes.txt").write_text("not read")
    put(f"{url}/run", home / "run")
    assert coooler("check", f"{url}/run")[1].startswith(f"{url}/run/predictions.parquet: good. 3 predictions")
    assert coooler("submit", f"{url}/run", "--name", "There")[0] == 0
    assert coooler("submit", "run", "--name", "Here")[0] == 0
    there, here = (
        {path.name: path.read_bytes() for path in (home / "submissions" / slug).iterdir()}
        for slug in ("there", "here")
    )
    assert {name: there[name] for name in there if name != "submission.toml"} == {
        name: here[name] for name in here if name != "submission.toml"
    }
    assert {"stages.parquet", "outcomes.parquet", "original.parquet"} <= there.keys()
    assert b"an agent" in there["submission.toml"]


def test_faults_name_the_url(home: Path, url: str) -> None:
    (home / "mine.csv").write_text(CSV + "v9,1,A bird\n")
    put(f"{url}/mine.csv", home / "mine.csv")
    code, _, said = coooler("check", f"{url}/mine.csv")
    assert code == 1 and f"{url}/mine.csv, row 4, column video_id: found 'v9'" in said
    PREDICTIONS.write(home / "shards" / "part-2.parquet", [Prediction("v9", 1, "A bird")])
    put(f"{url}/shards", home / "shards")
    for command in (["check"], ["score"], ["submit", "--name", "x"]):
        code, _, said = coooler(*command, f"{url}/shards")
        assert code == 1 and f"{url}/shards/part-2.parquet, row 1, column video_id: found 'v9'" in said
        assert "/tmp" not in said
    code, _, said = coooler("check", f"{url}/none.csv")
    assert code == 1 and f"{url}/none.csv: found no such file" in said


def test_a_corrected_copy_of_a_url_is_written_here(home: Path, url: str) -> None:
    (home / "odd.csv").write_text(CSV.replace("A cat", " A cat "))
    put(f"{url}/odd.csv", home / "odd.csv")
    (home / "odd.csv").unlink()
    code, said, _ = coooler("check", f"{url}/odd.csv", "--fix")
    assert code == 0 and "odd.fixed.csv: good" in said
    assert (home / "odd.fixed.csv").read_text() == CSV


def test_results_behind_a_url_are_scored_by_the_rules_of_coool(home: Path, url: str) -> None:
    (home / "run").mkdir()
    (home / "run" / "results.csv").write_text(
        "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1\nv0_0,False,1,cat\nv1_0,True,,\nv2_0,True,,\n"
    )
    put(f"{url}/run", home / "run")
    here = coooler("score", "run", "--coool", "--json")
    assert here[0] == 0, here
    for there in (f"{url}/run", f"{url}/run/results.csv"):
        code, said, _ = coooler("score", there, "--coool", "--json")
        assert (code, {**json.loads(said), "file": ""}) == (0, {**json.loads(here[1]), "file": ""})
    code, _, said = coooler("score", "shards", "--coool")
    assert code == 1 and "a folder without results.csv" in said


class Store(MemoryFileSystem):
    """The files in memory, by another name."""

    cachable = False

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        return str(super()._strip_protocol(path.partition("://")[2] or path))


class Sized(Store):
    """A store that tells of each file the size `told`, and counts the reads."""

    protocol = "sized"
    told: int | None = None
    opened = 0

    def info(self, path: str, **more: Any) -> dict[str, Any]:
        found = super().info(path, **more)
        return {**found, "size": self.told} if found["type"] == "file" else found

    def ls(self, path: str, detail: bool = True, **more: Any) -> Any:
        return [{**one, "size": self.told} for one in super().ls(path, detail=True, **more)]

    def open(self, *words: Any, **more: Any) -> Any:
        type(self).opened += 1
        return super().open(*words, **more)


@pytest.fixture
def sized(url: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """A URL of a folder in such a store, with two shards of 1,000 bytes; a file may have 1,500."""
    fsspec.register_implementation("sized", Sized, clobber=True)
    monkeypatch.setattr(Sized, "opened", 0)
    monkeypatch.setattr(formats, "MAX_BYTES", 1_500)
    system = MemoryFileSystem()
    for name in ("a.parquet", "b.parquet", "_SUCCESS", ".hidden"):
        system.pipe_file(f"{url}/{name}", b"PAR1" + bytes(996))
    return url.replace("memory://", "sized://")


@pytest.mark.parametrize("told", [None, 0, 10, 1_000])
def test_never_more_than_one_file_may_have(
    sized: str, told: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Sized, "told", told)
    ((_, _, found),) = faults(lambda: fetched(sized, tmp_path))
    assert found == ("0 MB" if told == 1_000 else "more than 0 MB")
    assert Sized.opened == (0 if told == 1_000 else 2)
    assert sum(path.stat().st_size for path in tmp_path.rglob("*.parquet")) <= 1_500
    assert fetched(f"{sized}/a.parquet", tmp_path).read_bytes()[:4] == b"PAR1"


def test_too_many_shards_are_not_fetched(sized: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shards, "MAX_SHARDS", 1)
    assert faults(lambda: fetched(sized, tmp_path)) == [(None, None, "2 files")]
    assert files(lambda: fetched(sized, tmp_path)) == [sized]
    assert Sized.opened == 0


@pytest.mark.parametrize("name", ["a\\b.parquet", "nul\0.parquet", "x" * 300])
def test_names_that_no_file_can_have(name: str, url: str, tmp_path: Path) -> None:
    MemoryFileSystem().pipe_file(f"{url}/{name}", b"PAR1")
    ((_, _, found),) = faults(lambda: fetched(url, tmp_path))
    assert found.startswith("the name '")
    copy = fetched(f"{url}/{name}", tmp_path)
    assert copy == tmp_path / "predictions"


def test_a_folder_within_is_no_shard(home: Path, url: str) -> None:
    put(f"{url}/shards", home / "shards")
    put(f"{url}/shards/year=2026", home / "shards")
    code, _, said = coooler("check", f"{url}/shards")
    assert code == 1 and f"{url}/shards/year=2026: found a folder" in said


class Failing(Store):
    """A store whose reads fail."""

    protocol = "failing"

    def open(self, *words: Any, **more: Any) -> Any:
        raise ConnectionResetError("reset by peer")


def test_a_store_that_fails_is_an_error_outside(home: Path, url: str) -> None:
    fsspec.register_implementation("failing", Failing, clobber=True)
    put(f"{url}/mine.csv", home / "mine.csv")
    where = f"{url}/mine.csv".replace("memory", "failing")
    code, _, said = coooler("check", where)
    assert (code, said) == (3, f"{where}: ConnectionResetError: reset by peer")


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = {"class": "no_such_package.Store", "err": "Install nowherefs to reach it"}
    monkeypatch.setitem(known_implementations, "nowhere", known)
    with pytest.raises(OutsideError, match=r"nowhere://x.csv: .*Install nowherefs to reach it"):
        fetched("nowhere://x.csv", tmp_path)


def test_a_web_server(home: Path) -> None:
    handler = partial(http.server.SimpleHTTPRequestHandler, directory=str(home))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            there = f"http://127.0.0.1:{server.server_port}/mine.csv"
            said, same = (json.loads(coooler("check", where, "--json")[1]) for where in (there, "mine.csv"))
            assert {**said, "file": ""} == {**same, "file": ""}
            assert coooler("check", f"{there}?x=1")[0] == 0
            code, _, text = coooler("check", f"{there}.none")
            assert code == 1 and "found no such file" in text
        finally:
            server.shutdown()
