"""The site in a real Chromium: by double-click and served, both widths and themes, scripts on and off."""

from dataclasses import dataclass, field
from pathlib import Path
from urllib.request import Request, urlopen

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page

from sitegen.build import build_site
from tests.site_fixtures import WordEmbedder, make_benchmark, make_board

pytestmark = pytest.mark.browser

BUDGET = 300 * 1024
PATHS = (
    "index.html",
    "videos.html",
    "videos/v1.html",
    "videos/v2.html",
    "videos/zz-gone.html",
    "submissions/good-system.html",
    "method.html",
    "submit.html",
    "compare.html",
    "failures.html",
    "vote.html",
    "data.html",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    benchmark = make_benchmark(tmp_path_factory.mktemp("benchmark"))
    out = tmp_path_factory.mktemp("site")
    build_site(benchmark, out, make_board(benchmark), embedder=WordEmbedder())
    return out


@dataclass
class Watched:
    """A page with all that it asked for and complained about."""

    page: Page
    addresses: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on("request", lambda request: self.addresses.append(request.url))
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("requestfailed", lambda request: self.complaints.append(f"failed: {request.url}"))
        self.page.on("dialog", lambda dialog: self.complaints.append(f"dialog: {dialog.message}"))


def open_page(context: BrowserContext, address: str) -> Page:
    page = context.new_page()
    page.goto(address)
    return page


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("way", ["file", "http"])
def test_silent_and_inside(context: BrowserContext, site: Path, served: str, path: str, way: str) -> None:
    root = site.as_uri() if way == "file" else served
    watched = Watched(context.new_page())
    watched.page.goto(f"{root}/{path}", wait_until="networkidle")
    if path == "index.html":
        watched.page.wait_for_selector(".plot .main-svg")
    assert watched.complaints == []
    assert [
        address for address in watched.addresses if not address.startswith((f"{root}/", "data:", "blob:"))
    ] == []


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing_and_nothing_sticks_out(
    browser: Browser, site: Path, width: int, theme: str
) -> None:
    with browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme="dark" if theme == "dark" else "light"
    ) as context:
        for path in PATHS:
            page = open_page(context, f"{site.as_uri()}/{path}")
            if path == "index.html":
                page.wait_for_selector(".plot .main-svg")
            page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")
            assert page.evaluate("document.documentElement.scrollWidth") <= width, path
            found = Axe().run(page).response["violations"]
            assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == [], path
            page.close()


def test_a_video_page_stays_in_its_budget(context: BrowserContext, site: Path, served: str) -> None:
    page = context.new_page()
    loaded: dict[str, int] = {}
    page.on("response", lambda response: loaded.update({response.url: len(response.body())}))
    page.goto(f"{served}/videos/v1.html", wait_until="networkidle")
    assert any(address.endswith(".webp") for address in loaded)
    assert not any(address.endswith((".mp4", "plotly.min.js")) for address in loaded)
    assert sum(loaded.values()) <= BUDGET, loaded


def test_neighbours_by_key(context: BrowserContext, site: Path) -> None:
    page = open_page(context, f"{site.as_uri()}/videos/v1.html")
    page.keyboard.press("k")  # there is none before
    page.keyboard.press("j")
    page.wait_for_url("**/v2.html")
    page.keyboard.press("k")
    page.wait_for_url("**/v1.html")


def test_help_opens_and_closes_by_key(context: BrowserContext, site: Path) -> None:
    page = open_page(context, f"{site.as_uri()}/videos/v1.html")
    page.keyboard.press("?")
    assert page.locator("#keys").is_visible() and "next, previous video" in page.locator("#keys").inner_text()
    page.keyboard.press("j")  # keys rest while the list is open
    assert page.url.endswith("v1.html")
    page.keyboard.press("Escape")
    assert not page.locator("#keys").is_visible()


def test_frames_by_key_and_click(context: BrowserContext, site: Path) -> None:
    page = open_page(context, f"{site.as_uri()}/videos/v1.html")
    links = page.locator("#strip a")
    assert links.count() == 25 and page.locator("#strip a[aria-current]").count() == 1
    links.nth(3).click()
    page.keyboard.press("ArrowRight")
    current = page.locator("#strip a[aria-current]")
    assert current.get_attribute("href") == links.nth(4).get_attribute("href")
    page.wait_for_function("() => document.getElementById('stage-picture').src.endsWith('f000005.jpg')")
    assert page.locator("#stage-text").inner_text().startswith("Frame 5 ")
    assert page.locator("#stage svg rect").count() == 2
    page.locator("#frame-back").click()
    assert page.locator("#stage-text").inner_text().startswith("Frame 4 ")


@pytest.mark.parametrize("scripts", [True, False])
def test_boxes_can_be_turned_off(browser: Browser, site: Path, scripts: bool) -> None:
    with browser.new_context(java_script_enabled=scripts) as context:
        page = open_page(context, f"{site.as_uri()}/videos/v1.html")
        boxes = page.locator("#strip svg.boxes").first
        traffic = page.locator("#stage svg.boxes g:not(.hazard)")
        assert boxes.is_visible() and traffic.is_visible()
        page.locator("#show-traffic").uncheck()
        assert boxes.is_visible() and not traffic.is_visible()
        page.locator("#show-boxes").uncheck()
        assert not boxes.is_visible()
        if scripts:
            page.keyboard.press("b")
            assert boxes.is_visible()


def test_the_clip_plays_when_asked(context: BrowserContext, site: Path, served: str) -> None:
    page = open_page(context, f"{served}/videos/v1.html")
    assert page.evaluate("document.querySelector('video').readyState") == 0
    page.evaluate("document.querySelector('video').play()")
    page.wait_for_function("() => document.querySelector('video').currentTime > 0")
    request = Request(f"{served}/media/v1/clip.mp4", headers={"Range": "bytes=0-9"})
    with urlopen(request) as answer:
        assert answer.status == 206 and len(answer.read()) == 10
        assert answer.headers["Content-Type"] == "video/mp4"


def test_the_theme_is_remembered(browser: Browser, served: str) -> None:
    with browser.new_context(color_scheme="light") as context:
        page = open_page(context, f"{served}/method.html")
        colour = "getComputedStyle(document.body).backgroundColor"
        light = page.evaluate(colour)
        page.locator("#theme").click()
        assert page.evaluate(colour) == light and page.locator("#theme").inner_text().endswith("Light")
        page.keyboard.press("t")
        dark = page.evaluate(colour)
        assert dark != light
        page.goto(f"{served}/videos/v1.html")
        assert page.evaluate(colour) == dark
        page.keyboard.press("t")
        assert page.evaluate(colour) == light and page.locator("#theme").inner_text().endswith("System")


def test_the_board_sorts_and_searches(context: BrowserContext, site: Path) -> None:
    page = open_page(context, f"{site.as_uri()}/index.html")
    first = page.locator("#board tbody tr:visible").first
    besm = page.locator("#board th", has_text="BESM")
    assert besm.get_attribute("aria-sort") == "descending" and "Good system" in first.inner_text()
    besm.locator("button").click()
    assert besm.get_attribute("aria-sort") == "ascending" and "Good system" not in first.inner_text()
    name = page.locator("#board th", has_text="Submission")
    name.locator("button").click()
    assert name.get_attribute("aria-sort") == "ascending" and besm.get_attribute("aria-sort") is None
    assert "HYPERLINK" in first.inner_text()
    page.keyboard.press("/")
    page.keyboard.type("sile")
    assert page.locator("#board tbody tr:visible").count() == 1 and "Silent" in first.inner_text()
    page.keyboard.type("zzz")
    assert page.locator("#board tbody tr:visible").count() == 0
    assert page.get_by_text("No submission matches.").is_visible()


def test_videos_are_filtered(context: BrowserContext, site: Path) -> None:
    page = open_page(context, f"{site.as_uri()}/videos.html")
    assert page.locator(".card:visible").count() == 4
    page.locator("select").select_option("clear")
    assert page.locator(".card:visible").count() == 1 and page.get_by_text("1 of 4 videos").is_visible()
    page.locator("select").select_option("")
    page.locator("#search").fill("deer road")
    assert page.locator(".card:visible .card-id").all_inner_texts() == ["v2"]


@pytest.mark.parametrize("width", [390, 1440])
@pytest.mark.parametrize("path", PATHS)
def test_every_page_reads_without_scripts(browser: Browser, site: Path, path: str, width: int) -> None:
    with browser.new_context(java_script_enabled=False, viewport={"width": width, "height": 900}) as context:
        page = open_page(context, f"{site.as_uri()}/{path}")
        assert page.locator("h1").is_visible()
        assert len(page.locator("main").inner_text()) > 150
        assert page.locator(".js-only:visible").count() == 0
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_pages_read_without_scripts(browser: Browser, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = open_page(context, f"{site.as_uri()}/index.html")
        assert page.locator("#board tbody tr").count() == 3 and not page.locator("#theme").is_visible()
        assert not page.locator(".plot").first.is_visible()
        page.locator("summary").first.click()
        assert page.locator(".chart table").first.is_visible()
        page.goto(f"{site.as_uri()}/videos/v1.html")
        assert page.locator("#strip img").count() == 25
        page.locator("#strip a").first.click()  # leads to the large picture
        assert page.url.endswith("/media/v1/f000000.jpg")
