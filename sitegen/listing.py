"""The lists of videos of a large benchmark: which pages there are, and what stands on each. Pure.

    videos.html, list/all-2.html, ...        all videos, by id
    list/missed.html, list/missed-2.html     those of one state; `partly`, `found`, `clear` likewise
    list/labels.html, list/labels-2.html     each label with its videos, by the label

A benchmark of at most PAGE videos has none of these but videos.html, which then holds everything.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

PAGE = 200
"""So many videos stand on a page."""

ALL, LABELS = "all", "labels"
FOLDER = "list"
_BESIDE = 2  # page numbers on either side of the page's own


@dataclass(frozen=True, slots=True)
class Group:
    """Videos that belong together, in order; `anchor` names them on their pages, none where it is empty."""

    title: str
    video_ids: tuple[str, ...]
    anchor: str = ""


@dataclass(frozen=True, slots=True)
class Listing:
    """Groups that follow each other over pages; none of them is empty."""

    name: str
    groups: tuple[Group, ...]

    @property
    def total(self) -> int:
        """How many videos are listed; one in two groups counts twice."""
        return sum(len(group.video_ids) for group in self.groups)

    @property
    def pages(self) -> int:
        """How many pages there are."""
        return -(-self.total // PAGE)


@dataclass(frozen=True, slots=True)
class Section:
    """The part of a group that stands on a page; `is_rest` when it began on one before."""

    group: Group
    video_ids: tuple[str, ...]
    is_rest: bool


@dataclass(frozen=True, slots=True)
class ListPage:
    """A page of a listing: its number from 1, the number of its first video from 1, and its sections."""

    listing: Listing
    number: int
    first: int
    sections: tuple[Section, ...]

    @property
    def video_ids(self) -> tuple[str, ...]:
        """The videos on the page, in order."""
        return tuple(video_id for section in self.sections for video_id in section.video_ids)

    @property
    def last(self) -> int:
        """The number of the last video."""
        return self.first + len(self.video_ids) - 1


def pages_of(listing: Listing) -> Iterator[ListPage]:
    """The pages in order: PAGE videos on each but the last, in the order of the groups."""
    sections: list[Section] = []
    held = done = 0
    for group in listing.groups:
        start = 0
        while start < len(group.video_ids):
            part = group.video_ids[start : start + PAGE - held]
            sections.append(Section(group, part, start > 0))
            start, held = start + len(part), held + len(part)
            if held == PAGE:
                yield ListPage(listing, done // PAGE + 1, done + 1, tuple(sections))
                done, held, sections = done + held, 0, []
    if sections:
        yield ListPage(listing, done // PAGE + 1, done + 1, tuple(sections))


def path_of(name: str, number: int = 1) -> str:
    """The path of a listing's page from the site's root."""
    if number == 1:
        return "videos.html" if name == ALL else f"{FOLDER}/{name}.html"
    return f"{FOLDER}/{name}-{number}.html"


def places_of(listing: Listing) -> Iterator[tuple[Group, str]]:
    """Each group with the path, and the place there, where it begins."""
    before = 0
    for group in listing.groups:
        path = path_of(listing.name, before // PAGE + 1)
        yield group, f"{path}#{group.anchor}" if group.anchor else path
        before += len(group.video_ids)


def numbers(number: int, pages: int) -> tuple[int | None, ...]:
    """The page numbers to link from one page: the first, the last, those around it; None is a gap.

    A gap stands for two pages at least.
    """
    wanted = sorted({1, pages, *range(max(1, number - _BESIDE), min(pages, number + _BESIDE) + 1)})
    found: list[int | None] = []
    for before, one in zip([0, *wanted], wanted, strict=False):
        if one - before > 2:
            found.append(None)
        elif one - before == 2:
            found.append(one - 1)
        found.append(one)
    return tuple(found)


def by_label(labels: Sequence[tuple[str, str]]) -> tuple[Group, ...]:
    """A group a label of (video id, label) pairs, by the label without case; a video once in each.

    A group has the spelling that comes first, and its videos in the order in which they come.
    """
    held: dict[str, tuple[str, dict[str, None]]] = {}
    for video_id, label in labels:
        held.setdefault(label.casefold(), (label, {}))[1][video_id] = None
    ordered = sorted(held.items())
    return tuple(
        Group(label, tuple(ids), f"label-{number}")
        for number, (_folded, (label, ids)) in enumerate(ordered, start=1)
    )
