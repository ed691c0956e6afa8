"""The failures gallery in a real Chromium: facets, search, the address, keys, and lists of any length."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page

from sitegen.failures import SENTENCES, Blame, Failure, FailureKind
from sitegen.gathered import SiteData
from tests.failures_case import generated, write_page

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def board() -> tuple[SiteData, dict[str, Blame]]:
    return generated(150, 4, each=8)  # 4,800 failures


@pytest.fixture(scope="module")
def site(board: tuple[SiteData, dict[str, Blame]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(*board, tmp_path_factory.mktemp("failures"))


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    with browser.new_context(viewport={"width": 1440, "height": 900}, reduced_motion="reduce") as made:
        yield made


def opened(context: BrowserContext, root: str, query: str = "") -> Page:
    page = context.new_page()
    page.goto(f"{root}/failures.html{query}")
    done(page)
    return page


def done(page: Page) -> None:
    """Wait until everything that is loading is here."""
    page.wait_for_function(
        """() => !document.getElementById("fail-tool").hidden
            && document.getElementById("fail-progress").hidden"""
    )


def shown_count(page: Page) -> int:
    return int(page.locator("#fail-count").inner_text().split()[0].replace(",", ""))


def facet(page: Page, name: str) -> dict[str, int]:
    """The counts of a facet by its keys, as the page shows them."""
    rows = page.locator(f"input[name={name}]").evaluate_all(
        "boxes => boxes.map((box) => [box.value, box.parentNode.querySelector('.fail-count').textContent])"
    )
    return {key: int(count.replace(",", "")) for key, count in rows}


def keys_of(page: Page) -> list[str]:
    """Video, kind and system of every item in the document, in its order."""
    return page.locator("#fail-list .fail-link").all_inner_texts()


def expected(board: tuple[SiteData, dict[str, Blame]], fits: Callable[[str, Failure], bool]) -> int:
    return sum(fits(slug, failure) for slug, blame in board[1].items() for failure in blame.failures)


@pytest.mark.parametrize("way", ["file", "http"])
def test_facets_search_address_and_back(
    context: BrowserContext, board: tuple[SiteData, dict[str, Blame]], site: Path, served: str, way: str
) -> None:
    root = site.as_uri() if way == "file" else served
    page = context.new_page()
    complaints: list[str] = []
    addresses: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: addresses.append(request.url))
    page.goto(f"{root}/failures.html")
    done(page)
    assert shown_count(page) == 4_800 and not any(
        "/texts/" in one and "system-3/1" in one for one in addresses
    )
    assert sum(facet(page, "kind").values()) == sum(facet(page, "system").values()) == 4_800

    page.locator("input[name=kind][value=near-miss]").check()
    page.locator("input[name=kind][value=extra]").check()
    page.locator("input[name=system][value=system-2]").check()
    kinds = {FailureKind.NEAR_MISS, FailureKind.EXTRA}
    both = expected(board, lambda slug, failure: slug == "system-2" and failure.kind in kinds)
    assert shown_count(page) == both
    of_system = Counter(one.kind.value for one in board[1]["system-2"].failures)
    assert facet(page, "kind") == of_system  # what its own choice keeps out counts
    of_kinds = Counter(
        slug for slug, blame in board[1].items() for one in blame.failures if one.kind in kinds
    )
    assert facet(page, "system") == of_kinds
    known = sum(one.stages_known for one in board[1]["system-2"].failures if one.kind in kinds)
    assert facet(page, "stages") == {"known": known, "unknown": both - known}
    assert page.url.endswith("?kind=near-miss&kind=extra&system=system-2")
    page.go_back()
    assert page.url.endswith("?kind=near-miss&kind=extra")
    assert shown_count(page) == expected(board, lambda _, failure: failure.kind in kinds)
    page.go_forward()
    assert shown_count(page) == both

    page.locator("#search").fill("frame 3 V0007")
    done(page)
    found = expected(
        board,
        lambda slug, failure: (
            (slug == "system-2" and failure.kind in kinds)
            and failure.video_id == "v0007"
            and failure.evidence.startswith("Frame 3 ")
        ),
    )
    assert shown_count(page) == found
    page.locator("#search").fill("evil")  # in captions only, and in those of one video
    done(page)
    evil = sorted(board[0].truth)[3]
    assert shown_count(page) == expected(
        board, lambda slug, one: slug == "system-2" and one.kind in kinds and one.video_id == evil
    )
    page.locator("#fail-sort").select_option("low")
    link, count, items = page.url, page.locator("#fail-count").inner_text(), keys_of(page)
    other = opened(context, *link.replace("failures.html", " ").replace("/ ", " ").split(" "))
    assert other.locator("#fail-count").inner_text() == count and keys_of(other) == items
    assert other.locator("#search").input_value() == "evil"
    assert complaints == []
    assert [one for one in addresses if not one.startswith(f"{root}/")] == []


def test_sorts(context: BrowserContext, site: Path, board: tuple[SiteData, dict[str, Blame]]) -> None:
    page = opened(context, site.as_uri())
    everything = [(slug, one) for slug, blame in board[1].items() for one in blame.failures]
    similarity = sorted(round(one.similarity * 10_000) for _, one in everything)
    for sort, first in (("high", similarity[-1]), ("low", similarity[0])):
        page.locator("#fail-sort").select_option(sort)
        page.evaluate("window.scrollTo(0, document.getElementById('fail-list').offsetTop)")
        assert page.locator("[aria-posinset='1'] .fail-score b").inner_text() == f"{first / 10_000:.4f}"
    for sort, text in (("video", "odd/"), ("system", "System 0"), ("kind", "Not seen")):
        page.locator("#fail-sort").select_option(sort)
        assert text in page.locator("[aria-posinset='1']").inner_text()


def test_windowed_list_and_keys(context: BrowserContext, site: Path) -> None:
    page = opened(context, site.as_uri())
    items = page.locator("#fail-list > li")
    page.keyboard.press("j")
    assert page.locator("[aria-current]").get_attribute("aria-posinset") == "1"
    for key, number in (("j", "2"), ("ArrowDown", "3"), ("k", "2"), ("ArrowUp", "1"), ("k", "1")):
        page.keyboard.press(key)
        assert page.locator("[aria-current]").get_attribute("aria-posinset") == number
        assert page.evaluate("document.activeElement.closest('[aria-current]') !== null")
    page.evaluate("window.scrollTo(0, document.documentElement.scrollHeight / 2)")
    page.wait_for_function(
        "() => document.querySelectorAll('#fail-list > li')[3].getAttribute('aria-posinset') > 1000"
    )
    places = [int(number or 0) for number in items.evaluate_all("all => all.map((li) => li.ariaPosInSet)")]
    assert places[0] == 1 and places == sorted(places) and len(places) < 40  # the selected one stays
    assert items.first.get_attribute("aria-setsize") == "4800"
    page.evaluate("window.scrollTo(0, document.documentElement.scrollHeight)")
    page.locator("[aria-posinset='4800']").wait_for()
    page.keyboard.press("j")
    assert page.locator("[aria-current]").get_attribute("aria-posinset") == "2"

    at = page.url
    assert "at=system-" in at
    other = opened(context, site.as_uri(), "?" + at.split("?")[1])
    assert other.locator("[aria-current]").get_attribute("aria-posinset") == "2"
    other.keyboard.press("Enter")
    other.wait_for_url(re.compile(r"/videos/[^/]+\.html#system-\d$"))
    page.keyboard.press("/")
    page.keyboard.type("cat")
    done(page)
    assert shown_count(page) < 4_800 and "q=cat" in page.url
    page.keyboard.press("Escape")
    assert shown_count(page) == 4_800 and page.locator("#search").input_value() == ""
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("f")
    assert page.evaluate("document.activeElement.name") == "kind"
    page.keyboard.press("Space")
    assert shown_count(page) == 480 and page.locator("#fail-chosen li").count() == 1
    assert page.locator("#fail-meaning").inner_text() == SENTENCES[FailureKind.NOT_SEEN]
    page.keyboard.press("Escape")
    assert shown_count(page) == 4_800 and page.url.endswith("failures.html")
    page.keyboard.press("?")
    assert "next, previous failure" in page.locator("#keys").inner_text()


def test_long_facets_chips_and_copy(context: BrowserContext, served: str) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"], origin=served)
    page = opened(context, served, "?kind=nonsense&video=v0149&label=Deer&score=0.2-0.4")
    assert "what is not here: nonsense" in page.locator("#fail-said").inner_text()
    assert page.locator("#fail-chosen li").count() == 3
    page.get_by_role("button", name="Video: v0149, remove").click()
    assert set(facet(page, "score")) == {"0-0.2", "0.2-0.4", "0.4-0.6", "0.6-0.8"}
    videos = page.locator("input[name=video]")
    assert videos.count() == 8
    page.get_by_role("searchbox", name="Find: video").fill("v0042")
    assert videos.count() == 1
    videos.check()
    assert page.evaluate("document.activeElement.value") == "v0042"
    page.locator("#fail-copy").click()
    page.get_by_text("Link copied").wait_for()
    link = page.evaluate("navigator.clipboard.readText()")
    assert link == page.url and "video=v0042" in link
    page.locator("#search").fill("no such words anywhere")
    done(page)
    assert page.locator("#fail-none").is_visible() and not page.locator("#fail-list").is_visible()
    page.locator("#fail-clear").click()
    assert shown_count(page) == 4_800


@pytest.mark.parametrize("missing", ["**/data/failures.js", "**/hazards/0.js", "**/rows/system-1/0.js"])
def test_missing_data_is_told(context: BrowserContext, served: str, missing: str) -> None:
    context.route(missing, lambda route: route.abort())
    page = context.new_page()
    page.goto(f"{served}/failures.html")
    page.get_by_text("could not be loaded").wait_for()
    assert page.locator("#fail-progress").is_hidden()
    assert page.locator(".fail-link:visible").count() > 0  # the plain list, or what is here


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing(browser: Browser, site: Path, width: int, theme: Any) -> None:
    with browser.new_context(viewport={"width": width, "height": 900}, color_scheme=theme) as context:
        page = opened(context, site.as_uri(), "?kind=near-miss&q=frame")
        assert page.locator("#fail-filters").evaluate("filters => filters.open") == (width == 1440)
        page.locator("#fail-filters").evaluate("filters => { filters.open = true; }")
        page.keyboard.press("j")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page).response["violations"]
        assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == []


def test_without_scripts_and_on_paper(browser: Browser, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/failures.html")
        assert page.locator("#fail-first li").count() == 50 and not page.locator("#fail-tool").is_visible()
        assert page.get_by_text("Filters, search and the whole list need JavaScript").is_visible()
        assert page.get_by_text("4,750 more failures not in this list").is_visible()
        assert page.locator("#counts-table tbody a").first.get_attribute("href") == (
            "failures.html?kind=not-seen&system=system-0"
        )
        page.locator("summary", has_text="All funnels as a table").click()
        assert page.locator("#funnel-table").get_by_text("not recorded").first.is_visible()
    with browser.new_context() as context:
        page = opened(context, site.as_uri())
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        page.emulate_media(media="print")
        assert page.locator("#fail-list > li").count() == 50
        assert page.get_by_text("Printed: the first 50 of 4,800").is_visible()


def test_a_video_opened_from_a_filter_is_followed_by_the_others(context: BrowserContext, served: str) -> None:
    page = opened(context, served, "?kind=near-miss")
    count = page.locator("#fail-count").inner_text()
    page.evaluate("document.addEventListener('click', (event) => event.preventDefault())")
    page.locator(".fail-link").first.click()
    walk = page.evaluate("JSON.parse(sessionStorage.getItem('coooler-walk'))")
    assert walk["title"] == count
    assert "/failures.html?kind=near-miss" in walk["from"]
    first = page.locator(".fail-link").first.get_attribute("href")
    assert first and first.startswith(walk["ids"][0] + "#")
    assert len(set(walk["ids"])) == len(walk["ids"]) > 1
    page.locator("#fail-clear").click()
    page.locator(".fail-link").first.click()
    assert page.evaluate("sessionStorage.getItem('coooler-walk')") is None


def test_very_many_failures_come_when_they_are_asked_for(context: BrowserContext, tmp_path: Path) -> None:
    root = write_page(*generated(160, 4, each=8), tmp_path).as_uri()  # 5,120 failures
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{root}/failures.html", wait_until="networkidle")
    assert not any("/data/" in address for address in asked)
    assert page.locator("#fail-first").is_visible()
    page.locator("#fail-load").click()
    done(page)
    assert shown_count(page) == 5_120 and not page.locator("#fail-load").is_visible()
    assert opened(context, root, "?sort=low").locator("#fail-sort").input_value() == "low"
