"""The page about the data: its figures, the check's findings on the same data only, none when hidden."""

import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import BrowserContext
from typer.testing import CliRunner

from pipeline.benchmark import open_benchmark
from pipeline.records import TruthHazard
from pipeline.tables import TRUTH
from sitegen.build import build_site
from sitegen.cli import app
from sitegen.contexts import Shell
from sitegen.data_check_run import FILE_NAME
from sitegen.data_findings import Finding, Severity, StoredCheck
from sitegen.page_data import MAX_FINDINGS, data_page
from tests.board_case import site_data
from tests.hidden_case import hiding
from tests.site_fixtures import make_benchmark

SHELL = Shell("Data", "", "", "data", "Bench", "0")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A benchmark that was checked; its last video has no clip."""
    folder = make_benchmark(tmp_path_factory.mktemp("data") / "b", 2).root
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert CliRunner().invoke(app, ["data", "check", "--workers", "1"]).exit_code == 1
        yield folder


@pytest.fixture(scope="module")
def site(root: Path) -> Path:
    build_site(open_benchmark(root), root / "site", [])
    return root / "site"


def test_the_page_has_figures_and_findings(site: Path) -> None:
    text = (site / "data.html").read_text(encoding="utf-8")
    assert "<dt>Videos</dt><dd>3</dd>" in text and "<dt>Hazards</dt><dd>4</dd>" in text
    assert "truth without video" in text and 'href="videos/zz-gone.html"' in text
    assert "on exactly these data" in text
    assert "<script>alert" not in text and "\u202e" not in text
    assert 'href="data.html"' in (site / "index.html").read_text(encoding="utf-8")
    assert 'href="../data.html"' in (site / "videos" / "v1.html").read_text(encoding="utf-8")


def test_findings_of_another_state_are_not_shown(root: Path, site: Path, tmp_path: Path) -> None:
    benchmark = open_benchmark(root)
    rows = TRUTH.read(benchmark.truth)
    out = tmp_path / "site"
    shutil.copytree(site, out)  # its pictures need not be made again
    try:
        TRUTH.write(benchmark.truth, [*rows, TruthHazard("v9", "h1", "", "")])
        build_site(benchmark, out, [])
    finally:
        TRUTH.write(benchmark.truth, rows)
    text = (out / "data.html").read_text(encoding="utf-8")
    assert "another state of the data" in text and "truth without video" not in text
    kept = (root / FILE_NAME).read_bytes()
    try:
        (root / FILE_NAME).unlink()
        build_site(benchmark, out, [])
    finally:
        (root / FILE_NAME).write_bytes(kept)
    assert "were not checked" in (out / "data.html").read_text(encoding="utf-8")


def test_a_hidden_truth_leaves_clips_only(root: Path, tmp_path: Path) -> None:
    build_site(hiding(open_benchmark(root)), tmp_path / "site", [])
    text = (tmp_path / "site" / "data.html").read_text(encoding="utf-8")
    assert "keeps the truth back" in text and "<dt>Videos</dt><dd>3</dd>" in text and "320 × 180 (2)" in text
    for word in ("Hazards", "truth without video", "cat", "deer", "Vocabulary", "Balance"):
        assert not re.search(rf"\b{word}\b", text), word


def test_bars_add_up_and_long_lists_are_cut() -> None:
    data = site_data(60, 1)
    found = [
        Finding(Severity.NOTE, f"kind {n}", tuple(data.video_ids), "m", "n") for n in range(MAX_FINDINGS + 3)
    ]
    page = data_page(replace(data, check=StoredCheck(tuple(found), False, True)), SHELL)
    hazards = sum(not row.is_no_hazard for rows in data.truth.values() for row in rows)
    assert page.histogram and sum(int(bar.count) for bar in page.histogram.bars) == hazards
    assert max(bar.height for bar in page.histogram.bars) == 100
    assert sum(int(row.count) for row in page.labels) == hazards
    (group,) = page.groups
    assert len(group.findings) == MAX_FINDINGS and group.more == "and 3 more"
    assert len(group.findings[0].where) == 12 and group.findings[0].more == "and 48 more"
    assert "did not decode" in page.check_note
    stale = data_page(replace(data, check=StoredCheck(tuple(found), True, False)), SHELL)
    assert stale.groups == ()


def test_no_hazard_at_all() -> None:
    data = site_data(4, 1)
    calm = {name: (TruthHazard(name, "", "", ""),) for name in data.truth}
    page = data_page(replace(data, truth=calm), SHELL)
    assert page.histogram is None and page.labels == () and page.words == ()


@pytest.mark.browser
@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1440, "light")])
def test_in_a_browser(context: BrowserContext, site: Path, width: int, scheme: str) -> None:
    page = context.new_page()
    page.set_viewport_size({"width": width, "height": 900})
    page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"{site.as_uri()}/data.html")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    page.locator("summary").first.click()
    assert page.get_by_role("region", name="Descriptions by length, table").is_visible()
    assert complaints == []  # axe itself makes the policy complain
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
