"""The compare page in Chromium: choices, orders, filters, keys, links that restore what was seen."""

from collections.abc import Callable
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect

from sitegen.compare import compare
from sitegen.gathered import SiteData
from sitegen.page_compare import p_text
from sitegen.words import visible
from tests.compare_case import PAIR, A, B, board, gap, opened, query_of, system, write_page

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def data() -> SiteData:
    return board(130, 5)


@pytest.fixture(scope="module")
def site(data: SiteData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(data, tmp_path_factory.mktemp("compare"))


def shown(page: Page) -> list[str]:
    """The ids of the rows, once all their names are there."""
    expect(page.locator("#duel-rows .duel-video:not([href])")).to_have_count(0)
    return page.locator("#duel-rows .duel-id").all_inner_texts()


def expected(data: SiteData, keep: Callable[[str], bool], order: Callable[[str], float]) -> list[str]:
    """The first 20 ids that are kept, by the order and then by id, as the page shows them."""
    ids = sorted((video_id for video_id in data.video_ids if keep(video_id)), key=order)
    return [visible(video_id) for video_id in ids[:20]]


def test_silent_and_inside(context: BrowserContext, root: str) -> None:
    page = context.new_page()
    asked: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda request: complaints.append(request.url))
    page.on("dialog", lambda dialog: complaints.append(dialog.message))
    page.goto(f"{root}/compare.html{PAIR}", wait_until="networkidle")
    page.locator("#duel-swap").click()
    page.locator("#duel-more").click()
    page.locator(".solved-choice summary").click()
    page.locator("#solved-boxes input").first.uncheck()
    expect(page.locator("#solved-matrix tbody tr")).to_have_count(4)
    assert complaints == [] and [url for url in asked if not url.startswith(f"{root}/")] == []
    assert sum("/scores/" in url for url in asked) == 4  # two systems, two shards each


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing_and_nothing_sticks_out(
    browser: Browser, site: Path, width: int, theme: str
) -> None:
    with browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme="dark" if theme == "dark" else "light"
    ) as context:
        page = opened(context, site.as_uri(), PAIR)
        page.keyboard.press("j")
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page).response["violations"]
        assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == []


def test_the_first_two_are_there_and_others_are_chosen(
    context: BrowserContext, data: SiteData, root: str
) -> None:
    page = opened(context, root)
    assert page.locator("#duel-a").input_value() == data.systems[0].slug
    assert page.locator("#duel-b").input_value() == data.systems[1].slug
    page.locator("#duel-a").select_option(A)
    page.locator("#duel-b").select_option(B)
    expect(page.locator("#duel-words")).to_contain_text("System 3")
    one = compare(system(data, A).evaluation, system(data, B).evaluation)["besm"]
    cells = page.locator("#duel-tests .duel-chosen td").all_inner_texts()
    assert cells[:2] == [f"{one.a:.4f}", f"{one.b:.4f}"] and cells[4] == p_text(one.p_randomisation)
    assert cells[5:] == [str(one.wins), str(one.losses), str(one.ties)]
    words = page.locator("#duel-words").inner_text()
    assert f"by {abs(one.difference):.4f} in BESM" in words
    assert ("can be told apart" in words) == (one.p_randomisation < 0.05)
    assert query_of(page) == {"a": A, "b": B, "metric": "besm", "sort": "a", "show": "all"}
    page.locator("#duel-b").select_option(A)  # the same on both sides: they change sides
    assert (query_of(page)["a"], query_of(page)["b"]) == (B, A)


def test_every_order(context: BrowserContext, data: SiteData, site: Path) -> None:
    page = opened(context, site.as_uri(), PAIR)
    orders: dict[str, Callable[[str], float]] = {
        "a": lambda video_id: -gap(data, video_id),
        "b": lambda video_id: gap(data, video_id),
        "size": lambda video_id: -abs(gap(data, video_id)),
        "id": lambda _: 0,
    }
    for name, order in orders.items():
        page.locator("#duel-sort").select_option(name)
        assert shown(page) == expected(data, lambda _: True, order), name
        assert query_of(page)["sort"] == name
    assert page.locator("#duel-count").inner_text() == "130 videos; the first 20 are shown"
    page.locator("#duel-more").click()
    assert len(shown(page)) == 120 and page.locator("#duel-more").inner_text() == "Show 10 more (10 left)"
    page.locator("#duel-more").click()
    assert len(shown(page)) == 130 and not page.locator("#duel-more").is_visible()


def test_every_filter(context: BrowserContext, data: SiteData, site: Path) -> None:
    page = opened(context, site.as_uri(), f"{PAIR}&sort=id")
    in_a, in_b = (
        {video.video_id for video in system(data, slug).evaluation.videos if video.detected}
        for slug in (A, B)
    )
    filters: dict[str, Callable[[str], bool]] = {
        "a-better": lambda video_id: gap(data, video_id) > 0,
        "b-better": lambda video_id: gap(data, video_id) < 0,
        "equal": lambda video_id: gap(data, video_id) == 0,
        "both": lambda video_id: video_id in in_a & in_b,
        "only-a": lambda video_id: video_id in in_a - in_b,
        "only-b": lambda video_id: video_id in in_b - in_a,
        "neither": lambda video_id: video_id not in in_a | in_b,
    }
    for name, keep in filters.items():
        chip = page.locator(f"#duel-show input[value={name}]")
        chip.check()
        assert shown(page) == expected(data, keep, lambda _: 0), name
        count = chip.locator("xpath=..").locator(".chip-count").inner_text()
        assert int(count) == sum(map(keep, data.video_ids)) and query_of(page)["show"] == name


def test_a_video_opened_from_a_list_is_followed_by_the_others(context: BrowserContext, served: str) -> None:
    page = opened(context, served, f"{PAIR}&sort=id&show=a-better")
    rows = shown(page)
    page.evaluate("document.addEventListener('click', (event) => event.preventDefault())")
    page.locator("#duel-rows .duel-video").nth(1).click()
    walk = page.evaluate("JSON.parse(sessionStorage.getItem('coooler-walk'))")
    assert len(walk["ids"]) == len(rows) > 1
    assert page.locator("#duel-rows .duel-video").nth(1).get_attribute("href") == walk["ids"][1]
    assert "show=a-better" in walk["from"] and walk["title"] == page.locator("#duel-count").inner_text()


def test_every_score(context: BrowserContext, data: SiteData, site: Path) -> None:
    page = opened(context, site.as_uri(), f"{PAIR}&sort=id")
    video = system(data, A).scores[data.video_ids[0]]
    for metric, value in (("sam", video.sam), ("best", video.best), ("detection", video.best)):
        page.locator(f"#duel-metric input[value={metric}]").check()
        assert page.locator(".duel-row .duel-score b").first.inner_text() == f"{value:.4f}"
    assert page.locator(".duel-gap b").first.inner_text() in {"only A", "only B", "same"}
    page.locator("#duel-metric input[value=best]").check()
    assert "there is no test of it" in page.locator("#duel-words").inner_text()
    assert page.locator("#duel-tests .duel-chosen").count() == 0


def test_keys(context: BrowserContext, data: SiteData, root: str) -> None:
    page = opened(context, root, f"{PAIR}&sort=id")
    here = page.locator(".duel-here .duel-id")
    page.keyboard.press("k")
    assert here.inner_text() == visible(data.video_ids[0])
    page.keyboard.press("j")
    page.keyboard.press("j")
    page.keyboard.press("k")
    assert here.inner_text() == data.video_ids[1] and page.locator(".duel-cursor").count() == 1
    page.keyboard.press("x")
    expect(page.locator("#duel-words")).to_contain_text("System 2 B")
    assert (query_of(page)["a"], query_of(page)["b"]) == (B, A)
    page.keyboard.press("?")
    page.keyboard.press("x")  # keys rest while the list is open
    assert query_of(page)["a"] == B and "swap A and B" in page.locator("#keys").inner_text()
    page.keyboard.press("Escape")
    for _ in range(25):  # beyond the rows that are there
        page.keyboard.press("j")
    assert page.locator(".duel-row").count() == 120 and here.inner_text() == data.video_ids[24]
    page.keyboard.press("Enter")
    page.wait_for_url(f"**/videos/{data.names[data.video_ids[24]]}.html")


def test_a_link_restores_what_was_seen(context: BrowserContext, data: SiteData, root: str) -> None:
    page = opened(context, root)
    page.locator("#duel-b").select_option(B)
    page.locator("#duel-metric input[value=detection]").check()
    page.locator("#duel-sort").select_option("size")
    page.locator("#duel-show input[value=only-a]").check()
    page.locator(".solved-choice summary").click()
    page.locator("#solved-boxes input[value=system-4]").uncheck()
    ids, words = shown(page), page.locator("#duel-words").inner_text()
    again = context.new_page()
    again.goto(page.url)
    again.wait_for_selector("#duel-rows .duel-video[href]")
    assert (shown(again), again.locator("#duel-words").inner_text()) == (ids, words)
    assert again.locator("#duel-metric input[value=detection]").is_checked()
    assert again.locator("#duel-show input[value=only-a]").is_checked()
    assert again.locator("#duel-sort").input_value() == "size"
    expect(again.locator("#solved-matrix tbody tr")).to_have_count(4)
    assert not again.locator("#solved-boxes input[value=system-4]").is_checked()


def test_a_link_to_what_is_gone_says_so(context: BrowserContext, data: SiteData, site: Path) -> None:
    page = opened(context, site.as_uri(), "?a=<b>gone&b=system-0&show=%22&metric=sam&a=x")
    assert "<b>gone" in page.locator("#duel-said").inner_text()
    assert page.locator("#duel-b").input_value() == "system-0"
    assert page.locator("#duel-metric input[value=sam]").is_checked()
    same = opened(context, site.as_uri(), f"?a={B}&b={B}")
    assert same.locator("#duel-a").input_value() == B and same.locator("#duel-b").input_value() != B


def test_systems_beyond_the_tested_ones(context: BrowserContext, tmp_path: Path) -> None:
    many = board(8, 22)
    last = many.systems[21]
    page = opened(context, write_page(many, tmp_path).as_uri(), f"?a={last.slug}&b=system-0")
    assert "for the 20 best systems only" in page.locator("#duel-words").inner_text()
    row = page.locator("#duel-tests .duel-chosen td").all_inner_texts()
    assert row[0] == f"{last.evaluation.card.besm:.4f}" and row[3:] == ["–"] * 5
    assert page.locator("#solved-boxes input:checked").count() == 20
