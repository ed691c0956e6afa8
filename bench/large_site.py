"""A site of 2,000 videos and 20 systems in a real browser: `python -m bench.large_site [FOLDER]`.

Texts are generated; every video shows the pictures of one of the demo's clips. Prints how long the
leaderboard takes to open, and how long the failure gallery takes to answer a filter.
"""

import random
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

from pipeline.benchmark import open_benchmark
from pipeline.files import slug, write_text
from pipeline.minilm import open_embedder
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Submission
from sitegen.build import build_site, put_pages
from sitegen.evaluate import embed_all, evaluate, texts_of, truth_sha256
from sitegen.gather import gather
from sitegen.gathered import path_names
from sitegen.media import media_from_json
from sitegen.output import open_output
from sitegen.probes import probe_board
from sitegen.standings import Standing
from sitegen.submissions import StoredSubmission
from tests.browser_setup import ARGUMENTS, find_chromium

VIDEOS, SYSTEMS, ROUNDS = 2_000, 20, 5
_THINGS = (
    "cat",
    "dog",
    "deer",
    "ladder",
    "tyre",
    "child",
    "cyclist",
    "ball",
    "mattress",
    "horse",
    "door",
    "branch",
)
_DOINGS = ("crosses the road", "lies in our lane", "stands beside the road", "comes closer on the left")
_PLACES = ("", " at dusk", " in the rain", " behind a bend", " near a junction")


def main(folder: Path) -> None:
    """Build the site into `folder` and measure it."""
    start = time.perf_counter()
    _build(folder)
    files = sum(1 for path in folder.rglob("*") if path.is_file())
    print(
        f"built {VIDEOS:,} videos x {SYSTEMS} systems: {files:,} files in {time.perf_counter() - start:.0f} s"
    )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_chromium(), args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        opened = sorted(_opened(page, (folder / "index.html").as_uri()) for _ in range(ROUNDS))
        paint, ready = opened[ROUNDS // 2]
        print(f"leaderboard: first paint {paint:.0f} ms, ready {ready:.0f} ms (goal: 1,000)")
        page.goto((folder / "failures.html").as_uri())
        begun = time.perf_counter()
        page.wait_for_function("() => document.querySelector('#fail-progress').hidden", timeout=120_000)
        count = page.text_content("#fail-count")
        print(f"failure gallery: all data loaded in {time.perf_counter() - begun:.1f} s: {count}")
        answers = sorted(_filtered(page) for _ in range(ROUNDS))
        print(f"failure gallery: a filter answers in {answers[ROUNDS // 2]:.0f} ms (goal: 100)")
        browser.close()


def _opened(page: Page, address: str) -> tuple[float, float]:
    """First contentful paint and the end of loading, ms after the navigation began."""
    page.goto(address)
    page.wait_for_load_state("load")
    page.wait_for_function("() => performance.getEntriesByName('first-contentful-paint').length")
    found: Any = page.evaluate(
        "[performance.getEntriesByName('first-contentful-paint')[0].startTime,"
        " performance.getEntriesByType('navigation')[0].domInteractive]"
    )
    return found[0], found[1]


def _filtered(page: Page) -> float:
    """From a click on a facet to the next frame that shows its answer, ms; the filter is taken away again."""
    return float(
        page.evaluate(
            """async () => {
              const box = document.querySelector('#fail-facets input[type=checkbox]');
              const paint = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
              const start = performance.now();
              box.click();
              await paint();
              const took = performance.now() - start;
              document.querySelector('#fail-clear').click();
              await paint();
              return took;
            }"""
        )
    )


def _build(folder: Path) -> None:
    """The demo's pictures, and around them pages of generated texts."""
    chance = random.Random(0)  # noqa: S311
    demo = open_benchmark(Path(__file__).parent.parent / "demo")
    build_site(demo, folder, [])
    output = open_output(folder)
    entries = output.before.media.values()
    pictures = [media_from_json(entry["media"]) for entry in entries]
    output.kept({path: digest for entry in entries for path, digest in entry["files"].items()})
    with tempfile.TemporaryDirectory() as scratch:
        write_text(Path(scratch) / "coooler.toml", 'name = "Large"\n')
        benchmark = open_benchmark(Path(scratch))
        truth = made_truth(VIDEOS, chance)
        names = path_names(truth)
        media = {
            video_id: replace(pictures[place % len(pictures)], video_id=video_id, name=names[video_id])
            for place, video_id in enumerate(truth)
        }
        rows = [row for found in truth.values() for row in found]
        submissions = made_submissions(rows, SYSTEMS, chance)
        board = made_board(submissions, rows, with_probes=True)
        data = gather(benchmark, truth, {}, media, board)
        digest = put_pages(output, data, open_embedder(), lambda what, done, total: None)
        output.finish(digest, {}, "", {})


def _text(chance: random.Random) -> tuple[str, str]:
    thing = chance.choice(_THINGS)
    return thing, f"A {thing} {chance.choice(_DOINGS)}{chance.choice(_PLACES)}"


def made_truth(videos: int, chance: random.Random) -> dict[str, tuple[TruthHazard, ...]]:
    """Video id -> its one hazard."""
    ids = [f"v{number:05}" for number in range(videos)]
    return {video_id: (TruthHazard(video_id, "1", *_text(chance)),) for video_id in ids}


def made_submissions(truth: list[TruthHazard], systems: int, chance: random.Random) -> list[Submission]:
    """Systems that are right ever less often, with one or two captions a video."""
    submissions = []
    for number in range(systems):
        rows = []
        for hazard in truth:
            right = chance.random() > number / systems
            first = hazard.description if right else _text(chance)[1]
            texts = [first, _text(chance)[1]] if chance.random() < 0.3 else [first]
            rows += [Prediction(hazard.video_id, rank, text) for rank, text in enumerate(texts, start=1)]
        submissions.append(Submission(f"System {number + 1}", "", "", "2026-01-01", "csv", tuple(rows)))
    return submissions


def made_board(
    submissions: list[Submission], truth: list[TruthHazard], *, with_probes: bool
) -> list[Standing]:
    """The submissions with their scores; probes take long when there are many videos."""
    embedder, digest = open_embedder(), truth_sha256(truth)
    vectors = embed_all(texts_of(submissions, truth), embedder)
    probes = probe_board(submissions, truth, vectors, 0.8) if with_probes else [()] * len(submissions)
    nowhere = Path("nowhere")
    return [
        Standing(
            StoredSubmission(slug(one.name), nowhere, one, "", f"{place:064x}", "0" * 64, "", ()),
            evaluate(one, truth, embedder, 0.8, digest, vectors=vectors),
            found,
        )
        for place, (one, found) in enumerate(zip(submissions, probes, strict=True))
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(temporary))
