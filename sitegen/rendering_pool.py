"""Many pages rendered by worker processes, in the order in which they are asked for."""

import multiprocessing
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from functools import partial
from itertools import chain, islice
from typing import TypeAlias

from pipeline.memory import collect_rarely
from sitegen.catalogues import read_language
from sitegen.language import speak
from sitegen.pages import Page
from sitegen.rendering import find_locale, render

FEW = 600
"""Up to so many pages are rendered here: starting workers takes as long."""
_BATCH = 16
_WAITING = 4  # batches a worker that are asked for ahead

Render: TypeAlias = Callable[[Page, str], bytes]
_Asked: TypeAlias = "tuple[list[Page], Future[list[bytes]] | None]"


def rendered(
    pages: Iterable[Page], address: str, language: str, jobs: int, here: Render = render
) -> Iterator[tuple[Page, bytes]]:
    """Each page with its bytes, in the order of the pages; `here` renders in this process.

    More than `FEW` pages are shared out to `jobs` processes, but for those that are made of all the data,
    of which no process gets a copy. An error names its page in a note.
    """
    rest = iter(pages)
    first = list(islice(rest, FEW + 1))
    if jobs < 2 or len(first) <= FEW:
        for page in chain(first, rest):
            yield page, _noted(page, address, here)
        return
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_start, initargs=(language,)) as pool:
        asked: deque[_Asked] = deque()
        try:
            for batch in _batches(chain(first, rest)):
                narrow = bool(batch[0].shows)
                asked.append((batch, pool.submit(_batch, batch, address) if narrow else None))
                if len(asked) > _WAITING * jobs:
                    yield from _done(*asked.popleft(), address, here)
            while asked:
                yield from _done(*asked.popleft(), address, here)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _batches(pages: Iterable[Page]) -> Iterator[list[Page]]:
    """The pages in their order, those made of little in batches, each of the others alone."""
    batch: list[Page] = []
    for page in pages:
        if batch and (len(batch) == _BATCH or not page.shows):
            yield batch
            batch = []
        if page.shows:
            batch.append(page)
        else:
            yield [page]
    if batch:
        yield batch


def _done(
    pages: Sequence[Page], future: "Future[list[bytes]] | None", address: str, here: Render
) -> Iterator[tuple[Page, bytes]]:
    made = future.result() if future else map(partial(_noted, address=address, how=here), pages)
    yield from zip(pages, made, strict=True)


def _noted(page: Page, address: str, how: Render) -> bytes:
    try:
        return how(page, address)
    except Exception as error:
        error.add_note(f"This happened in the page {page.path}.")
        raise


def _start(language: str) -> None:
    """In a worker: its pages are in this language."""
    collect_rarely()
    speak(read_language(language, find_locale()))


def _batch(pages: Sequence[Page], address: str) -> list[bytes]:
    return [_noted(page, address, render) for page in pages]
