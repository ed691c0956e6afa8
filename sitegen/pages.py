"""All data of a site to its pages and data files. Pure: nothing is read or written here."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from pipeline import __version__
from sitegen import charts
from sitegen.contexts import LeaderboardPage, Link, MethodPage, Shell, SubmissionPage, VideosPage
from sitegen.gathered import SiteData
from sitegen.page_board import board_csv, board_json, leaderboard_page, video_href, videos_page
from sitegen.page_method import method_page
from sitegen.page_submission import submission_page
from sitegen.page_video import Place, video_page
from sitegen.transcript import transcript
from sitegen.verdicts import title_of
from sitegen.video_contexts import VideoPage
from sitegen.words import shorten, visible

Context: TypeAlias = LeaderboardPage | VideosPage | VideoPage | SubmissionPage | MethodPage

BOARD_FIGURES = "data/leaderboard.js"


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
    yield Page("index.html", "leaderboard.html", leaderboard_page(data, shell, BOARD_FIGURES))
    shell = _shell(data, "Videos", f"All {len(data.truth)} videos with their hazards.", "", "videos")
    yield Page("videos.html", "videos.html", videos_page(data, shell))
    yield from _video_pages(data)
    for system in data.systems:
        about = f"{visible(system.name)}: scores, every video, provenance."
        shell = _shell(data, visible(system.name), about, "../", "leaderboard")
        context = submission_page(data, system, shell)
        yield Page(f"submissions/{system.slug}.html", "submission.html", context)
    about = "What BESM, SAM, detection and hazard recall are, with an example; prompts, models, sources."
    yield Page("method.html", "method.html", method_page(data, _shell(data, "Method", about, "", "method")))


def _video_pages(data: SiteData) -> Iterator[Page]:
    ids = data.video_ids
    links = [Link(visible(video_id), video_href(data, video_id)) for video_id in ids]
    for place, video_id in enumerate(ids):
        title = visible(title_of(data.truth[video_id]))
        about = shorten(f"{visible(video_id)}: {title}. Keyframes, boxes, and every system's captions.", 160)
        shell = _shell(data, f"{shorten(title, 60)} · {visible(video_id)}", about, "../", "videos")
        boxes, media = data.boxes.get(video_id, ()), data.media[video_id]
        said = [made for system in data.systems if (made := transcript(system, video_id, boxes, media))]
        where = Place(
            links[place - 1] if place else None,
            links[place + 1] if place + 1 < len(ids) else None,
            f"{place + 1} of {len(ids)}",
        )
        context = video_page(data, video_id, shell, said, where)
        yield Page(links[place].href, "video.html", context)


def data_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The files that pages load or offer: (path, content)."""
    yield "data/leaderboard.csv", board_csv(data)
    yield "data/leaderboard.json", board_json(data)
    if not data.systems:
        return
    cards = [(system.name, system.evaluation.card) for system in data.systems]
    figures = {
        "besm-sam": charts.besm_against_sam([(n, c.besm, c.sam, c.detection_rate) for n, c in cards]),
        "distribution": charts.score_distribution(
            [(s.name, [video.best for video in s.evaluation.videos]) for s in data.systems],
            data.settings.threshold,
        ),
    }
    yield BOARD_FIGURES, charts.data_file(figures)


def _shell(data: SiteData, title: str, description: str, root: str, section: str) -> Shell:
    return Shell(visible(title), description, root, section, visible(data.settings.name), __version__)
