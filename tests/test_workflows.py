"""What the workflows of a new benchmark folder do: the check with real git, the comment in a real Node."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from sitegen.readers import read_truth
from sitegen.scaffold import write_benchmark
from tests.test_scaffold import ROOT, steps

ABOUT = 'name = "My system"\nauthors = "Ann"\n'
GOOD = "video_id,rank,description\nexample-with-hazard,1,A cat crosses the road.\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("new") / "benchmark"
    write_benchmark(target, "Scratch")
    return target


class Repository:
    """A git repository with a new benchmark, a pull request to it, and the check that runs for it."""

    def __init__(self, root: Path) -> None:
        self.root = root / "repository"
        self.runner = root / "runner"
        self.runner.mkdir()
        write_benchmark(self.root, "Scratch")
        self.git("init", "--quiet", "--initial-branch=main")
        self.commit("first")
        self.git("checkout", "--quiet", "-b", "pull")

    def git(self, *words: str) -> str:
        told = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
        who = ["-c", "user.name=Ann", "-c", "user.email=ann@example.org", "-c", "commit.gpgsign=false"]
        run = subprocess.run(
            ["git", *who, *words], cwd=self.root, env={**os.environ, **told}, check=True, capture_output=True
        )
        return run.stdout.decode()

    def commit(self, message: str) -> None:
        self.git("add", "--all", "--force")
        self.git("commit", "--quiet", "--message", message)

    def propose(self, name: str, files: dict[str, str]) -> None:
        place = self.root / "proposals" / name
        place.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (place / file).write_text(text, encoding="utf-8")

    def check(self) -> tuple[int, str, str]:
        """Run the check's own commands on the merged pull request: exit code, report, log."""
        self.commit("what is sent")
        self.git("checkout", "--quiet", "main")
        self.git("merge", "--quiet", "--no-ff", "--no-edit", "pull")
        command = self.runner / "coooler"
        python, root = shlex.quote(sys.executable), shlex.quote(str(ROOT))
        command.write_text(f'#!/bin/sh\nPYTHONPATH={root} exec {python} -m sitegen.cli "$@"\n')
        command.chmod(0o755)
        environment = {
            **os.environ,
            "PATH": f"{self.runner}{os.pathsep}{os.environ['PATH']}",
            "GITHUB_ENV": str(self.runner / "env"),
            "RUNNER_TEMP": str(self.runner),
            "REPORT": str(self.runner / "report"),
            "COLUMNS": "200",
        }
        log, code = "", 0
        for step in steps(self.root, "check"):
            if step.get("shell") != "bash":
                continue
            shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
            run = subprocess.run(
                shell,
                cwd=self.root,
                env=environment,
                capture_output=True,
                text=True,
                timeout=120,
                check=False,
            )
            log, code = log + run.stdout + run.stderr, run.returncode
            if (self.runner / "env").exists():
                lines = (self.runner / "env").read_text().splitlines()
                environment |= dict(line.split("=", 1) for line in lines)
        report = self.runner / "report" / "report.md"
        return code, report.read_text(encoding="utf-8") if report.exists() else "", log


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    if not shutil.which("git") or not shutil.which("bash"):
        pytest.skip("git and bash are needed")
    return Repository(tmp_path)


def test_a_good_submission_is_scored_and_nothing_is_stored(repository: Repository) -> None:
    repository.propose("mine", {"predictions.csv": GOOD, "about.toml": ABOUT})
    code, report, log = repository.check()
    assert code == 0, log
    assert "My system" in report and "BESM" in report
    assert [path.name for path in (repository.root / "submissions").iterdir()] == [".gitkeep"]


def test_faults_fail_the_check_and_are_annotated(repository: Repository) -> None:
    repository.propose("mine", {"predictions.csv": GOOD + "no-such,x,A dog.\n", "about.toml": ABOUT})
    code, report, log = repository.check()
    assert code == 1
    assert re.search(r"^::error .*file=proposals/mine/predictions\.csv", log, re.MULTILINE)
    assert "no-such" in report


def test_a_hostile_pull_request_runs_nothing_and_changes_nothing(repository: Repository) -> None:
    marker = repository.runner / "MARKER"
    evil = f"$(touch {marker})"
    repository.propose("a b", {"predictions.csv": GOOD, "about.toml": ABOUT})
    repository.propose("link", {"about.toml": ABOUT})
    (repository.root / "proposals" / "link" / "predictions.csv").symlink_to("/etc/passwd")
    repository.propose("program", {"predictions.csv": GOOD, "about.toml": ABOUT})
    (repository.root / "proposals" / "program" / "predictions.csv").chmod(0o755)
    quoted = evil.replace("/", "\u2215")
    repository.propose(f"`{quoted}`", {f"{quoted}\n;{quoted}.csv": GOOD})
    repository.propose("two", {"predictions.csv": GOOD, "predictions.json": "{}", "about.toml": ABOUT})
    for name, text in (("truth.csv", "video_id\n"), ("requirements.txt", "evil\n"), ("coooler.toml", "evil")):
        (repository.root / name).write_text(text)
    code, report, log = repository.check()
    assert code == 1
    assert "5 files under proposals/ are not taken" in report
    assert "changes 3 files outside" in report
    assert "`two`: found 2 files" in report and "passwd" not in report
    assert not [path for path in repository.runner.rglob("*") if "MARKER" in path.name]
    assert "root:" not in log
    assert read_truth(repository.root / "truth.csv")


def test_a_pull_request_without_submissions_passes(repository: Repository) -> None:
    (repository.root / "README.md").write_text("Better.\n")
    assert repository.check()[:2] == (0, "")


NODE = """
const [script, report, pulls, comments] = JSON.parse(require("fs").readFileSync(0, "utf8"));
process.env.REPORT = report;
const calls = [];
const say = (text) => calls.push(["said", text]);
const issues = {
  listComments: () => comments,
  createComment: (what) => calls.push(["create", what]),
  updateComment: (what) => calls.push(["update", what]),
};
const github = { paginate: async (ask, what) => ask(what), rest: { pulls: { list: () => pulls }, issues } };
const run = { head_sha: "abc", head_branch: "x", head_repository: { owner: { login: "ann" } } };
const context = { repo: { owner: "o", repo: "r" }, payload: { workflow_run: run } };
const AsyncFunction = (async () => {}).constructor;
new AsyncFunction("github", "context", "core", "require", script)(
  github, context, { info: say, warning: say }, require
).then(() => console.log(JSON.stringify(calls)));
"""


def _node() -> str:
    driver = pytest.importorskip("playwright._impl._driver")
    return str(driver.compute_driver_executable()[0])


def _comment(folder: Path, report: Path, comments: list[dict[str, Any]]) -> list[Any]:
    (script,) = [step["with"]["script"] for step in steps(folder, "comment") if "script" in step["with"]]
    pulls = [{"number": 7, "head": {"sha": "old"}}, {"number": 12, "head": {"sha": "abc"}}]
    given = json.dumps([script, str(report), pulls, comments])
    run = subprocess.run(
        [_node(), "-e", NODE], input=given, capture_output=True, text=True, check=True, timeout=60
    )
    calls: list[Any] = json.loads(run.stdout)
    return calls


def test_the_report_is_posted_once_and_then_replaced(folder: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    report.write_text("BESM 0.5 @maintainer \u202e\x1b[31m `${{ github.token }}`\n", encoding="utf-8")
    ((verb, what),) = _comment(folder, report, [])
    assert verb == "create" and what["issue_number"] == 12
    assert "BESM 0.5 @\u200bmaintainer [31m" in what["body"] and "abc" in what["body"]
    ours = {"id": 5, "user": {"login": "github-actions[bot]"}, "body": what["body"]}
    forged = {"id": 4, "user": {"login": "mallory"}, "body": what["body"]}
    assert [(verb, what.get("comment_id")) for verb, what in _comment(folder, report, [forged, ours])] == [
        ("update", 5)
    ]


def test_what_is_no_small_text_is_not_posted(folder: Path, tmp_path: Path) -> None:
    contents: dict[str, bytes] = {"large": b"x" * 1_000_001, "binary": b"\xff\xfe"}
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "link").symlink_to("/etc/passwd")
    for name in (*contents, "link", "missing"):
        assert [verb for verb, _ in _comment(folder, tmp_path / name, [])] == ["said"]
    (tmp_path / "long").write_text("x" * 100_000)
    ((_, what),) = _comment(folder, tmp_path / "long", [])
    assert len(what["body"]) < 65_000
