"""Blind votes in a real Chromium: by keys and clicks, kept, taken back, exported, and imported again."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page

from pipeline.benchmark import Benchmark
from sitegen.build import build_site
from sitegen.votes import import_votes, load_votes
from tests.site_fixtures import make_benchmark, make_board

pytestmark = pytest.mark.browser

BUDGET = 300 * 1024
NAMES = ("Good system", "Silent")  # the third is named like one of its captions
SEED = "crypto.getRandomValues = (array) => array.fill(20260102)"
SIDES = "[document.getElementById('vote-left').innerText, document.getElementById('vote-right').innerText]"


@pytest.fixture(scope="module")
def benchmark(tmp_path_factory: pytest.TempPathFactory) -> Benchmark:
    return make_benchmark(tmp_path_factory.mktemp("benchmark"))


@pytest.fixture(scope="module")
def site(benchmark: Benchmark, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    build_site(benchmark, out, make_board(benchmark))
    return out


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    with browser.new_context(viewport={"width": 1440, "height": 900}) as made:
        made.add_init_script(SEED)
        yield made


def complaints_of(page: Page) -> list[str]:
    """What the page will complain about, and every address it asks for beside its own."""
    found: list[str] = []
    page.on("console", lambda message: found.append(message.text))
    page.on("pageerror", lambda error: found.append(str(error)))
    # A picture that is still on its way when the page is left is no complaint.
    aborted = "net::ERR_ABORTED"
    page.on("requestfailed", lambda request: request.failure == aborted or found.append(request.url))
    return found


def open_vote(context: BrowserContext, root: str) -> Page:
    page = context.new_page()
    page.goto(f"{root}/vote.html", wait_until="networkidle")
    page.wait_for_selector("#vote-left > *")
    return page


def press(page: Page, key: str) -> None:
    """Press a key and wait until the next comparison is there."""
    page.keyboard.press(key)
    page.wait_for_function("() => document.querySelector('[aria-disabled=false]')")


def number(page: Page) -> str:
    return page.locator("#vote-number").inner_text()


def exported(page: Page, folder: Path) -> Path:
    with page.expect_download() as download:
        page.locator("#vote-export").click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


@pytest.mark.parametrize("way", ["file", "http"])
def test_vote_undo_reload_export_import(
    context: BrowserContext, benchmark: Benchmark, site: Path, served: str, tmp_path: Path, way: str
) -> None:
    root = site.as_uri() if way == "file" else served
    page = context.new_page()
    complaints, addresses = complaints_of(page), []
    page.on("request", lambda request: addresses.append(request.url))
    page.goto(f"{root}/vote.html", wait_until="networkidle")
    assert number(page) == "Comparison 1" and page.locator("#vote-count").inner_text().startswith(
        "0 votes of 7"
    )

    seen, chosen = [], []
    for key, choice in (("1", "left"), ("b", "right"), ("t", "tie"), ("s", "skip"), ("0", "tie")):
        assert not any(name in page.locator("body").inner_text() for name in NAMES)
        seen.append(page.evaluate(SIDES))
        chosen.append(choice)
        press(page, key)
    assert len({tuple(sides) for sides in seen}) == 5 and number(page) == "Comparison 6"
    assert page.evaluate("document.documentElement.dataset.theme") is None  # t is a tie here
    last = page.evaluate(SIDES)
    press(page, "u")
    assert page.evaluate(SIDES) == seen[4] and number(page) == "Comparison 5"
    press(page, "2")
    assert page.evaluate(SIDES) == last

    page.locator("#vote-voter").fill("Ada 1")  # typing is no voting
    page.reload()
    page.wait_for_selector("#vote-left > *")
    assert page.evaluate(SIDES) == last and number(page) == "Comparison 6"
    assert page.locator("#vote-voter").input_value() == "Ada 1"
    file = exported(page, tmp_path)
    content = json.loads(file.read_text(encoding="utf-8"))
    assert (content["voter"], content["seed"], content["revision"]) == ("Ada 1", 20260102, 7)
    assert [one["choice"] for one in content["votes"]] == ["left", "right", "tie", "right"]
    texts = {"good-system": "A ", "silent": "(says nothing)"}
    for one, sides in zip(content["votes"], [*seen[:3], seen[4]], strict=True):
        for side, text in zip(("left", "right"), sides, strict=True):
            assert text.startswith(texts.get(one[side], text)), one

    report = import_votes(benchmark, [file])
    assert (report.votes, report.apart, len(report.stored)) == (4, 0, 1)
    assert {(one.video_id, one.choice) for one in load_votes(benchmark).current} == {
        (one["video_id"], one["choice"]) for one in content["votes"]
    }
    report.stored[0].unlink()
    assert complaints == []
    assert [one for one in addresses if not one.startswith((f"{root}/", "data:", "blob:"))] == []


def test_to_the_end_and_over_again(context: BrowserContext, served: str) -> None:
    page = open_vote(context, served)
    complaints = complaints_of(page)
    for _ in range(7):
        page.locator("[data-choice=left]").click()
    page.wait_for_function("() => document.getElementById('vote-number').textContent === 'Finished'")
    assert not page.locator("#vote-left").is_visible()
    facts = page.locator("#vote-facts").inner_text().split()
    assert facts[:2] == ["Votes", "7"] and page.locator("#vote-facts").inner_text().endswith("3 of 3")
    assert not any(name in page.locator("body").inner_text() for name in NAMES)
    page.locator("#vote-names").click()
    rows = page.locator("#vote-won tbody tr").all_inner_texts()
    assert sum(int(row.split("\t")[1]) for row in rows) == 7 and any("Silent" in row for row in rows)
    page.keyboard.press("1")
    assert page.locator("#vote-count").inner_text().startswith("7 votes")
    press(page, "u")
    assert number(page) == "Comparison 7" and page.locator("#vote-left").is_visible()
    page.on("dialog", lambda dialog: dialog.accept())
    page.locator("#vote-restart").click()
    page.wait_for_function("() => document.getElementById('vote-number').textContent === 'Comparison 1'")
    assert page.locator("#vote-summary").is_hidden() and complaints == []


def test_names_only_for_those_who_ask(context: BrowserContext, served: str) -> None:
    page = open_vote(context, served)
    page.locator("#vote-reveal").check()
    press(page, "1")
    said = page.locator("#vote-said").inner_text()
    assert said.startswith("A is better. In v") and "A was " in said and "B was " in said
    page.locator("#vote-reveal").uncheck()
    press(page, "1")
    assert page.locator("#vote-said").inner_text() == "A is better."
    press(page, "?")
    assert "undo the last one" in page.locator("#keys").inner_text()
    page.keyboard.press("1")  # keys rest while the list is open
    page.keyboard.press("Escape")
    assert number(page) == "Comparison 3"


def test_without_storage_votes_last_as_long_as_the_page(
    browser: Browser, served: str, tmp_path: Path
) -> None:
    with browser.new_context() as context:
        forbid = "Object.defineProperty(window, 'localStorage', { get() { throw new Error('no'); } })"
        context.add_init_script(forbid)
        page = open_vote(context, served)
        assert page.get_by_text("This browser keeps nothing").is_visible()
        press(page, "1")
        press(page, "2")
        assert len(json.loads(exported(page, tmp_path).read_bytes())["votes"]) == 2
        page.reload()
        page.wait_for_selector("#vote-left > *")
        assert number(page) == "Comparison 1"


@pytest.mark.parametrize("kept", ["{", "null", "[]", '{"seed": -1}', '{"seed": 1, "acts": [3]}'])
def test_spoilt_memory_is_a_new_start(context: BrowserContext, served: str, kept: str) -> None:
    page = open_vote(context, served)
    press(page, "1")
    page.evaluate("kept => localStorage.setItem(Object.keys(localStorage)[0], kept)", kept)
    complaints = complaints_of(page)
    page.reload()
    page.wait_for_selector("#vote-left > *")
    assert number(page) == "Comparison 1" and complaints == []


def test_first_load_and_playing(context: BrowserContext, served: str) -> None:
    page = context.new_page()
    loaded: dict[str, int] = {}
    page.on("response", lambda response: loaded.update({response.url: len(response.body())}))
    page.goto(f"{served}/vote.html", wait_until="networkidle")
    assert any(address.endswith(".webp") for address in loaded)
    assert not any(address.endswith(".mp4") for address in loaded)
    assert sum(loaded.values()) <= BUDGET, loaded
    page.keyboard.press("p")
    page.wait_for_function("() => document.getElementById('vote-clip').currentTime > 0")
    page.keyboard.press("p")
    assert page.evaluate("document.getElementById('vote-clip').paused")
    page.locator("#vote-play").check()
    press(page, "s")
    page.wait_for_function("() => document.getElementById('vote-clip').currentTime > 0")


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing(browser: Browser, site: Path, width: int, theme: Any) -> None:
    with browser.new_context(viewport={"width": width, "height": 900}, color_scheme=theme) as context:
        context.add_init_script(SEED)
        page = open_vote(context, site.as_uri())
        for step in range(2):
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            found = Axe().run(page).response["violations"]
            assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == [], step
            if step == 0:
                press(page, "1")
                page.locator("#vote-summary summary").click()
                page.locator("#vote-names").click()


def test_without_scripts_and_on_paper(browser: Browser, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/vote.html")
        assert page.get_by_text("Voting needs JavaScript").is_visible()
        assert not page.locator("#vote").is_visible()
        page.emulate_media(media="print")
        assert page.get_by_text("This page is interactive").is_visible()


def test_where_clips_are_not_shown_keyframes_are(
    context: BrowserContext, benchmark: Benchmark, tmp_path: Path
) -> None:
    settings = benchmark.settings.model_copy(update={"show_videos": False})
    build_site(Benchmark(benchmark.root, settings), tmp_path, make_board(benchmark))
    page = open_vote(context, tmp_path.as_uri())
    complaints = complaints_of(page)
    assert not page.locator("#vote-clip").is_visible() and page.locator("#vote-strip img").count() == 9
    first = page.locator("#vote-frame").get_attribute("src")
    page.keyboard.press("ArrowRight")
    assert page.locator("#vote-frame").get_attribute("src") != first
    page.locator("#vote-strip button").first.click()
    assert page.locator("#vote-strip [aria-current]").inner_text().startswith("0.0")
    press(page, "1")
    assert number(page) == "Comparison 2" and complaints == []


@pytest.mark.parametrize("missing", ["**/data/votes.js", "**/data/votes/0.js"])
def test_missing_data_is_told(context: BrowserContext, served: str, missing: str) -> None:
    context.route(missing, lambda route: route.abort())
    page = context.new_page()
    page.goto(f"{served}/vote.html")
    page.get_by_text("could not be loaded").wait_for()
    assert not page.locator("#vote").is_visible()


def test_two_tabs_count_together(context: BrowserContext, served: str) -> None:
    one, other = open_vote(context, served), open_vote(context, served)
    press(one, "1")
    other.wait_for_function("() => document.getElementById('vote-number').textContent === 'Comparison 2'")
    press(other, "2")
    one.wait_for_function("() => document.getElementById('vote-number').textContent === 'Comparison 3'")


def test_new_captions_are_asked_about_again(context: BrowserContext, served: str, tmp_path: Path) -> None:
    page = open_vote(context, served)
    press(page, "1")
    changed = page.evaluate("COOOLER_BALLOT.file().votes[0].left_predictions_sha256")
    context.route(
        "**/data/votes.js",
        lambda route: route.fulfill(body=route.fetch().text().replace(changed, "f" * 64)),
    )
    page.reload()
    page.wait_for_selector("#vote-left > *")
    for n in range(7):
        assert number(page) == f"Comparison {n + 2}"
        page.locator("[data-choice=tie]").click()
    page.wait_for_function("() => document.getElementById('vote-number').textContent === 'Finished'")
    votes = json.loads(exported(page, tmp_path).read_bytes())["votes"]
    assert len(votes) == 8 and [one["choice"] for one in votes].count("tie") == 7
    assert [one["choice"] for one in votes if changed in one.values()] == ["left"]
