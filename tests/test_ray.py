"""Ray: a cluster of several nodes on this machine, and what it does when one of them dies."""

import os
import signal
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.errors import Fault, FaultsError, OutsideError
from pipeline.execute import AHEAD, RayExecutor, SerialExecutor
from tests.test_execute import ROOT, Counted, die_always, die_once, fail, lost, most_in_flight, square

STORE_BYTES = 80 * 2**20  # Ray takes no less
CORES = 2


@pytest.fixture(scope="module")
def spilled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the cluster's nodes put what their object stores cannot hold."""
    return tmp_path_factory.mktemp("spilled")


@pytest.fixture(scope="module")
def cluster(spilled: Path) -> Iterator[Any]:
    """Two nodes with one core each and small object stores, ours alone."""
    import ray
    from ray.cluster_utils import Cluster

    node = {"num_cpus": 1, "object_store_memory": STORE_BYTES, "object_spilling_directory": str(spilled)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))  # the workers import this module
        made = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
        made.add_node(**node)
        ray.init(address=made.address, log_to_driver=False, logging_level="error")
        made.node = node
        yield made
        ray.shutdown()
        made.shutdown()


@pytest.fixture
def executor(cluster: Any) -> RayExecutor:
    """On that cluster."""
    return RayExecutor(cluster.address)


def test_many_tiny_items_come_back_once_and_few_are_drawn_before_their_time(executor: RayExecutor) -> None:
    items = Counted(2_500)
    found, most = most_in_flight(executor.run(square, items, lost), items)
    assert sorted(found) == [number**2 for number in range(2_500)]
    assert most <= 2 * CORES + AHEAD


def test_what_a_dead_worker_had_is_run_again(executor: RayExecutor, tmp_path: Path) -> None:
    jobs = [(tmp_path, number) for number in range(8)]
    assert sorted(executor.run(die_once, jobs, lost)) == list(range(8))


def test_an_item_that_always_kills_its_worker_is_given_up_alone(executor: RayExecutor) -> None:
    assert sorted(executor.run(die_always, range(6), lost)) == [-1, 0, 1, 2, 4, 5]


def test_an_error_of_ours_arrives_as_it_was_raised(executor: RayExecutor) -> None:
    with pytest.raises(FaultsError) as caught:
        list(executor.run(fail, range(6), lost))
    assert caught.value.faults == (Fault("boxes.csv", 4, "width", "-1", "1 or more", "Correct it."),)
    assert len(str(caught.value).splitlines()) == 2


def megabyte(number: int) -> NDArray[np.uint8]:
    return np.full(2**20, number % 256, np.uint8)


def test_large_results_flow_through_a_small_object_store(executor: RayExecutor, spilled: Path) -> None:
    """More than the stores hold, all of it kept by the caller, and nothing goes to disk."""
    import ray

    whole = ray.cluster_resources()["object_store_memory"]
    least = whole
    done = threading.Event()

    def watch() -> None:
        nonlocal least
        while not done.wait(0.1):
            least = min(least, ray.available_resources().get("object_store_memory", 0.0))

    watcher = threading.Thread(target=watch)
    watcher.start()
    kept = list(executor.run(megabyte, range(250), lost))
    done.set()
    watcher.join()
    assert sorted(int(array[-1]) for array in kept) == sorted(range(250))
    assert all(array.flags.writeable for array in kept)
    # Those in flight, and as many again that Ray has not yet let go of; the rest is the caller's.
    assert whole - least <= 4 * (2 * CORES + AHEAD) * 2**20
    assert not [path for path in spilled.rglob("*") if path.is_file()]


def test_a_node_that_dies_in_the_middle_changes_no_byte(
    executor: RayExecutor, cluster: Any, tmp_path: Path
) -> None:
    from pipeline.config import FrameSettings, RunConfig, Track2Settings
    from pipeline.places import Place
    from pipeline.run import RUN_TABLES, VideoRun, find_videos, predict
    from pipeline.tables import BOXES

    config = RunConfig(frames=FrameSettings(count=3), track2=Track2Settings(queries=2))
    clips = find_videos(Place(str(ROOT / "demo" / "videos")))[:9]
    boxes = BOXES.read(ROOT / "demo" / "boxes.parquet")
    node = cluster.add_node(**cluster.node)
    done: list[str] = []

    def kill_one(run: VideoRun) -> None:
        done.append(run.video_id)
        if len(done) == 3:
            cluster.remove_node(node, allow_graceful=False)

    predict(clips, boxes, config, Place(str(tmp_path / "ray")), executor, done=kill_one)
    assert len(done) == len(set(done)) == len(clips)
    predict(clips, boxes, config, Place(str(tmp_path / "serial")), SerialExecutor())
    for table in RUN_TABLES:
        one, other = (tmp_path / name / f"{table.name}.parquet" for name in ("ray", "serial"))
        assert one.read_bytes() == other.read_bytes(), table.name


def note_and_wait(folder: Path) -> None:
    (folder / str(os.getpid())).touch()
    signal.pause()


def test_what_is_at_work_ends_with_a_caller_that_wants_no_more(executor: RayExecutor, tmp_path: Path) -> None:
    """One item a core waits for ever; the caller is interrupted, as by Ctrl-C."""

    class Interrupted(Iterator[Path]):
        """Gives out one item a core, and interrupts when both are at work."""

        given = 0

        def __next__(self) -> Path:
            if self.given == CORES:
                while len(list(tmp_path.iterdir())) < CORES:
                    threading.Event().wait(0.05)
                raise KeyboardInterrupt
            self.given += 1
            return tmp_path

    with pytest.raises(KeyboardInterrupt):
        list(executor.run(note_and_wait, Interrupted(), lambda item, why: None))
    # Both cores are free again for others.
    assert sorted(executor.run(square, range(4), lost)) == [0, 1, 4, 9]


def test_an_address_where_nobody_listens_is_said_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    import ray

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    with pytest.raises(OutsideError, match=r"found no usable Ray cluster at 127\.0\.0\.1:\d+ .*--address"):
        list(RayExecutor(address).run(square, range(3), lost))
