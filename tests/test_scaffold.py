"""A new benchmark folder works as it is, and its workflows are given no more than they need."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml  # type: ignore[import-untyped]

from pipeline.benchmark import open_benchmark
from pipeline.config import BenchmarkSettings, DemoSubmission
from pipeline.errors import InputError
from pipeline.minilm import INSTALL
from sitegen.about import Sender
from sitegen.cli import app
from sitegen.readers import read_truth
from sitegen.rendering import find_templates
from sitegen.scaffold import write_benchmark

ROOT = Path(__file__).parent.parent
WORKFLOWS = ("check", "comment", "land")
NAME = 'Night roads "é" \\ & co'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("new") / "benchmark"
    write_benchmark(target, NAME)
    return target


def workflow(folder: Path, name: str) -> dict[str, Any]:
    """A workflow of a new benchmark folder."""
    text = (folder / ".github" / "workflows" / f"{name}.yml").read_text(encoding="utf-8")
    # YAML 1.1 reads the key `on` as true.
    return {"on" if key is True else key: value for key, value in yaml.safe_load(text).items()}


def steps(folder: Path, name: str) -> list[dict[str, Any]]:
    """The steps of all jobs of a workflow."""
    return [step for job in workflow(folder, name)["jobs"].values() for step in job["steps"]]


def test_the_folder_is_a_benchmark(folder: Path) -> None:
    benchmark = open_benchmark(folder)
    assert benchmark.settings == BenchmarkSettings(name=NAME)
    hazards = read_truth(benchmark.truth)
    assert [hazard.is_no_hazard for hazard in hazards] == [False, True]
    assert all("example" in hazard.video_id for hazard in hazards)
    assert benchmark.videos.is_dir() and benchmark.submissions.is_dir()
    assert f"# {NAME}\n" in (folder / "README.md").read_text(encoding="utf-8")
    assert not [path for path in folder.rglob("*") if path.is_file() and b"@NAME@" in path.read_bytes()]


def test_every_setting_is_explained(folder: Path) -> None:
    text = (folder / "coooler.toml").read_text(encoding="utf-8")
    for name in BenchmarkSettings.model_fields.keys() - {"demo"}:
        assert re.search(rf"^{name} = .*  # \w", text, re.MULTILINE), name
    for name in DemoSubmission.model_fields:
        assert re.search(rf"^# {name} = ", text, re.MULTILINE), name


def test_it_is_the_same_each_time_and_tells_what_it_wrote(folder: Path, tmp_path: Path) -> None:
    written = write_benchmark(tmp_path / "again", NAME)
    paths = [path for path in (tmp_path / "again").rglob("*") if path.is_file()]
    assert written == sorted(paths)
    for path in paths:
        assert path.read_bytes() == (folder / path.relative_to(tmp_path / "again")).read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["again"]


def test_an_empty_folder_and_a_new_repository_are_filled(folder: Path, tmp_path: Path) -> None:
    for name in ("empty", "repository"):
        (tmp_path / name).mkdir()
    (tmp_path / "repository" / ".git").mkdir()
    for name in ("empty", "repository"):
        assert len(write_benchmark(tmp_path / name, "x")) == len(
            [p for p in folder.rglob("*") if p.is_file()]
        )


def test_what_is_there_stays_and_is_named(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match=r"holds mine\.txt"):
        write_benchmark(tmp_path / "full", "x")
    with pytest.raises(InputError, match="is a file"):
        write_benchmark(tmp_path / "file", "x")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "full", "mine.txt"]


@pytest.mark.parametrize("name", ["", "  ", "a\nb", "x" * 121, "\u202e"])
def test_names_that_cannot_be_shown_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="expected 1 to 120 printable characters"):
        write_benchmark(tmp_path / "new", name)
    assert not (tmp_path / "new").exists()


def test_nothing_half_written_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "target").mkdir()
    rename = Path.rename

    def failing(path: Path, target: Path) -> Path:
        if path.name == "truth.csv" and "target" in str(target):
            raise OSError("no space")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(InputError, match="no space"):
        write_benchmark(tmp_path / "target", "x")
    assert [path.name for path in tmp_path.rglob("*")] == ["target"]


def test_the_site_does_not_hold_the_templates_of_a_folder() -> None:
    assets = find_templates() / "assets"
    assert not [path for path in assets.rglob("*") if "init" in path.relative_to(assets).parts]


def test_the_embedder_is_the_one_that_the_tool_names(folder: Path) -> None:
    assert (folder / "models.txt").read_text().splitlines()[-1] == INSTALL.split()[-1]


def test_workflows_get_no_more_than_they_need(folder: Path) -> None:
    allowed = {
        "check": {"check": {"contents": "read"}},
        "comment": {"comment": {"actions": "read", "pull-requests": "write"}},
        "land": {"build": {"contents": "read"}, "publish": {"pages": "write", "id-token": "write"}},
    }
    for name in WORKFLOWS:
        found = workflow(folder, name)
        assert found["permissions"] == {}, "nothing unless a job asks for it"
        assert {job: body["permissions"] for job, body in found["jobs"].items()} == allowed[name]
        assert found["concurrency"]
        assert all(0 < body["timeout-minutes"] <= 60 for body in found["jobs"].values())
        assert "pull_request_target" not in found["on"]
    assert list(workflow(folder, "check")["on"]) == ["pull_request"]
    assert workflow(folder, "comment")["on"] == {
        "workflow_run": {"workflows": [workflow(folder, "check")["name"]], "types": ["completed"]}
    }


def test_no_text_of_a_pull_request_is_part_of_a_command(folder: Path) -> None:
    for name in WORKFLOWS:
        for step in steps(folder, name):
            for code in (step.get("run", ""), step.get("with", {}).get("script", "")):
                assert "${{" not in code
            assert "secrets." not in json.dumps(step)
            if "uses" in step:
                assert re.fullmatch(r"actions/[a-z-]+@(v[0-9]+|[0-9a-f]{40})", step["uses"])
            if step.get("uses", "").startswith("actions/checkout"):
                assert step["with"]["persist-credentials"] is False
    assert not [step for step in steps(folder, "comment") if "run" in step]


def _commands(text: str) -> list[list[str]]:
    lines = [line.strip() for line in text.replace("\\\n", " ").splitlines()]
    found = [line.partition(" #")[0].partition(" ||")[0] for line in lines if line.startswith("coooler ")]
    found += re.findall(r"`(coooler [^`]+)`", text)
    return [shlex.split(part) for line in found for part in line.split(" && ")]


def test_every_command_that_is_named_exists_with_its_options(folder: Path) -> None:
    tree: Any = typer.main.get_command(app)
    known = {
        name: {option for one in command.params for option in one.opts}
        for name, command in tree.commands.items()
    }
    texts = [step.get("run", "") for name in WORKFLOWS for step in steps(folder, name)]
    texts += [(folder / "README.md").read_text(encoding="utf-8")]
    texts += [(ROOT / "docs" / "submitting.md").read_text(encoding="utf-8")]
    commands = [command for text in texts for command in _commands(text)]
    assert {command[1] for command in commands} >= {"check", "submit", "verify", "build", "serve", "init"}
    for command in commands:
        options = {word for word in command if word.startswith("--")}
        assert options <= known[command[1]], command


def test_the_docs_name_the_fields_of_an_about_file(folder: Path) -> None:
    for text in ((folder / "README.md").read_text(), (ROOT / "docs" / "submitting.md").read_text()):
        (block,) = re.findall(r"```toml\n# about\.toml.*?\n(.*?)```", text, re.DOTALL)
        keys = [line.split(" = ")[0] for line in block.splitlines()]
        assert keys[0] == "name" and set(keys) <= set(Sender.__slots__)
