"""The pages of `coooler data annotate`: what their templates are given, and the HTML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from sitegen.annotate_desk import Desk, VideoState
from sitegen.annotate_truth import Standing
from sitegen.language import fixed
from sitegen.numerals import percent
from sitegen.rendering import environment
from sitegen.words import visible

if TYPE_CHECKING:
    from sitegen.agreement import PairAgreement, VideoAgreement

_MINE = {"todo": "to do", "unfinished": "unfinished", "done": "done"}
_STATES: Mapping[Standing, str] = {
    "none": "nothing yet",
    "imported": "as it began",
    "one": "one annotator",
    "agree": "all agree",
    "differ": "awaits a merge",
    "merged": "merged",
    "changed": "changed since the merge",
}
_OPEN = frozenset({"differ", "changed"})
"""The states that a merge would settle."""


@dataclass(frozen=True, slots=True)
class PageShell:
    """What surrounds each page; `key` keeps the drafts of benchmarks apart in a browser's storage."""

    title: str
    section: str = ""
    author: str = ""
    key: str = ""


@dataclass(frozen=True, slots=True)
class Way:
    """A link: where it leads, and its text."""

    href: str
    text: str


@dataclass(frozen=True, slots=True)
class ListRow:
    """A video of the list; `tags` are the choices of the filter that show it, parted by blanks."""

    video_id: str
    href: str
    mine: str
    mine_text: str
    others: int
    state_text: str
    hazards: str
    merge_href: str
    is_open: bool
    tags: str


@dataclass(frozen=True, slots=True)
class ListPage:
    """All videos; an address of what is next is empty when nothing is."""

    name: str
    truth: str
    done: int
    todo: int
    merges: int
    next_todo: str
    next_merge: str
    choices: Sequence[tuple[str, str]]
    rows: Sequence[ListRow]


@dataclass(frozen=True, slots=True)
class EditorPage:
    """One video, to annotate or to merge; `todo` is the address of the next that needs it, or empty."""

    video_id: str
    merge: bool
    place: int
    count: int
    before: Way | None
    after: Way | None
    todo: str
    is_changed: bool
    other_view: Way | None


@dataclass(frozen=True, slots=True)
class DisputeRow:
    """One video of a pair, its measures as text."""

    video_id: str
    href: str
    verdict: str
    hazards: str
    cosine: str
    label: str
    track: str


@dataclass(frozen=True, slots=True)
class PairPart:
    """Two annotators: their measures as (title, text), and their videos."""

    first: str
    second: str
    count: str
    figures: Sequence[tuple[str, str]]
    rows: Sequence[DisputeRow]


@dataclass(frozen=True, slots=True)
class AgreementPage:
    """All pairs; `problem` says why cosines are missing, or is empty."""

    pairs: Sequence[PairPart]
    problem: str


@dataclass(frozen=True, slots=True)
class AskPage:
    """The question for a name, with what was typed before and what was wrong with it."""

    name: str
    value: str
    problem: str
    known: Sequence[str]


@dataclass(frozen=True, slots=True)
class ErrorPage:
    """What went wrong, and how to mend it."""

    title: str
    message: str


def list_page(desk: Desk, author: str) -> bytes:
    """All videos with what `author` and the others made of them."""
    states = desk.overview(author)
    merges = sum(state.state in _OPEN for state in states)
    done = sum(state.mine == "done" for state in states)
    page = ListPage(
        name=visible(desk.name),
        truth=f"{desk.rows} row{'s' if desk.rows != 1 else ''} in {visible(desk.out.name)}",
        done=done,
        todo=len(states) - done,
        merges=merges,
        next_todo=_next(states, -1, merge=False),
        next_merge=_next(states, -1, merge=True),
        choices=[
            *((name, f"you: {text}") for name, text in _MINE.items()),
            *((name, f"truth: {text}") for name, text in _STATES.items()),
        ],
        rows=[_row(state) for state in states],
    )
    return _render("list", page, PageShell(page.name, "videos", author, desk.key))


def video_page(desk: Desk, video_id: str, author: str, merge: bool) -> bytes:
    """The editor of one video of the desk; its content comes by the API."""
    states = desk.overview(author)
    place = [state.video_id for state in states].index(video_id)
    state = states[place]
    other_view = None
    if merge:
        other_view = Way(_href(video_id), "What you said of it yourself")
    elif state.state in {"agree", "differ", "merged", "changed"}:
        other_view = Way(_href(video_id, merge=True), "Compare and merge what all said of it")
    page = EditorPage(
        video_id=video_id,
        merge=merge,
        place=place + 1,
        count=len(states),
        before=_way(states[place - 1], merge) if place else None,
        after=_way(states[place + 1], merge) if place + 1 < len(states) else None,
        todo=_next(states, place, merge),
        is_changed=state.state == "changed",
        other_view=other_view,
    )
    title = f"Merge {video_id}" if merge else video_id
    return _render("video", page, PageShell(title, "videos", author, desk.key))


def agreement_page(desk: Desk, author: str) -> bytes:
    """How far each pair of annotators agrees, the most disputed videos first."""
    report = desk.agreement()
    page = AgreementPage([_pair(pair) for pair in report.pairs], visible(report.problem))
    return _render("agreement", page, PageShell("Agreement", "agreement", author, desk.key))


def ask_page(desk: Desk, value: str = "", problem: str = "") -> bytes:
    """The question for the annotator's name; `problem` says what was wrong with `value`."""
    page = AskPage(visible(desk.name), value, visible(problem), desk.authors())
    return _render("ask", page, PageShell(page.name))


def error_page(status: int, message: str) -> bytes:
    """A page that is not there or may not be seen."""
    page = ErrorPage(HTTPStatus(status).phrase.capitalize(), visible(message))
    return _render("error", page, PageShell(page.title))


def _render(name: str, page: Any, shell: PageShell) -> bytes:
    template = environment().get_template(f"annotate/{name}.html")
    return template.render(page=page, shell=shell).encode()


def _href(video_id: str, merge: bool = False) -> str:
    return f"/{'merge' if merge else 'video'}/{quote(video_id, safe='')}"


def _way(state: VideoState, merge: bool) -> Way:
    return Way(_href(state.video_id, merge), state.video_id)


def _next(states: Sequence[VideoState], place: int, merge: bool) -> str:
    """The address of the first video after `place`, round the end, that needs a merge or its author."""
    around = [*states[place + 1 :], *states[: max(0, place)]]
    needs = [state for state in around if (state.state in _OPEN if merge else state.mine != "done")]
    return _href(needs[0].video_id, merge) if needs else ""


def _row(state: VideoState) -> ListRow:
    is_open = state.state in _OPEN
    can_merge = is_open or state.state in {"agree", "merged"}
    return ListRow(
        video_id=state.video_id,
        href=_href(state.video_id),
        mine=state.mine,
        mine_text=_MINE[state.mine],
        others=state.others,
        state_text=_STATES[state.state],
        hazards=visible(state.hazards),
        merge_href=_href(state.video_id, merge=True) if can_merge else "",
        is_open=is_open,
        tags=f"{state.mine} {state.state}",
    )


def _pair(pair: "PairAgreement") -> PairPart:
    figures = (
        ("Hazard or none: the same", percent(pair.verdict)),
        ("Beyond chance (Cohen's κ)", _decimal(pair.kappa)),
        ("Cosine of descriptions", _decimal(pair.cosine)),
        ("The same label", _share(pair.label)),
        ("The same track", _share(pair.track)),
    )
    count = f"{pair.n_videos} video{'s' if pair.n_videos != 1 else ''} in common"
    return PairPart(pair.first, pair.second, count, figures, [_dispute(video) for video in pair.videos])


def _dispute(video: "VideoAgreement") -> DisputeRow:
    return DisputeRow(
        video_id=video.video_id,
        href=_href(video.video_id, merge=True),
        verdict="same" if video.same_verdict else "differs",
        hazards=f"{video.n_first} and {video.n_second}",
        cosine=_decimal(video.cosine),
        label=percent(video.label),
        track=percent(video.track),
    )


def _decimal(value: float | None) -> str:
    return "–" if value is None else fixed(value, 3)


def _share(value: float | None) -> str:
    return "–" if value is None else percent(value)
