"""The page of a video in a real Chromium: scrubbing, tracks, links, walks through a list, print."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.video_case import NOT_RANKED, make_site

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_site(tmp_path_factory.mktemp("benchmark"), tmp_path_factory.mktemp("site"))


@pytest.fixture
def page(context: BrowserContext) -> Iterator[Page]:
    """A page that must stay silent."""
    made = context.new_page()
    complaints: list[str] = []
    made.on("console", lambda message: complaints.append(message.text))
    made.on("pageerror", lambda error: complaints.append(str(error)))
    yield made
    assert complaints == []


def current(page: Page) -> str | None:
    return page.locator("#strip a[aria-current]").get_attribute("data-frame")


def shown(page: Page, place: str) -> list[str]:
    return [text.strip() for text in page.locator(f"{place} .boxes g:not([hidden]) text").all_text_contents()]


def test_tracks_are_switched_and_a_link_shows_it(page: Page, root: str) -> None:
    page.goto(f"{root}/videos/v1.html")
    assert shown(page, "#stage") == ["<i>8</i>", "7"]
    page.locator("#tracks input").nth(1).focus()
    page.keyboard.press("Space")
    assert shown(page, "#stage") == ["7"] and "<i>8</i>" not in shown(page, "#strip")
    assert not page.locator("#show-traffic").is_checked()
    page.wait_for_url("**/v1.html?tracks=7")
    page.keyboard.press("ArrowLeft")
    assert shown(page, "#stage") == ["7"]
    page.wait_for_url("**/v1.html?tracks=7&frame=*")
    page.locator("#show-traffic").check()
    page.locator("#tracks input").first.uncheck()
    page.wait_for_url("**/v1.html?frame=*&tracks=%3Ci%3E8*")
    page.goto(page.url)
    assert shown(page, "#stage") == ["<i>8</i>"] and page.locator("#show-traffic").is_checked()
    page.locator(".crop a").first.click()  # a crop shows its frame, and its track
    assert sorted(shown(page, "#stage")) == ["7", "<i>8</i>"]


def test_what_is_hovered_or_focused_stands_out(page: Page, root: str) -> None:
    page.goto(f"{root}/videos/v1.html?frame=5")
    lit = page.locator("#stage g.lit text")
    page.locator("#tracks .chip").nth(1).hover()
    assert lit.all_text_contents() == ["<i>8</i>"]
    page.mouse.move(5, 5)
    assert lit.count() == 0
    page.locator(".crop a").first.focus()
    assert lit.all_text_contents() == ["7"]
    assert page.locator("#strip g.lit").count() == 25


def test_the_strip_scrubs(page: Page, root: str) -> None:
    page.goto(f"{root}/videos/v1.html")
    links = page.locator("#strip a")
    links.nth(2).scroll_into_view_if_needed()
    start, end = links.nth(2).bounding_box(), links.nth(5).bounding_box()
    assert start and end
    page.mouse.move(start["x"] + 20, start["y"] + 20)
    page.mouse.down()
    page.mouse.move(end["x"] + 20, end["y"] + 20, steps=8)
    assert current(page) == links.nth(5).get_attribute("data-frame")
    page.mouse.up()
    page.mouse.move(start["x"] + 20, start["y"] + 20)
    assert current(page) == links.nth(5).get_attribute("data-frame")
    large = links.nth(5).get_attribute("href")
    assert large
    expect(page.locator("#stage-picture")).to_have_attribute("src", re.compile(f"{re.escape(large[3:])}$"))
    links.nth(5).focus()
    page.keyboard.press("Home")
    assert current(page) == links.first.get_attribute("data-frame")
    page.keyboard.press("End")
    assert current(page) == links.last.get_attribute("data-frame")
    page.keyboard.press("ArrowRight")  # there is none
    scrub = page.locator("#scrub")
    scrub.focus()
    page.keyboard.press("ArrowLeft")
    assert current(page) == links.nth(23).get_attribute("data-frame")
    assert (scrub.get_attribute("aria-valuetext") or "").startswith(f"Frame {current(page)} ")
    page.wait_for_url(f"**/v1.html?frame={current(page)}")


@pytest.mark.parametrize(
    "odd", ["frame=x", "frame=%E0%A4%A", "frame=1e999", "tracks=%", "frame=&&=", "frame"]
)
def test_an_odd_address_shows_the_page_as_it_is(page: Page, site: Path, odd: str) -> None:
    page.goto(f"{site.as_uri()}/videos/v1.html?{odd}#%E0%A4%A")
    cover = page.locator("#stage-picture").get_attribute("src") or ""
    assert cover.endswith(("cover.webp", ".jpg")) and len(shown(page, "#stage")) == 2


def test_a_filtered_list_is_walked(page: Page, root: str) -> None:
    page.goto(f"{root}/videos.html")
    page.locator("#search").fill("road")
    page.wait_for_url("**/videos.html?q=road")
    paths = page.locator(".card:visible .card-link").evaluate_all("all => all.map(a => a.href)")
    assert len(paths) == 2
    page.locator(".card:visible .card-link").first.click()
    page.wait_for_url(paths[0])
    assert page.locator("#walk-text").inner_text() == "1 of 2 in “road”"
    assert page.locator("#previous").count() == 0
    page.keyboard.press("j")
    page.wait_for_url(paths[1])
    page.keyboard.press("j")  # there is none after
    page.keyboard.press("k")
    page.wait_for_url(paths[0])
    page.locator("#walk-leave").click()
    expect(page.locator("#walk")).to_be_hidden()
    page.reload()
    expect(page.locator("#walk")).to_be_hidden()
    page.goto(f"{root}/videos.html?q=road")
    assert page.locator(".card:visible").count() == 2
    page.locator(".card:visible .card-link").first.click()
    page.locator("#walk-back").click()
    page.wait_for_url("**/videos.html?q=road")
    page.goto(f"{root}/videos/v3.html")  # not of the list
    expect(page.locator("#walk")).to_be_hidden()
    assert page.locator("#previous").count() == 1


def test_a_walk_that_leads_out_is_none(page: Page, site: Path) -> None:
    page.goto(f"{site.as_uri()}/videos/v1.html")
    for walk in (
        '{"ids": ["videos/v1.html", "videos/v2.html"], "from": "javascript:alert(1)", "title": "x"}',
        '{"ids": ["videos/v1.html"], "from": "https://evil.example/", "title": "x"}',
        '{"ids": "videos/v1.html", "from": "videos.html"}',
        "null",
        "{",
    ):
        page.evaluate("walk => sessionStorage.setItem('coooler-walk', walk)", walk)
        page.reload()
        expect(page.locator("#walk")).to_be_hidden()
    walk = '{"ids": ["//evil.example/", "videos/v1.html"], "from": "failures.html?k=1", "title": "<b>"}'
    page.evaluate("walk => sessionStorage.setItem('coooler-walk', walk)", walk)
    page.reload()
    assert page.locator("#walk-text").inner_text() == "1 of 1 in “<b>”"


def test_a_link_to_a_stage_opens_it_and_the_link_is_copied(context: BrowserContext, served: str) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(f"{served}/videos/v1.html?frame=5#good-system-rhs")
    assert page.locator("#good-system-rhs").is_visible()
    page.locator("#copy-link").click()
    expect(page.locator("#copied")).to_have_text("The link is copied.")
    assert page.evaluate("navigator.clipboard.readText()").endswith("/v1.html?frame=5#good-system-rhs")
    page.locator('.system a[href="#good-system-stages"]').click()
    assert page.locator("#good-system-stages").evaluate("details => details.open")


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing(browser: Browser, site: Path, width: int, theme: str) -> None:
    scheme: Any = theme
    with browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/videos.html?q=road")
        page.locator(".card:visible .card-link").first.click()
        page.wait_for_url("**/videos/*.html")
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")
        page.locator("#tracks input").last.uncheck()
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page).response["violations"]
        assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == []


def test_without_scripts_and_on_paper(browser: Browser, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/videos/v1.html")
        for name in ("#tracks", "#scrub", "#copy-link", "#walk"):
            assert not page.locator(name).is_visible(), name
        assert page.locator("#strip img").count() == 25 and page.locator("#stage svg").is_visible()
        assert page.get_by_text(NOT_RANKED).first.is_visible()
        page.locator("#show-boxes").uncheck()
        assert not page.locator("#stage svg").is_visible()
    with browser.new_context(reduced_motion="reduce") as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/videos/v1.html")
        assert page.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"
        page.emulate_media(media="print")
        for name in ("#tracks", "#scrub", "#copy-link", "#show-boxes", ".anchor", ".stages", "video"):
            assert not page.locator(name).first.is_visible(), name
        for name in ("#stage svg", "#strip img", ".matrix", ".caption-text", ".fates"):
            assert page.locator(name).first.is_visible(), name
        page.locator("#good-system-stages").evaluate("details => { details.open = true }")
        assert page.locator("#good-system-rhs").is_visible()
        assert not page.locator(".transcript:not([open])").first.is_visible()
