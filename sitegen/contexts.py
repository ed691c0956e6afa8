"""What each template is given: one frozen dataclass a template. Texts come ready to print.

Paths are from the site's root; `Shell.root` leads there from the page ("" or "../").
"""

from dataclasses import dataclass

from sitegen.blocks import Block
from sitegen.board_history import History
from sitegen.judgements import AgreementTable
from sitegen.numerals import Score


@dataclass(frozen=True, slots=True)
class Shell:
    """What every page has; `section` names the entry of the menu that it belongs to.

    With `hidden` the menu leaves out the pages that would tell of the truth. `language` is a BCP 47 tag;
    `restored` says that there is a page of restored clips.
    """

    title: str
    description: str
    root: str
    section: str
    benchmark: str
    version: str
    hidden: bool = False
    language: str = "en"
    restored: bool = False


@dataclass(frozen=True, slots=True)
class Link:
    """A link inside the site; `href` is from the site's root."""

    text: str
    href: str


@dataclass(frozen=True, slots=True)
class Measure:
    """A number with its 95 % interval: as text, and its ends in whole percent of the full scale."""

    score: Score
    interval: str
    low: int
    high: int


@dataclass(frozen=True, slots=True)
class BoardRow:
    """A row of the leaderboard; `key` holds what search looks through, in lower case.

    `place` is that of the score alone; `ranks` and `first` say how stable the rank is; `flags` says how
    many probes speak, and is empty when none does; `part` is the data file that tells more of the row.
    """

    place: int
    rank_text: str
    ranks: str
    first: Score
    slug: str
    name: str
    authors: str
    agents: str
    is_baseline: bool
    is_rehearsed: bool
    flags: str
    besm: Measure
    sam: Measure
    detection: Measure
    recall: Measure | None
    date: str
    key: str
    part: int


@dataclass(frozen=True, slots=True)
class LedgerLine:
    """A line of the ledger; `slug` is empty when the submission has no page (any more)."""

    date: str
    event: str
    name: str
    slug: str
    reason: str
    sha256: str
    scores: str
    signature: str


@dataclass(frozen=True, slots=True)
class HeatCell:
    """One video under one system."""

    video_id: str
    href: str
    score: Score
    detected: bool
    label: str


@dataclass(frozen=True, slots=True)
class HeatRow:
    """A system's cells, in the order of the videos."""

    name: str
    slug: str
    cells: tuple[HeatCell, ...]


@dataclass(frozen=True, slots=True)
class Chart:
    """A plotly figure (by id, in the page's data file) with the words and the table behind it."""

    chart_id: str
    title: str
    summary: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class VideoCard:
    """A video in a grid; `state` is `found`, `partly`, `missed` or `clear` (no hazard in the truth)."""

    video_id: str
    href: str
    picture: str
    picture_width: int
    picture_height: int
    alt: str
    labels: str
    descriptions: tuple[str, ...]
    best: Score | None
    best_by: str
    found_by: str
    state: str
    length: str
    key: str


@dataclass(frozen=True, slots=True)
class Fact:
    """A name and a value; `code` asks for a monospaced value, `href` makes it a link out.

    `note` is a small line below the value.
    """

    name: str
    value: str
    code: bool = False
    href: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class LeaderboardPage:
    """index.html

    `thresholds` are those that can be tried, empty when none can; `heat_left_out` and `cards_left_out`
    say how many videos are not shown, and are empty when all are; `history` is None without a ledger.
    """

    shell: Shell
    facts: tuple[Fact, ...]
    paragraphs: tuple[str, ...]
    hidden: bool
    rows: tuple[BoardRow, ...]
    signatures: tuple[str, ...]
    threshold: str
    downloads: tuple[Link, ...]
    published: tuple[Fact, ...]
    ledger: tuple[LedgerLine, ...]
    ledger_summary: str
    ledger_file: str
    charts: tuple[Chart, ...]
    chart_data: str
    heat: tuple[HeatRow, ...]
    cards: tuple[VideoCard, ...]
    thresholds: tuple[str, ...]
    heat_left_out: str
    cards_left_out: str
    history: History | None


@dataclass(frozen=True, slots=True)
class VideosPage:
    """videos.html"""

    shell: Shell
    hidden: bool
    cards: tuple[VideoCard, ...]
    summary: str
    threshold: str


@dataclass(frozen=True, slots=True)
class PromptView:
    """A prompt of the paper; `hint` is ours."""

    prompt_id: str
    section: str
    system: str
    user: str
    hint: str


@dataclass(frozen=True, slots=True)
class ModelView:
    """A model that COOOLER can use."""

    part: str
    name: str
    licence: str
    role: str


@dataclass(frozen=True, slots=True)
class MethodPage:
    """method.html"""

    shell: Shell
    hidden: bool
    threshold: str
    signature: str
    probes: tuple[tuple[str, str, str], ...]
    signature_parts: tuple[tuple[str, str], ...]
    prompts: tuple[PromptView, ...]
    models: tuple[ModelView, ...]
    systems: tuple[tuple[str, str, str], ...]
    attribution: tuple[Block, ...]
    attribution_rest: tuple[Block, ...]
    agreement: AgreementTable
    mention_rule: str
    failure_kinds: tuple[tuple[str, str], ...]
    verify: str
