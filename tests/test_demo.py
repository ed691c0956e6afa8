"""The demo from an installed wheel, outside the checkout: real clips to a site, and again."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.tables import MATCHES, PREDICTIONS, STAGES

ROOT = Path(__file__).parent.parent


def _run(command: list[str], cwd: Path, installed: Path) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": str(installed), "COLUMNS": "200"}
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from this tree and installed into a folder of its own."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    target = folder / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target"]
    subprocess.run([*pip, str(target), str(wheel)], check=True, capture_output=True)
    return target


@pytest.fixture(scope="module")
def demo(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder in which `coooler demo` has run, and what it printed."""
    folder = tmp_path_factory.mktemp("demo")
    where = _run([sys.executable, "-c", "import sitegen; print(sitegen.__file__)"], folder, installed)
    assert str(installed) in where.stdout
    run = _run([sys.executable, "-m", "sitegen.cli", "demo"], folder, installed)
    assert run.returncode == 0, run.stderr
    return folder, run.stdout


def _tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_ends_with_a_site_and_a_table(demo: tuple[Path, str]) -> None:
    folder, printed = demo
    assert (folder / "site" / "index.html").is_file()
    for name in ("Embedded pipeline", "without Track 2", "Constant caption (probe)"):
        assert name in printed
    assert re.search(r"signature coooler:\S+\|n:14\|thr:>0\.8", printed)


def test_the_runs_looked_at_every_clip(demo: tuple[Path, str]) -> None:
    folder, _ = demo
    run = folder / "coooler-demo" / "runs" / "embedded-pipeline"
    stages = STAGES.read(run / "stages.parquet")
    assert len({output.video_id for output in stages}) == 14
    scenes = {}
    for output in stages:
        scenes.setdefault(output.video_id, []).append(output.reply.text)
    assert len({tuple(said) for said in scenes.values()}) == 14
    assert MATCHES.read(run / "matches.parquet")
    assert PREDICTIONS.read(run / "predictions.parquet")


def test_builds_are_byte_equal_and_a_second_demo_changes_nothing(
    demo: tuple[Path, str], installed: Path
) -> None:
    folder, printed = demo
    site = _tree(folder / "site")
    build = [sys.executable, "-m", "sitegen.cli", "build", "--out", "../other", "--json"]
    run = _run(build, folder / "coooler-demo", installed)
    assert run.returncode == 0, run.stderr
    other = _tree(folder / "other")
    assert other.keys() == site.keys()
    assert [name for name in site if site[name] != other[name]] == []
    assert json.loads(run.stdout)["tree_sha256"].encode() in other["index.html"]
    again = _run([sys.executable, "-m", "sitegen.cli", "demo"], folder, installed)
    assert again.returncode == 0, again.stderr
    assert again.stdout == printed
    assert _tree(folder / "site") == site


def test_the_wheel_holds_no_leftovers(installed: Path) -> None:
    packaged = installed / "sitegen" / "demo_benchmark"
    assert sorted(path.name for path in packaged.iterdir()) == [
        "ATTRIBUTION.md",
        "boxes.parquet",
        "configs",
        "constant-caption.csv",
        "coooler.toml",
        "truth.csv",
        "videos",
    ]
    assert sum(path.stat().st_size for path in (packaged / "videos").iterdir()) <= 6_000_000
