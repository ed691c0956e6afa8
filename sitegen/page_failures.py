"""The failures page as it reads without scripts: funnels, counts by kind, and the first failures."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import nsmallest
from urllib.parse import urlencode

from sitegen.contexts import Shell
from sitegen.failure_files import (
    INDEX_FILE,
    Hazard,
    Shown,
    caption_of,
    evidence_of,
    shown,
    shown_id,
    system_name,
    units,
)
from sitegen.failures import Blame, Failure, FailureKind, FunnelStep, meaning_of, name_of
from sitegen.gathered import SiteData, System
from sitegen.language import N_, whole
from sitegen.language import gettext as _
from sitegen.numerals import Score, number, plural, score
from sitegen.words import shorten

FIRST = 50
LARGE = 5_000
"""Of more failures than this, the page loads the data only when it is asked to: it is megabytes."""

CHARTS, MORE_CHARTS = 3, 9
"""So many systems have their funnel drawn in sight, and so many more when asked; the table has all."""

STAGE_NAMES = {
    "truth": N_("In the truth"),
    "seen": N_("Seen"),
    "ranked": N_("Ranked"),
    "merged": N_("Merged"),
    "anomalous": N_("Anomalous"),
    "matched": N_("Matched"),
}
NOT_RECORDED = N_("not recorded")

_ROW, _BAR, _LEFT, _FULL = 28, 18, 92, 196  # of a funnel, in viewBox units


@dataclass(frozen=True, slots=True)
class KindCell:
    """How often a kind of failure occurs; `href` leads to these failures, and is empty where none is."""

    count: int
    href: str


@dataclass(frozen=True, slots=True)
class KindView:
    """A kind of failure, what it means, and how often it occurs."""

    name: str
    sentence: str
    cell: KindCell


@dataclass(frozen=True, slots=True)
class SystemLine:
    """A system with its number of failures, of each kind, and the hazards alive after each stage."""

    slug: str
    name: str
    total: KindCell
    kinds: tuple[KindCell, ...]
    alive: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FunnelBar:
    """A stage of a drawn funnel: bars in viewBox units, `before` is what the stage before let through."""

    name: str
    y: str
    text_y: str
    before: str
    alive: str
    text_x: str
    text: str
    lost: str
    recorded: bool


@dataclass(frozen=True, slots=True)
class Funnel:
    """A system's funnel as a picture, and the same in words."""

    slug: str
    name: str
    summary: str
    bars: tuple[FunnelBar, ...]


@dataclass(frozen=True, slots=True)
class FirstFailure:
    """A failure of the plain list; `caption` is empty where nothing is meant."""

    href: str
    video: str
    picture: str
    alt: str
    kind: str
    system: str
    truth: tuple[tuple[str, str], ...]
    caption: str
    score: Score
    evidence: str


@dataclass(frozen=True, slots=True)
class FailuresPage:
    """failures.html; `index_file` is empty when there is no failure, `systems` when there is no blame.

    `is_large` says that the gallery's data are loaded only when they are asked for.
    """

    shell: Shell
    index_file: str
    summary: str
    threshold_share: int
    total: int
    kinds: tuple[KindView, ...]
    systems: tuple[SystemLine, ...]
    stages: tuple[str, ...]
    funnels: tuple[Funnel, ...]
    more_funnels: tuple[Funnel, ...]
    first: tuple[FirstFailure, ...]
    more: str
    is_large: bool


def failures_page(data: SiteData, blames: Mapping[str, Blame], shell: Shell) -> FailuresPage:
    """The context of failures.html; `blames` by the slugs of the systems."""
    found = shown(data, blames)
    counts = [Counter(failure.kind for failure in failures) for failures in found.failures]
    total = sum(len(failures) for failures in found.failures)
    everywhere = sum(counts, Counter[FailureKind]())
    lines = tuple(
        _line(system, count, blames[system.slug].funnel)
        for system, count in zip(found.systems, counts, strict=True)
    )
    first = tuple(_first(data, found))
    drawn = tuple(
        _funnel(system, blames[system.slug].funnel) for system in found.systems[: CHARTS + MORE_CHARTS]
    )
    return FailuresPage(
        shell=shell,
        index_file=INDEX_FILE if total else "",
        summary=_("{failures} of {systems} in {videos}").format(
            failures=plural(total, "{n} failure", "{n} failures"),
            systems=plural(len(lines), "{n} system", "{n} systems"),
            videos=plural(len(data.truth), "{n} video", "{n} videos"),
        ),
        threshold_share=round(data.settings.threshold * 100),
        total=total,
        kinds=tuple(
            KindView(name_of(kind), meaning_of(kind), _cell(everywhere[kind], kind=kind.value))
            for kind in FailureKind
        ),
        systems=lines,
        stages=tuple(map(_, STAGE_NAMES.values())),
        funnels=drawn[:CHARTS],
        more_funnels=drawn[CHARTS:],
        first=first,
        more=plural(total - len(first), "{n} more failure", "{n} more failures")
        if total > len(first)
        else "",
        is_large=total > LARGE,
    )


def _cell(count: int, **wanted: str) -> KindCell:
    return KindCell(count, f"failures.html?{urlencode(wanted)}" if count else "")


def _line(system: System, counts: Counter[FailureKind], funnel: Sequence[FunnelStep]) -> SystemLine:
    cells = tuple(_cell(counts[kind], kind=kind.value, system=system.slug) for kind in FailureKind)
    alive = {step.stage: step.alive for step in funnel}
    texts = tuple(_alive(alive.get(stage)) for stage in STAGE_NAMES)
    total = _cell(counts.total(), system=system.slug)
    return SystemLine(system.slug, system_name(system), total, cells, texts)


def _alive(count: int | None) -> str:
    return _(NOT_RECORDED) if count is None else whole(count)


def _funnel(system: System, funnel: Sequence[FunnelStep]) -> Funnel:
    alive = {step.stage: step.alive for step in funnel}
    full = alive.get("truth") or 0
    bars: list[FunnelBar] = []
    words: list[str] = []
    before = full
    for place, (stage, name) in enumerate(STAGE_NAMES.items()):
        now = alive.get(stage)
        kept = before if now is None else now
        lost = before - kept
        width, shadow = (_FULL * value / full if full else 0.0 for value in (kept, before))
        bars.append(
            FunnelBar(
                name=_(name),
                y=number(place * _ROW),
                text_y=number(place * _ROW + _BAR / 2 + 4),
                before=number(shadow),
                alive=number(width),
                text_x=number(_LEFT + (0.0 if now is None else shadow) + 6),
                text=_alive(now),
                lost=f"−{whole(lost)}" if lost > 0 else "",
                recorded=now is not None,
            )
        )
        if stage != "truth":
            words.append(f"{_(name).lower()} {_alive(now)}")
        before = kept
    hazards = plural(full, "{n} hazard", "{n} hazards")
    summary = _("Of {hazards}: {stages}.").format(hazards=hazards, stages=", ".join(words))
    return Funnel(system.slug, system_name(system), summary, tuple(bars))


def _first(data: SiteData, found: Shown) -> Iterator[FirstFailure]:
    """The failures of highest similarity, in the order in which the script shows them."""
    everything = (
        (-units(failure.similarity), place, n, failure)
        for place, failures in enumerate(found.failures)
        for n, failure in enumerate(failures)
    )
    by_video: dict[str, list[Hazard]] = {}
    for hazard in found.hazards:
        by_video.setdefault(hazard.video_id, []).append(hazard)
    for _units, place, _n, failure in nsmallest(FIRST, everything, key=lambda row: row[:3]):
        hazards = [
            hazard
            for hazard in by_video.get(failure.video_id, ())
            if failure.hazard_id in {None, hazard.hazard_id}
        ]
        yield _first_failure(data, found.systems[place], failure, hazards)


def _first_failure(
    data: SiteData, system: System, failure: Failure, hazards: Sequence[Hazard]
) -> FirstFailure:
    video = shown_id(failure.video_id)
    labels = shorten(", ".join(hazard.label for hazard in hazards), 80) or _("No hazard")
    return FirstFailure(
        href=f"videos/{data.names[failure.video_id]}.html#{system.slug}",
        video=video,
        picture=data.media[failure.video_id].card,
        alt=_("A keyframe of {video}: {labels}").format(video=video, labels=labels),
        kind=name_of(failure.kind),
        system=system_name(system),
        truth=tuple((hazard.label, hazard.description) for hazard in hazards),
        caption=caption_of(system, failure),
        score=score(units(failure.similarity) / 10_000, False),
        evidence=evidence_of(failure),
    )
