"""The built site: reproducible, incremental, whole, safe with hostile text, readable without scripts."""

import csv
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from pipeline.records import Kind
from sitegen import build as build_module
from sitegen.build import build_site
from sitegen.media import media_from_json, media_to_json
from sitegen.output import MANIFEST
from sitegen.uncertainty import uncertainties
from tests.site_fixtures import BIDI, FORMULA, LONG, Board, make_benchmark, make_board

SVG = "http://www.w3.org/2000/svg"  # a name that scripts need for SVG elements; nothing is loaded from it


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Benchmark, Board]:
    benchmark = make_benchmark(tmp_path_factory.mktemp("benchmark"))
    return benchmark, make_board(benchmark)


@pytest.fixture(scope="module")
def site(small: tuple[Benchmark, Board], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    build_site(small[0], out, small[1])
    return out


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


class Tags(HTMLParser):
    """Collects tags, ids and visible text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data

    @property
    def ids(self) -> list[str]:
        return [str(attrs["id"]) for _, attrs in self.tags if "id" in attrs]


def pages(site: Path) -> Iterator[tuple[Path, Tags]]:
    for path in sorted(site.rglob("*.html")):
        yield path, Tags(path.read_text(encoding="utf-8"))


def test_two_builds_are_equal(small: tuple[Benchmark, Board], site: Path, tmp_path: Path) -> None:
    other = tmp_path / "deep" / "er"
    build_site(small[0], other, list(reversed(small[1])), jobs=1)
    assert contents(other) == contents(site)


def test_expected_pages(site: Path) -> None:
    found = {path.relative_to(site).as_posix() for path, _ in pages(site)}
    assert {"index.html", "videos.html", "method.html", "videos/v1.html", "videos/zz-gone.html"} <= found
    assert {"submissions/good-system.html", "submissions/silent.html"} <= found


def test_rebuild_decodes_and_writes_nothing(
    small: tuple[Benchmark, Board], site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build_module, "make_media", None)  # calling it would fail
    before = contents(site)
    report = build_site(small[0], site, small[1])
    assert (report.written, report.removed, report.decoded) == (0, 0, 0)
    assert report.unchanged == len(before) - 1  # all but the manifest
    assert contents(site) == before


def test_only_what_changed_is_made_again(small: tuple[Benchmark, Board], site: Path, tmp_path: Path) -> None:
    out = tmp_path / "site"
    shutil.copytree(site, out)
    damaged = next((out / "media" / "v2").glob("t*.webp"))
    damaged.write_bytes(b"damaged")
    report = build_site(small[0], out, small[1])
    assert (report.decoded, report.written) == (1, 1)
    assert contents(out) == contents(site)
    for broken in ("[not json", "[]", '{"format": 1, "files": [], "media": 3}'):
        (out / MANIFEST).write_text(broken, encoding="utf-8")
        assert build_site(small[0], out, small[1]).decoded == 4
        assert contents(out) == contents(site)


def test_stale_files_go_and_foreign_files_stay(
    small: tuple[Benchmark, Board], site: Path, tmp_path: Path
) -> None:
    out = tmp_path / "site"
    shutil.copytree(site, out)
    (out / ".gitignore").write_text("*\n", encoding="utf-8")
    (out / "videos" / "mine.html").write_text("mine", encoding="utf-8")
    outside = tmp_path / "outside.txt"
    outside.write_text("keep", encoding="utf-8")
    manifest = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
    manifest["files"]["../outside.txt"] = ["0" * 64, 4]
    (out / MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
    board = [entry for entry in small[1] if entry[0].slug != "silent"]
    report = build_site(small[0], out, board)
    assert report.removed >= 1
    assert not [path for path in out.rglob("*") if "silent" in path.name]
    assert not (out / "submissions" / "silent.html").exists()
    assert (out / ".gitignore").exists() and (out / "videos" / "mine.html").exists() and outside.exists()


def test_no_submission_yet(small: tuple[Benchmark, Board], tmp_path: Path) -> None:
    build_site(small[0], tmp_path, [])
    assert "No submission yet" in (tmp_path / "index.html").read_text(encoding="utf-8")
    assert not (tmp_path / "assets" / "plotly.min.js").exists()


def test_footer_holds_the_hash_of_the_tree(small: tuple[Benchmark, Board], site: Path) -> None:
    import hashlib

    blank = re.compile(rb'(id="tree-sha256">)[0-9a-f]{64}<')
    lines = []
    for path, data in contents(site).items():
        if not Path(path).name.startswith("."):
            page = blank.sub(rb"\1<", data) if path.endswith(".html") else data
            lines.append(f"{hashlib.sha256(page).hexdigest()}  {path}\n")
    tree = hashlib.sha256("".join(sorted(lines)).encode()).hexdigest()
    for _, tags in pages(site):
        assert tree in tags.text


def test_every_link_and_asset_is_there(site: Path) -> None:
    for path, tags in pages(site):
        for tag, attrs in tags.tags:
            for name in ("href", "src", "poster"):
                address = attrs.get(name)
                if address is None:
                    continue
                parts = urlsplit(address)
                if parts.scheme:
                    assert tag == "a" and parts.scheme in {"https", "http"}, (path, tag, address)
                    continue
                target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
                assert target.is_file() and target.is_relative_to(site), (path, address)
                if parts.fragment:
                    assert unquote(parts.fragment) in Tags(target.read_text(encoding="utf-8")).ids, (
                        path,
                        address,
                    )


def test_ids_are_unique_and_pages_complete(site: Path) -> None:
    for path, tags in pages(site):
        assert len(tags.ids) == len(set(tags.ids)), path
        names = [attrs.get("name") for tag, attrs in tags.tags if tag == "meta"]
        assert "description" in names and "viewport" in names
        assert sum(tag == "h1" for tag, _ in tags.tags) == 1, path
        assert all(attrs.get("alt") for tag, attrs in tags.tags if tag == "img"), path
        assert not any(
            name.startswith("on") or name == "style" for _, attrs in tags.tags for name in attrs
        ), path
        assert all("src" in attrs for tag, attrs in tags.tags if tag == "script"), path
        assert tags.tags.count(("main", {"id": "main", "class": "wrap", "tabindex": "-1"})) == 1


def test_nothing_but_plotly_names_other_hosts(site: Path) -> None:
    """Styles and scripts of ours load nothing; plotly is kept in by the policy and the browser tests."""
    for path in (site / "assets").glob("*"):
        if path.name not in {"plotly.min.js", "icon.svg"}:
            text = path.read_text(encoding="utf-8").replace(SVG, "")
            assert not re.search(r"https?:|//cdn|@import|url\(|fetch\(|XMLHttpRequest", text), path


def test_hostile_text_stays_text(site: Path) -> None:
    for path, tags in pages(site):
        raw = path.read_text(encoding="utf-8")
        assert BIDI not in raw and "\u2028" not in raw, path
        assert "alert(1)</script>" not in raw, path
        assert "49" not in re.findall(r"evil &amp;amp; .{0,40}", raw)
        assert not any(attrs.get("src") == "x" for _, attrs in tags.tags), path
    video = (site / "videos" / "v1.html").read_text(encoding="utf-8")
    assert "⟨U+202E⟩" in video and "{{ 7*7 }}" in video and "&lt;/script&gt;" in video
    assert LONG in (site / "videos" / "v2.html").read_text(encoding="utf-8")
    script = (site / "data" / "leaderboard.js").read_text(encoding="utf-8")
    assert "<" not in script and script.isascii()


def test_downloads(site: Path) -> None:
    with (site / "data" / "leaderboard.csv").open(encoding="utf-8", newline="") as source:
        rows = list(csv.DictReader(source))
    assert [row["rank"] for row in rows] == ["1", "1", "1"]  # over four videos nobody is told apart
    assert [row["place"] for row in rows] == ["1", "2", "3"]
    assert {row["submission"] for row in rows} == {"Good system", "'" + FORMULA, "Silent"}
    board = json.loads((site / "data" / "leaderboard.json").read_text(encoding="utf-8"))
    assert board["threshold"] == 0.8 and {row["submission"] for row in board["rows"]} >= {FORMULA}
    assert all(row["signature"].startswith("coooler:") for row in board["rows"])


def test_uncertainty_and_probes_are_shown(small: tuple[Benchmark, Board], site: Path) -> None:
    board = Tags((site / "index.html").read_text(encoding="utf-8"))
    sure = uncertainties([standing.evaluation for standing in small[1]])
    for one in sure:
        assert f"{one.besm.low:.2f}–{one.besm.high:.2f}" in board.text
        assert f"{one.rank_low} to {one.rank_high}first in {one.first_share * 100:.0f}\u202f%" in board.text
    low, high = round(sure[0].besm.low * 100), round(sure[0].besm.high * 100)
    drawn = {attrs["d"] for tag, attrs in board.tags if tag == "path" and attrs.get("class") == "bar-range"}
    assert f"M{low} 3H{high}M{low} 0V6M{high} 0V6" in drawn
    flags = [attrs["href"] for tag, attrs in board.tags if attrs.get("class") == "flag"]
    assert flags == [f"submissions/{small[1][1].stored.slug}.html#probes", "submissions/silent.html#probes"]
    assert "1 probe speaks" in board.text and "2 probes speak" in board.text
    page = Tags((site / "submissions" / "silent.html").read_text(encoding="utf-8"))
    assert "2 probes speak." in page.text and "A sentence <b>on</b> word-bag." in page.text
    assert page.text.count("quiet") == 3 and page.text.count("speaks") == 2
    assert page.text.count("cannot be said") == 1
    assert f"{sure[2].besm.low:.4f} to {sure[2].besm.high:.4f}" in page.text
    assert "Rank 1, shared with 2 others" in page.text and "By BESM alone it is number 3" in page.text


def test_provenance(site: Path) -> None:
    text = Tags((site / "submissions" / "good-system.html").read_text(encoding="utf-8")).text
    for words in ("MIT", "A note, </script>", "26 calls of eyes, words", "at least 1,000 tokens in"):
        assert words in text
    assert "at least 12.2 seconds" in text and "BESM 0.4107, SAM 0.4405, detection 50.0" in text
    assert text.count("coooler:1|emb:words") == 2  # its signature now, and that of its ledger line


def test_the_ledger_is_shown_and_offered(small: tuple[Benchmark, Board], site: Path, tmp_path: Path) -> None:
    stored = (small[0].submissions / "ledger.jsonl").read_bytes()
    assert (site / "data" / "ledger.jsonl").read_bytes() == stored
    page = Tags((site / "index.html").read_text(encoding="utf-8"))
    assert "5 entries, newest first" in page.text and "withdrawn" in page.text and "Gone" in page.text
    build_site(small[0], tmp_path, small[1], as_of="2026-01-02")
    text = Tags((tmp_path / "index.html").read_text(encoding="utf-8")).text
    assert "3 entries, newest first" in text and "withdrawn" not in text
    assert (tmp_path / "data" / "ledger.jsonl").read_bytes() == b"".join(stored.splitlines(True)[:3])


def test_a_rehearsal_is_marked_and_offers_no_board(small: tuple[Benchmark, Board], tmp_path: Path) -> None:
    board = [small[1][0]._replace(rehearsed=True), *small[1][1:]]
    build_site(small[0], tmp_path, board)
    text = Tags((tmp_path / "index.html").read_text(encoding="utf-8")).text
    assert text.count("Rehearsal, not on the board") == 1 and "Take it with you" not in text
    page = (tmp_path / "submissions" / "good-system.html").read_text(encoding="utf-8")
    assert "Rehearsal, not on the board" in page
    assert not list((tmp_path / "data").glob("leaderboard.[!j]*"))
    assert not (tmp_path / "data" / "leaderboard.json").exists()


def test_signatures_are_never_mixed(small: tuple[Benchmark, Board], tmp_path: Path) -> None:
    one, *others = small[1]
    card = replace(one.evaluation.card, signature=replace(one.evaluation.card.signature, threshold=0.7))
    board = [one._replace(evaluation=replace(one.evaluation, card=card)), *others]
    with pytest.raises(InputError, match="signatures differ"):
        build_site(small[0], tmp_path, board)


def test_pages_read_without_scripts(site: Path) -> None:
    video = Tags((site / "videos" / "v2.html").read_text(encoding="utf-8"))
    for words in ("A deer stands on the road", "A tyre lies in our lane", "1.0000", "Detected", "above 0.80"):
        assert words in video.text
    assert "The run failed on this video: broken" in video.text
    first = Tags((site / "videos" / "v1.html").read_text(encoding="utf-8"))
    assert "Scene descriptions" in first.text and "1 too narrow, 1 too low" in first.text
    assert sum(tag == "rect" and "x" in attrs for tag, attrs in first.tags) == (25 + 1) * 2
    assert "No hazard." in Tags((site / "videos" / "v3.html").read_text(encoding="utf-8")).text
    gone = Tags((site / "videos" / "zz-gone.html").read_text(encoding="utf-8"))
    assert "There is no clip of this video" in gone.text
    assert "0.3922" in Tags((site / "index.html").read_text(encoding="utf-8")).text


def test_a_broken_clip_is_said_and_the_rest_is_built(tmp_path: Path) -> None:
    benchmark = make_benchmark(tmp_path / "b", clips=1)
    (benchmark.videos / "zz-gone.mp4").write_bytes(b"not a video")
    build_site(benchmark, tmp_path / "site", [])
    page = Tags((tmp_path / "site" / "videos" / "zz-gone.html").read_text(encoding="utf-8")).text
    assert "No pictures: zz-gone.mp4:" in page and str(tmp_path) not in page


def test_clips_can_be_left_out(tmp_path: Path) -> None:
    benchmark = make_benchmark(tmp_path / "b", clips=1)
    shown = benchmark.settings.model_copy(update={"show_videos": False})
    build_site(Benchmark(benchmark.root, shown), tmp_path / "site", [])
    assert not list((tmp_path / "site").rglob("*.mp4"))
    assert "<video" not in (tmp_path / "site" / "videos" / "v1.html").read_text(encoding="utf-8")


def test_media_record_round_trip(site: Path) -> None:
    manifest = json.loads((site / MANIFEST).read_text(encoding="utf-8"))
    media = media_from_json(manifest["media"]["v1"]["media"])
    assert json.loads(json.dumps(media_to_json(media))) == manifest["media"]["v1"]["media"]
    assert len(media.frames) == 25
    assert {crop.kind for crop in media.crops} == {Kind.CHALLENGE, Kind.TRAFFIC}
    assert [crop.frame_index for crop in media.crops if crop.kind is Kind.CHALLENGE] == [26, 28, 29]
