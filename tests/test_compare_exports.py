"""What the compare page gives away, in Chromium: links, JSON, pictures, who detects what, no scripts."""

import json
import xml.etree.ElementTree as ET
from dataclasses import asdict
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, expect

from sitegen.compare import compare
from sitegen.gathered import SiteData
from tests.compare_case import PAIR, A, B, board, gap, opened, query_of, system, write_page

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def data() -> SiteData:
    return board(130, 5)


@pytest.fixture(scope="module")
def site(data: SiteData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(data, tmp_path_factory.mktemp("compare"))


@pytest.mark.parametrize("way", ["file", "http"])
def test_the_link_is_copied(context: BrowserContext, site: Path, served: str, way: str) -> None:
    if way == "http":
        context.grant_permissions(["clipboard-read", "clipboard-write"], origin=served)
    page = opened(context, site.as_uri() if way == "file" else served, PAIR)
    page.locator("#duel-sort").select_option("b")
    page.locator("#duel-copy").click()
    expect(page.locator("#duel-said")).not_to_be_empty()
    said = page.locator("#duel-said").inner_text()
    if way == "http":
        assert said.startswith("The link is copied")
        assert page.evaluate("navigator.clipboard.readText()") == page.url
    assert said.startswith("The link is copied") or page.url in said


def test_the_export_is_what_compare_says(context: BrowserContext, data: SiteData, root: str) -> None:
    page = opened(context, root, f"{PAIR}&sort=id&show=equal")
    with page.expect_download() as download:
        page.locator("#duel-json").click()
    assert download.value.suggested_filename == f"compare-{A}-{B}.json"
    content = json.loads(Path(download.value.path()).read_text(encoding="utf-8"))
    found = compare(system(data, A).evaluation, system(data, B).evaluation)
    for key, one in found.items():
        assert {"key": key, **content["tests"][key]} == asdict(one)
    assert (content["format"], content["a"], content["b"]) == ("coooler-comparison", A, B)
    assert content["signature"] == str(data.systems[0].evaluation.card.signature)
    ids = [video_id for video_id in data.video_ids if gap(data, video_id) == 0]
    assert [row["video_id"] for row in content["videos"]] == ids
    for row in content["videos"]:
        score = system(data, B).scores[row["video_id"]]
        assert row["b"]["besm"] == pytest.approx(score.besm, abs=1e-7)
        assert row["b"]["detected"] == score.detected


def test_the_chart_is_exported(context: BrowserContext, root: str) -> None:
    page = opened(context, root, PAIR)
    with page.expect_download() as download:
        page.locator("#duel-svg").click()
    text = Path(download.value.path()).read_text(encoding="utf-8")
    svg = ET.fromstring(text)
    assert svg.tag == "{http://www.w3.org/2000/svg}svg" and "var(" not in text
    words = [node.text for node in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert "A better: System 2" in words and "BESM, A − B, in 130 videos" in words
    with page.expect_download() as download:
        page.locator("#duel-png").click()
    assert Path(download.value.path()).read_bytes().startswith(b"\x89PNG\r\n")


def test_a_bar_leads_to_its_row(context: BrowserContext, data: SiteData, site: Path) -> None:
    page = opened(context, site.as_uri(), f"{PAIR}&show=b-better")
    plot = page.locator("#duel-plot svg")
    plot.click(position={"x": 58, "y": 100})  # the first bar: the largest lead of A
    assert query_of(page)["show"] == "all"
    best = max(data.video_ids, key=lambda video_id: (gap(data, video_id), [-ord(c) for c in video_id]))
    expect(page.locator(".duel-here .duel-id")).not_to_be_empty()
    assert page.locator(".duel-here .duel-id").inner_text() == best


def test_who_detects_what_is_counted_anew(context: BrowserContext, data: SiteData, root: str) -> None:
    page = opened(context, root)
    text = (
        "['solved-counts', 'solved-sets', 'solved-matrix'].map(id => document.getElementById(id).innerText)"
    )
    before = page.evaluate(text)
    page.locator(".solved-choice summary").click()
    page.locator("#solved-boxes input").nth(1).uncheck()
    expect(page.locator("#solved-matrix tbody tr")).to_have_count(4)
    assert page.locator("#solved-counts tbody th").all_inner_texts()[0] == "all 4"
    kept = [one for place, one in enumerate(data.systems) if place != 1]
    both = sum(all(one.scores[video_id].detected for one in kept) for video_id in data.video_ids)
    assert page.locator("#solved-counts tbody td").first.inner_text() == str(both)
    assert "of" in query_of(page)
    page.locator("#solved-boxes input").nth(1).check()
    expect(page.locator("#solved-matrix tbody tr")).to_have_count(5)
    expect(page.locator("#solved-counts .solved-rest")).not_to_have_count(0)
    assert page.evaluate(text) == before
    assert "of" not in query_of(page)
    rest = page.locator("#solved-counts .solved-rest").first
    wanted = int(rest.inner_text().split()[1])
    row = rest.evaluate("rest => rest.closest('tr').sectionRowIndex")
    cell = page.locator("#solved-counts tbody tr").nth(row).locator(".solved-which")
    rest.click()
    expect(cell.locator("a")).to_have_count(6 + wanted)
    page.locator("#solved-none").click()
    expect(page.locator("#solved-matrix tbody tr")).to_have_count(0)


def test_the_matrix_leads_to_its_videos(context: BrowserContext, data: SiteData, site: Path) -> None:
    page = opened(context, site.as_uri())
    link = page.locator("#solved-matrix td a").first
    number = int(link.inner_text())
    link.click()
    page.wait_for_url("**show=only-a**")
    page.wait_for_selector("#duel-rows .duel-video[href]")
    assert page.locator("#duel-count").inner_text().startswith(f"{number} of 130 videos")


def test_missing_data_is_said(context: BrowserContext, data: SiteData, tmp_path: Path) -> None:
    root = write_page(data, tmp_path)
    (root / "data/compare/scores" / B / "1.js").unlink()
    page = opened(context, root.as_uri())
    page.locator("#duel-b").select_option(B)
    page.wait_for_selector("#duel-problem:visible")
    page.locator("#duel-b").select_option(A)
    page.wait_for_selector("#duel-problem", state="hidden")
    (root / "data/compare.js").unlink()
    page.goto(f"{root.as_uri()}/compare.html")
    page.wait_for_selector("#duel-problem:visible")
    assert page.locator("#solved-counts tbody tr").count() == 6


def test_without_scripts(browser: Browser, data: SiteData, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/compare.html{PAIR}")
        assert not page.locator("#duel").is_visible() and not page.locator(".solved-choice").is_visible()
        assert page.locator("#against-table tbody tr:visible").count() == 4
        assert page.locator("#solved-matrix tbody tr:visible").count() == 5
        assert page.locator(".kept-back").is_visible()
        href = page.locator("#solved-counts .solved-which a").first.get_attribute("href")
        assert href is not None and (site / href).is_file()
