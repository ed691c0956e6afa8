"""What the pages' scripts say, with a catalogue that has everything: no English is left beside it."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page

from sitegen.build import build_site
from tests.site_fixtures import WordEmbedder, make_benchmark, make_board

pytestmark = pytest.mark.browser

EVERYTHING = """window.COOOLER_CATALOGUE = new Proxy({}, { get: (_, message) => `⟦${message}⟧` });"""
# All texts of a page in their order, then those that are heard or shown otherwise; of what it came as, when
# given. Faults of files are told in the words of the command.
TEXTS = """html => {
  const root = html ? new DOMParser().parseFromString(html, "text/html") : document;
  const found = [];
  const walk = root.createTreeWalker(root.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const { parentNode, data } = walk.currentNode;
    if (!parentNode.closest("script, style, noscript, .found, .expected, .mend")) found.push(data);
  }
  for (const name of ["aria-label", "aria-valuetext", "alt", "title", "placeholder", "data-label"]) {
    root.querySelectorAll(`[${name}]`).forEach((one) => found.push(one.getAttribute(name)));
  }
  return found.map((text) => text.replace(/\\s+/g, " ").trim());
}"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    benchmark = make_benchmark(tmp_path_factory.mktemp("benchmark"))
    build_site(benchmark, out, make_board(benchmark), embedder=WordEmbedder())
    return out


def data_texts(site: Path) -> set[str]:
    """Every text of the site's data files, which is no word of a script's."""
    files = [path.read_text("utf-8") for path in (site / "data").rglob("*.js")]
    found = [json.loads(text) for file in files for text in re.findall(r'"(?:[^"\\]|\\.)*"', file)]
    return {re.sub(r"\s+", " ", text).strip() for text in found}


def left_over(texts: list[str]) -> set[str]:
    """What stands outside of brackets, which may open in one text and close in a later one."""
    found = set()
    depth = 0
    for text in texts:
        outside = ""
        for char in text:
            depth += (char == "⟦") - (char == "⟧")
            outside += char if depth == 0 else ""
        found.add(outside.strip("⟧ ():,"))
    assert depth == 0
    return found


def leaderboard(page: Page) -> None:
    page.locator(".board-open").first.click()
    page.locator(".board-facts").wait_for()
    page.locator("#board-metric input[value=sam]").check()
    page.locator("#board-threshold").press("ArrowRight")
    page.locator("#board-note").get_by_text("⟦Detection and").wait_for()
    page.locator("#board-link").click()


def failures(page: Page) -> None:
    page.locator(".fail-item").first.wait_for()
    page.locator("#fail-facets input[type=checkbox]").first.check()
    page.locator(".fail-chip").wait_for()
    page.locator("#fail-copy").click()


def compared(page: Page) -> None:
    page.locator("#duel-rows .duel-video[href]").first.wait_for()
    page.locator("#duel-swap").click()
    page.locator(".solved-choice summary").click()
    page.locator("#solved-boxes input").first.uncheck()
    page.locator("#solved-counts").get_by_text("⟦none⟧").wait_for()
    page.locator(".duel-caption").get_by_text("⟦(says nothing)⟧").first.wait_for()


def video(page: Page) -> None:
    page.keyboard.press("ArrowRight")
    page.locator("#copy-link").click()
    page.locator("#copied").get_by_text("⟦").wait_for()


def videos(page: Page) -> None:
    page.locator("#search").fill("v")
    page.locator("#theme").click()


def walked(page: Page) -> None:
    page.locator("#search").fill("v")
    page.locator(".card-link").first.click()
    page.locator("#walk-leave").wait_for()


def voted(page: Page) -> None:
    page.locator("#vote-left > *").first.wait_for()
    page.keyboard.press("1")
    page.get_by_text("⟦Comparison 2⟧").wait_for()


def submitted(page: Page) -> None:
    content = b"video_id,rank,description\nv1,1,A cat\nv1,1,A cat\nv1,x,\n"
    page.locator("#file").set_input_files({"name": "v1.csv", "mimeType": "text/csv", "buffer": content})
    page.locator("#fault-rows tr").first.wait_for()


@pytest.mark.parametrize(
    ("path", "act", "expected"),
    [
        ("index.html", leaderboard, ["⟦Rank by BESM⟧", "⟦Rank redrawn⟧", "⟦Details of Silent⟧"]),
        ("failures.html", failures, ["⟦Kind⟧", "⟦Truth:⟧", "⟦best similarity⟧", "⟦Filters (1 chosen)⟧"]),
        ("compare.html", compared, ["⟦not detected⟧", "⟦all 2⟧", "⟦(says nothing)⟧"]),
        ("videos/v1.html", video, []),
        ("videos.html", videos, ["⟦Light⟧", "⟦4 video⟧"]),
        ("videos.html", walked, ["⟦Next:⟧", "⟦1 of 4 in “v”⟧"]),
        ("vote.html", voted, ["⟦Comparison 2⟧", "⟦A is better.⟧", "⟦Videos seen⟧"]),
        ("submit.html", submitted, ["✕ ⟦v1.csv has 3 fault⟧", "⟦row 2⟧", "⟦Mend⟧"]),
    ],
)
def test_all_that_scripts_say_is_translated(
    context: BrowserContext,
    site: Path,
    served: str,
    path: str,
    act: Callable[[Page], None],
    expected: list[str],
) -> None:
    context.add_init_script(EVERYTHING)
    page = context.new_page()
    page.goto(f"{served}/{path}", wait_until="networkidle")
    act(page)
    texts = page.evaluate(TEXTS)
    assert not set(expected) - set(texts)
    assert not [text for text in texts if re.search(r"\{[a-z]+\}", text)]
    came = site / page.url.removeprefix(f"{served}/").split("?")[0]
    known = {*page.evaluate(TEXTS, came.read_text("utf-8")), *data_texts(site)}
    bare = left_over([text for text in texts if text not in known]) - known
    assert not [text for text in bare if re.search(r"[^\W\d_]{2}", re.sub("BESM|SAM", "", text))]
