"""The page of one submission."""

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial

from pipeline.records import UsageRow
from sitegen.contexts import Fact, Shell
from sitegen.failures import FailureKind, meaning_of, name_of
from sitegen.gathered import SiteData, System
from sitegen.language import N_, fixed, grouped, ngettext, said_again, whole
from sitegen.language import gettext as _
from sitegen.listing import ALL, Group, Listing, ListPage, pages_of
from sitegen.numerals import percent, plural, score
from sitegen.page_videos import span_of
from sitegen.pager import Pager, pager
from sitegen.probes import Probe
from sitegen.submission_contexts import (
    Extreme,
    JudgedLine,
    KindCount,
    ProbeLine,
    SubmissionLines,
    SubmissionPage,
    VideoLine,
)
from sitegen.uncertainty import Interval
from sitegen.verdicts import best_pairs, first_share, ledger_line, rank_text, ranks_text, title_of, verdict
from sitegen.words import shorten, visible

EXTREMES = 3
SHOWN_CAPTIONS = 5

_VERDICTS = {"unsaid": N_("cannot be said"), "speaks": N_("speaks"), "quiet": N_("quiet")}


def submission_page(data: SiteData, system: System, shell: Shell) -> SubmissionPage:
    """The context of submissions/<slug>.html."""
    submission = system.evaluation.submission
    best, worst = ((), ()) if data.hidden else _extremes(data, system)
    flagged = sum(probe.flagged for probe in system.probes)
    first = submission_parts(data)[0]
    return SubmissionPage(
        shell=shell,
        slug=system.slug,
        name=visible(system.name),
        agents=visible(said_again(system.agents)),
        is_baseline=system.is_baseline,
        is_rehearsed=system.rehearsed,
        hidden=data.hidden,
        rank_text=_("Rank {rank} of {n}").format(rank=rank_text(data, system), n=len(data.systems)),
        standing=_standing(data, system),
        cards=_scorecard(data, system),
        probes=tuple(map(_probe_line, system.probes)),
        probes_summary=plural(flagged, "{n} probe speaks", "{n} probes speak")
        if flagged
        else _("No probe speaks"),
        failures=_failures(system),
        lines=tuple(_line(data, system, video_id) for video_id in first.video_ids),
        best=best,
        worst=worst,
        provenance=_provenance(system),
        ledger=tuple(ledger_line(data, entry) for entry in system.history),
        warnings=tuple(visible(warning) for warning in submission.warnings),
        signature=str(system.evaluation.card.signature),
        threshold=fixed(data.settings.threshold, 2),
        pager=lines_pager(system, first) if first.listing.pages > 1 else None,
        span=span_of(first),
    )


def submission_parts(data: SiteData) -> tuple[ListPage, ...]:
    """The videos as a submission's pages have them, by id."""
    return tuple(pages_of(Listing(ALL, (Group("", data.video_ids),))))


def submission_lines(
    data: SiteData, system: System, pager: Pager, span: str, shell: Shell
) -> SubmissionLines:
    """The context of submissions/<slug>/<n>.html, whose videos are those of `data`."""
    return SubmissionLines(
        shell=shell,
        slug=system.slug,
        name=visible(system.name),
        hidden=data.hidden,
        lines=tuple(_line(data, system, video_id) for video_id in data.video_ids),
        pager=pager,
        span=span,
    )


def lines_pager(system: System, page: ListPage) -> Pager:
    """From one page of a system's videos to the others."""
    return pager(page.number, page.listing.pages, partial(submission_path, system.slug))


def submission_path(slug: str, number: int = 1) -> str:
    """The path of a submission's page."""
    return f"submissions/{slug}.html" if number == 1 else f"submissions/{slug}/{number}.html"


def _failures(system: System) -> tuple[KindCount, ...]:
    """How many failures of each kind there are; none where it was not worked out."""
    counts = Counter(failure.kind for failure in system.blame.failures) if system.blame else Counter()
    address = f"failures.html?system={system.slug}&kind="
    return tuple(
        KindCount(name_of(kind), counts[kind], f"{address}{kind}", meaning_of(kind))
        for kind in FailureKind
        if counts[kind]
    )


def _scorecard(data: SiteData, system: System) -> tuple[Fact, ...]:
    card, sure = system.evaluation.card, system.uncertainty
    predictions = system.evaluation.submission.predictions
    recall = _("none to find") if card.hazard_recall is None else percent(card.hazard_recall)
    found = sum(video.n_hazards_found for video in system.evaluation.videos)
    hazards = sum(video.n_hazards for video in system.evaluation.videos)
    facts = [
        Fact("BESM", fixed(card.besm, 4), note=_means(sure.besm)),
        Fact("SAM", fixed(card.sam, 4), note=_means(sure.sam)),
        Fact(_("Detection rate"), percent(card.detection_rate), note=_shares(sure.detection_rate)),
        Fact(_("Hazard recall"), recall, note=_shares(sure.hazard_recall) if sure.hazard_recall else ""),
    ]
    if not data.hidden:
        detected = round(card.detection_rate * card.n_videos)
        facts += [
            Fact(_("Videos detected"), _of(detected, card.n_videos)),
            Fact(_("Hazards found"), _of(found, hazards)),
        ]
    said = len({row.video_id for row in predictions})
    facts += [
        Fact(_("Videos with captions"), _of(said, card.n_videos)),
        Fact(_("Captions"), whole(len(predictions))),
    ]
    return tuple(facts)


def _of(count: int, total: int) -> str:
    return _("{n} of {total}").format(n=count, total=total)


def _means(interval: Interval) -> str:
    return _("{low} to {high}").format(low=fixed(interval.low, 4), high=fixed(interval.high, 4))


def _shares(interval: Interval) -> str:
    return _("{low} to {high}").format(low=fixed(interval.low * 100, 1), high=percent(interval.high))


def _standing(data: SiteData, system: System) -> tuple[str, ...]:
    """The rank band and its stability in words."""
    others = sum(other.rank == system.rank for other in data.systems) - 1
    videos = plural(len(data.truth), "{n} video", "{n} videos")
    if others:
        band = ngettext(
            "Rank {rank}, shared with {n} other: over these {videos}, none of them can be told apart from "
            "the best of them.",
            "Rank {rank}, shared with {n} others: over these {videos}, none of them can be told apart from "
            "the best of them.",
            others,
        ).format(rank=system.rank, n=whole(others), videos=videos)
    else:
        band = _("Rank {rank}, shared with no other.").format(rank=system.rank)
    if system.rank != system.place:
        band += " " + _("By BESM alone it is number {place}.").format(place=system.place)
    drawn = _(
        "With the {videos} drawn again 1,000 times, its rank is {ranks} in 95 % of the draws, and it is "
        "first in {share} of them."
    )
    return band, drawn.format(videos=videos, ranks=ranks_text(system), share=first_share(system).text)


def _probe_line(probe: Probe) -> ProbeLine:
    verdict = "unsaid" if probe.value is None else "speaks" if probe.flagged else "quiet"
    return ProbeLine(
        name=_(probe.name),
        sentence=visible(said_again(probe.sentence)),
        value=visible(said_again(probe.text)),
        threshold=said_again(probe.threshold_text),
        verdict=verdict,
        verdict_text=_(_VERDICTS[verdict]),
    )


def _line(data: SiteData, system: System, video_id: str) -> VideoLine:
    rows = system.predictions.get(video_id, [])
    captions = [visible(shorten(row.description, 200)) for row in rows[:SHOWN_CAPTIONS]]
    if len(rows) > SHOWN_CAPTIONS:
        captions.append(plural(len(rows) - SHOWN_CAPTIONS, "and {n} more", "and {n} more"))
    return VideoLine(
        visible(video_id),
        f"videos/{data.names[video_id]}.html#{system.slug}",
        tuple(captions),
        None if data.hidden else _judged(data, system, video_id),
    )


def _judged(data: SiteData, system: System, video_id: str) -> JudgedLine:
    video = system.scores[video_id]
    kind, text = verdict(video)
    return JudgedLine(
        visible(title_of(data.truth[video_id])),
        score(video.best, video.detected if video.n_hazards else None),
        score(video.besm),
        score(video.sam),
        kind,
        text,
    )


def _extremes(data: SiteData, system: System) -> tuple[tuple[Extreme, ...], tuple[Extreme, ...]]:
    """The videos with the best and the worst captions; videos without a hazard or a caption are left out."""
    spoken = [v for v in system.evaluation.videos if v.n_hazards and v.n_predictions]
    ordered = sorted(spoken, key=lambda video: (-video.best, video.video_id))
    count = min(EXTREMES, len(ordered) // 2)
    best = [video.video_id for video in ordered[:count]]
    worst = [video.video_id for video in reversed(ordered[len(ordered) - count :])]
    return _views(data, system, best), _views(data, system, worst)


def _views(data: SiteData, system: System, video_ids: Sequence[str]) -> tuple[Extreme, ...]:
    views = []
    for video_id in video_ids:
        pair = max(best_pairs(system, video_id).values(), key=lambda found: found.cosine)
        words = {hazard.hazard_id: hazard.description for hazard in data.truth[video_id]}
        said = {row.rank: row.description for row in system.predictions[video_id]}
        video = system.scores[video_id]
        views.append(
            Extreme(
                visible(video_id),
                f"videos/{data.names[video_id]}.html#{system.slug}",
                data.media[video_id].card,
                _("A keyframe of {video}").format(video=visible(video_id)),
                visible(shorten(words[pair.hazard_id], 200)),
                visible(shorten(said[pair.prediction_rank], 200)),
                score(video.best, video.detected, digits=2),
            )
        )
    return tuple(views)


def _provenance(system: System) -> tuple[Fact, ...]:
    submission = system.evaluation.submission
    url = submission.url if submission.url.startswith(("https://", "http://")) else ""
    facts = [
        Fact(_("Authors"), visible(submission.authors)),
        Fact(_("Address"), visible(submission.url), href=url),
        Fact(_("Date"), visible(submission.date)),
        Fact(_("Licence"), visible(system.licence)),
        Fact(_("Notes"), visible(system.notes)),
        Fact(_("Format"), visible(submission.source_format)),
        Fact(_("Agents"), visible(said_again(system.agents))),
        Fact(_("Cost of the run"), _cost(system.usage)),
    ]
    facts += [Fact(_(name), visible(value), code=True) for name, value in system.facts]
    return tuple(fact for fact in facts if fact.value)


def _cost(usage: Sequence[UsageRow]) -> str:
    """What a run's questions cost in all; "at least" where some were not counted. Empty without records."""
    if not usage:
        return ""
    models = sorted({visible(row.model) for row in usage if row.model})
    parts = [plural(sum(row.calls for row in usage), "{n} call", "{n} calls")]
    if models:
        parts[0] = _("{calls} of {models}").format(calls=parts[0], models=shorten(", ".join(models), 200))
    parts += _total([row.input_tokens for row in usage], _("{total} tokens in"), 0)
    parts += _total([row.output_tokens for row in usage], _("{total} tokens out"), 0)
    parts += _total([row.seconds for row in usage], _("{total} seconds of answering"), 1)
    parts += _total([row.cost for row in usage], _("a price of {total}"), 4)
    return "; ".join(parts)


def _total(values: Iterable[float | None], words: str, digits: int) -> list[str]:
    """The sum of what was counted, in words; nothing when nothing was."""
    every = list(values)
    known = [value for value in every if value is not None]
    if not known:
        return []
    total = words.format(total=grouped(sum(known), digits))
    return [total if len(known) == len(every) else _("at least {total}").format(total=total)]
