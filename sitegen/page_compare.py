"""The compare page as it reads without scripts: all systems against the first, and who solves what."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sitegen.compare import Comparison
from sitegen.compare_files import INDEX_FILE, short_name, shown_name, tested, tests, video_href
from sitegen.contexts import Link, Shell
from sitegen.gathered import SiteData, System
from sitegen.language import fixed, whole
from sitegen.language import gettext as _
from sitegen.numerals import Score, plural, rate
from sitegen.paired import RESAMPLES
from sitegen.score import Index, Mask
from sitegen.uncertainty import SIGNIFICANT
from sitegen.words import visible

SHOWN_VIDEOS = 6
SHOWN_SETS = 12


@dataclass(frozen=True, slots=True)
class Contender:
    """A system against the first-ranked one by BESM; `apart` says whether the two can be told apart."""

    slug: str
    name: str
    besm: str
    difference: str
    interval: str
    p: str
    apart: str
    better: str
    worse: str
    equal: str


@dataclass(frozen=True, slots=True)
class Solved:
    """Videos that the same number of systems, or exactly the same systems, detect."""

    name: str
    videos: int
    share: Score
    links: tuple[Link, ...]
    more: int


@dataclass(frozen=True, slots=True)
class SolvedCell:
    """How many videos the row's system detects and the column's does not; `level` is 0 to 10."""

    videos: int
    level: int


@dataclass(frozen=True, slots=True)
class SolvedRow:
    """A system: the videos it detects, those that only it detects, a cell for each system (itself: None)."""

    slug: str
    name: str
    detected: int
    alone: int
    cells: tuple[SolvedCell | None, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """A system to choose; `chosen` marks those that are counted from the start."""

    slug: str
    name: str
    chosen: bool


@dataclass(frozen=True, slots=True)
class ComparePage:
    """compare.html; with fewer than two systems everything but the shell is empty.

    `left_out` says which systems are not tested, `sets_left_out` how many sets of systems the table
    does not show; both may be empty.
    """

    shell: Shell
    index_file: str
    videos: str
    resamples: str
    systems: tuple[Choice, ...]
    first: Choice | None
    first_besm: str
    contenders: tuple[Contender, ...]
    left_out: str
    counts: tuple[Solved, ...]
    sets: tuple[Solved, ...]
    sets_left_out: str
    matrix: tuple[SolvedRow, ...]


def compare_page(data: SiteData, shell: Shell) -> ComparePage:
    """The context of compare.html."""
    if len(data.systems) < 2:
        return ComparePage(shell, "", "", "", (), None, "", (), "", (), (), "", ())
    chosen = tested(data)
    systems = tuple(Choice(s.slug, shown_name(s), s in chosen) for s in data.systems)
    rest = len(data.systems) - len(chosen)
    best_of = _("the {n} best of {total} systems").format(n=len(chosen), total=len(data.systems))
    left_out = best_of if rest else ""
    found = np.array([[s.scores[video_id].detected for video_id in data.video_ids] for s in chosen])
    sets, more = _sets(data, chosen, found)
    return ComparePage(
        shell=shell,
        index_file=INDEX_FILE,
        videos=plural(len(data.truth), "{n} video", "{n} videos"),
        resamples=whole(RESAMPLES),
        systems=systems,
        first=systems[0],
        first_besm=fixed(chosen[0].evaluation.card.besm, 4),
        contenders=tuple(
            _contender(system, tests(chosen)[place, 0]["besm"])
            for place, system in enumerate(chosen)
            if place
        ),
        left_out=left_out,
        counts=_counts(data, found),
        sets=sets,
        sets_left_out=plural(more, "{n} more set", "{n} more sets") if more else "",
        matrix=_matrix(chosen, found),
    )


def signed(value: float) -> str:
    """A difference to four digits with its sign; none for what rounds to zero."""
    size = fixed(abs(value), 4)
    if round(abs(value), 4) == 0:
        return size
    return f"{'+' if value > 0 else '−'}{size}"


def p_text(p: float) -> str:
    """A p-value to three digits."""
    return f"< {fixed(0.001, 3)}" if p < 0.001 else fixed(p, 3)


def _contender(system: System, found: Comparison) -> Contender:
    ends = found.interval
    return Contender(
        slug=system.slug,
        name=shown_name(system),
        besm=fixed(found.a, 4),
        difference=signed(found.difference),
        interval=_("{low} to {high}").format(low=signed(ends.low), high=signed(ends.high)),
        p=p_text(found.p_randomisation),
        apart=_("yes") if found.p_randomisation < SIGNIFICANT else _("no"),
        better=whole(found.wins),
        worse=whole(found.losses),
        equal=whole(found.ties),
    )


def _counts(data: SiteData, found: Mask) -> tuple[Solved, ...]:
    """A row for each number of systems, from all down to none; `found` (S, N) says who detects what."""
    n_systems = len(found)
    by: Index = found.sum(axis=0)
    rows = []
    for number in range(n_systems, -1, -1):
        name = _("{n} of {total}") if number else _("none")
        name = (_("all {total}") if number == n_systems else name).format(n=number, total=n_systems)
        rows.append(_solved(data, name, np.flatnonzero(by == number)))
    return tuple(rows)


def _sets(data: SiteData, systems: Sequence[System], found: Mask) -> tuple[tuple[Solved, ...], int]:
    """The sets of systems, not empty, that detect most videos together; how many sets are left out."""
    columns = Counter(tuple(np.flatnonzero(column).tolist()) for column in found.T)
    ordered = sorted((places for places in columns if places), key=lambda p: (-columns[p], len(p), p))
    rows = []
    for places in ordered[:SHOWN_SETS]:
        wanted = np.isin(np.arange(len(found)), places)
        videos = np.flatnonzero((found == wanted[:, np.newaxis]).all(axis=0))
        name = " · ".join(short_name(systems[place]) for place in places)
        rows.append(_solved(data, name, videos))
    return tuple(rows), len(ordered) - len(rows)


def _solved(data: SiteData, name: str, places: Index) -> Solved:
    ids = data.video_ids
    shown = [ids[place] for place in places[:SHOWN_VIDEOS]]
    links = tuple(Link(visible(video_id), video_href(data, video_id)) for video_id in shown)
    return Solved(name, len(places), rate(len(places) / len(data.truth)), links, len(places) - len(links))


def _matrix(systems: Sequence[System], found: Mask) -> tuple[SolvedRow, ...]:
    counts = found.astype(np.int64)
    ahead = counts @ (1 - counts).T
    alone = (counts * (counts.sum(axis=0) == 1)).sum(axis=1)
    rows = []
    for place, system in enumerate(systems):
        numbers = ahead[place].tolist()
        cells = [
            None if other == place else SolvedCell(number, rate(number / counts.shape[1]).level)
            for other, number in enumerate(numbers)
        ]
        detected = int(counts[place].sum())
        rows.append(SolvedRow(system.slug, short_name(system), detected, int(alone[place]), tuple(cells)))
    return tuple(rows)
