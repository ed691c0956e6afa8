"""Executors: every item once, whatever happens to the workers."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.execute import ProcessExecutor, RayExecutor, SerialExecutor, ThreadExecutor
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


@pytest.fixture(scope="module")
def ray_executor() -> Any:
    """A Ray cluster of this machine's two cores, ours alone."""
    import ray

    # Its workers import this module.
    environment = {"env_vars": {"PYTHONPATH": str(ROOT)}}
    ray.init(
        num_cpus=2,
        include_dashboard=False,
        log_to_driver=False,
        logging_level="error",
        runtime_env=environment,
        object_store_memory=200 * 2**20,
    )
    yield RayExecutor()
    ray.shutdown()


@pytest.mark.parametrize("make", [SerialExecutor, lambda: ThreadExecutor(3), lambda: ProcessExecutor(2)])
def test_every_item_comes_back_once(make: Callable[[], Any]) -> None:
    assert sorted(make().run(square, range(20), lost)) == [n * n for n in range(20)]
    assert list(make().run(square, [], lost)) == []


def test_items_of_a_dead_worker_are_run_again(tmp_path: Path) -> None:
    jobs = [(tmp_path, number) for number in range(8)]
    assert sorted(ProcessExecutor(2).run(die_once, jobs, lost)) == list(range(8))


def test_an_item_that_always_kills_its_worker_is_given_up_alone() -> None:
    assert sorted(ProcessExecutor(2).run(die_always, range(6), lost)) == [-1, 0, 1, 2, 4, 5]


def test_ray_runs_every_item_and_what_a_dead_worker_had(ray_executor: RayExecutor, tmp_path: Path) -> None:
    assert sorted(ray_executor.run(square, range(20), lost)) == [n * n for n in range(20)]
    jobs = [(tmp_path, number) for number in range(8)]
    assert sorted(ray_executor.run(die_once, jobs, lost)) == list(range(8))


def test_ray_writes_the_bytes_that_one_process_writes(ray_executor: RayExecutor, tmp_path: Path) -> None:
    from pipeline.config import FrameSettings, RunConfig, Track2Settings
    from pipeline.places import Place
    from pipeline.run import RUN_TABLES, find_videos, predict
    from pipeline.tables import BOXES

    config = RunConfig(frames=FrameSettings(count=3), track2=Track2Settings(queries=2))
    clips = find_videos(Place(str(ROOT / "demo" / "videos")))[:3]
    boxes = BOXES.read(ROOT / "demo" / "boxes.parquet")
    for name, executor in (("ray", ray_executor), ("serial", SerialExecutor())):
        predict(clips, boxes, config, Place(str(tmp_path / name)), executor)
    for table in RUN_TABLES:
        one, other = (tmp_path / name / f"{table.name}.parquet" for name in ("ray", "serial"))
        assert one.read_bytes() == other.read_bytes(), table.name


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
