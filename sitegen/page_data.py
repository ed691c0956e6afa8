"""The page about the data: what truth, boxes and clips hold, counted, and what the last check found."""

from dataclasses import dataclass

from sitegen.contexts import Fact, Shell
from sitegen.data_figures import (
    NO_LABEL,
    ClipFigures,
    LabelFigures,
    TextFigures,
    TruthFigures,
    clip_figures,
    truth_figures,
)
from sitegen.data_findings import Finding, Severity, StoredCheck
from sitegen.gathered import SiteData, VideoMedia
from sitegen.language import fixed, ngettext, whole
from sitegen.language import gettext as _
from sitegen.numerals import Score, percent, plural, rate
from sitegen.words import shorten, visible

MAX_LABELS = 15
MAX_PLACES = 12
MAX_FINDINGS = 200
HEIGHT = 100  # of the histogram, in its own units
STEP = 10  # width of a bar with its gap


@dataclass(frozen=True, slots=True)
class Bar:
    """A bar of the histogram: where it stands, how high it is, and what it stands for."""

    x: int
    y: int
    height: int
    words: str
    count: str


@dataclass(frozen=True, slots=True)
class Histogram:
    """Descriptions by their number of words; `width` in the units of the bars."""

    summary: str
    width: int
    first: str
    last: str
    top: str
    bars: tuple[Bar, ...]


@dataclass(frozen=True, slots=True)
class Share:
    """A row of a table with bars: a name, a count, its share."""

    name: str
    count: str
    share: Score


@dataclass(frozen=True, slots=True)
class Told:
    """A finding as it is shown; `where` are links (text, address or empty) and `more` counts the rest."""

    kind: str
    message: str
    mend: str
    where: tuple[tuple[str, str], ...]
    more: str


@dataclass(frozen=True, slots=True)
class FindingGroup:
    """The findings of one severity."""

    severity: str
    title: str
    findings: tuple[Told, ...]
    more: str


@dataclass(frozen=True, slots=True)
class DataPage:
    """data.html

    Without a histogram there is no description, or the truth is hidden. `check_note` says where the
    findings come from, or how to get them.
    """

    shell: Shell
    hidden: bool
    facts: tuple[Fact, ...]
    clips: tuple[Fact, ...]
    histogram: Histogram | None
    label_summary: str
    labels: tuple[Share, ...]
    word_summary: str
    words: tuple[Share, ...]
    check_note: str
    groups: tuple[FindingGroup, ...]


def data_page(data: SiteData, shell: Shell) -> DataPage:
    """The context of data.html; with a hidden truth, nothing but the number of videos and the clips."""
    clips = clip_figures(_clip(media) for _name, media in sorted(data.media.items()))
    if data.hidden:
        facts = (Fact(_("Videos"), whole(len(data.truth))),)
        note = _("The organiser keeps the truth back, so nothing that is counted in it is shown.")
        return DataPage(shell, True, facts, _clip_facts(clips), None, "", (), "", (), note, ())
    figures = truth_figures([row for video_id in data.video_ids for row in data.truth[video_id]])
    return DataPage(
        shell,
        False,
        _truth_facts(figures, sum(bool(rows) for rows in data.boxes.values())),
        _clip_facts(clips),
        _histogram(figures.text),
        _label_summary(figures.labels),
        _labels(figures.labels),
        _word_summary(figures.text),
        _words(figures.text),
        _check_note(data.check),
        _groups(data, data.check.findings) if data.check else (),
    )


def _clip(media: VideoMedia) -> tuple[bool, float, int, int, str, str, str]:
    seconds = media.frame_count / media.fps_hz if media.fps_hz else 0.0
    size, fps = f"{media.width_px} × {media.height_px}", f"{media.fps_hz:.5g}"
    return (not media.problem, seconds, media.frame_count, 0, size, fps if media.fps_hz else "", "")


def _truth_facts(figures: TruthFigures, with_boxes: int) -> tuple[Fact, ...]:
    return (
        Fact(_("Videos"), whole(figures.videos)),
        Fact(_("Hazards"), whole(figures.hazards)),
        Fact(_("Videos without a hazard"), whole(figures.no_hazard_videos)),
        Fact(_("Videos with several"), whole(figures.several_hazards)),
        Fact(_("Hazards with a track"), whole(figures.with_track)),
        Fact(_("Videos with boxes"), whole(with_boxes)),
        Fact(_("Different labels"), whole(len(figures.labels.counts))),
        Fact(_("Different words"), whole(figures.text.vocabulary)),
    )


def _clip_facts(clips: ClipFigures) -> tuple[Fact, ...]:
    def listed(counts: tuple[tuple[str, int], ...]) -> str:
        return ", ".join(f"{name} ({whole(count)})" for name, count in counts[:4]) or "–"

    facts = [Fact(_("Clips"), whole(clips.clips - clips.unreadable))]
    if clips.unreadable:
        facts.append(Fact(_("Missing or unreadable"), whole(clips.unreadable)))
    minutes = _("{n} min").format(n=fixed(clips.seconds / 60, 1))
    return (
        *facts,
        Fact(_("Together"), minutes, note=plural(clips.frames, "{n} frame", "{n} frames")),
        Fact(_("Sizes, in pixels"), listed(clips.sizes)),
        Fact(_("Frames a second"), listed(clips.rates)),
    )


def _histogram(text: TextFigures) -> Histogram | None:
    if not text.lengths:
        return None
    counts = dict(text.lengths)
    low, high = min(counts), max(counts)
    step = max(1, -(-(high - low + 1) // 40))  # at most 40 bars, each of as many lengths
    starts = range(low, high + 1, step)
    sums = [sum(counts.get(length, 0) for length in range(start, start + step)) for start in starts]
    top = max(sums)
    bars = []
    for place, (start, count) in enumerate(zip(starts, sums, strict=True)):
        height = round(count / top * HEIGHT)
        words = whole(start) if step == 1 else f"{whole(start)}–{whole(start + step - 1)}"
        bars.append(Bar(place * STEP, HEIGHT - height, height, words, whole(count)))
    summary = _(
        "{descriptions}, {low} to {high} words long; {mean} words on average, {median} in the middle."
    ).format(
        descriptions=plural(text.descriptions, "{n} description", "{n} descriptions"),
        low=whole(low),
        high=whole(high),
        mean=fixed(text.mean_words, 1),
        median=fixed(text.median_words, 1),
    )
    return Histogram(summary, len(bars) * STEP, bars[0].words, bars[-1].words, whole(top), tuple(bars))


def _label_summary(labels: LabelFigures) -> str:
    if not labels.counts:
        return _("There is no hazard.")
    return _(
        "{labels}, {single} of them once. Entropy {bits} bits, {even} of what even labels would have."
    ).format(
        labels=plural(len(labels.counts), "{n} label", "{n} labels"),
        single=whole(labels.singletons),
        bits=fixed(labels.entropy_bits, 2),
        even=percent(labels.evenness),
    )


def _labels(labels: LabelFigures) -> tuple[Share, ...]:
    total = sum(count for _name, count in labels.counts)
    shown = [
        (_("no label") if name == NO_LABEL else shorten(visible(name), 40), count)
        for name, count in labels.counts[:MAX_LABELS]
    ]
    if rest := total - sum(count for _name, count in shown):
        shown.append((_("all others"), rest))
    return tuple(Share(name, whole(count), rate(count / total)) for name, count in shown)


def _word_summary(text: TextFigures) -> str:
    return _(
        "{words} in {tokens} (a type-token ratio of {ratio}). The most frequent, without articles, "
        "prepositions and the like:"
    ).format(
        words=plural(text.vocabulary, "{n} different word", "{n} different words"),
        tokens=whole(text.tokens),
        ratio=fixed(text.type_token_ratio, 2),
    )


def _words(text: TextFigures) -> tuple[Share, ...]:
    top = max((count for _word, count in text.common), default=1)
    return tuple(
        Share(shorten(visible(word), 40), whole(count), rate(count / top)) for word, count in text.common
    )


def _check_note(check: StoredCheck | None) -> str:
    if check is None:
        return _("These data were not checked, or the result was not kept: coooler data check.")
    if not check.is_current:
        return _("The check was made for another state of the data, so its findings are not shown.")
    if not check.is_decoded:
        return _("The check did not decode the clips, so copies among them were not looked for.")
    return _("The check decoded every clip; these are its findings on exactly these data.")


def _groups(data: SiteData, findings: tuple[Finding, ...]) -> tuple[FindingGroup, ...]:
    if not data.check or not data.check.is_current:
        return ()
    titles = {
        Severity.ERROR: _("Errors"),
        Severity.WARNING: _("Warnings"),
        Severity.NOTE: _("Notes"),
    }
    groups = []
    for severity, title in titles.items():
        found = [one for one in findings if one.severity is severity]
        if found:
            rest = len(found) - MAX_FINDINGS
            more = ngettext("and {n} more", "and {n} more", rest).format(n=whole(rest)) if rest > 0 else ""
            shown = tuple(_told(data, one) for one in found[:MAX_FINDINGS])
            groups.append(FindingGroup(str(severity), title, shown, more))
    return tuple(groups)


def _told(data: SiteData, finding: Finding) -> Told:
    where = tuple(
        (visible(name), f"videos/{data.names[name]}.html" if name in data.names else "")
        for name in finding.where[:MAX_PLACES]
    )
    rest = len(finding.where) - MAX_PLACES
    more = ngettext("and {n} more", "and {n} more", rest).format(n=whole(rest)) if rest > 0 else ""
    return Told(visible(finding.kind), visible(finding.message), visible(finding.mend), where, more)
