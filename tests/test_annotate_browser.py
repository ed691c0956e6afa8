"""`coooler data annotate` as two people use it: a real server, which also crashes, and real browsers."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect

from sitegen.numerals import percent
from sitegen.readers import read_truth
from tests.annotating import Serving, make_folder, serving

pytestmark = pytest.mark.browser

READY = "() => document.getElementById('editor')?.dataset.ready"
SENTENCE = "A van pulls out in front of us"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_folder(tmp_path / "roads")


@pytest.fixture
def server(folder: Path) -> Iterator[Serving]:
    with serving(folder) as started:
        yield started


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    """A server for the tests that need none of their own; they write of different videos."""
    with serving(make_folder(tmp_path_factory.mktemp("calm") / "roads")) as started:
        yield started


class Person:
    """An annotator with a browser of their own; `complaints` are what its pages threw."""

    def __init__(self, context: BrowserContext, server: Serving, name: str) -> None:
        self.base = server.base
        self.context = context
        self.complaints: list[str] = []
        self.page = self.tab()
        self.page.goto(server.address)
        self.page.get_by_label("Name").fill(name)
        self.page.get_by_role("button", name="Begin").click()
        self.page.wait_for_selector("table.videos")

    def tab(self) -> Page:
        page = self.context.new_page()
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        return page

    def open(self, path: str, page: Page | None = None) -> Page:
        page = page or self.page
        page.goto(f"{self.base}/{path}")
        page.wait_for_function(READY)
        return page

    def says(self, video_id: str, key: str, label: str = "", sentence: str = "") -> None:
        page = self.open(f"video/{video_id}")
        page.keyboard.press(key)
        if label:
            write(page, label, sentence)
        saved(page)


def write(page: Page, label: str, sentence: str) -> None:
    """In the label's field: it and the sentence, then back to the clip."""
    page.keyboard.type(label)
    page.keyboard.press("Enter")
    page.keyboard.type(sentence)
    page.keyboard.press("Escape")


def saved(page: Page) -> None:
    expect(page.locator("#saved")).to_contain_text("Saved ", timeout=20_000)


@pytest.fixture
def ada(browser: Browser, server: Serving) -> Iterator[Person]:
    with browser.new_context(viewport={"width": 1440, "height": 900}) as context:
        person = Person(context, server, "Ada")
        yield person
        assert person.complaints == []


@pytest.fixture
def bob(browser: Browser, server: Serving) -> Iterator[Person]:
    with browser.new_context(viewport={"width": 390, "height": 800}) as context:
        person = Person(context, server, "Bob")
        yield person
        assert person.complaints == []


@pytest.fixture
def cleo(browser: Browser, calm: Serving) -> Iterator[Person]:
    with browser.new_context(viewport={"width": 1440, "height": 900}) as context:
        person = Person(context, calm, "Cleo")
        yield person
        assert person.complaints == []


def rows(folder: Path, *videos: str) -> list[tuple[Any, ...]]:
    """The truth of these videos, else of all."""
    return [
        (row.video_id, row.label, row.description, row.track_id, row.first_frame, row.last_frame)
        for row in read_truth(folder / "truth.parquet")
        if not videos or row.video_id in videos
    ]


def test_two_annotate_and_merge(folder: Path, ada: Person, bob: Person) -> None:
    page = ada.open("video/road_1")
    expect(page.locator("#saved")).to_have_text("Nothing saved yet")
    expect(page.locator(".track")).to_have_count(2)
    expect(page.locator("#boxes g")).to_have_count(2)
    page.keyboard.press("1")
    expect(page.locator("#label-h1")).to_be_focused()
    page.keyboard.type("Van [1]")  # letters of keys are text in a field
    page.keyboard.press("Enter")
    page.keyboard.press("Escape")
    expect(page.locator("#problems")).to_contain_text("description")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("[")
    page.keyboard.press("Shift+ArrowRight")
    expect(page.locator("#now")).not_to_contain_text("Frame 5 ")
    page.locator("#scrub").fill("20")
    page.keyboard.press("]")
    page.keyboard.press("e")
    page.keyboard.type(SENTENCE)
    page.keyboard.press("Control+Enter")
    page.wait_for_url("**/video/road_2")
    page.wait_for_function(READY)
    page.keyboard.press("0")
    expect(page.locator("#finished")).to_be_visible()
    assert rows(folder) == [
        ("road_1", "Van [1]", SENTENCE, "1", 5, 20),
        ("road_2", "", "", None, None, None),
    ]

    bob.says("road_1", "g", "Fog", "Fog hides the road")
    bob.says("road_2", "0")
    assert rows(folder) == [("road_2", "", "", None, None, None)]  # they differ on road_1
    assert pq.read_table(folder / "truth.parquet")["author"].to_pylist() == ["ada+bob"]

    bob.page.goto(f"{bob.base}/")
    bob.page.locator("#show").select_option("differ")
    expect(bob.page.locator("table.videos tbody tr:visible")).to_have_count(1)
    bob.page.keyboard.press("Escape")
    bob.page.locator("#next-merge").click()
    bob.page.wait_for_function(READY)
    expect(bob.page.locator(".other")).to_have_count(2)
    bob.page.keyboard.press("Shift+Digit1")
    expect(bob.page.locator("#label-h1")).to_have_value("Van [1]")
    bob.page.keyboard.press("g")
    write(bob.page, "Fog", "Fog hides the road")
    saved(bob.page)
    expect(bob.page.locator("#finished")).to_be_visible()
    assert rows(folder) == [
        ("road_1", "Van [1]", SENTENCE, "1", 5, 20),
        ("road_1", "Fog", "Fog hides the road", None, None, None),
        ("road_2", "", "", None, None, None),
    ]


def test_remove_undo_and_none(calm: Serving, cleo: Person) -> None:
    page = cleo.open("video/road_1")
    page.keyboard.press("2")
    write(page, "Car", "A car brakes")
    page.keyboard.press("2")  # it is none after all
    expect(page.locator(".hazard-card")).to_have_count(0)
    page.keyboard.press("u")
    expect(page.locator("#label-h1")).to_have_value("Car")
    page.keyboard.press("0")
    expect(page.locator("#no-hazard")).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="Undo").click()
    saved(page)
    expect(page.locator("#finished")).to_be_visible()
    assert rows(calm.folder, "road_1") == [("road_1", "Car", "A car brakes", "2", 0, 29)]
    page.keyboard.press("-")
    expect(page.locator("#speed")).to_have_value("0.5")
    page.locator("#scrub").fill("2")
    page.keyboard.press("Space")  # from the slider too
    page.wait_for_function("() => Number(document.getElementById('scrub').value) > 3")
    page.keyboard.press("Space")
    page.keyboard.press("?")
    expect(page.locator("#keys")).to_be_visible()
    page.keyboard.press("0")  # no key acts behind the list
    page.keyboard.press("Escape")
    expect(page.locator("#label-h1")).to_have_value("Car")


def test_a_crash_of_the_server_loses_nothing(folder: Path, ada: Person, server: Serving) -> None:
    page = ada.open("video/road_1")
    page.keyboard.press("1")
    page.keyboard.type("Van")
    page.keyboard.press("Enter")
    page.keyboard.type(SENTENCE[:12])
    server.kill()
    page.keyboard.type(SENTENCE[12:20])
    expect(page.locator("#saved")).to_have_text("Not saved: the server does not answer; trying again")
    page.keyboard.type(SENTENCE[20:])
    page.keyboard.press("Escape")
    page.keyboard.press("n")  # it does not leave what is not saved
    page.wait_for_timeout(300)
    assert page.url.endswith("/video/road_1")
    with serving(folder, server.port) as again:
        saved(page)
        assert rows(folder) == [("road_1", "Van", SENTENCE, "1", 0, 29)]
        again.kill()
        page.keyboard.press("e")
        page.keyboard.press("End")
        page.locator("#description-h1").press_sequentially(" now")
        page.close()  # and the browser's page is gone too
        with serving(folder, server.port):
            page = ada.tab()
            page.goto(f"{ada.base}/")
            expect(page.locator("#leftovers")).to_contain_text("Saved what a page")
            ada.open("video/road_1", page)
            expect(page.locator("#description-h1")).to_have_value(f"{SENTENCE} now")
            assert rows(folder) == [("road_1", "Van", f"{SENTENCE} now", "1", 0, 29)]


def test_two_tabs_of_one_author(calm: Serving, cleo: Person) -> None:
    first, second = cleo.open("video/road_3"), cleo.open("video/road_3", cleo.tab())
    first.keyboard.press("0")
    saved(first)
    second.keyboard.press("g")
    write(second, "Fog", "Fog hides the road")
    expect(second.locator("#conflict")).to_be_visible()
    expect(second.locator("#conflict-here")).to_contain_text("Fog hides the road")
    expect(second.locator("#conflict-saved")).to_contain_text("No hazard.")
    assert rows(calm.folder, "road_3") == [("road_3", "", "", None, None, None)]
    second.get_by_role("button", name="Keep mine").click()
    saved(second)
    assert rows(calm.folder, "road_3") == [("road_3", "Fog", "Fog hides the road", None, None, None)]
    first.keyboard.press("0")
    first.keyboard.press("0")
    first.get_by_role("button", name="Take what is saved").click()
    expect(first.locator("#label-h1")).to_have_value("Fog")
    saved(first)
    assert rows(calm.folder, "road_3") == [("road_3", "Fog", "Fog hides the road", None, None, None)]
    assert first.evaluate("() => Object.keys(localStorage).filter((k) => k.includes('draft'))") == []


def test_without_a_clip_that_plays(cleo: Person) -> None:
    page = cleo.tab()
    page.route(re.compile(r"\d/clip/"), lambda route: route.abort())
    cleo.open("video/road_1", page)
    expect(page.locator("#still-frame")).to_be_visible()
    expect(page.locator("#play")).to_be_disabled()
    second = page.locator("#strip button").nth(1)
    page.keyboard.press("ArrowRight")
    expect(second).to_have_attribute("aria-current", "true")
    expect(page.locator("#now")).to_contain_text(f"Frame {second.inner_text()} ")
    expect(page.locator("#boxes g")).to_have_count(2)


def test_axe_finds_nothing_and_nothing_sticks_out(ada: Person, bob: Person) -> None:
    ada.says("road_1", "1", "<b>Van</b>", SENTENCE)
    bob.says("road_1", "1", "Van", "A truck brakes")
    wide, narrow = (ada, 1440, ("light", "dark")), (bob, 390, ("dark",))
    for (person, width, themes), paths in (
        (wide, ("", "video/road_1", "merge/road_1", "agreement")),
        (narrow, ("", "merge/road_1", "agreement", "nowhere")),
    ):
        page = person.page
        for path in paths:
            page.goto(f"{person.base}/{path}")
            if path.startswith(("video", "merge")):
                page.wait_for_function(READY)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, path
            for theme in themes:
                page.emulate_media(color_scheme="dark" if theme == "dark" else "light")
                found = Axe().run(page).response["violations"]
                assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == [], path
    ada.page.goto(f"{ada.base}/merge/road_1")
    expect(ada.page.locator(".other .label")).to_have_text(["<b>Van</b>", "Van"])
    ada.page.goto(f"{ada.base}/agreement")
    expect(ada.page.locator("h2")).to_have_text(["ada and bob", "Keyboard"])
    expect(ada.page.locator(".figures dd").nth(4)).to_have_text(percent(1.0))  # the same track
