"""How often Python looks for garbage that refers to itself."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

NEW_OBJECTS = 100_000
"""So many more objects made than freed start a search (ours; Python's own number is 700)."""


def collect_rarely() -> None:
    """Search rarely from now on: for a process that works through many objects and then ends.

    Contexts of pages and rows of tables are trees, freed without a search; a search after every 700 of
    them takes a tenth of the time that it takes to render pages.
    """
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])


@contextmanager
def collected_rarely() -> Iterator[None]:
    """`collect_rarely` for a while; how often was searched before is how often is searched after."""
    before = gc.get_threshold()
    collect_rarely()
    try:
        yield
    finally:
        gc.set_threshold(*before)
