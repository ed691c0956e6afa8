"""The leaderboard and the index of videos."""

import csv
import io
import json
from collections.abc import Sequence

from pipeline.scores import VideoScore
from sitegen.contexts import (
    BoardRow,
    Chart,
    Fact,
    HeatCell,
    HeatRow,
    LeaderboardPage,
    Shell,
    VideoCard,
    VideosPage,
)
from sitegen.gathered import SiteData, System
from sitegen.numerals import Score, percent, plural, rate, score, seconds
from sitegen.verdicts import title_of, verdict
from sitegen.words import visible

BINS = 5


def leaderboard_page(data: SiteData, shell: Shell, chart_data: str) -> LeaderboardPage:
    """index.html"""
    ranks = [system.rank for system in data.systems]
    signatures = tuple(dict.fromkeys(str(system.evaluation.card.signature) for system in data.systems))
    hazards = sum(not hazard.is_no_hazard for rows in data.truth.values() for hazard in rows)
    empty = sum(all(hazard.is_no_hazard for hazard in rows) for rows in data.truth.values())
    return LeaderboardPage(
        shell=shell,
        facts=(
            Fact("videos", f"{len(data.truth):,}"),
            Fact("described hazards", f"{hazards:,}"),
            Fact("without a hazard", f"{empty:,}"),
            Fact("submissions", f"{len(data.systems):,}"),
        ),
        paragraphs=tuple(visible(part) for part in data.settings.description.split("\n\n") if part.strip()),
        rows=tuple(_row(system, ranks) for system in data.systems),
        signatures=signatures,
        threshold=f"{data.settings.threshold:.2f}",
        charts=_charts(data) if data.systems else (),
        chart_data=chart_data if data.systems else "",
        heat=tuple(_heat_row(data, system) for system in data.systems),
        cards=cards(data),
    )


def videos_page(data: SiteData, shell: Shell) -> VideosPage:
    """videos.html"""
    return VideosPage(shell, cards(data), plural(len(data.truth), "video"), f"{data.settings.threshold:.2f}")


def _row(system: System, ranks: Sequence[int]) -> BoardRow:
    card, submission = system.evaluation.card, system.evaluation.submission
    name, authors, agents = visible(system.name), visible(submission.authors), visible(system.agents)
    return BoardRow(
        system.rank,
        f"{system.rank}=" if ranks.count(system.rank) > 1 else str(system.rank),
        system.slug,
        name,
        authors,
        agents,
        system.is_baseline,
        score(card.besm),
        score(card.sam),
        rate(card.detection_rate),
        None if card.hazard_recall is None else rate(card.hazard_recall),
        visible(submission.date),
        f"{name} {authors} {agents}".casefold(),
    )


def video_href(data: SiteData, video_id: str) -> str:
    """The path of a video's page."""
    return f"videos/{data.names[video_id]}.html"


def _heat_row(data: SiteData, system: System) -> HeatRow:
    cells = []
    for video_id in data.video_ids:
        video = system.scores[video_id]
        _, text = verdict(video)
        shown = score(video.besm, video.detected, digits=2)
        what = f"{visible(system.name)} on {visible(video_id)}: BESM {shown.text}, {text.lower()}"
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
        "BESM against SAM",
        f"{visible(systems[0].name)} leads with BESM {best.besm:.4f} and SAM {best.sam:.4f}. "
        f"The two metrics differ by at most {apart:.4f} for any system; they can differ only in videos "
        "with three captions or more.",
        ("Submission", "BESM", "SAM", "Detection rate"),
        tuple(
            (
                visible(s.name),
                f"{s.evaluation.card.besm:.4f}",
                f"{s.evaluation.card.sam:.4f}",
                percent(s.evaluation.card.detection_rate),
            )
            for s in systems
        ),
    )
    head = systems[0]
    passed = sum(video.detected for video in head.evaluation.videos)
    spread = Chart(
        "distribution",
        "How close the best caption comes",
        f"{visible(head.name)} detects {passed} of {plural(len(head.evaluation.videos), 'video')}: above "
        f"{data.settings.threshold:.2f}, or rightly silent, which counts as 1. Each bar counts videos by "
        "their best similarity.",
        ("Submission", *(f"{i / BINS:.1f}–{(i + 1) / BINS:.1f}" for i in range(BINS))),
        tuple((visible(s.name), *map(str, _coarse(s))) for s in systems),
    )
    return both, spread


def _coarse(system: System) -> list[int]:
    counted = [0] * BINS
    for video in system.evaluation.videos:
        counted[min(BINS - 1, int(video.best * BINS + 1e-9))] += 1
    return counted


def cards(data: SiteData) -> tuple[VideoCard, ...]:
    """A card a video, in the order of their ids."""
    return tuple(_card(data, video_id) for video_id in data.video_ids)


def _card(data: SiteData, video_id: str) -> VideoCard:
    media, truth = data.media[video_id], data.truth[video_id]
    hazards = [hazard for hazard in truth if not hazard.is_no_hazard]
    ranked = sorted(data.systems, key=lambda system: -system.scores[video_id].best)
    best: Score | None = None
    if ranked and hazards:
        video = ranked[0].scores[video_id]
        best = score(video.best, video.detected, digits=2)
    found = sum(_good(system.scores[video_id]) for system in data.systems)
    labels = visible(title_of(truth))
    if not hazards:
        state, words = "clear", f"{found} of {len(data.systems)} rightly silent"
    else:
        state = "missed" if not found else "found" if found == len(data.systems) else "partly"
        words = f"{found} of {len(data.systems)} detected it"
    length = seconds(media.frame_count / media.fps_hz) if media.fps_hz else ""
    shape = (media.height_px / media.width_px) if media.width_px else 9 / 16
    width = min(400, media.width_px or 400)
    descriptions = tuple(visible(hazard.description) for hazard in hazards)
    return VideoCard(
        visible(video_id),
        video_href(data, video_id),
        media.card,
        width,
        round(width * shape),
        f"A keyframe of {visible(video_id)}: {labels}",
        labels,
        descriptions or ("Nothing to report: silence is right here.",),
        best,
        visible(ranked[0].name) if ranked else "",
        words if data.systems else "",
        state,
        length,
        " ".join([visible(video_id), labels, *descriptions]).casefold(),
    )


_COLUMNS = (
    "rank",
    "submission",
    "authors",
    "agents",
    "besm",
    "sam",
    "detection_rate",
    "hazard_recall",
    "n_videos",
    "date",
    "url",
    "signature",
)


def _table(data: SiteData) -> list[dict[str, str | int | float | None]]:
    rows: list[dict[str, str | int | float | None]] = []
    for system in data.systems:
        card, submission = system.evaluation.card, system.evaluation.submission
        values = (
            system.rank,
            submission.name,
            submission.authors,
            system.agents,
            card.besm,
            card.sam,
            card.detection_rate,
            card.hazard_recall,
            card.n_videos,
            submission.date,
            submission.url,
            str(card.signature),
        )
        rows.append(dict(zip(_COLUMNS, values, strict=True)))
    return rows


def board_json(data: SiteData) -> bytes:
    """The board as JSON: an object with `benchmark`, `threshold` and `rows`; texts as they were given."""
    board = {
        "benchmark": data.settings.name,
        "threshold": data.settings.threshold,
        "rows": _table(data),
    }
    return (json.dumps(board, ensure_ascii=True, indent=1, allow_nan=False) + "\n").encode()


def board_csv(data: SiteData) -> bytes:
    """The board as CSV in UTF-8; a text that a spreadsheet would run as a formula starts with `'`."""
    out = io.StringIO()
    writer = csv.DictWriter(out, _COLUMNS, lineterminator="\r\n")
    writer.writeheader()
    for row in _table(data):
        writer.writerow({name: _cell(value) for name, value in row.items()})
    return out.getvalue().encode()


def _cell(value: str | int | float | None) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        text = visible(value)
        return f"'{text}" if text.lstrip()[:1] in {"=", "+", "-", "@"} else text
    return f"{value:.6f}" if isinstance(value, float) else str(value)
