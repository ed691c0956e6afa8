"""The links from a page of many to the others: by number, with gaps, and to its neighbours."""

from collections.abc import Callable
from dataclasses import dataclass

from sitegen.language import whole
from sitegen.listing import numbers


@dataclass(frozen=True, slots=True)
class NumberLink:
    """A link to a page by its number; without `text` it stands for those left out."""

    text: str
    href: str
    here: bool


@dataclass(frozen=True, slots=True)
class Pager:
    """The numbers to choose from, none when there is one page; neighbours are empty at the ends."""

    numbers: tuple[NumberLink, ...]
    previous: str
    following: str


def pager(number: int, pages: int, href: Callable[[int], str]) -> Pager:
    """The links of page `number` of `pages`, both from 1."""
    links = tuple(
        NumberLink("", "", False) if one is None else NumberLink(whole(one), href(one), one == number)
        for one in numbers(number, pages)
    )
    return Pager(
        links if pages > 1 else (),
        href(number - 1) if number > 1 else "",
        href(number + 1) if number < pages else "",
    )
