"""Executors: every item once, whatever happens to the workers."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import Fault, FaultsError
from pipeline.execute import AHEAD, ProcessExecutor, SerialExecutor, ThreadExecutor
from pipeline.tables import OUTCOMES, PREDICTIONS, STAGES

ROOT = Path(__file__).parent.parent


def square(number: int) -> int:
    return number * number


def die_once(job: tuple[Path, int]) -> int:
    """Kills its worker the first time that it gets the number 3."""
    folder, number = job
    mark = folder / "died"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def die_always(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def lost(item: Any, why: str) -> int:
    return -1


@pytest.mark.parametrize("make", [SerialExecutor, lambda: ThreadExecutor(3), lambda: ProcessExecutor(2)])
def test_every_item_comes_back_once(make: Callable[[], Any]) -> None:
    assert sorted(make().run(square, range(20), lost)) == [n * n for n in range(20)]
    assert list(make().run(square, [], lost)) == []


def test_items_of_a_dead_worker_are_run_again(tmp_path: Path) -> None:
    jobs = [(tmp_path, number) for number in range(8)]
    assert sorted(ProcessExecutor(2).run(die_once, jobs, lost)) == list(range(8))


def test_an_item_that_always_kills_its_worker_is_given_up_alone() -> None:
    assert sorted(ProcessExecutor(2).run(die_always, range(6), lost)) == [-1, 0, 1, 2, 4, 5]


def wait_long(number: int) -> None:
    print(os.getpid(), flush=True)
    time.sleep(600)


RUN_FOR_EVER = """
import signal

from pipeline.execute import ProcessExecutor
from tests.test_execute import lost, wait_long

if __name__ == "__main__":
    # Ignored where the tests run in the background, as with nohup; not in a terminal.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    list(ProcessExecutor(2).run(wait_long, range(2), lost))
"""


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_however_a_run_ends_its_processes_end_with_it(by: signal.Signals, tmp_path: Path) -> None:
    script = tmp_path / "for_ever.py"
    script.write_text(RUN_FOR_EVER)
    path = {**os.environ, "PYTHONPATH": str(ROOT)}
    quiet: Any = {"env": path, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with subprocess.Popen([sys.executable, str(script)], start_new_session=True, **quiet) as run:
        assert run.stdout is not None
        for _ in range(2):
            assert run.stdout.readline().strip().isdigit()  # both workers are at work
        try:
            # As a terminal does: Ctrl-C goes to all of them.
            (os.killpg if by is signal.SIGINT else os.kill)(run.pid, by)
            # The pipe is at its end when no process holds it any more; it does not end by itself.
            assert run.communicate(timeout=60)[0] == ""
        finally:
            with suppress(ProcessLookupError):
                os.killpg(run.pid, signal.SIGKILL)


def fail(number: int) -> int:
    if number == 3:
        raise FaultsError([Fault("boxes.csv", 4, "width", "-1", "1 or more", "Correct it.")])
    return number


@pytest.mark.parametrize("make", [SerialExecutor, lambda: ThreadExecutor(2), lambda: ProcessExecutor(2)])
def test_an_error_of_ours_arrives_as_it_was_raised(make: Callable[[], Any]) -> None:
    with pytest.raises(FaultsError) as caught:
        list(make().run(fail, range(6), lost))
    assert str(caught.value).splitlines()[1].startswith("  boxes.csv, row 4, column width: found -1;")


class Counted:
    """Items that know how many of them were drawn."""

    def __init__(self, count: int) -> None:
        self.drawn = 0
        self._count = count

    def __iter__(self) -> Iterator[int]:
        for number in range(self._count):
            self.drawn += 1
            yield number


def most_in_flight(results: Iterator[int], items: Counted) -> tuple[list[int], int]:
    """The results, and how many items were at most drawn whose result had not been taken."""
    found: list[int] = []
    most = 0
    for result in results:
        most = max(most, items.drawn - len(found))
        found.append(result)
    return found, most


@pytest.mark.parametrize("make", [lambda: ThreadExecutor(2), lambda: ProcessExecutor(2)])
def test_few_items_are_drawn_before_their_time(make: Callable[[], Any]) -> None:
    items = Counted(2_000)
    found, most = most_in_flight(make().run(square, items, lost), items)
    assert sorted(found) == [number**2 for number in range(2_000)]
    assert most <= 2 + AHEAD


def test_killed_at_any_moment_nothing_is_lost_and_nothing_twice(tmp_path: Path) -> None:
    """SIGKILL to the whole run, again and again, a little later each time; then to the end."""
    (tmp_path / "run.toml").write_text("[frames]\ncount = 3\n[track2]\nqueries = 2\n")
    videos = tmp_path / "videos"
    videos.mkdir()
    for path in sorted((ROOT / "demo" / "videos").glob("*.mp4"))[:6]:
        (videos / path.name).symlink_to(path)
    boxes = ROOT / "demo" / "boxes.parquet"
    command = [sys.executable, "-m", "sitegen.cli", "predict", "--videos", str(videos), "--boxes", str(boxes)]
    command += ["--config", str(tmp_path / "run.toml"), "--out", str(tmp_path / "run"), "--workers", "2"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT}
    killed = 0
    for delay_s in (1.5, 3.0, 4.5, 6.0):
        with subprocess.Popen(command, start_new_session=True, **quiet) as run:
            time.sleep(delay_s)
            if run.poll() is None:
                os.killpg(run.pid, signal.SIGKILL)
                killed += 1
    assert killed
    subprocess.run(command, check=True, **quiet)
    undisturbed = [*command]
    undisturbed[undisturbed.index(str(tmp_path / "run"))] = str(tmp_path / "whole")
    subprocess.run(undisturbed, check=True, **quiet)
    for table in (STAGES, PREDICTIONS, OUTCOMES):
        one, other = (tmp_path / name / f"{table.name}.parquet" for name in ("run", "whole"))
        assert one.read_bytes() == other.read_bytes(), table.name
    assert len(OUTCOMES.read(tmp_path / "run" / "outcomes.parquet")) == 6
    assert not list((tmp_path / "run").glob("*.tmp"))
