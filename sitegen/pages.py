"""All data of a site to its pages and data files. Pure: nothing is read or written here."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

from pipeline import __version__
from pipeline.files import sha256_of
from sitegen import charts, page_restoration
from sitegen.board_files import board_files
from sitegen.compare_files import compare_files
from sitegen.contexts import LeaderboardPage, Link, MethodPage, Shell, VideosPage
from sitegen.exports import FORMATS
from sitegen.failure_files import failure_files
from sitegen.failures import Blame
from sitegen.gathered import SiteData, System
from sitegen.language import ENGLISH, ngettext, speaking, whole
from sitegen.language import gettext as _
from sitegen.narrowed import of_lines, of_video
from sitegen.page_board import leaderboard_page, video_href, videos_page
from sitegen.page_compare import ComparePage, compare_page
from sitegen.page_data import DataPage, data_page
from sitegen.page_failures import FailuresPage, failures_page
from sitegen.page_method import method_page
from sitegen.page_restoration import RestorationPage, restoration_files
from sitegen.page_submission import (
    lines_pager,
    submission_lines,
    submission_page,
    submission_parts,
    submission_path,
)
from sitegen.page_submit import SubmitPage, submit_files, submit_page
from sitegen.page_video import Place, video_page
from sitegen.page_videos import VideoListPage, is_long, list_files, list_pages, span_of
from sitegen.page_vote import VotePage, vote_files, vote_page
from sitegen.spreads import spreads
from sitegen.submission_contexts import SubmissionLines, SubmissionPage
from sitegen.transcript import transcript
from sitegen.verdicts import title_of
from sitegen.video_contexts import VideoPage
from sitegen.words import shorten, visible

Context: TypeAlias = (
    LeaderboardPage
    | VideosPage
    | VideoListPage
    | VideoPage
    | SubmissionPage
    | SubmissionLines
    | FailuresPage
    | ComparePage
    | SubmitPage
    | VotePage
    | DataPage
    | RestorationPage
    | MethodPage
)

BOARD_FIGURES = "data/leaderboard.js"
LEDGER = "data/ledger.jsonl"


@dataclass(frozen=True, slots=True)
class Page:
    """A page to render: its path from the site's root, its template, how to make what that is given.

    `shows` is the hash of all that decides the page, but for the code; empty where that is not known.
    """

    path: str
    template: str
    make: Callable[[], Context]
    shows: str = ""


def make_pages(data: SiteData) -> Iterator[Page]:
    """Every page of the site, one after the other, so that few contexts are in memory at a time."""
    names = ngettext("one system", "{n} systems", len(data.systems)).format(n=len(data.systems))
    about = _("{systems} on {n} dashcam videos: BESM, SAM and detection rate.").format(
        systems=names, n=len(data.truth)
    )
    shell = _shell(data, data.settings.name, about, "", "leaderboard")
    downloads = () if data.is_rehearsal else tuple(Link(name, path) for name, path, _made in FORMATS)
    ledger = LEDGER if data.ledger_file else ""
    made = partial(leaderboard_page, data, shell, BOARD_FIGURES, downloads, ledger)
    yield Page("index.html", "leaderboard.html", made)
    about = _("All {n} videos.") if data.hidden else _("All {n} videos with their hazards.")
    shell = _shell(data, _("Videos"), about.format(n=len(data.truth)), "", "videos")
    if is_long(data):
        for path, listed in list_pages(data, partial(_list_shell, data)):
            yield Page(path, "video_list.html", listed)
    else:
        yield Page("videos.html", "videos.html", partial(videos_page, data, shell))
    yield from _video_pages(data)
    more = submission_parts(data)[1:]
    for system in data.systems:
        about = _("{system}: scores, every video, provenance.").format(system=visible(system.name))
        shell = _shell(data, visible(system.name), about, "../", "leaderboard")
        yield Page(
            submission_path(system.slug),
            "submission.html",
            partial(submission_page, data, system, shell),
        )
        for rest in more:
            title = _("{title}, page {n} of {pages}").format(
                title=visible(system.name), n=whole(rest.number), pages=whole(rest.listing.pages)
            )
            shell = _shell(data, title, about, "../../", "leaderboard")
            shown = *of_lines(data, system, rest.video_ids), lines_pager(system, rest), span_of(rest), shell
            path, template = submission_path(system.slug, rest.number), "submission_lines.html"
            yield Page(path, template, partial(submission_lines, *shown), _sha256(shown))
    if not data.hidden:
        about = _("Every hazard that a system missed, where it was lost, and every wrong caption.")
        shell = _shell(data, _("Failures"), about, "", "failures")
        yield Page("failures.html", "failures.html", partial(failures_page, data, _blames(data), shell))
        about = _("Two systems on the same videos: per-video differences, paired tests, who detects what.")
        shell = _shell(data, _("Compare"), about, "", "compare")
        yield Page("compare.html", "compare.html", partial(compare_page, data, shell))
    about = _("The format of a predictions file, a check of it in your browser, and the ways to send it.")
    shell = _shell(data, _("Submit"), about, "", "submit")
    yield Page("submit.html", "submit.html", partial(submit_page, data, shell))
    about = _("Which of two captions describes the hazard better? Two at a time, without names.")
    shell = _shell(data, _("Vote"), about, "", "vote")
    yield Page("vote.html", "vote.html", partial(vote_page, data, shell))
    about = _("What the data hold: descriptions, labels, boxes, clips, and what a check of them found.")
    shell = _shell(data, _("About the data"), about, "", "data")
    yield Page("data.html", "data.html", partial(data_page, data, shell))
    yield from _restoration_pages(data)
    about = _("What BESM, SAM, detection and hazard recall are, with an example; prompts, models, sources.")
    shell = _shell(data, _("Method"), about, "", "method")
    yield Page("method.html", "method.html", partial(method_page, data, shell))


def _restoration_pages(data: SiteData) -> Iterator[Page]:
    about = _("What was done to the clips, by which method, and a frame of each before and after.")
    pages = page_restoration.page_count(data)
    for number in range(1, pages + 1):
        title = _("Restored clips")
        if number > 1:
            title = _("{title}, page {n} of {pages}").format(title=title, n=whole(number), pages=whole(pages))
        shell = _shell(data, title, about, "../" if number > 1 else "", "videos")
        made = partial(page_restoration.restoration_page, data, number, shell)
        yield Page(page_restoration.path_of(number), "restoration.html", made)


def _video_pages(data: SiteData) -> Iterator[Page]:
    ids = data.video_ids
    links = [Link(visible(video_id), video_href(data, video_id)) for video_id in ids]
    for place, video_id in enumerate(ids):
        title = shown = visible(video_id)
        about = _("{video}. Keyframes and every system's captions.").format(video=shown)
        if not data.hidden:
            labels = visible(title_of(data.truth[video_id]))
            title = f"{shorten(labels, 60)} · {shown}"
            about = _("{video}: {labels}. Keyframes, boxes, and every system's captions.").format(
                video=shown, labels=labels
            )
        shell = _shell(data, title, shorten(about, 160), "../", "videos")
        where = Place(
            links[place - 1] if place else None,
            links[place + 1] if place + 1 < len(ids) else None,
            _("{n} of {total}").format(n=place + 1, total=len(ids)),
        )
        view = of_video(data, video_id)
        made = partial(_video_page, view, video_id, shell, where)
        yield Page(links[place].href, "video.html", made, _sha256((view, shell, where)))


def _sha256(shown: object) -> str:
    return sha256_of(repr(shown).encode(errors="replace"))


def _video_page(view: SiteData, video_id: str, shell: Shell, place: Place) -> VideoPage:
    boxes, media = view.boxes[video_id], view.media[video_id]
    heard = [made for system in view.systems if (made := transcript(system, video_id, boxes, media))]
    return video_page(view, video_id, shell, heard, place)


def data_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The files that pages load or offer: (path, content)."""
    if not data.is_rehearsal:  # a preview is no board to take away
        with speaking(ENGLISH):  # programs read these
            files = [(path, made(data)) for _name, path, made in FORMATS]
        yield from files
    if data.ledger_file:
        yield LEDGER, data.ledger_file
    yield from submit_files(data)
    yield from vote_files(data)
    if not data.hidden:
        yield from compare_files(data)
        yield from failure_files(data, _blames(data))
    yield from board_files(data)
    yield from list_files(data)
    yield from restoration_files(data)
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


def _list_shell(data: SiteData, title: str, description: str, root: str) -> Shell:
    return _shell(data, title, description, root, "videos")


def _shell(data: SiteData, title: str, description: str, root: str, section: str) -> Shell:
    name, language, restored = visible(data.settings.name), data.settings.language, not data.restored.is_empty
    hidden = data.hidden
    return Shell(visible(title), description, root, section, name, __version__, hidden, language, restored)
