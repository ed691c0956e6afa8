"""All data of a site to its pages and data files. Pure: nothing is read or written here."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from pipeline import __version__
from sitegen import charts
from sitegen.board_files import board_files
from sitegen.compare_files import compare_files
from sitegen.contexts import LeaderboardPage, Link, MethodPage, Shell, VideosPage
from sitegen.exports import FORMATS
from sitegen.failure_files import failure_files
from sitegen.failures import Blame
from sitegen.gathered import SiteData, System
from sitegen.page_board import leaderboard_page, video_href, videos_page
from sitegen.page_compare import ComparePage, compare_page
from sitegen.page_failures import FailuresPage, failures_page
from sitegen.page_method import method_page
from sitegen.page_submission import submission_page
from sitegen.page_submit import SubmitPage, submit_files, submit_page
from sitegen.page_video import Place, video_page
from sitegen.page_vote import VotePage, vote_files, vote_page
from sitegen.spreads import spreads
from sitegen.submission_contexts import SubmissionPage
from sitegen.transcript import transcript
from sitegen.verdicts import title_of
from sitegen.video_contexts import VideoPage
from sitegen.words import shorten, visible

Context: TypeAlias = (
    LeaderboardPage
    | VideosPage
    | VideoPage
    | SubmissionPage
    | FailuresPage
    | ComparePage
    | SubmitPage
    | VotePage
    | MethodPage
)

BOARD_FIGURES = "data/leaderboard.js"
LEDGER = "data/ledger.jsonl"


@dataclass(frozen=True, slots=True)
class Page:
    """A page to render: its path from the site's root, its template, what the template is given."""

    path: str
    template: str
    context: Context


def make_pages(data: SiteData) -> Iterator[Page]:
    """Every page of the site, one after the other, so that few contexts are in memory at a time."""
    names = f"{len(data.systems)} systems" if len(data.systems) != 1 else "one system"
    about = f"{names} on {len(data.truth)} dashcam videos: BESM, SAM and detection rate."
    shell = _shell(data, data.settings.name, about, "", "leaderboard")
    downloads = () if data.is_rehearsal else tuple(Link(name, path) for name, path, _ in FORMATS)
    ledger = LEDGER if data.ledger_file else ""
    context = leaderboard_page(data, shell, BOARD_FIGURES, downloads, ledger)
    yield Page("index.html", "leaderboard.html", context)
    about = f"All {len(data.truth)} videos{'' if data.hidden else ' with their hazards'}."
    shell = _shell(data, "Videos", about, "", "videos")
    yield Page("videos.html", "videos.html", videos_page(data, shell))
    yield from _video_pages(data)
    for system in data.systems:
        about = f"{visible(system.name)}: scores, every video, provenance."
        shell = _shell(data, visible(system.name), about, "../", "leaderboard")
        yield Page(f"submissions/{system.slug}.html", "submission.html", submission_page(data, system, shell))
    if not data.hidden:
        about = "Every hazard that a system missed, where it was lost, and every wrong caption."
        shell = _shell(data, "Failures", about, "", "failures")
        yield Page("failures.html", "failures.html", failures_page(data, _blames(data), shell))
        about = "Two systems on the same videos: per-video differences, paired tests, who detects what."
        shell = _shell(data, "Compare", about, "", "compare")
        yield Page("compare.html", "compare.html", compare_page(data, shell))
    about = "The format of a predictions file, a check of it in your browser, and the ways to send it."
    yield Page("submit.html", "submit.html", submit_page(data, _shell(data, "Submit", about, "", "submit")))
    about = "Which of two captions describes the hazard better? Two at a time, without names."
    yield Page("vote.html", "vote.html", vote_page(data, _shell(data, "Vote", about, "", "vote")))
    about = "What BESM, SAM, detection and hazard recall are, with an example; prompts, models, sources."
    yield Page("method.html", "method.html", method_page(data, _shell(data, "Method", about, "", "method")))


def _video_pages(data: SiteData) -> Iterator[Page]:
    ids = data.video_ids
    links = [Link(visible(video_id), video_href(data, video_id)) for video_id in ids]
    for place, video_id in enumerate(ids):
        title = shown = visible(video_id)
        about = f"{shown}. Keyframes and every system's captions."
        if not data.hidden:
            labels = visible(title_of(data.truth[video_id]))
            title = f"{shorten(labels, 60)} · {shown}"
            about = f"{shown}: {labels}. Keyframes, boxes, and every system's captions."
        shell = _shell(data, title, shorten(about, 160), "../", "videos")
        boxes, media = data.boxes.get(video_id, ()), data.media[video_id]
        heard = [made for system in data.systems if (made := transcript(system, video_id, boxes, media))]
        where = Place(
            links[place - 1] if place else None,
            links[place + 1] if place + 1 < len(ids) else None,
            f"{place + 1} of {len(ids)}",
        )
        context = video_page(data, video_id, shell, heard, where)
        yield Page(links[place].href, "video.html", context)


def data_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The files that pages load or offer: (path, content)."""
    if not data.is_rehearsal:  # a preview is no board to take away
        for _, path, made in FORMATS:
            yield path, made(data)
    if data.ledger_file:
        yield LEDGER, data.ledger_file
    yield from submit_files(data)
    yield from vote_files(data)
    if not data.hidden:
        yield from compare_files(data)
        yield from failure_files(data, _blames(data))
    yield from board_files(data)
    if not data.systems:
        return
    figures = {"besm-sam": charts.besm_against_sam([_point(system) for system in data.systems])}
    if not data.hidden:
        figures["distribution"] = charts.score_distribution(
            [(s.name, [video.best for video in s.evaluation.videos]) for s in data.systems],
            data.settings.threshold,
        )
        figures |= {chart.chart_id: figure for chart, figure in spreads(data)}
    yield BOARD_FIGURES, charts.data_file(figures)


def _blames(data: SiteData) -> dict[str, Blame]:
    return {system.slug: system.blame for system in data.systems if system.blame}


def _point(system: System) -> charts.Point:
    card, sure = system.evaluation.card, system.uncertainty
    besm, sam = (sure.besm.low, sure.besm.high), (sure.sam.low, sure.sam.high)
    return charts.Point(system.name, card.besm, card.sam, card.detection_rate, besm, sam)


def _shell(data: SiteData, title: str, description: str, root: str, section: str) -> Shell:
    return Shell(
        visible(title), description, root, section, visible(data.settings.name), __version__, data.hidden
    )
