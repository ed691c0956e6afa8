"""Runs one function over many items: in turn, in threads, in processes, or on a Ray cluster.

Results come as soon as they are there. When a worker dies, the items it had are run again; an item
that keeps killing its worker gets the result that `lost` gives, and the others go on. Items are
drawn as workers become free, and neither they nor results are kept: ten thousand need no more
memory than ten.
"""

import copy
import multiprocessing
import os
import re
import socket
import threading
import time
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
from itertools import islice
from typing import Any, TypeVar

from pipeline.errors import ConfigError, OutsideError

T = TypeVar("T")
R = TypeVar("R")

TRIES = 3
# Items handed out beyond those at work, so that no worker waits; few, so that little is lost.
AHEAD = 2
# How often a Ray cluster is asked for its size, which changes as nodes come and go.
LOOK_EVERY_S = 5.0
# How long the head node of a cluster may take to answer.
KNOCK_S = 5.0


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
            for _, future in _bounded(pool, function, iter(items), self.workers + AHEAD):
                yield future.result()


class ProcessExecutor:
    """In `workers` processes; `function` and the items must be picklable."""

    def __init__(self, workers: int) -> None:
        """`workers` >= 1."""
        self.workers = workers

    def run(self, function: Callable[[T], R], items: Iterable[T], lost: Callable[[T, str], R]) -> Iterator[R]:
        """The results, each as soon as it is there."""
        source = iter(items)
        while True:
            suspects: list[T] = []
            with _pool(self.workers) as pool:
                for item, future in _bounded(pool, function, source, self.workers + AHEAD):
                    if isinstance(future.exception(), BrokenProcessPool):
                        suspects.append(item)
                    else:
                        yield future.result()
            if not suspects:
                return
            # A worker died and took the others along: whose fault it was shows when each runs alone.
            for item in suspects:
                yield self._alone(function, item, lost)

    def _alone(self, function: Callable[[T], R], item: T, lost: Callable[[T, str], R]) -> R:
        for _ in range(TRIES):
            with _pool(1) as pool:
                future = pool.submit(function, item)
                if not isinstance(future.exception(), BrokenProcessPool):
                    return future.result()
        return lost(item, f"its worker process died {TRIES + 1} times")


def _pool(workers: int) -> ProcessPoolExecutor:
    # Spawned, not forked: onnxruntime's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent)


def _end_with_parent() -> None:
    """Let this worker end when its parent was killed: it would wait for work for ever."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _bounded(
    pool: Executor, function: Callable[[T], R], source: Iterator[T], at_once: int
) -> Iterator[tuple[T, "Future[R]"]]:
    """(item, finished future) of the items, at most `at_once` of them handed out.

    Draws no more items when the pool broke.
    """
    waiting: dict[Future[R], T] = {}
    broken = False
    try:
        while True:
            for item in islice(source, 0 if broken else at_once - len(waiting)):
                try:
                    future = pool.submit(function, item)
                except BrokenProcessPool as error:
                    future = Future()
                    future.set_exception(error)
                waiting[future] = item
            if not waiting:
                return
            finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
            broken = broken or any(isinstance(one.exception(), BrokenProcessPool) for one in finished)
            while finished:
                future = finished.pop()
                yield waiting.pop(future), future
    finally:
        for future in waiting:
            future.cancel()


class RayExecutor:
    """On a Ray cluster, one task an item; Ray runs what a dead worker or node had again."""

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
        """The results, each as soon as it is there.

        Raises OutsideError when the cluster cannot be reached or is lost.
        """

        def answer(item: T) -> R:  # Ray takes no other callable than a function
            return function(item)

        ray = self._ray
        ours = not ray.is_initialized()
        if ours:
            self._connect()
        waiting: dict[Any, T] = {}
        try:
            remote = ray.remote(max_retries=TRIES)(answer)
            source = iter(items)
            at_once, look_at_s = 0, 0.0
            while True:
                if time.monotonic() >= look_at_s:
                    look_at_s = time.monotonic() + LOOK_EVERY_S
                    # One at work and one at the door for each core: asking for the next takes a while.
                    at_once = 2 * int(ray.cluster_resources().get("CPU", 0)) + AHEAD
                for item in islice(source, max(0, at_once - len(waiting))):
                    waiting[remote.remote(item)] = item
                if not waiting:
                    return
                ray.wait(list(waiting))
                ready, _ = ray.wait(list(waiting), num_returns=len(waiting), timeout=0)
                while ready:
                    reference = ready.pop()
                    yield self._result(reference, waiting.pop(reference), lost)
        finally:
            if ours:
                ray.shutdown()
            else:
                for reference in waiting:
                    ray.cancel(reference, force=True)

    def _connect(self) -> None:
        ray = self._ray
        named = re.fullmatch(r"(?:ray://)?\[?([^/]+?)\]?:(\d+)", self._address or "")
        try:
            if named:  # where nobody listens, Ray itself tries for minutes and then ends the process
                socket.create_connection((named[1], int(named[2])), KNOCK_S).close()
            ray.init(
                address=self._address,
                log_to_driver=False,
                logging_level="error",
                include_dashboard=None if self._address else False,
            )
        except (OSError, OverflowError, RuntimeError, ValueError, ray.exceptions.RayError) as error:
            where = self._address or "this machine"
            raise OutsideError(
                f"found no usable Ray cluster at {where} ({str(error)[:200]}); expected one "
                "with this Python and this Ray. Check --address, and `ray status` on its head node."
            ) from error

    def _result(self, reference: Any, item: T, lost: Callable[[T, str], R]) -> R:
        failures = self._ray.exceptions
        try:
            # An array of it is a view into the object store, which would fill up: keep a copy.
            result: R = copy.deepcopy(self._ray.get(reference))
        except failures.RayTaskError as error:
            raise error.cause from None
        except (
            failures.WorkerCrashedError,
            failures.NodeDiedError,
            failures.OutOfMemoryError,
            failures.ObjectLostError,
        ) as error:
            return lost(item, f"its worker or its node died {TRIES + 1} times ({type(error).__name__})")
        except failures.RayError as error:
            raise OutsideError(
                f"Ray failed ({type(error).__name__}: {str(error).splitlines()[0][:200]}); expected one "
                "that stays up. Run the command again: it goes on where it stopped."
            ) from error
        return result


def default_workers() -> int:
    """As many workers as this process may use cores."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
