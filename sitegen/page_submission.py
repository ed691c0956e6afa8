"""The page of one submission."""

from collections.abc import Sequence

from sitegen.contexts import Extreme, Fact, Shell, SubmissionPage, VideoLine
from sitegen.gathered import SiteData, System
from sitegen.numerals import percent, plural, score
from sitegen.verdicts import best_pairs, title_of, verdict
from sitegen.words import shorten, visible

EXTREMES = 3
SHOWN_CAPTIONS = 5


def submission_page(data: SiteData, system: System, shell: Shell) -> SubmissionPage:
    """The context of submissions/<slug>.html."""
    card, submission = system.evaluation.card, system.evaluation.submission
    detected = sum(video.detected for video in system.evaluation.videos)
    predicted = sum(video.n_predictions > 0 for video in system.evaluation.videos)
    hazards = sum(video.n_hazards for video in system.evaluation.videos)
    found = sum(video.n_hazards_found for video in system.evaluation.videos)
    recall = "none to find" if card.hazard_recall is None else percent(card.hazard_recall)
    best, worst = _extremes(data, system)
    return SubmissionPage(
        shell=shell,
        name=visible(system.name),
        agents=visible(system.agents),
        is_baseline=system.is_baseline,
        rank_text=f"Rank {system.rank} of {len(data.systems)}",
        cards=(
            Fact("BESM", f"{card.besm:.4f}"),
            Fact("SAM", f"{card.sam:.4f}"),
            Fact("Detection rate", percent(card.detection_rate)),
            Fact("Hazard recall", recall),
            Fact("Videos detected", f"{detected} of {card.n_videos}"),
            Fact("Hazards found", f"{found} of {hazards}"),
            Fact("Videos with captions", f"{predicted} of {card.n_videos}"),
            Fact("Captions", f"{len(submission.predictions):,}"),
        ),
        lines=tuple(_line(data, system, video_id) for video_id in data.video_ids),
        best=best,
        worst=worst,
        provenance=_provenance(system),
        warnings=tuple(visible(warning) for warning in submission.warnings),
        signature=str(card.signature),
        threshold=f"{data.settings.threshold:.2f}",
    )


def _line(data: SiteData, system: System, video_id: str) -> VideoLine:
    video = system.scores[video_id]
    kind, text = verdict(video)
    rows = system.predictions.get(video_id, [])
    captions = [visible(shorten(row.description, 200)) for row in rows[:SHOWN_CAPTIONS]]
    if len(rows) > SHOWN_CAPTIONS:
        captions.append(f"and {plural(len(rows) - SHOWN_CAPTIONS, 'more', 'more')}")
    return VideoLine(
        visible(video_id),
        f"videos/{data.names[video_id]}.html#{system.slug}",
        visible(title_of(data.truth[video_id])),
        tuple(captions),
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
        Fact("Format", visible(submission.source_format)),
        Fact("Agents", visible(system.agents)),
    ]
    facts += [Fact(name, visible(value), code=True) for name, value in system.facts]
    return tuple(fact for fact in facts if fact.value)
