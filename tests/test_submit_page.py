"""The submit page in Chromium: its check says what the Python check says, and how it shows that."""

import base64
import json
from collections.abc import Iterator
from dataclasses import asdict
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page

from pipeline.errors import FaultsError
from pipeline.records import TruthHazard
from sitegen import checks, coool, formats, texts
from sitegen.build import build_site
from sitegen.readers import read_predictions, read_truth
from sitegen.serve import serving
from tests.site_fixtures import make_benchmark
from tests.submit_case import HEAD, IDS, NO_HAZARD, TRUTH
from tests.submit_corpus import cases

pytestmark = pytest.mark.browser

# The check as the page runs it, but to its end at once.
RUN = """async ([files, truth]) => {
  const results = [];
  for (const [name, content] of files) {
    const bytes = Uint8Array.from(atob(content), (char) => char.charCodeAt(0));
    const steps = await COOOLER_CHECK.steps(new File([bytes], name), truth);
    let step = steps.next();
    while (!step.done) step = steps.next();
    results.push(step.value);
  }
  return results;
}"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    benchmark = make_benchmark(tmp_path_factory.mktemp("benchmark"))
    out = tmp_path_factory.mktemp("site")
    build_site(benchmark, out, [])
    return out


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> list[TruthHazard]:
    return read_truth(make_benchmark(tmp_path_factory.mktemp("truth"), clips=3).truth)


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    with browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True) as made:
        yield made


@pytest.fixture
def page(context: BrowserContext, site: Path) -> Page:
    opened = context.new_page()
    opened.goto(f"{site.as_uri()}/submit.html")
    return opened


def _expected(folder: Path, name: str, content: bytes, truth: list[TruthHazard]) -> dict[str, Any]:
    """What the Python check says of a file, in the page's form."""
    path = folder / name
    path.write_bytes(content)
    try:
        read = read_predictions(path, truth)
    except FaultsError as error:
        faults = [{k: value for k, value in asdict(fault).items() if k != "file"} for fault in error.faults]
        return {"faults": faults, "warnings": [], "predictions": 0, "videos": 0}
    finally:
        path.unlink()
    videos = len({row.video_id for row in read.predictions})
    return {
        "faults": [],
        "warnings": list(read.warnings),
        "predictions": len(read.predictions),
        "videos": videos,
        "format": read.source_format,
    }


def test_both_checks_say_the_same(page: Page, tmp_path: Path) -> None:
    table = cases()
    assert len(table) > 700
    wanted = [_expected(tmp_path, case.name, case.content, TRUTH) for case in table]
    assert sum(not want["faults"] for want in wanted) > 40
    known = {"ids": sorted(IDS), "hazards": "".join("01"[video not in NO_HAZARD] for video in sorted(IDS))}
    files = [[case.name, base64.b64encode(case.content).decode()] for case in table]
    results = page.evaluate(RUN, [files, known])
    for case, want, got in zip(table, wanted, results, strict=True):
        shown = (case.name, case.content[:300])
        assert bool(got["closed"]) == case.closed, shown
        if case.closed:
            assert got["faults"] == [], shown
            continue
        faults = [{key: fault[key] for key in fault if key != "more"} for fault in got["faults"]]
        for fault, other in zip(faults, want["faults"], strict=False):
            if case.close:
                assert SequenceMatcher(None, fault["found"], other["found"]).ratio() > 0.5, shown
                fault["found"] = other["found"]
        assert {**got, "faults": faults} | want == {**got, "faults": faults}, shown


def test_a_hidden_truth_counts_all_videos(page: Page) -> None:
    files = [["p.csv", base64.b64encode(f"{HEAD}v1,1,x\n".encode()).decode()]]
    (got,) = page.evaluate(RUN, [files, {"ids": ["v1", "v2", "v3"]}])
    assert got["warnings"] == [
        "2 of 3 videos have no prediction; each of them that has a hazard counts as 0: v2, v3."
    ]


def test_the_bounds_are_the_same(page: Page) -> None:
    assert page.evaluate("COOOLER_CHECK.limits") == {
        "MAX_BYTES": formats.MAX_BYTES,
        "MAX_ROWS": texts.MAX_ROWS,
        "MAX_TEXT_CHARS": checks.MAX_TEXT_CHARS,
        "MAX_ID_CHARS": checks.MAX_ID_CHARS,
        "MAX_LIST_ITEMS": checks.MAX_LIST_ITEMS,
        "MAX_WHOLE": checks.MAX_WHOLE,
        "MAX_JSON_MARKS": texts.MAX_JSON_MARKS,
        "MAX_SLOTS": coool.MAX_SLOTS,
    }


def _choose(page: Page, name: str, content: str | bytes) -> None:
    """Choose a file, and wait for what the check says."""
    data = content.encode() if isinstance(content, str) else content
    page.locator("#file").set_input_files({"name": name, "mimeType": "", "buffer": data})
    page.locator("#result").wait_for()


FAULTY = HEAD + 'v1,0,"A <b>cat</b>, running"\nv1,1,\u202egpj\nv9,1,\nv2,2\n'


def test_a_faulty_file(page: Page, tmp_path: Path, truth: list[TruthHazard]) -> None:
    _choose(page, "mine.csv", FAULTY)
    assert page.locator("#result-title").inner_text() == "✕ mine.csv has 4 faults"
    rows = [
        [cell.inner_text() for cell in row.locator("td").all()]
        for row in page.locator("#fault-rows tr").all()
    ]
    faults = _expected(tmp_path, "mine.csv", FAULTY.encode(), truth)["faults"]
    assert [row[1:] for row in rows] == [
        [fault["column"] or "", fault["found"], fault["expected"], fault["mend"]] for fault in faults
    ]
    assert rows[0][0].split() == ["row", "1", "line", "2"]
    assert "mine.csv has 4 faults" in page.locator("#said").inner_text()
    assert not page.locator("#more").is_visible()
    _choose(page, "mine.csv", HEAD + "v1,1,A cat\n")  # the same name again
    assert page.locator("#result-title").inner_text() == "✓ mine.csv is good, with 1 warning"
    assert not page.locator("#faults").is_visible()


def test_the_sample_is_good(page: Page, site: Path) -> None:
    _choose(page, "sample.csv", (site / "data/sample-predictions.csv").read_bytes())
    assert page.locator("#result-title").inner_text() == "✓ sample.csv is good"
    assert page.locator("#result-text").inner_text() == "5 predictions for 4 of 4 videos (CSV)."
    assert not page.locator("#warnings").is_visible()


def test_what_a_browser_cannot_open_is_never_good(page: Page) -> None:
    _choose(page, "mine.parquet", b"PAR1" + bytes(100) + b"PAR1")
    assert page.locator("#result-title").inner_text() == "– mine.parquet is not checked"
    assert "coooler check mine.parquet" in page.locator("#result-text").inner_text()


def test_many_faults_come_in_parts(page: Page) -> None:
    _choose(page, "mine.csv", HEAD + "v1,0,\n" * 1_500)
    assert page.locator("#result-title").inner_text() == "✕ mine.csv has 3,000 faults"
    assert page.locator("#fault-rows tr").count() == 200
    with page.expect_download() as started:
        page.locator("#save").click()
    report = json.loads(started.value.path().read_text(encoding="utf-8"))
    assert len(report["faults"]) == 1_001 and report["faults"][-1]["found"] == "2,000 more faults"
    assert report["file"] == "mine.csv" and set(report["faults"][0]) == {
        *("file", "row", "column", "found", "expected", "mend")
    }
    page.locator("#more").press("Enter")
    assert page.locator("#fault-rows tr").count() == 1_001 and not page.locator("#more").is_visible()
    assert page.evaluate("document.activeElement.sectionRowIndex") == 200


def test_the_list_is_copied(context: BrowserContext, page: Page) -> None:
    _choose(page, "mine.csv", FAULTY)
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.locator("#copy").click()
    page.get_by_text("Copied.").wait_for()
    lines = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert lines[0] == "mine.csv has 4 faults."
    assert lines[1] == (
        "  mine.csv, row 1, column rank: found '0'; expected a whole number from 1. "
        "Ranks count 1, 2, 3, ... in each video."
    )


@pytest.mark.parametrize("way", ["file", "http"])
def test_nothing_is_sent(context: BrowserContext, site: Path, way: str) -> None:
    with serving(site) as served:
        root = site.as_uri() if way == "file" else served
        page = context.new_page()
        asked: list[str] = []
        complaints: list[str] = []
        page.goto(f"{root}/submit.html", wait_until="networkidle")
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        _choose(page, "mine.csv", FAULTY)
        with page.expect_download():
            page.locator("#save").click()
        _choose(page, "good.csv", HEAD + "v1,1,A cat\n")
        assert [address for address in asked if not address.startswith("blob:")] == [] and complaints == []
        policy = page.locator("meta[http-equiv]").get_attribute("content")
        assert policy and "connect-src 'none'" in policy and "form-action 'none'" in policy


def test_a_dropped_file_is_checked(page: Page) -> None:
    page.evaluate(
        """(text) => {
          for (const [name, type] of [["a.csv", "dragover"], ["a.csv", "drop"], ["dropped.csv", "drop"]]) {
            const dataTransfer = new DataTransfer();
            dataTransfer.items.add(new File([text], name));
            const details = { dataTransfer, bubbles: true, cancelable: true };
            document.body.dispatchEvent(new DragEvent(type, details));
          }
        }""",
        FAULTY,
    )
    page.get_by_text("✕ dropped.csv has 4 faults").wait_for()  # the last one counts


def test_a_large_file_leaves_the_page_alive(page: Page) -> None:
    page.evaluate(
        """() => {
          const lines = ["video_id,rank,description"];
          for (let row = 1; row <= 200_000; row += 1) lines.push("v1," + row + ",Cat number " + row);
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File([lines.join("\\n")], "large.csv"));
          window.ticks = 0;
          setInterval(() => { window.ticks += 1; }, 10);
          const details = { dataTransfer, bubbles: true, cancelable: true };
          document.body.dispatchEvent(new DragEvent("drop", details));
        }"""
    )
    page.get_by_text("large.csv is good").first.wait_for(timeout=60_000)
    assert page.evaluate("window.ticks") >= 5  # a frozen page would not have ticked


@pytest.mark.parametrize(("width", "theme"), [(390, "dark"), (1440, "light")])
def test_axe_finds_nothing_in_any_state(browser: Browser, site: Path, width: int, theme: Any) -> None:
    with browser.new_context(viewport={"width": width, "height": 900}, color_scheme=theme) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/submit.html")
        for name, content in (
            ("mine.csv", HEAD + "v1,1,A cat\n"),
            ("x.parquet", "PAR1"),
            ("m.csv", FAULTY + "v1,0,x\n" * 20),
        ):
            _choose(page, name, content)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, name
            found = Axe().run(page).response["violations"]
            assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == [], name


def test_the_page_reads_without_scripts(browser: Browser, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/submit.html")
        assert not page.locator("#checker").is_visible()
        assert page.get_by_text("needs JavaScript").is_visible()
        assert page.locator(".columns tbody tr").count() == 6
        assert page.get_by_text("coooler submit mine.csv --about about.toml").is_visible()
        assert page.get_by_role("link", name="sample-predictions.csv").is_visible()
