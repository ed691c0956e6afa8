"""The leaderboard in Chromium: threshold, metric, columns, copies, details, links that restore it all."""

from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect

from pipeline.scores import Scorecard
from sitegen.evaluate import evaluate, truth_sha256
from sitegen.exports import latex, markdown
from sitegen.gathered import SiteData
from sitegen.numerals import percent
from tests.board_case import site_data, write_page
from tests.compare_case import query_of
from tests.site_fixtures import WordEmbedder

pytestmark = pytest.mark.browser

ROWS = "#board tbody tr[data-slug]"


@pytest.fixture(scope="module")
def data() -> SiteData:
    return site_data(40, 5)


@pytest.fixture(scope="module")
def site(data: SiteData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(data, tmp_path_factory.mktemp("board"))


def opened(context: BrowserContext, address: str, query: str = "") -> Page:
    page = context.new_page()
    page.goto(f"{address}/index.html{query}")
    page.wait_for_selector(".board-open")
    return page


def column(page: Page, name: str) -> list[str]:
    """The first line of a column's cells, as shown."""
    place = page.evaluate("name => document.querySelector(`[data-column=${name}]`).cellIndex + 1", name)
    texts = page.locator(f"{ROWS} > :nth-child({place})").all_inner_texts()
    return [text.strip().split("\n")[0] for text in texts]


def slugs(page: Page) -> list[str]:
    return [row.get_attribute("data-slug") or "" for row in page.locator(ROWS).all()]


def cards(data: SiteData, threshold: float) -> dict[str, Scorecard]:
    """Every system evaluated anew at a threshold."""
    truth = [row for video_id in data.video_ids for row in data.truth[video_id]]
    made = {}
    for system in data.systems:
        submission = system.evaluation.submission
        made[system.slug] = evaluate(submission, truth, WordEmbedder(), threshold, truth_sha256(truth)).card
    return made


def ranks(values: dict[str, float]) -> dict[str, str]:
    """Competition ranks by hand: 1 + how many are better; `=` when another has the same."""
    found = list(values.values())
    return {
        slug: f"{1 + sum(other > value for other in found)}{'=' if found.count(value) > 1 else ''}"
        for slug, value in values.items()
    }


def test_silent_and_inside(context: BrowserContext, root: str) -> None:
    page = context.new_page()
    asked: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda request: complaints.append(request.url))
    page.on("dialog", lambda dialog: complaints.append(dialog.message))
    page.goto(f"{root}/index.html?", wait_until="networkidle")
    assert not any("/board/" in url for url in asked)
    page.locator("#board-threshold").fill("20")
    page.locator(".board-open").first.click()
    expect(page.locator(".board-probes, .board-inside .sub").first).to_be_visible()
    page.locator(".charts").scroll_into_view_if_needed()
    page.wait_for_function("() => !!window.Plotly")
    assert complaints == [] and [url for url in asked if not url.startswith(f"{root}/")] == []
    assert sum("/board/" in url for url in asked) == 1


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing_and_nothing_sticks_out(
    browser: Browser, site: Path, width: int, theme: str
) -> None:
    with browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme="dark" if theme == "dark" else "light"
    ) as context:
        page = opened(context, site.as_uri(), "?threshold=0.90&rank=detection")
        page.locator(".board-open").last.click()
        page.locator("#board-columns-open").click()
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")
        expect(page.locator(".board-facts")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page).response["violations"]
        assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == []


@pytest.mark.parametrize("threshold", [0.55, 0.8, 0.93])
def test_the_slider_counts_and_ranks_as_an_evaluation(
    context: BrowserContext, data: SiteData, root: str, threshold: float
) -> None:
    page = opened(context, root)
    page.locator("#board-metric input[value=detection]").check()
    page.locator("#board-threshold").fill(str(round(threshold * 100) - 50))
    expect(page.locator("#board-threshold-text")).to_have_text(f"{threshold:.2f}")
    own = threshold == 0.8
    expect(page.locator(f"{ROWS} .range", has_text="published")).to_have_count(0 if own else 10)
    made = cards(data, threshold)
    order = slugs(page)
    rates = {slug: made[slug].detection_rate for slug in order}
    assert column(page, "detection") == [percent(rates[slug]) for slug in order]
    assert column(page, "recall") == [percent(made[slug].hazard_recall or 0) for slug in order]
    assert [rates[slug] for slug in order] == sorted(rates.values(), reverse=True)
    assert column(page, "rank") == [ranks(rates)[slug] for slug in order]
    note = page.locator("#board-note").inner_text()
    assert ("belong to the published threshold, 0.80" in note) is not own
    assert "equal scores share a rank" in note


def test_the_slider_by_key_and_back(context: BrowserContext, site: Path) -> None:
    page = opened(context, site.as_uri())
    before = page.locator("#board tbody").inner_text()
    slider = page.locator("#board-threshold")
    slider.focus()
    page.keyboard.press("ArrowRight")
    expect(slider).to_have_attribute("aria-valuetext", "0.81")
    expect(page.locator(f"{ROWS} .range", has_text="published")).to_have_count(10)
    assert query_of(page) == {"threshold": "0.81"}
    page.keyboard.press("End")
    expect(slider).to_have_attribute("aria-valuetext", "0.95")
    page.locator("#board-reset").click()
    expect(page.locator("#board-reset")).to_be_hidden()
    assert page.locator("#board tbody").inner_text() == before and "?" not in page.url
    assert page.locator("#board-note").inner_text() == ""


@pytest.mark.parametrize(("name", "key"), [("sam", "sam"), ("recall", "hazard_recall"), ("besm", "besm")])
def test_rank_by_another_score(
    context: BrowserContext, data: SiteData, site: Path, name: str, key: str
) -> None:
    page = opened(context, site.as_uri(), "?rank=detection")
    bands = [
        f"{s.rank}{'=' if sum(o.rank == s.rank for o in data.systems) > 1 else ''}" for s in data.systems
    ]
    page.locator(f"#board-metric input[value={name}]").check()
    values = {s.slug: getattr(s.evaluation.card, key) for s in data.systems}
    order = slugs(page)
    assert [values[slug] for slug in order] == sorted(values.values(), reverse=True)
    assert column(page, "rank") == (bands if name == "besm" else [ranks(values)[slug] for slug in order])
    assert page.locator(f"[data-column={name}]").get_attribute("aria-sort") == "descending"
    assert query_of(page) == ({} if name == "besm" else {"rank": name})


def test_columns_and_a_deep_link(context: BrowserContext, data: SiteData, root: str) -> None:
    page = opened(context, root)
    page.locator("#board-columns-open").click()
    for name in ("sam", "agents"):
        page.locator(f"#board-columns input[value={name}]").uncheck()
    assert not page.locator("[data-column=sam]").is_visible()
    page.locator("#board-metric input[value=recall]").check()
    page.locator("#board-threshold").fill("40")
    page.locator("[data-column=name] button").click()
    page.locator("#search").fill("system")
    page.locator(f"tr[data-slug={data.systems[2].slug}] .board-open").click()
    expect(page.locator(".board-facts")).to_be_visible()
    assert query_of(page) == {
        "rank": "recall",
        "threshold": "0.90",
        "sort": "name",
        "columns": "besm,detection,recall,redrawn,date",
        "q": "system",
        "open": data.systems[2].slug,
    }
    again = context.new_page()
    again.goto(page.url)
    expect(again.locator(".board-facts")).to_be_visible()
    expect(again.locator("#board-threshold-text")).to_have_text("0.90")
    expect(again.locator(f"{ROWS} .range", has_text="published")).to_have_count(10)
    assert again.locator("#board").inner_text() == page.locator("#board").inner_text()
    assert again.url == page.url


def test_a_link_to_what_is_not_there_says_so(context: BrowserContext, site: Path) -> None:
    page = opened(context, site.as_uri(), "?rank=<b>x&threshold=2&sort=-none&columns=sam,zzz&open=gone")
    expect(page.locator("#board-said")).to_contain_text("<b>x")
    assert "?" not in page.url and page.locator("[data-column=besm]").is_visible()


def test_copies_are_what_is_shown(context: BrowserContext, data: SiteData, site: Path) -> None:
    context.add_init_script(
        "const clipboard = { writeText: async text => { window.copied = text; } };"
        "Object.defineProperty(navigator, 'clipboard', { value: clipboard });"
    )
    page = opened(context, site.as_uri(), "?columns=besm,detection&threshold=0.90")
    expect(page.locator(f"{ROWS} .range", has_text="published")).to_have_count(10)
    made = cards(data, 0.9)
    page.locator("#board-markdown").click()
    lines = page.evaluate("window.copied").splitlines()
    assert lines[2:4] == ["| Rank | Submission | BESM | Detection |", "|---:|---|---:|---:|"]
    for line, system in zip(lines[4:9], data.systems, strict=True):
        low, high = system.uncertainty.besm.low, system.uncertainty.besm.high
        assert f" | {markdown(system.name)} | " in line
        assert f" | {system.evaluation.card.besm:.4f} ({low:.2f}–{high:.2f}) | " in line
        assert line.endswith(f" | {percent(made[system.slug].detection_rate)} |")
    assert "Detected above 0.90." in lines and any(
        line.startswith("Signature&#58; coooler") for line in lines
    )
    page.locator("#board-latex").click()
    text = page.evaluate("window.copied")
    assert "\\begin{tabular}{rlrr}" in text and "Rank & Submission & BESM & Detection \\\\" in text
    for system in data.systems:
        assert f" & {latex(system.name)} & {system.evaluation.card.besm:.4f} (" in text
        assert f" & {latex(percent(made[system.slug].detection_rate))} \\\\" in text
    page.locator("#board-link").click()
    assert page.evaluate("window.copied") == page.url


def test_a_closed_clipboard_opens_a_window(context: BrowserContext, site: Path) -> None:
    context.add_init_script("Object.defineProperty(navigator, 'clipboard', {value: undefined})")
    page = opened(context, site.as_uri())
    page.locator("#board-markdown").click()
    field = page.locator("#board-dialog textarea")
    expect(field).to_be_focused()
    assert field.input_value().startswith("# Generated")
    page.keyboard.press("Escape")
    expect(field).to_be_hidden()


def test_details_by_key(context: BrowserContext, data: SiteData, root: str) -> None:
    page = opened(context, root)
    last = data.systems[-1]
    button = page.locator(f"tr[data-slug={last.slug}] .board-open")
    button.focus()
    page.keyboard.press("Enter")
    below = page.locator(f"#detail-{last.slug}")
    expect(below.locator(".board-probes")).to_contain_text("7 captions a video. It says <b>a lot</b>.")
    assert button.get_attribute("aria-expanded") == "true"
    assert below.locator("a", has_text="All of").get_attribute("href") == f"submissions/{last.slug}.html"
    assert str(last.evaluation.card.signature) in below.inner_text()
    page.locator("[data-column=name] button").click()  # it stays below its row
    assert below.evaluate("row => row.previousElementSibling.dataset.slug") == last.slug
    page.locator("#search").fill("zzz")
    assert not below.is_visible()
    page.locator("#search").fill("")
    button.focus()
    page.keyboard.press("Space")
    expect(below).to_have_count(0)


def test_without_scripts_it_reads_as_before(browser: Browser, data: SiteData, site: Path) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/index.html")
        assert page.locator(ROWS).count() == 5 and page.locator("#board tbody tr:visible").count() == 5
        assert not page.locator("#board-tools").is_visible() and page.locator(".board-open").count() == 0
        assert page.locator(".history svg").is_visible()
