"""What the template of a submission's page is given; texts come ready to print, paths are from the root."""

from dataclasses import dataclass

from sitegen.contexts import Fact, LedgerLine, Shell
from sitegen.numerals import Score
from sitegen.pager import Pager


@dataclass(frozen=True, slots=True)
class VideoLine:
    """A video in a submission's table; when the truth is hidden, `judged` is None."""

    video_id: str
    href: str
    captions: tuple[str, ...]
    judged: "JudgedLine | None"


@dataclass(frozen=True, slots=True)
class JudgedLine:
    """How a submission did on a video."""

    labels: str
    best: Score
    besm: Score
    sam: Score
    verdict: str
    verdict_text: str


@dataclass(frozen=True, slots=True)
class ProbeLine:
    """A probe; `verdict` is `quiet`, `speaks` or `unsaid`, and `verdict_text` the same in words."""

    name: str
    sentence: str
    value: str
    threshold: str
    verdict: str
    verdict_text: str


@dataclass(frozen=True, slots=True)
class Extreme:
    """One of a submission's best or worst videos."""

    video_id: str
    href: str
    picture: str
    alt: str
    truth: str
    caption: str
    score: Score


@dataclass(frozen=True, slots=True)
class KindCount:
    """How many failures of one kind a system has; `href` shows them in the gallery."""

    name: str
    count: int
    href: str
    meaning: str


@dataclass(frozen=True, slots=True)
class SubmissionPage:
    """submissions/<slug>.html

    Where one page cannot hold all videos, `pager` leads to the others and `span` says which are here.
    """

    shell: Shell
    slug: str
    name: str
    agents: str
    is_baseline: bool
    is_rehearsed: bool
    hidden: bool
    rank_text: str
    standing: tuple[str, ...]
    cards: tuple[Fact, ...]
    probes: tuple[ProbeLine, ...]
    probes_summary: str
    failures: tuple[KindCount, ...]
    lines: tuple[VideoLine, ...]
    best: tuple[Extreme, ...]
    worst: tuple[Extreme, ...]
    provenance: tuple[Fact, ...]
    ledger: tuple[LedgerLine, ...]
    warnings: tuple[str, ...]
    signature: str
    threshold: str
    pager: Pager | None
    span: str


@dataclass(frozen=True, slots=True)
class SubmissionLines:
    """submissions/<slug>/<n>.html: more of the videos, the first of which are on the submission's page."""

    shell: Shell
    slug: str
    name: str
    hidden: bool
    lines: tuple[VideoLine, ...]
    pager: Pager
    span: str
