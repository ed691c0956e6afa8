"""Versions of submissions: kept, found by day, and whole whenever a process is killed."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.files import sha256_file
from sitegen import ledger, shelf
from sitegen.submissions import load_all, withdraw
from tests.submitting import CSV, Bench

ROOT = Path(__file__).parent.parent
LONGER = CSV + "v3,1,A bird.\n"

# Runs `submit` and dies without warning right before, or right after, the named step.
KILLED = """
import os, signal, sys
from pathlib import Path
from sitegen import ledger, shelf
from tests.submitting import Bench, CSV

step, when, root = sys.argv[1:]
owner, name = {
    "append": (ledger, "append"),
    "rename": (Path, "rename"),
}[step.split("-")[0]]
wanted = int(step.split("-")[1])
real, calls = getattr(owner, name), 0

def dying(*arguments, **more):
    global calls
    calls += 1
    if calls == wanted and when == "before":
        os.kill(os.getpid(), signal.SIGKILL)
    result = real(*arguments, **more)
    if calls == wanted and when == "after":
        os.kill(os.getpid(), signal.SIGKILL)
    return result

setattr(owner, name, dying)
Bench(Path(root)).submit(content=CSV + "v3,1,A bird.\\n", replace=True, today="2026-03-01")
"""


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """An empty one."""
    return Bench(tmp_path)


def _sizes(bench: Bench, as_of: str = "") -> dict[str, int]:
    return {one.slug: len(one.submission.predictions) for one in load_all(bench.folder, as_of=as_of)}


# Renames of a replacing: staged, the old one to the earlier ones, the new one to its place.
@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("step", ["rename-1", "append-1", "rename-2", "rename-3"])
def test_killed_while_it_replaces(bench: Bench, step: str, when: str) -> None:
    bench.submit(today="2026-02-01")
    run = subprocess.run(
        [sys.executable, "-c", KILLED, step, when, str(bench.root)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert run.returncode == -signal.SIGKILL
    noted = len(bench.events()) == 2
    assert noted == (step in {"rename-2", "rename-3"} or (step, when) == ("append-1", "after"))
    assert _sizes(bench) == {"team-a": 3 if noted else 2}
    assert _sizes(bench, "2026-02-28") == {"team-a": 2}
    left = sorted(path.name for path in bench.folder.iterdir())
    assert left == [*(["_earlier"] if noted else []), "ledger.jsonl", "team-a"]
    bench.submit(content=LONGER, replace=True, today="2026-03-01")
    assert bench.events() == [("add", "team-a"), ("replace", "team-a")]
    assert _sizes(bench) == {"team-a": 3}


def test_every_version_is_kept_and_found_by_its_day(bench: Bench) -> None:
    bench.submit(today="2026-02-01")
    bench.submit("Team B", today="2026-02-03")
    bench.submit(content=LONGER, replace=True, why="a bug", today="2026-02-05")
    withdraw(bench.folder, "team-a", "trained on the truth", "2026-02-07")
    bench.submit(content="video_id,rank,description\nv1,1,A cat.\n", today="2026-02-09")
    days = {
        "2026-01-31": {},
        "2026-02-01": {"team-a": 2},
        "2026-02-04": {"team-a": 2, "team-b": 2},
        "2026-02-05": {"team-a": 3, "team-b": 2},
        "2026-02-08": {"team-b": 2},
        "2026-02-09": {"team-a": 1, "team-b": 2},
        "": {"team-a": 1, "team-b": 2},
    }
    for day, sizes in days.items():
        assert _sizes(bench, day) == sizes, day
    entries = ledger.read(bench.folder)
    assert [(entry.event, entry.reason) for entry in entries] == [
        ("add", "submitted"),
        ("add", "submitted"),
        ("replace", "a bug"),
        ("withdraw", "trained on the truth"),
        ("add", "submitted"),
    ]
    first = shelf.earlier(bench.folder, "team-a", 1)
    assert sha256_file(first / "predictions.parquet") == entries[0].predictions_sha256
    assert sha256_file(first / "original.csv") == entries[0].original_sha256


def test_a_line_is_never_dated_before_the_line_before(bench: Bench) -> None:
    bench.submit(today="2026-02-05")
    bench.submit("Team B", today="2026-02-01")
    assert [entry.date for entry in ledger.read(bench.folder)] == ["2026-02-05", "2026-02-05"]


def test_an_earlier_version_that_is_gone_is_said(bench: Bench) -> None:
    bench.submit(today="2026-02-01")
    bench.submit(content=LONGER, replace=True, today="2026-02-05")
    (bench.folder / "_earlier" / "team-a-1").rename(bench.root / "elsewhere")
    assert _sizes(bench) == {"team-a": 3}
    with pytest.raises(InputError, match="team-a-1: found nothing"):
        load_all(bench.folder, as_of="2026-02-03")


def test_old_leftovers_of_killed_processes_are_removed(bench: Bench) -> None:
    bench.submit()
    for name in (".new-abc", ".staged-team-b-1", ".staged-team-a-3", ".staged-"):
        (bench.folder / name).mkdir()
    assert _sizes(bench) == {"team-a": 2}
    assert sorted(path.name for path in bench.folder.iterdir()) == ["ledger.jsonl", "team-a"]


def test_two_processes_that_submit_at_once_both_land_in_order(bench: Bench) -> None:
    code = (
        "import sys\nfrom pathlib import Path\nfrom tests.submitting import Bench\n"
        "bench = Bench(Path(sys.argv[1]) / sys.argv[2])\nbench.root.mkdir()\n"
        "bench.folder = Path(sys.argv[1]) / 'submissions'\nsys.stdin.readline()\n"
        "for number in range(6):\n    bench.submit(f'{sys.argv[2]} {number}')\n"
    )
    children = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(bench.root), name],
            stdin=subprocess.PIPE,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
        for name in ("left", "right")
    ]
    for child in children:
        assert child.stdin
        child.stdin.write(b"go\n")
        child.stdin.close()
    assert [child.wait(timeout=60) for child in children] == [0, 0]
    slugs = [slug for _, slug in bench.events()]
    for name in ("left", "right"):
        assert [slug for slug in slugs if slug.startswith(name)] == [f"{name}-{n}" for n in range(6)]
    assert len(load_all(bench.folder)) == 12
