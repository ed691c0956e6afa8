"""The lists of many videos in a real Chromium: paging, search, a walk through what was found."""

from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.many_case import VIDEOS, made_truth, make_site

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    make_site(tmp_path_factory.mktemp("benchmark"), out)
    return out


@pytest.fixture
def page(context: BrowserContext) -> Page:
    return context.new_page()


def searched(page: Page, address: str, query: str) -> None:
    page.goto(address)
    page.locator("#search").fill(query)
    expect(page.locator("#list-found")).to_be_visible()


@pytest.mark.parametrize(("scripts", "width"), [(True, 390), (False, 390), (False, 1440)])
def test_every_video_is_reached_by_next(browser: Browser, root: str, scripts: bool, width: int) -> None:
    size: Any = {"width": width, "height": 900}
    with browser.new_context(java_script_enabled=scripts, viewport=size) as context:
        page = context.new_page()
        page.goto(f"{root}/videos.html")
        found: list[str] = []
        while True:
            links = page.locator("#list-plain .card-link")
            found += [href.rpartition("/")[2] for href in links.evaluate_all("all => all.map(a => a.href)")]
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.locator("#search").is_visible() == scripts
            following = page.locator(".pager a[rel=next]").first
            if not following.count():
                break
            following.click()
            page.wait_for_load_state()
        assert found == [f"{video_id}.html" for video_id in made_truth()]
        assert page.url.endswith("/list/all-3.html")
        page.locator(".groups a", has_text="missed by all").click()
        assert page.locator("h1").inner_text() == "Videos missed by all"
        page.locator(".groups a", has_text="by label").click()
        page.locator(".labels a", has_text="tyre").click()
        expect(page.locator("h2.label-head", has_text="tyre").first).to_be_in_viewport()


def test_nothing_is_loaded_before_it_is_asked_for(page: Page, root: str) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{root}/videos.html", wait_until="networkidle")
    assert not any("/data/" in address for address in asked)
    page.locator("#search").fill("cat")
    expect(page.locator("#list-found")).to_be_visible()
    shards = [address for address in asked if "/data/videos/" in address]
    assert len(shards) == len(set(shards)) >= VIDEOS // 100


def test_a_search_finds_all_and_is_walked(page: Page, root: str) -> None:
    cats = [video_id for video_id, rows in made_truth().items() if rows[0].label == "cat"]
    searched(page, f"{root}/list/all-2.html", "CAT road")
    assert page.locator("#list-count").inner_text() == f"{len(cats)} of {VIDEOS} videos"
    page.wait_for_url("**/list/all-2.html?q=CAT+road")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("n")
    page.wait_for_url("**/list/all-2.html?q=CAT+road&page=2")
    assert page.locator("#list-cards .card").count() == len(cats) - 60
    page.reload()
    expect(page.locator("#list-pager [aria-current]")).to_have_text("2")
    page.locator("#list-cards .card-link").first.click()
    page.wait_for_url(f"**/videos/{cats[60]}.html")
    assert page.locator("#walk-text").inner_text() == f"61 of {len(cats)} in “CAT road”"
    page.keyboard.press("j")
    page.wait_for_url(f"**/videos/{cats[61]}.html")
    page.keyboard.press("k")
    page.keyboard.press("k")
    page.locator("#walk-back").click()
    page.wait_for_url("**/list/all-2.html?q=CAT+road&page=2")
    expect(page.locator("#list-found")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("#list-plain")).to_be_visible()
    page.wait_for_url("**/list/all-2.html")


def test_groups_filters_and_words_combine(page: Page, root: str) -> None:
    searched(page, f"{root}/list/missed.html", "v00")
    truth = made_truth()
    cats = {video_id for video_id, rows in truth.items() if rows[0].label == "cat"}
    missed = cats - {"v0010"} | {"v0011"}  # a second hazard that is found; one that nobody describes
    first = [video_id for video_id in missed if video_id.startswith("v00")]
    expect(page.locator("#list-count")).to_have_text(f"{len(first)} of {VIDEOS} videos")
    page.locator("#list-label").select_option("deer")
    expect(page.locator("#list-none")).to_be_visible()
    page.locator("#list-state").select_option("found")
    page.wait_for_url("**/list/missed.html?show=found&label=deer&q=v00")
    early = [rows for video_id, rows in truth.items() if video_id.startswith("v00")]
    deer = [rows for rows in early if any(row.label.casefold() == "deer" for row in rows)]
    expect(page.locator("#list-count")).to_have_text(f"{len(deer)} of {VIDEOS} videos")
    page.locator("#list-clear").click()
    assert page.locator("#list-state").input_value() == "missed"
    expect(page.locator("#list-plain")).to_be_visible()


def test_a_card_that_was_found_is_the_card_of_the_page(page: Page, site: Path) -> None:
    inside = "item => item.innerText.replace(/\\s+/g, ' ').trim()"
    for video_id in ("v0000", "v0002", "v0008", "v0010", "v0011"):
        page.goto(f"{site.as_uri()}/videos.html")
        card = f'.card:has(a[href="videos/{video_id}.html"])'
        plain = page.locator(f"#list-plain {card}").evaluate(inside)
        page.locator("#search").fill(video_id)
        expect(page.locator("#list-cards .card")).to_have_count(1)
        assert page.locator(f"#list-cards {card}").evaluate(inside) == plain


def test_data_that_is_gone_is_said(page: Page, served: str) -> None:
    page.route("**/data/videos/all/2.js", lambda route: route.abort())
    page.goto(f"{served}/videos.html")
    page.locator("#search").fill("cat")
    expect(page.locator("#list-problem")).to_be_visible()
    expect(page.locator("#list-plain")).to_be_visible()
    page.unroute("**/data/videos/all/2.js")
    page.locator("#search").fill("dog")
    expect(page.locator("#list-found")).to_be_visible()
    expect(page.locator("#list-problem")).to_be_hidden()


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing(browser: Browser, site: Path, width: int, theme: str) -> None:
    scheme: Any = theme
    with browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme) as context:
        page = context.new_page()
        for path in ("list/labels-2.html", "videos.html?q=road&page=2", "submissions/broad/3.html"):
            page.goto(f"{site.as_uri()}/{path}")
            if "?" in path:
                expect(page.locator("#list-found")).to_be_visible()
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            found = Axe().run(page).response["violations"]
            assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == [], path
