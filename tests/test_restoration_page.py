"""The page of restored clips: what records say, what broken ones do, and the slider in a real Chromium."""

import json
import re
import struct
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import Browser, BrowserContext

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from sitegen import page_restoration
from sitegen.build import build_site
from sitegen.output import MANIFEST
from sitegen.page_restoration import SHOWN_PROBLEMS
from sitegen.restoration import FOLDER, MAX_PICTURE_BYTES, read_restorations, webp_size
from sitegen.strict import strict_faults
from tests.restoration_case import PLAIN, TELEA, make_restored, pictures, put, record
from tests.site_fixtures import make_benchmark, make_board


@pytest.fixture(scope="module")
def benchmark(tmp_path_factory: pytest.TempPathFactory) -> Benchmark:
    return make_restored(tmp_path_factory.mktemp("benchmark"))


@pytest.fixture(scope="module")
def site(benchmark: Benchmark, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    build_site(benchmark, out, make_board(benchmark))
    return out


def problem(tmp_path: Path, made: Any, files: dict[str, bytes]) -> str:
    """What is said of one record that is not right."""
    put(tmp_path / FOLDER, "a", made, files)
    found = read_restorations(tmp_path)
    assert found.clips == () and len(found.problems) == 1
    return found.problems[0]


def test_a_record_and_its_pictures_are_read_as_they_are(tmp_path: Path) -> None:
    files = pictures(1)
    put(tmp_path / FOLDER, "a", record("a", files), files)
    (one,) = read_restorations(tmp_path).clips
    assert [step.method for step in one.record.steps] == [TELEA, PLAIN]
    assert one.record.steps[0].settings.boxes_px == [(20, 20, 110, 40)]
    assert one.overlay is not None
    for picture, ending in ((one.before, "before"), (one.after, "after"), (one.overlay, "overlay")):
        assert picture.read() == files[f"{ending}.webp"]
        assert (picture.width_px, picture.height_px) == (320, 180)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"schema_version": 2}, "a.restore.json: schema_version"),
        ({"video_id": "b"}, "found the video id 'b'; expected 'a'"),
        ({"frames": 0}, "frames"),
        ({"width_px": 10**9}, "width_px"),
        ({"steps": [{"step": "deblur"}]}, "steps.0.method"),
        ({"steps": [{"step": "x", "method": "y", "settings": {"boxes_px": [[1, 2]]}}]}, "boxes_px"),
        ({"files_sha256": {}}, "no pictures before and after"),
        ({"source_sha256": "../../etc/passwd"}, "source_sha256"),
    ],
)
def test_a_wrong_record_is_told_of(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    files = pictures(1)
    assert said in problem(tmp_path, record("a", files, **changes), files)


def test_wrong_pictures_are_told_of(tmp_path: Path) -> None:
    files = pictures(1)
    for number, (data, said) in enumerate(
        {
            b"<svg onload='alert(1)'/>": "found no WebP picture",
            b"": "found no WebP picture",
            b"x" * (MAX_PICTURE_BYTES + 1): "bytes",
            _vp8x(16_000, 16_000): "at most 2048 px a side",
            _vp8x(64, 64): "different sizes",
        }.items()
    ):
        changed = {**files, "after.webp": data}
        assert said in problem(tmp_path / str(number), record("a", changed), changed)
    assert "it is not the file" in problem(tmp_path / "x", record("a", files), {**files, "after.webp": b"x"})


def test_a_link_out_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    files = pictures(1)
    put(tmp_path / FOLDER, "a", record("a", files), files)
    target = tmp_path / FOLDER / "a.after.webp"
    target.rename(tmp_path / "elsewhere.webp")
    target.symlink_to(tmp_path / "elsewhere.webp")
    assert "expected a plain one" in read_restorations(tmp_path).problems[0]


def _vp8x(width: int, height: int) -> bytes:
    sizes = struct.pack("<I", width - 1)[:3] + struct.pack("<I", height - 1)[:3]
    return b"RIFF" + bytes(4) + b"WEBPVP8X" + struct.pack("<I", 10) + bytes(4) + sizes


@given(st.binary(max_size=64))
def test_any_bytes_have_a_size_or_none(data: bytes) -> None:
    for start in (b"", b"RIFF0000WEBP", b"RIFF0000WEBPVP8 ", b"RIFF0000WEBPVP8L", b"RIFF0000WEBPVP8X"):
        size = webp_size(start + data)
        assert size is None or min(size) >= 1


@given(st.one_of(st.binary(max_size=80), st.recursive(st.none() | st.integers() | st.text(), st.lists)))
def test_no_record_stops_anything(tmp_path_factory: pytest.TempPathFactory, content: Any) -> None:
    folder = tmp_path_factory.mktemp("any")
    (folder / FOLDER).mkdir()
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    (folder / FOLDER / "a.restore.json").write_bytes(data)
    assert len(read_restorations(folder).problems) == 1


def test_the_page_says_what_was_done_and_what_is_broken(site: Path) -> None:
    page = (site / "restoration.html").read_text(encoding="utf-8")
    assert TELEA in page and PLAIN in page and "NAFNet" not in page
    assert "v2.before.webp: it is not the file" in page and "v3.restore.json: frames" in page
    assert "<script>alert" not in page and page.count('loading="lazy"') == 5
    assert page.count("<rect ") == 1
    assert strict_faults(site) == []
    files = json.loads((site / MANIFEST).read_text(encoding="utf-8"))["files"]
    assert sum(path.startswith("restored/") for path in files) == 5
    video = (site / "videos" / "v1.html").read_text(encoding="utf-8")
    assert "../restoration.html#clip-" in video and "Restored: before and after" in video
    assert "Restored: before and after" not in (site / "videos" / "v2.html").read_text(encoding="utf-8")
    assert "restoration.html" in (site / "index.html").read_text(encoding="utf-8")


def test_without_records_there_is_no_page(tmp_path: Path) -> None:
    plain = make_benchmark(tmp_path / "plain")
    build_site(plain, tmp_path / "site", make_board(plain))
    assert not (tmp_path / "site" / "restoration.html").exists()
    assert "restoration.html" not in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    files = pictures(1)
    put(plain.videos / FOLDER, "v1", record("v1", files), files)
    build_site(plain, tmp_path / "site", make_board(plain))
    assert (tmp_path / "site" / "restoration.html").is_file() and strict_faults(tmp_path / "site") == []


def test_many_clips_have_pages_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_restoration, "CLIPS", 2)
    benchmark = make_benchmark(tmp_path / "b")
    files = pictures(1)
    for stem in ("v1", "v2", "v3", "w1", "w2"):
        put(benchmark.videos / FOLDER, stem, record(stem, files), files)
    put(benchmark.videos / FOLDER, "x", {}, {})
    site = tmp_path / "site"
    build_site(benchmark, site, make_board(benchmark))
    pages = [site / "restoration.html", site / "restoration" / "2.html", site / "restoration" / "3.html"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    shown = [re.findall(r'<h2 id="clip-\w+-\w+-title">(?:<a[^>]*>)?(\w+)', text) for text in texts]
    assert shown == [["v1", "v2"], ["v3", "w1"], ["w2"]]
    assert ["x.restore.json" in text for text in texts] == [True, False, False]
    assert all("5 clips" in text for text in texts) and 'href="../restoration/2.html"' in texts[2]
    assert "../restoration/2.html#clip-v3" in (site / "videos" / "v3.html").read_text(encoding="utf-8")
    assert "../restoration.html#clip-v2" in (site / "videos" / "v2.html").read_text(encoding="utf-8")
    assert strict_faults(site) == []


def test_many_broken_records_are_counted(tmp_path: Path) -> None:
    benchmark = make_benchmark(tmp_path / "b")
    for number in range(SHOWN_PROBLEMS + 7):
        put(benchmark.videos / FOLDER, f"x{number:03}", {}, {})
    build_site(benchmark, tmp_path / "site", make_board(benchmark))
    page = (tmp_path / "site" / "restoration.html").read_text(encoding="utf-8")
    assert page.count(".restore.json: ") == SHOWN_PROBLEMS and "and 7 more" in page


def test_a_picture_that_changes_meanwhile_is_told_of(tmp_path: Path) -> None:
    files = pictures(1)
    put(tmp_path / FOLDER, "a", record("a", files), files)
    (one,) = read_restorations(tmp_path).clips
    (tmp_path / FOLDER / "a.after.webp").write_bytes(files["before.webp"])
    assert one.before.read() == files["before.webp"]
    with pytest.raises(InputError, match=r"a\.after\.webp: it was changed"):
        one.after.read()


@pytest.mark.browser
def test_the_slider_by_keys_and_by_pointer(context: BrowserContext, root: str) -> None:
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"{root}/restoration.html", wait_until="networkidle")
    both = page.locator(".both").first
    slider, after = both.locator("input"), both.locator(".after")
    where = "one => getComputedStyle(one).clipPath"
    assert after.evaluate(where) == "inset(0px 0px 0px 50%)"
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert after.evaluate(where) == "inset(0px 0px 0px 51%)"
    page.keyboard.press("Home")
    assert after.evaluate(where) in {"inset(0px)", "inset(0px 0px 0px 0%)"}
    area = both.locator(".both-pictures").bounding_box()
    assert area is not None
    page.mouse.move(area["x"] + area["width"] * 0.25, area["y"] + 40)
    page.mouse.down()
    page.mouse.move(area["x"] + area["width"] * 0.75, area["y"] + 40, steps=3)
    page.mouse.up()
    assert slider.input_value() == "75" and after.evaluate(where) == "inset(0px 0px 0px 75%)"
    assert both.locator("img.marks").is_visible()
    page.get_by_label("Mask and boxes").uncheck()
    assert not both.locator("img.marks").is_visible()
    assert complaints == []


@pytest.mark.browser
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_axe_finds_nothing(browser: Browser, site: Path, width: int, theme: Any) -> None:
    with browser.new_context(viewport={"width": width, "height": 900}, color_scheme=theme) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/restoration.html", wait_until="networkidle")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page).response["violations"]
        assert [(v["id"], [n["html"][:120] for n in v["nodes"][:3]]) for v in found] == []


@pytest.mark.browser
def test_without_scripts_both_pictures_are_whole(browser: Browser, site: Path) -> None:
    with browser.new_context(java_script_enabled=False, viewport={"width": 1440, "height": 900}) as context:
        page = context.new_page()
        page.goto(f"{site.as_uri()}/restoration.html")
        before, after = (page.locator(f".{name}").first.bounding_box() for name in ("before", "after"))
        assert before is not None and after is not None
        assert before["y"] == after["y"] and before["x"] + before["width"] <= after["x"]
        assert not page.locator("input[type=range]").first.is_visible()
        page.get_by_label("Mask and boxes").uncheck()
        assert not page.locator("img.marks").first.is_visible()
