"""A site of many videos and 10 systems in a real browser: `python -m bench.many_videos [VIDEOS] [FOLDER]`.

VIDEOS is 20,000 when it is not given. Texts are generated and no video has a clip; the pages of single
videos are left out, since none of them grows with the number of videos. Prints what each kind of page
loads when it is opened, when it is painted and when nothing more is asked for, and how long the list of
videos takes for its shards and for an answer.
"""

import random
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from playwright.sync_api import Page, sync_playwright

from bench.large_site import made_board, made_submissions, made_truth
from pipeline.benchmark import open_benchmark
from pipeline.files import write_text
from pipeline.minilm import open_embedder
from sitegen.blame import blame_board
from sitegen.gather import gather
from sitegen.gathered import SiteData, VideoMedia, path_names
from sitegen.language import ENGLISH, speaking
from sitegen.pages import data_files, make_pages
from sitegen.rendering import find_templates, render
from sitegen.serve import serving
from tests.browser_setup import ARGUMENTS, find_chromium

VIDEOS, SYSTEMS, ROUNDS = 20_000, 10, 5
QUIET_S = 0.5  # Playwright waits so long without a request
WITHOUT_HAZARD = 25  # one video of so many
PAGES = (
    "index.html",
    "videos.html",
    "list/all-50.html",
    "list/partly.html",
    "list/labels.html",
    "submissions/system-1.html",
    "submissions/system-1/50.html",
    "compare.html",
    "failures.html",
    "submit.html",
    "vote.html",
    "data.html",
)
QUERIES = ("cat", "v123", "deer dusk", "o", "nowhere")


def main(videos: int, folder: Path) -> None:
    """Build the site into `folder` and measure it."""
    with speaking(ENGLISH):
        _write(_made(videos), folder)
    with sync_playwright() as playwright, serving(folder) as root:
        browser = playwright.chromium.launch(executable_path=find_chromium(), args=list(ARGUMENTS))
        for path in PAGES:
            if (folder / path).is_file():
                print(
                    _opened(browser.new_page(viewport={"width": 1440, "height": 900}), f"{root}/{path}", path)
                )
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.goto(f"{root}/videos.html")
        begun = time.perf_counter()
        page.evaluate("COOOLER_VIDEO_LIST.begin(() => {})")
        print(f"videos.html: all shards here in {time.perf_counter() - begun:.1f} s")
        page.locator("#search").focus()
        page.locator("#list-label option").nth(1).wait_for(state="attached")
        for query in QUERIES:
            answers = [_answered(page, query) for _ in range(ROUNDS)]
            count = page.text_content("#list-count")
            print(f"videos.html: “{query}” answered in {median(answers):.0f} ms (goal: 100): {count}")
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        begun = time.perf_counter()
        page.goto(f"{root}/failures.html?kind=not-seen", timeout=180_000)
        page.wait_for_function(
            "() => { const bar = document.querySelector('#fail-tool'); return bar && !bar.hidden"
            " && document.querySelector('#fail-progress').hidden; }",
            timeout=180_000,
        )
        print(f"failures.html, asked for: all data here in {time.perf_counter() - begun:.1f} s")
        browser.close()


def _opened(page: Page, address: str, path: str) -> str:
    """What is loaded until nothing is asked for, and when: ms after the navigation began."""
    sizes: list[int] = []
    page.on("response", lambda response: sizes.append(len(response.body())))
    begun = time.perf_counter()
    page.goto(address, wait_until="networkidle", timeout=180_000)
    quiet = (time.perf_counter() - begun - QUIET_S) * 1000
    page.wait_for_function("() => performance.getEntriesByName('first-contentful-paint').length")
    found: Any = page.evaluate(
        """() => {
          const paint = performance.getEntriesByName('first-contentful-paint')[0].startTime;
          const { domInteractive } = performance.getEntriesByType('navigation')[0];
          return [paint, domInteractive];
        }"""
    )
    page.close()
    paint, ready = found
    return (
        f"{path}: {sum(sizes) / 1024:,.0f} KB in {len(sizes)} files, the page {sizes[0] / 1024:,.0f} KB; "
        f"first paint {paint:.0f} ms, ready {ready:.0f} ms, quiet {quiet:.0f} ms"
    )


def _answered(page: Page, query: str) -> float:
    """From a query in the box to the next frame, ms; the box is emptied before."""
    return float(
        page.evaluate(
            """async (query) => {
              const box = document.querySelector('#search');
              const paint = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
              const type = (text) => {
                box.value = text;
                box.dispatchEvent(new Event('input', { bubbles: true }));
              };
              type('');
              await paint();
              const start = performance.now();
              type(query);
              await paint();
              return performance.now() - start;
            }""",
            query,
        )
    )


@contextmanager
def _timed(what: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    print(f"{what}: {time.perf_counter() - start:.0f} s", flush=True)


def _made(videos: int) -> SiteData:
    """All that the site is made of."""
    chance = random.Random(0)  # noqa: S311
    truth = made_truth(videos, chance)
    for video_id in list(truth)[::WITHOUT_HAZARD]:
        truth[video_id] = (replace(truth[video_id][0], label="", description=""),)
    rows = [row for found in truth.values() for row in found]
    names = path_names(truth)
    media = {video_id: VideoMedia(video_id, name, problem="No clip") for video_id, name in names.items()}
    with tempfile.TemporaryDirectory() as scratch:
        write_text(Path(scratch) / "coooler.toml", 'name = "Many videos"\n')
        with _timed("scored"):
            board = made_board(made_submissions(rows, SYSTEMS, chance), rows, with_probes=False)
            data = gather(open_benchmark(Path(scratch)), truth, {}, media, board)
    with _timed("failures found"):
        blames = blame_board(data.systems, rows, open_embedder(), data.settings.threshold)
    systems = (replace(system, blame=blame) for system, blame in zip(data.systems, blames, strict=True))
    return replace(data, systems=tuple(systems))


def _write(data: SiteData, folder: Path) -> None:
    """All but the pages of single videos, and what renders charts."""
    assets = sorted((find_templates() / "assets").iterdir())
    _put(folder, ((f"assets/{path.name}", path.read_bytes()) for path in assets))
    with _timed("data written"):
        _put(folder, data_files(data))
    with _timed("pages written"):
        pages = (page for page in make_pages(data) if page.template != "video.html")
        _put(folder, ((page.path, render(page, "")) for page in pages))


def _put(folder: Path, files: Iterable[tuple[str, bytes]]) -> None:
    for path, content in files:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else VIDEOS
    with tempfile.TemporaryDirectory() as temporary:
        main(count, Path(sys.argv[2]) if len(sys.argv) > 2 else Path(temporary))
