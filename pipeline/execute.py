"""Runs one function over many items: in turn, in threads, in processes, or on a Ray cluster.

Results come as soon as they are there. When a worker dies, the items it had are run again; an item
that keeps killing its worker gets the result that `lost` gives, and the others go on.
"""

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from pipeline.errors import ConfigError

T = TypeVar("T")
R = TypeVar("R")

TRIES = 3
# Items handed out beyond those at work, so that no worker waits; few, so that little is lost.
AHEAD = 2


class SerialExecutor:
    """In this process, in order."""

    def run(self, function: Callable[[T], R], items: Iterable[T], lost: Callable[[T, str], R]) -> Iterator[R]:
        """The results, in the order of the items."""
        return map(function, items)


class ThreadExecutor:
    """In `workers` threads of this process: for agents that wait for servers."""

    def __init__(self, workers: int) -> None:
        """`workers` >= 1."""
        self.workers = workers

    def run(self, function: Callable[[T], R], items: Iterable[T], lost: Callable[[T, str], R]) -> Iterator[R]:
        """The results, each as soon as it is there."""
        with ThreadPoolExecutor(self.workers) as pool:
            for _, future in _bounded(pool, function, enumerate(items), self.workers + AHEAD):
                yield future.result()


class ProcessExecutor:
    """In `workers` processes; `function` and the items must be picklable."""

    def __init__(self, workers: int) -> None:
        """`workers` >= 1."""
        self.workers = workers

    def run(self, function: Callable[[T], R], items: Iterable[T], lost: Callable[[T, str], R]) -> Iterator[R]:
        """The results, each as soon as it is there."""
        left = dict(enumerate(items))
        while left:
            suspects: list[int] = []
            with _pool(self.workers) as pool:
                for place, future in _bounded(pool, function, left.items(), self.workers + AHEAD):
                    if isinstance(future.exception(), BrokenProcessPool):
                        suspects.append(place)
                        continue
                    del left[place]
                    yield future.result()
            # A worker died and took the others along: whose fault it was shows when each runs alone.
            for place in suspects:
                yield self._alone(function, left.pop(place), lost)

    def _alone(self, function: Callable[[T], R], item: T, lost: Callable[[T, str], R]) -> R:
        for _ in range(TRIES):
            with _pool(1) as pool:
                future = pool.submit(function, item)
                if not isinstance(future.exception(), BrokenProcessPool):
                    return future.result()
        return lost(item, f"its worker process died {TRIES + 1} times")


def _pool(workers: int) -> ProcessPoolExecutor:
    # Spawned, not forked: onnxruntime's threads do not survive a fork.
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


def _bounded(
    pool: Executor, function: Callable[[T], R], items: Iterable[tuple[int, T]], at_once: int
) -> Iterator[tuple[int, "Future[R]"]]:
    """(place, finished future) of the (place, item) pairs, at most `at_once` of them handed out.

    Stops handing out when the pool broke.
    """
    waiting: dict[Future[R], int] = {}
    source = iter(list(items))
    broken = False
    try:
        while True:
            while not broken and len(waiting) < at_once and (entry := next(source, None)) is not None:
                try:
                    waiting[pool.submit(function, entry[1])] = entry[0]
                except BrokenProcessPool:
                    broken = True
            if not waiting:
                return
            finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in sorted(finished, key=lambda one: waiting[one]):
                broken = broken or isinstance(future.exception(), BrokenProcessPool)
                yield waiting.pop(future), future
    finally:
        for future in waiting:
            future.cancel()


class RayExecutor:
    """On a Ray cluster: one task an item, lost tasks are run again by Ray."""

    def __init__(self, address: str | None = None) -> None:
        """`address` of a cluster, or None to start one on this machine.

        Raises ConfigError when Ray is not installed.
        """
        try:
            import ray
        except ImportError as error:
            raise ConfigError(
                "found no Ray; expected the package `ray`. Install it with: pip install 'coooler[ray]'"
            ) from error
        self._ray: Any = ray
        self._address = address

    def run(self, function: Callable[[T], R], items: Iterable[T], lost: Callable[[T, str], R]) -> Iterator[R]:
        """The results, each as soon as it is there."""
        ray = self._ray
        ours = not ray.is_initialized()
        if ours:
            ray.init(
                address=self._address,
                log_to_driver=False,
                logging_level="error",
                include_dashboard=None if self._address else False,
            )
        try:
            remote = ray.remote(max_retries=TRIES)(function)
            slots = max(1, int(ray.cluster_resources().get("CPU", 1)))
            source = iter(items)
            waiting: dict[Any, T] = {}
            while True:
                while len(waiting) < slots + AHEAD and (item := next(source, None)) is not None:
                    waiting[remote.remote(item)] = item
                if not waiting:
                    return
                finished, _ = ray.wait(list(waiting), num_returns=1)
                item = waiting.pop(finished[0])
                try:
                    result = ray.get(finished[0])
                except ray.exceptions.WorkerCrashedError:
                    result = lost(item, f"its worker died {TRIES + 1} times")
                yield result
        finally:
            if ours:
                ray.shutdown()


def default_workers() -> int:
    """As many workers as this process may use cores."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
