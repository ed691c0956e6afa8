"""The page of one submission."""

from collections import Counter
from collections.abc import Iterable, Sequence

from pipeline.records import UsageRow
from sitegen.contexts import Fact, Shell
from sitegen.failures import NAMES, SENTENCES, FailureKind
from sitegen.gathered import SiteData, System
from sitegen.numerals import percent, plural, score
from sitegen.probes import Probe
from sitegen.submission_contexts import (
    Extreme,
    JudgedLine,
    KindCount,
    ProbeLine,
    SubmissionPage,
    VideoLine,
)
from sitegen.uncertainty import Interval
from sitegen.verdicts import best_pairs, first_share, ledger_line, rank_text, ranks_text, title_of, verdict
from sitegen.words import shorten, visible

EXTREMES = 3
SHOWN_CAPTIONS = 5


def submission_page(data: SiteData, system: System, shell: Shell) -> SubmissionPage:
    """The context of submissions/<slug>.html."""
    submission = system.evaluation.submission
    best, worst = ((), ()) if data.hidden else _extremes(data, system)
    flagged = sum(probe.flagged for probe in system.probes)
    return SubmissionPage(
        shell=shell,
        name=visible(system.name),
        agents=visible(system.agents),
        is_baseline=system.is_baseline,
        is_rehearsed=system.rehearsed,
        hidden=data.hidden,
        rank_text=f"Rank {rank_text(data, system)} of {len(data.systems)}",
        standing=_standing(data, system),
        cards=_scorecard(data, system),
        probes=tuple(map(_probe_line, system.probes)),
        probes_summary=plural(flagged, "probe speaks", "probes speak") if flagged else "No probe speaks",
        failures=_failures(system),
        lines=tuple(_line(data, system, video_id) for video_id in data.video_ids),
        best=best,
        worst=worst,
        provenance=_provenance(system),
        ledger=tuple(ledger_line(data, entry) for entry in system.history),
        warnings=tuple(visible(warning) for warning in submission.warnings),
        signature=str(system.evaluation.card.signature),
        threshold=f"{data.settings.threshold:.2f}",
    )


def _failures(system: System) -> tuple[KindCount, ...]:
    """How many failures of each kind there are; none where it was not worked out."""
    counts = Counter(failure.kind for failure in system.blame.failures) if system.blame else Counter()
    address = f"failures.html?system={system.slug}&kind="
    return tuple(
        KindCount(NAMES[kind], counts[kind], f"{address}{kind}", SENTENCES[kind])
        for kind in FailureKind
        if counts[kind]
    )


def _scorecard(data: SiteData, system: System) -> tuple[Fact, ...]:
    card, sure = system.evaluation.card, system.uncertainty
    predictions = system.evaluation.submission.predictions
    recall = "none to find" if card.hazard_recall is None else percent(card.hazard_recall)
    found = sum(video.n_hazards_found for video in system.evaluation.videos)
    hazards = sum(video.n_hazards for video in system.evaluation.videos)
    facts = [
        Fact("BESM", f"{card.besm:.4f}", note=_means(sure.besm)),
        Fact("SAM", f"{card.sam:.4f}", note=_means(sure.sam)),
        Fact("Detection rate", percent(card.detection_rate), note=_shares(sure.detection_rate)),
        Fact("Hazard recall", recall, note=_shares(sure.hazard_recall) if sure.hazard_recall else ""),
        Fact("Videos detected", f"{round(card.detection_rate * card.n_videos)} of {card.n_videos}"),
        Fact("Hazards found", f"{found} of {hazards}"),
        Fact("Videos with captions", f"{len({row.video_id for row in predictions})} of {card.n_videos}"),
        Fact("Captions", f"{len(predictions):,}"),
    ]
    of_truth = {"Videos detected", "Hazards found"} if data.hidden else set()
    return tuple(fact for fact in facts if fact.name not in of_truth)


def _means(interval: Interval) -> str:
    return f"{interval.low:.4f} to {interval.high:.4f}"


def _shares(interval: Interval) -> str:
    return f"{interval.low * 100:.1f} to {percent(interval.high)}"


def _standing(data: SiteData, system: System) -> tuple[str, ...]:
    """The rank band and its stability in words."""
    others = sum(other.rank == system.rank for other in data.systems) - 1
    videos = plural(len(data.truth), "video")
    if others:
        band = (
            f"Rank {system.rank}, shared with {plural(others, 'other')}: over these {videos}, none of "
            "them can be told apart from the best of them."
        )
    else:
        band = f"Rank {system.rank}, shared with no other."
    if system.rank != system.place:
        band += f" By BESM alone it is number {system.place}."
    drawn = (
        f"With the {videos} drawn again 1,000 times, its rank is {ranks_text(system)} in 95 % of the draws, "
        f"and it is first in {first_share(system).text} of them."
    )
    return band, drawn


def _probe_line(probe: Probe) -> ProbeLine:
    verdict = "unsaid" if probe.value is None else "speaks" if probe.flagged else "quiet"
    return ProbeLine(
        name=probe.name,
        sentence=visible(probe.sentence),
        value=visible(probe.text),
        threshold=probe.threshold_text,
        verdict=verdict,
        verdict_text="cannot be said" if probe.value is None else verdict,
    )


def _line(data: SiteData, system: System, video_id: str) -> VideoLine:
    rows = system.predictions.get(video_id, [])
    captions = [visible(shorten(row.description, 200)) for row in rows[:SHOWN_CAPTIONS]]
    if len(rows) > SHOWN_CAPTIONS:
        captions.append(f"and {plural(len(rows) - SHOWN_CAPTIONS, 'more', 'more')}")
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
                f"A keyframe of {visible(video_id)}",
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
        Fact("Authors", visible(submission.authors)),
        Fact("Address", visible(submission.url), href=url),
        Fact("Date", visible(submission.date)),
        Fact("Licence", visible(system.licence)),
        Fact("Notes", visible(system.notes)),
        Fact("Format", visible(submission.source_format)),
        Fact("Agents", visible(system.agents)),
        Fact("Cost of the run", _cost(system.usage)),
    ]
    facts += [Fact(name, visible(value), code=True) for name, value in system.facts]
    return tuple(fact for fact in facts if fact.value)


def _cost(usage: Sequence[UsageRow]) -> str:
    """What a run's questions cost in all; "at least" where some were not counted. Empty without records."""
    if not usage:
        return ""
    models = sorted({visible(row.model) for row in usage if row.model})
    parts = [plural(sum(row.calls for row in usage), "call")]
    if models:
        parts[0] += f" of {shorten(', '.join(models), 200)}"
    parts += _total([row.input_tokens for row in usage], "{:,.0f} tokens in")
    parts += _total([row.output_tokens for row in usage], "{:,.0f} tokens out")
    parts += _total([row.seconds for row in usage], "{:,.1f} seconds of answering")
    parts += _total([row.cost for row in usage], "a price of {:,.4f}")
    return "; ".join(parts)


def _total(values: Iterable[float | None], words: str) -> list[str]:
    """The sum of what was counted, in words; nothing when nothing was."""
    every = list(values)
    known = [value for value in every if value is not None]
    if not known:
        return []
    return [f"{'at least ' if len(known) < len(every) else ''}{words.format(sum(known))}"]
