"""The board over time, from the ledger: a step chart as SVG, with its words and its table."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import groupby

from sitegen.language import fixed, marked, ngettext, whole
from sitegen.language import gettext as _
from sitegen.ledger import Entry
from sitegen.numerals import number, plural
from sitegen.words import shorten, visible

SHOWN_LINES = 20
SHOWN_DAYS = 60
WIDTH, HEIGHT = 720.0, 200.0
_NAME_CHARS = 60


@dataclass(frozen=True, slots=True)
class Tick:
    """A grid line at `y` with its value."""

    y: str
    text: str


@dataclass(frozen=True, slots=True)
class Day:
    """What a day brought, and how the board stood at its end."""

    date: str
    best: str
    leader: str
    systems: str
    changes: str


@dataclass(frozen=True, slots=True)
class History:
    """The chart: SVG paths of the best BESM and of every system in a box of 720 x 200, and the days.

    With one day only `summary` is all there is.
    """

    summary: str
    lines: tuple[str, ...] = ()
    best: str = ""
    ticks: tuple[Tick, ...] = ()
    first: str = ""
    last: str = ""
    days: tuple[Day, ...] = ()
    days_left_out: str = ""


@dataclass(frozen=True, slots=True)
class _Standing:
    """The end of a day: slug -> (BESM, name), and what changed."""

    day: date
    board: dict[str, tuple[float, str]]
    changes: tuple[str, ...]


def history(entries: Sequence[Entry]) -> History | None:
    """The history that the ledger tells, oldest first; None when it holds no score at all."""
    days = _days(entries)
    if not any(one.board for one in days):
        return None
    if len(days) == 1:
        one = days[0]
        words = _(
            "Everything on this board came on {day}: {submissions}, {system} leads with BESM {besm}. From "
            "the second day on, a chart shows how it changes."
        )
        return History(
            words.format(
                day=one.day,
                submissions=plural(len(one.board), "{n} submission", "{n} submissions"),
                system=_leader(one),
                besm=fixed(_best(one), 4),
            )
        )
    first, last = next(one for one in days if one.board), days[-1]
    now = _("Now the board is empty.")
    if last.board:
        risen = _best(last) - _best(first)
        now = _("Now {system} leads with BESM {besm}. That is {difference} since {day}.").format(
            system=_leader(last),
            besm=fixed(_best(last), 4),
            difference=marked(f"{risen:+.4f}").replace("-", "−"),
            day=first.day,
        )
    changed = ngettext(
        "{n} day on which the board changed, {first} to {last}.",
        "{n} days on which the board changed, {first} to {last}.",
        len(days),
    )
    low, high = _range(days)
    slugs = sorted({slug for one in days for slug in one.board}, key=lambda slug: (-_peak(days, slug), slug))
    shown = [one for one in days if one.changes][-SHOWN_DAYS:]
    left = len(days) - len(shown)
    return History(
        summary=f"{changed.format(n=whole(len(days)), first=days[0].day, last=last.day)} {now}",
        lines=tuple(
            _path(days, [one.board[slug][0] if slug in one.board else None for one in days], low, high)
            for slug in slugs[:SHOWN_LINES]
        ),
        best=_path(days, [_best(one) if one.board else None for one in days], low, high),
        ticks=tuple(Tick(number(_y(value, low, high)), fixed(value, 2)) for value in _grid(low, high)),
        first=f"{days[0].day}",
        last=f"{last.day}",
        days=tuple(_day(one) for one in reversed(shown)),
        days_left_out=plural(left, "{n} earlier day left out.", "{n} earlier days left out.") if left else "",
    )


def _days(entries: Iterable[Entry]) -> list[_Standing]:
    """How the board stood at the end of each day of the ledger; lines without a day are left out."""
    board: dict[str, tuple[float, str]] = {}
    days = []
    for day, events in groupby((entry for entry in entries if _date(entry)), key=_date):
        changes = []
        for entry in events:
            name = shorten(visible(entry.name), _NAME_CHARS)
            if entry.event == "withdraw":
                board.pop(entry.slug, None)
                changes.append(_("{system} withdrawn").format(system=name))
            elif entry.besm is not None:
                board[entry.slug] = (entry.besm, name)
                changes.append(f"{name} {fixed(entry.besm, 4)}")
        assert day is not None
        days.append(_Standing(day, dict(board), tuple(changes)))
    return days


def _date(entry: Entry) -> date | None:
    try:
        return date.fromisoformat(entry.date)
    except ValueError:
        return None


def _best(one: _Standing) -> float:
    return max(besm for besm, _ in one.board.values())


def _leader(one: _Standing) -> str:
    return min(one.board.values(), key=lambda row: (-row[0], row[1]))[1]


def _peak(days: Sequence[_Standing], slug: str) -> float:
    return max(one.board[slug][0] for one in days if slug in one.board)


def _day(one: _Standing) -> Day:
    best, leader = (fixed(_best(one), 4), _leader(one)) if one.board else ("–", "–")
    return Day(f"{one.day}", best, leader, whole(len(one.board)), ", ".join(one.changes))


def _range(days: Sequence[_Standing]) -> tuple[float, float]:
    """Whole tenths around all scores, at least one tenth apart."""
    scores = [besm for one in days for besm, _ in one.board.values()]
    low, high = int(min(scores) * 10), int(max(scores) * 10 + 1 - 1e-9)
    return low / 10, max(high, low + 1) / 10


def _grid(low: float, high: float) -> list[float]:
    tenths = range(round(low * 10), round(high * 10) + 1)
    step = 1 if len(tenths) <= 5 else 2
    return [tenth / 10 for tenth in tenths[::step]]


def _y(value: float, low: float, high: float) -> float:
    return HEIGHT * (1 - (value - low) / (high - low))


def _path(days: Sequence[_Standing], values: Sequence[float | None], low: float, high: float) -> str:
    """Steps through the values; a gap where there is none. The last day has a little width of its own."""
    span = (days[-1].day - days[0].day).days * 1.04 or 1.0
    starts = [WIDTH * (one.day - days[0].day).days / span for one in days] + [WIDTH]
    parts: list[str] = []
    drawn = False
    for place, value in enumerate(values):
        if value is None:
            drawn = False
            continue
        y = number(_y(value, low, high))
        parts.append(f"V{y}" if drawn else f"M{number(starts[place])} {y}")
        parts.append(f"H{number(starts[place + 1])}")
        drawn = True
    return "".join(parts)
