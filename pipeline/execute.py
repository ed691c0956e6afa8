"""Runs one function over many items: one after the other, or in processes."""

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


class SerialExecutor:
    """In this process, in order."""

    def run(self, function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
        """The results, in the order of the items."""
        return map(function, items)


class ProcessExecutor:
    """In `workers` processes; `function` and the items must be picklable."""

    def __init__(self, workers: int) -> None:
        """`workers` >= 1."""
        self.workers = workers

    def run(self, function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
        """The results, each as soon as it is there."""
        # Spawned, not forked: onnxruntime's threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.workers, mp_context=context) as pool:
            futures = [pool.submit(function, item) for item in items]
            try:
                for future in as_completed(futures):
                    yield future.result()
            finally:
                for future in futures:
                    future.cancel()


def default_workers() -> int:
    """As many workers as this process may use cores."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
