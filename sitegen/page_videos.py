"""The pages of the lists of videos, and the data of their search, where one page cannot hold all.

    data/videos.js            what can be chosen, and where the shards begin; loaded with the first search
    data/videos/all/<k>.js    at most 100 videos: what their cards show and a search looks through

Each file calls `COOOLER_VIDEOS(name, value)`, where name is its path without `data/` and `.js`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from sitegen.charts import script_json
from sitegen.contexts import Link, Shell, VideoCard
from sitegen.data_shards import Shards
from sitegen.gathered import SiteData
from sitegen.language import N_, fixed, whole
from sitegen.language import gettext as _
from sitegen.listing import (
    ALL,
    LABELS,
    PAGE,
    Group,
    Listing,
    ListPage,
    by_label,
    pages_of,
    path_of,
    places_of,
)
from sitegen.numerals import plural
from sitegen.page_board import found_by, state_of, video_card
from sitegen.pager import Pager, pager
from sitegen.words import shorten, visible

INDEX_FILE = "data/videos.js"
SHOWN_LABELS, INDEXED_LABELS = 24, 500
"""So many labels, the most frequent, are linked from the first page of all videos, and of the labels."""

CHOSEN_LABELS = 300
"""So many labels, the most frequent, can be chosen for a search."""

LABEL_CHARS = 60
WORDS_CHARS, SHOWN_HAZARDS = 240, 8

STATES = {
    "missed": N_("missed by all"),
    "partly": N_("found by some"),
    "found": N_("found by all"),
    "clear": N_("without a hazard"),
}
_TITLES = {
    ALL: N_("Videos"),
    "missed": N_("Videos missed by all"),
    "partly": N_("Videos found by some"),
    "found": N_("Videos found by all"),
    "clear": N_("Videos without a hazard"),
    LABELS: N_("Videos by label"),
}
_SHARDS = Shards("COOOLER_VIDEOS", "videos")


@dataclass(frozen=True, slots=True)
class Counted:
    """A link to a list or a place in one, with the number of its videos; `here` on the list's own pages."""

    text: str
    href: str
    count: str
    here: bool = False


@dataclass(frozen=True, slots=True)
class CardSection:
    """Cards under a heading; without a heading when `title` is empty."""

    anchor: str
    title: str
    count: str
    cards: tuple[VideoCard, ...]


@dataclass(frozen=True, slots=True)
class VideoListPage:
    """A page of a list of videos; `state` is the state that all of its videos have, or empty."""

    shell: Shell
    hidden: bool
    title: str
    summary: str
    threshold: str
    state: str
    span: str
    lists: tuple[Counted, ...]
    labels: tuple[Counted, ...]
    all_labels: Link | None
    pager: Pager
    sections: tuple[CardSection, ...]


class MakesShell(Protocol):
    """Gives a page's shell by its title, description and way to the root."""

    def __call__(self, title: str, description: str, root: str) -> Shell: ...


def is_long(data: SiteData) -> bool:
    """Whether the videos need more pages than one."""
    return len(data.truth) > PAGE


def listings(data: SiteData) -> tuple[Listing, ...]:
    """All lists that are not empty, all videos first; there is no other when the truth is hidden."""
    ids = data.video_ids
    every = Listing(ALL, (Group("", ids),))
    if data.hidden:
        return (every,)
    states: dict[str, list[str]] = {state: [] for state in STATES}
    for video_id in ids:
        states[state_of(data, video_id)].append(video_id)
    shown = [state for state in STATES if states[state] and (data.systems or state == "clear")]
    of_states = [Listing(state, (Group("", tuple(states[state])),)) for state in shown]
    labelled = by_label([(video_id, label) for video_id in ids for label in labels_of(data, video_id)])
    return (every, *of_states, *([Listing(LABELS, labelled)] if labelled else []))


def labels_of(data: SiteData, video_id: str) -> tuple[str, ...]:
    """The labels of a video's hazards as they are shown; a hazard without one has none."""
    labels = (" ".join(visible(row.label).split()) for row in data.truth[video_id] if not row.is_no_hazard)
    return tuple(shorten(label, LABEL_CHARS) for label in labels if label)


def list_pages(data: SiteData, shell: MakesShell) -> Iterator[tuple[str, "partial[VideoListPage]"]]:
    """Every page of every list: its path, and how its context is made."""
    lists = listings(data)
    for listing in lists:
        for page in pages_of(listing):
            path = path_of(listing.name, page.number)
            yield path, partial(_list_page, data, lists, page, shell)


def _list_page(
    data: SiteData, lists: Sequence[Listing], page: ListPage, make_shell: MakesShell
) -> VideoListPage:
    listing = page.listing
    title = name = _(_TITLES[listing.name])
    if listing.pages > 1:
        title = _("{title}, page {n} of {pages}").format(
            title=name, n=whole(page.number), pages=whole(listing.pages)
        )
    span = span_of(page)
    path = path_of(listing.name, page.number)
    labels = next((one for one in lists if one.name == LABELS), None)
    shown = {ALL: SHOWN_LABELS, LABELS: INDEXED_LABELS}.get(listing.name, 0)
    places = list(places_of(labels)) if labels and shown and page.number == 1 else []
    often = set(sorted(range(len(places)), key=lambda place: -len(places[place][0].video_ids))[:shown])
    return VideoListPage(
        shell=make_shell(title, span, "../" if "/" in path else ""),
        hidden=data.hidden,
        title=name,
        summary=plural(len(data.truth), "{n} video", "{n} videos"),
        threshold=fixed(data.settings.threshold, 2),
        state=listing.name if listing.name in STATES else "",
        span=span,
        lists=tuple(_counted(one, listing) for one in lists) if len(lists) > 1 else (),
        labels=tuple(
            Counted(group.title, href, whole(len(group.video_ids)))
            for place, (group, href) in enumerate(places)
            if place in often
        ),
        all_labels=Link(_("All {n} labels").format(n=whole(len(places))), path_of(LABELS))
        if len(places) > SHOWN_LABELS and listing.name == ALL
        else None,
        pager=pager(page.number, listing.pages, partial(path_of, listing.name)),
        sections=tuple(
            CardSection(
                section.group.anchor,
                _("{label}, continued").format(label=section.group.title)
                if section.is_rest
                else section.group.title,
                plural(len(section.group.video_ids), "{n} video", "{n} videos")
                if section.group.title
                else "",
                tuple(video_card(data, video_id) for video_id in section.video_ids),
            )
            for section in page.sections
        ),
    )


def _counted(one: Listing, here: Listing) -> Counted:
    words = {ALL: _("all videos"), LABELS: _("by label")} | {state: _(text) for state, text in STATES.items()}
    return Counted(words[one.name], path_of(one.name), whole(one.total), one is here)


def span_of(page: ListPage) -> str:
    """Which of the videos stand on the page."""
    first, last = page.sections[0], page.sections[-1]
    ends = (
        (first.group.title, last.group.title)
        if page.listing.name == LABELS
        else (visible(first.video_ids[0]), visible(last.video_ids[-1]))
    )
    return _("Videos {first} to {last} of {total}: from {start} to {end}.").format(
        first=whole(page.first),
        last=whole(page.last),
        total=whole(page.listing.total),
        start=shorten(ends[0], LABEL_CHARS),
        end=shorten(ends[1], LABEL_CHARS),
    )


def list_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The data of the search: (path, content); none where one page holds all videos."""
    if not is_long(data):
        return
    groups = [] if data.hidden else [one for one in listings(data) if one.name == LABELS]
    often = sorted((group for one in groups for group in one.groups), key=lambda group: -len(group.video_ids))
    chosen = sorted(often[:CHOSEN_LABELS], key=lambda group: group.title.casefold())
    codes = {group.title.casefold(): code for code, group in enumerate(chosen, start=1)}
    ids = data.video_ids
    entries = [script_json(_entry(data, video_id, codes)) for video_id in ids]
    ends: list[int] = []
    yield from _SHARDS.cut("all", entries, range(len(ids)), ends)
    index = {
        "videos": len(ids),
        "ends": ends,
        "systems": len(data.systems),
        "states": [] if data.hidden else list(STATES),
        "labels": ["", *(group.title for group in chosen)],
    }
    yield INDEX_FILE, f'COOOLER_VIDEOS("videos",{script_json(index)});\n'.encode()


def _entry(data: SiteData, video_id: str, codes: dict[str, int]) -> list[Any]:
    """Path name, id where it differs, picture with its size, length; and, of the truth, what is below.

    Labels, descriptions, the labels' numbers, the state's number, how many found it, best score, passed.
    """
    card = video_card(data, video_id)
    name, shown = data.names[video_id], shorten(visible(video_id), 2 * LABEL_CHARS)
    size = [card.picture, card.picture_width, card.picture_height] if card.picture else 0
    entry: list[Any] = [name, 0 if shown == name else shown, size, card.length or 0]
    if data.hidden:
        return entry
    numbered = sorted(
        {codes[label.casefold()] for label in labels_of(data, video_id) if label.casefold() in codes}
    )
    words = [shorten(text, WORDS_CHARS) for text in card.descriptions[:SHOWN_HAZARDS]]
    return [
        *entry,
        shorten(card.labels, 4 * LABEL_CHARS),
        words if card.state != "clear" else 0,
        numbered,
        list(STATES).index(card.state),
        found_by(data, video_id),
        card.best.text if card.best else 0,
    ]
