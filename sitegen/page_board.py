"""The leaderboard and the index of videos."""

from dataclasses import replace

from pipeline.scores import VideoScore
from sitegen.board_files import parts, threshold_text, thresholds
from sitegen.board_history import history
from sitegen.contexts import (
    BoardRow,
    Chart,
    Fact,
    HeatCell,
    HeatRow,
    LeaderboardPage,
    Link,
    Shell,
    VideoCard,
    VideosPage,
)
from sitegen.gathered import PUBLISHED, SiteData, System
from sitegen.language import fixed, ngettext, said_again, whole
from sitegen.language import gettext as _
from sitegen.numerals import Score, percent, plural, score, seconds
from sitegen.spreads import spreads
from sitegen.verdicts import (
    first_share,
    ledger_line,
    measure,
    rank_text,
    ranks_text,
    rate_measure,
    title_of,
    verdict,
)
from sitegen.words import visible

BINS = 5
SHOWN_ENTRIES = 20
SHOWN_CARDS = 24
HEAT_VIDEOS = 100


def leaderboard_page(
    data: SiteData, shell: Shell, chart_data: str, downloads: tuple[Link, ...], ledger_file: str
) -> LeaderboardPage:
    """index.html"""
    signatures = tuple(dict.fromkeys(str(system.evaluation.card.signature) for system in data.systems))
    entries = data.ledger[-SHOWN_ENTRIES:]
    held = parts(data)
    videos = len(data.truth)
    return LeaderboardPage(
        shell=shell,
        facts=_facts(data),
        paragraphs=tuple(visible(part) for part in data.settings.description.split("\n\n") if part.strip()),
        hidden=data.hidden,
        rows=tuple(_row(data, system, held[system.slug]) for system in data.systems),
        signatures=signatures,
        threshold=threshold_text(data.settings.threshold),
        downloads=downloads,
        published=(
            Fact(_("System"), _(PUBLISHED.system)),
            Fact("BESM", fixed(PUBLISHED.besm, 4)),
            Fact("SAM", fixed(PUBLISHED.sam, 4)),
            Fact(_("Videos"), str(PUBLISHED.n_videos)),
            Fact(_("Threshold"), fixed(PUBLISHED.threshold, 2)),
        ),
        ledger=tuple(ledger_line(data, entry) for entry in reversed(entries)),
        ledger_summary=_ledger_summary(data),
        ledger_file=ledger_file,
        charts=_charts(data) if data.systems else (),
        chart_data=chart_data if data.systems else "",
        heat=() if data.hidden else tuple(_heat_row(data, system) for system in data.systems),
        cards=cards(data, SHOWN_CARDS),
        thresholds=tuple(map(threshold_text, thresholds(data))),
        heat_left_out=_("{n} of {total}").format(n=HEAT_VIDEOS, total=whole(videos))
        if videos > HEAT_VIDEOS
        else "",
        cards_left_out=_("All {n} videos").format(n=whole(videos)) if videos > SHOWN_CARDS else "",
        history=history(data.ledger),
    )


def videos_page(data: SiteData, shell: Shell) -> VideosPage:
    """videos.html"""
    summary, threshold = plural(len(data.truth), "{n} video", "{n} videos"), fixed(data.settings.threshold, 2)
    return VideosPage(shell, data.hidden, cards(data), summary, threshold)


def _facts(data: SiteData) -> tuple[Fact, ...]:
    videos = Fact(_("videos"), whole(len(data.truth)))
    submissions = Fact(_("submissions"), whole(sum(not system.rehearsed for system in data.systems)))
    if data.hidden:
        return videos, submissions
    hazards = sum(not hazard.is_no_hazard for rows in data.truth.values() for hazard in rows)
    empty = sum(all(hazard.is_no_hazard for hazard in rows) for rows in data.truth.values())
    return (
        videos,
        Fact(_("described hazards"), whole(hazards)),
        Fact(_("without a hazard"), whole(empty)),
        submissions,
    )


def _row(data: SiteData, system: System, part: int) -> BoardRow:
    card, submission, sure = system.evaluation.card, system.evaluation.submission, system.uncertainty
    name, authors, agents = (
        visible(system.name),
        visible(submission.authors),
        visible(said_again(system.agents)),
    )
    flagged = sum(probe.flagged for probe in system.probes)
    recall = None
    if card.hazard_recall is not None and sure.hazard_recall is not None:
        recall = rate_measure(card.hazard_recall, sure.hazard_recall)
    return BoardRow(
        place=system.place,
        rank_text=rank_text(data, system),
        ranks=ranks_text(system),
        first=first_share(system),
        slug=system.slug,
        name=name,
        authors=authors,
        agents=agents,
        is_baseline=system.is_baseline,
        is_rehearsed=system.rehearsed,
        flags=plural(flagged, "{n} probe speaks", "{n} probes speak") if flagged else "",
        besm=measure(card.besm, sure.besm),
        sam=measure(card.sam, sure.sam),
        detection=rate_measure(card.detection_rate, sure.detection_rate),
        recall=recall,
        date=visible(submission.date),
        key=f"{name} {authors} {agents}".casefold(),
        part=part,
    )


def _ledger_summary(data: SiteData) -> str:
    shown, there = min(len(data.ledger), SHOWN_ENTRIES), len(data.ledger)
    if shown < there:
        return ngettext(
            "The last {shown} of {n} entry, newest first.",
            "The last {shown} of {n} entries, newest first.",
            there,
        ).format(shown=shown, n=whole(there))
    return plural(there, "{n} entry, newest first.", "{n} entries, newest first.")


def video_href(data: SiteData, video_id: str) -> str:
    """The path of a video's page."""
    return f"videos/{data.names[video_id]}.html"


def _heat_row(data: SiteData, system: System) -> HeatRow:
    cells = []
    for video_id in data.video_ids[:HEAT_VIDEOS]:
        video = system.scores[video_id]
        text = verdict(video)[1]
        shown = score(video.besm, video.detected, digits=2)
        what = _("{system} on {video}: BESM {besm}, {verdict}").format(
            system=visible(system.name), video=visible(video_id), besm=shown.text, verdict=text.lower()
        )
        cells.append(HeatCell(visible(video_id), video_href(data, video_id), shown, _good(video), what))
    return HeatRow(visible(system.name), system.slug, tuple(cells))


def _good(video: VideoScore) -> bool:
    return verdict(video)[0] == "pass"


def _charts(data: SiteData) -> tuple[Chart, ...]:
    systems = data.systems
    best = systems[0].evaluation.card
    apart = max(abs(s.evaluation.card.besm - s.evaluation.card.sam) for s in systems)
    both = Chart(
        "besm-sam",
        _("BESM against SAM"),
        _(
            "{system} leads with BESM {besm} and SAM {sam}. The two metrics differ by at most {apart} for "
            "any system; they can differ only in videos with three captions or more. The thin lines are the "
            "95 % intervals."
        ).format(
            system=visible(systems[0].name),
            besm=fixed(best.besm, 4),
            sam=fixed(best.sam, 4),
            apart=fixed(apart, 4),
        ),
        (_("Submission"), "BESM", "SAM", _("Detection rate")),
        tuple(
            (
                visible(s.name),
                fixed(s.evaluation.card.besm, 4),
                fixed(s.evaluation.card.sam, 4),
                percent(s.evaluation.card.detection_rate),
            )
            for s in systems
        ),
    )
    if data.hidden:
        return (both,)
    head = systems[0]
    passed = sum(video.detected for video in head.evaluation.videos)
    spread = Chart(
        "distribution",
        _("How close the best caption comes"),
        _(
            "{system} detects {n} of {videos}: above {threshold}, or rightly silent, which counts as 1. Each "
            "bar counts videos by their best similarity."
        ).format(
            system=visible(head.name),
            n=passed,
            videos=plural(len(head.evaluation.videos), "{n} video", "{n} videos"),
            threshold=fixed(data.settings.threshold, 2),
        ),
        (_("Submission"), *(f"{fixed(i / BINS, 1)}–{fixed((i + 1) / BINS, 1)}" for i in range(BINS))),
        tuple((visible(s.name), *map(str, _coarse(s))) for s in systems),
    )
    return both, spread, *(chart for chart, _ in spreads(data))


def _coarse(system: System) -> list[int]:
    counted = [0] * BINS
    for video in system.evaluation.videos:
        counted[min(BINS - 1, int(video.best * BINS + 1e-9))] += 1
    return counted


def cards(data: SiteData, limit: int | None = None) -> tuple[VideoCard, ...]:
    """A card a video, in the order of their ids; the first `limit` only, where one is given."""
    return tuple(video_card(data, video_id) for video_id in data.video_ids[:limit])


def video_card(data: SiteData, video_id: str) -> VideoCard:
    """The card of a video; with a hidden truth it tells no more than the id."""
    media = data.media[video_id]
    length = seconds(media.frame_count / media.fps_hz) if media.fps_hz else ""
    shape = (media.height_px / media.width_px) if media.width_px else 9 / 16
    width = min(400, media.width_px or 400)
    shown = visible(video_id)
    card = VideoCard(
        video_id="",
        href=video_href(data, video_id),
        picture=media.card,
        picture_width=width,
        picture_height=round(width * shape),
        alt=_("A keyframe of {video}").format(video=shown),
        labels=shown,
        descriptions=(),
        best=None,
        best_by="",
        found_by="",
        state="",
        length=length,
        key=shown.casefold(),
    )
    return card if data.hidden else _judged_card(data, video_id, card)


def found_by(data: SiteData, video_id: str) -> int:
    """How many systems detected a video's hazard, or were rightly silent."""
    return sum(_good(system.scores[video_id]) for system in data.systems)


def state_of(data: SiteData, video_id: str) -> str:
    """A video's state as VideoCard has it."""
    if all(hazard.is_no_hazard for hazard in data.truth[video_id]):
        return "clear"
    found = found_by(data, video_id)
    return "missed" if not found else "found" if found == len(data.systems) else "partly"


def _judged_card(data: SiteData, video_id: str, card: VideoCard) -> VideoCard:
    """The card with the truth and how many systems met it."""
    truth = data.truth[video_id]
    hazards = [hazard for hazard in truth if not hazard.is_no_hazard]
    ranked = sorted(data.systems, key=lambda system: -system.scores[video_id].best)
    best: Score | None = None
    if ranked and hazards:
        video = ranked[0].scores[video_id]
        best = score(video.best, video.detected, digits=2)
    found, state = found_by(data, video_id), state_of(data, video_id)
    labels = visible(title_of(truth))
    words = _("{n} of {total} rightly silent") if state == "clear" else _("{n} of {total} detected it")
    descriptions = tuple(visible(hazard.description) for hazard in hazards)
    return replace(
        card,
        video_id=card.labels,
        alt=_("A keyframe of {video}: {labels}").format(video=card.labels, labels=labels),
        labels=labels,
        descriptions=descriptions or (_("Nothing to report: silence is right here."),),
        best=best,
        best_by=visible(ranked[0].name) if ranked else "",
        found_by=words.format(n=found, total=len(data.systems)) if data.systems else "",
        state=state,
        key=" ".join([card.labels, labels, *descriptions]).casefold(),
    )
