"""The rules of a finished site: each broken one is named, and a built site breaks none."""

import shutil
from pathlib import Path

import pytest

from sitegen.build import build_site
from sitegen.strict import INDEX_BYTES, OPEN_BYTES, strict_faults
from tests.site_fixtures import make_benchmark, make_board


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small site with a hostile submission."""
    benchmark = make_benchmark(tmp_path_factory.mktemp("strict") / "b")
    out = tmp_path_factory.mktemp("strict-site")
    build_site(benchmark, out, make_board(benchmark))
    return out


@pytest.fixture
def site(built: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(built, tmp_path / "site"))


def test_a_built_site_keeps_every_rule(built: Path) -> None:
    assert strict_faults(built) == []


SPOILT = [
    ("<title>", "<i>", "no title"),
    ('<meta name="description"', '<meta name="other"', "no description"),
    ('<link rel="canonical"', '<link rel="next"', "no canonical"),
    (
        '<link rel="canonical" href="method.html">',
        '<link rel="canonical" href="index.html">',
        "is not its own",
    ),
    ('href="videos.html"', 'href="nowhere.html"', "a dead link to 'nowhere.html'"),
    ('href="#metrics"', 'href="#nothing"', "a link to '#nothing', where there is no such place"),
    ('id="metrics"', 'id="example"', "id 'example' 2 times"),
    ("<h1>", "<h1><marquee>", "markup that no template writes: <marquee>"),
    ("<h1>", '<h1><img src="assets/icon.svg" onerror="x()">', "<img onerror>"),
    ("<h1>", "<h1><script>x()</script>", "<script> without src"),
    ("<h1>", '<h1><a href="javascript:x()">x</a>', "only http and https lead out"),
    ("<h1>", '<h1><a href="../../etc/passwd">x</a>', "a dead link to '../../etc/passwd'"),
]


@pytest.mark.parametrize(("old", "new", "words"), SPOILT, ids=[row[2] for row in SPOILT])
def test_a_broken_rule_is_named(site: Path, old: str, new: str, words: str) -> None:
    page = site / "method.html"
    text = page.read_text(encoding="utf-8")
    assert old in text
    page.write_text(text.replace(old, new, 1), encoding="utf-8")
    faults = strict_faults(site)
    assert any(fault.startswith("method.html: ") and words in fault for fault in faults), faults


def test_budgets(site: Path) -> None:
    (site / "assets" / "video.js").write_bytes(b"/" * OPEN_BYTES)
    shard = site / "data" / "more" / "0.js"
    shard.parent.mkdir()
    shard.write_bytes(b" " * (INDEX_BYTES + 1))
    faults = strict_faults(site)
    assert any("videos/v1.html: loads " in fault for fault in faults)
    assert any(fault.startswith("data/more/0.js: 10,241 bytes") for fault in faults)


def test_a_link_to_a_keyframe_loads_one_picture_more(site: Path) -> None:
    page = site / "videos" / "v1.html"
    picture = site / "media" / "large.jpg"
    picture.parent.mkdir(exist_ok=True)
    picture.write_bytes(b"/" * OPEN_BYTES)
    assert not any(fault.startswith("videos/v1.html: loads ") for fault in strict_faults(site))
    link = '<a href="../media/large.jpg">x</a>'
    page.write_text(page.read_text(encoding="utf-8").replace("<h1>", f"<h1>{link}", 1), encoding="utf-8")
    assert any(fault.startswith("videos/v1.html: loads ") for fault in strict_faults(site))
