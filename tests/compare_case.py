"""A board of generated systems for the compare page, and its page in a folder, without building a site."""

from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
from playwright.sync_api import BrowserContext, Page

from pipeline.config import BenchmarkSettings
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Submission
from sitegen.compare_files import compare_files
from sitegen.contexts import Shell
from sitegen.evaluate import evaluate, truth_sha256
from sitegen.gathered import SiteData, System, VideoMedia, path_names
from sitegen.page_compare import compare_page
from sitegen.rendering import environment, find_templates
from sitegen.uncertainty import uncertainties
from tests.site_fixtures import EVIL, WordEmbedder

WHO = ("cat", "deer", "dog", "cyclist", "truck", "tyre")
DOES = ("crosses the road", "stands in our lane", "comes closer on the left", "falls from a bridge")
SHELL = Shell("Compare", "Two systems on the same videos.", "", "compare", "Generated", "0")
A, B = "system-2", "system-3"
PAIR = f"?a={A}&b={B}"
ODD_ID = "odd/\u202eid <b>"


def board(n_videos: int, n_systems: int) -> SiteData:
    """Systems that get worse one by one; every seventh video has no hazard; ids and texts try to break out.

    System number 0 says what the truth says; of two that are equal, so are all scores.
    """
    ids = [f"v{number:04d}" for number in range(1, n_videos)] + [ODD_ID]
    truth: list[TruthHazard] = []
    for number, video_id in enumerate(ids):
        label, action = WHO[number % len(WHO)], DOES[number % len(DOES)]
        empty = number % 7 == 6
        words = "" if empty else f"A {label} {action}"
        truth.append(TruthHazard(video_id, "h1", "" if empty else label.title(), words))
    evaluations = []
    for place in range(n_systems):
        rows = _said(truth, place, n_systems)
        submission = Submission(_name(place), "", "", "2026-01-02", "csv", tuple(rows))
        evaluations.append(evaluate(submission, truth, WordEmbedder(), 0.8, truth_sha256(truth)))
    unsure = uncertainties(evaluations, resamples=50)
    order = sorted(range(n_systems), key=lambda place: -evaluations[place].card.besm)
    systems = tuple(
        System(
            rank=unsure[place].band,
            place=number,
            slug=f"system-{place}",
            agents="Generated",
            is_baseline=False,
            evaluation=evaluations[place],
            uncertainty=unsure[place],
            predictions_sha256="0" * 64,
        )
        for number, place in enumerate(order, start=1)
    )
    names = path_names(ids)
    media = {video_id: VideoMedia(video_id, names[video_id], problem="No clip.") for video_id in ids}
    by_video = {row.video_id: (row,) for row in truth}
    return SiteData(BenchmarkSettings(name="Generated"), by_video, {}, media, names, systems)


def _name(place: int) -> str:
    return f"System {place} {EVIL}" if place == 1 else f"System {place}"


def _said(truth: list[TruthHazard], place: int, n_systems: int) -> list[Prediction]:
    chance = np.random.default_rng(place)
    rows = []
    for hazard in truth:
        if chance.random() < 0.1 * (place > 0):
            continue  # says nothing, which may be right
        words = hazard.description.split() or (["A", "cat"] if place else [])
        for word in range(len(words)):
            if chance.random() < place / (1.5 * n_systems):
                words[word] = ("strange", "grey", "sign", "tree")[int(chance.integers(4))]
        texts = [" ".join(words)] if words else []
        if texts and chance.random() < 0.3 * (place > 1):
            texts.append(f"A parked car {EVIL}")
        rows += [Prediction(hazard.video_id, rank, text) for rank, text in enumerate(texts, start=1)]
    return rows


def write_page(data: SiteData, folder: Path) -> Path:
    """compare.html with its assets and data, and a bare page for each video."""
    files = dict(compare_files(data))
    page = compare_page(data, SHELL)
    files["compare.html"] = environment().get_template("compare.html").render(page=page, shell=SHELL).encode()
    for path in (find_templates() / "assets").iterdir():
        files[f"assets/{path.name}"] = path.read_bytes()
    for video_id, name in data.names.items():
        files[f"videos/{name}.html"] = f"<!doctype html><title>{name}</title>{len(video_id)}".encode()
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder


def opened(context: BrowserContext, address: str, query: str = "") -> Page:
    """The compare page of a site, once its list is there."""
    page = context.new_page()
    page.goto(f"{address}/compare.html{query}")
    page.wait_for_selector("#duel-rows .duel-video[href]")
    return page


def query_of(page: Page) -> dict[str, str]:
    """The state in the page's address."""
    return {name: found[0] for name, found in parse_qs(urlsplit(page.url).query).items()}


def system(data: SiteData, slug: str) -> System:
    """The system of a slug."""
    return next(one for one in data.systems if one.slug == slug)


def gap(data: SiteData, video_id: str) -> float:
    """By how much A is better than B in a video, by BESM, as exactly as the page knows it."""
    a, b = (system(data, slug).scores[video_id].besm for slug in (A, B))
    return round(a - b, 7)
