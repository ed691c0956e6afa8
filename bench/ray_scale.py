"""What Ray costs: 10,000 tiny tasks, large results through a small object store, and starting it.

Nothing is done in a task, so that what is measured is what handing it out costs. The floors are
ProcessPoolExecutor and Ray itself, bare, with as many tasks in flight.
"""

import statistics
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from functools import partial
from itertools import islice
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.timing import Measure
from pipeline.execute import AHEAD, ProcessExecutor, RayExecutor

TASKS = 10_000
ROUNDS = 5
WORKERS = 2
STORE_BYTES = 80 * 2**20  # Ray takes no less
LARGE = 400  # results of 1 MiB: five times what the store holds


def nothing(number: int) -> int:
    """A task that is done at once."""
    return number


def mebibyte(number: int) -> NDArray[np.uint8]:
    """A result that goes through the object store."""
    return np.full(2**20, number % 256, np.uint8)


def _lost(number: int, why: str) -> int:
    raise AssertionError(why)


def bare_pool(tasks: int) -> int:
    """How many results ProcessPoolExecutor gives, as many in flight as ours; started here, as ours is."""
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        source = iter(range(tasks))
        waiting: set[Future[int]] = set()
        count = 0
        while True:
            new = islice(source, WORKERS + AHEAD - len(waiting))
            waiting |= {pool.submit(nothing, number) for number in new}
            if not waiting:
                return count
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            count += len([future.result() for future in finished])


def bare_ray(tasks: int) -> int:
    """How many results Ray gives, as many in flight as ours."""
    import ray

    remote = ray.remote(nothing)
    source = iter(range(tasks))
    waiting: list[Any] = []
    count = 0
    while True:
        waiting += [remote.remote(number) for number in islice(source, 2 * WORKERS + AHEAD - len(waiting))]
        if not waiting:
            return count
        finished, waiting = ray.wait(waiting)
        count += len(ray.get(finished))


@contextmanager
def least_free() -> Iterator[list[float]]:
    """The object store's size, then what was free in it every 20 ms, in bytes."""
    import ray

    seen = [ray.cluster_resources()["object_store_memory"]]
    done = threading.Event()

    def watch() -> None:
        while not done.wait(0.02):
            seen.append(ray.available_resources().get("object_store_memory", 0.0))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield seen
    finally:
        done.set()
        watcher.join()


def _start_ray() -> None:
    import ray

    ray.init(
        num_cpus=WORKERS,
        include_dashboard=False,
        log_to_driver=False,
        logging_level="error",
        object_store_memory=STORE_BYTES,
    )


def _seconds(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def measure() -> list[Measure]:
    """Four rows. The rounds share the tasks: 2,000 each, in turns, after one of 100 that warms up."""
    import ray

    started_s = _seconds(_start_ray)
    on_ray, in_pool = RayExecutor(), ProcessExecutor(WORKERS)
    first_s = _seconds(lambda: list(on_ray.run(nothing, range(WORKERS), _lost)))
    kinds: dict[str, Callable[[int], object]] = {
        "ray": lambda tasks: list(on_ray.run(nothing, range(tasks), _lost)),
        "bare ray": bare_ray,
        "processes": lambda tasks: list(in_pool.run(nothing, range(tasks), _lost)),
        "bare pool": bare_pool,
    }
    times: dict[str, list[float]] = {name: [] for name in kinds}
    starts: dict[str, list[float]] = {name: [] for name in kinds}
    for _ in range(ROUNDS):
        for name, run in kinds.items():
            # What starts at each run is measured by a run of two tasks, and taken off.
            starts[name].append(_seconds(partial(run, WORKERS)))
            times[name].append(_seconds(partial(run, TASKS // ROUNDS)))
    with least_free() as seen:
        large_s = _seconds(lambda: list(on_ray.run(mebibyte, range(LARGE), _lost)))
    ray.shutdown()
    start = {name: statistics.median(values) for name, values in starts.items()}
    whole = {name: (statistics.median(values) - start[name]) * ROUNDS for name, values in times.items()}
    each = {name: f"{seconds / TASKS * 1e6:.0f} us a task" for name, seconds in whole.items()}
    what = f"{TASKS:,} tiny tasks, {WORKERS} workers"
    note = f"{each['ray']}, {each['bare ray']}; {whole['ray'] / whole['processes']:.1f} times the processes'"
    peak = (seen[0] - min(seen)) / 2**20
    return [
        Measure(f"{what}, Ray", whole["ray"], "bare Ray", whole["bare ray"], "at most 1.3", note),
        Measure(
            f"{what}, processes",
            whole["processes"],
            "bare ProcessPoolExecutor",
            whole["bare pool"],
            "at most 1.3",
            f"{each['processes']}, {each['bare pool']}; as many in flight",
        ),
        Measure(
            "starting Ray on this machine, to the first results",
            started_s + first_s,
            f"starting {WORKERS} processes, to the first results",
            start["processes"],
            "",
            f"once: cluster {started_s:.1f} s, first worker {first_s:.1f} s",
        ),
        Measure(
            f"{LARGE} results of 1 MiB through Ray, all kept by the caller",
            large_s,
            "",
            None,
            f"peak at most {4 * (2 * WORKERS + AHEAD)} MiB",
            f"once: object store of {STORE_BYTES >> 20} MiB, peak {peak:.0f} MiB",
        ),
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, one.ratio)
