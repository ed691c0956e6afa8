"""The parts of the site by hand: words, blocks, paths, the tree's hash, byte ranges."""

import json
import re
from pathlib import Path

import pytest

from sitegen.blocks import blocks
from sitegen.charts import counts, label, script_json
from sitegen.gathered import path_names
from sitegen.output import open_output, stamped, tree_sha256
from sitegen.serve import byte_range, find_file
from sitegen.words import difference, shorten, visible
from tests.site_fixtures import EVIL


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain", "plain"),
        ("a\u202eb", "a⟨U+202E⟩b"),
        ("a\x00b\x1b", "a⟨U+0000⟩b⟨U+001B⟩"),
        ("two\nlines\t", "two lines "),
        ("\u2066x\u2069\ufeff", "⟨U+2066⟩x⟨U+2069⟩⟨U+FEFF⟩"),
        ("\ud800", "⟨U+D800⟩"),
        ("👩\u200d🚒", "👩\u200d🚒"),
        ("Ünïcödé 猫", "Ünïcödé 猫"),
    ],
)
def test_visible(text: str, shown: str) -> None:
    assert visible(text) == shown


def test_difference() -> None:
    assert difference("A cat crossing the road", "a cat is crossing the street.") == (
        ("same", "a cat"),
        ("added", "is"),
        ("same", "crossing the"),
        ("missing", "road"),
        ("added", "street"),
    )
    assert difference("A cat", "a cat!") == (("same", "a cat"),)
    assert difference("", "new") == (("added", "new"),)
    assert difference("x " * 500, "y")[0][0] == "added"


def test_shorten_and_counts() -> None:
    assert shorten("abcdef", 4) == "abc…" and shorten("abc", 3) == "abc"
    assert counts([0.0, 0.05, 1.0, 0.999]) == [1, 1, *[0] * 17, 2]


def test_scripts_and_labels_are_escaped() -> None:
    assert json.loads(script_json({"a": EVIL})) == {"a": EVIL}
    assert not set("<>&\u2028") & set(script_json(EVIL))
    assert label('<a href="x">b</a>') == "&lt;a href=&quot;x&quot;&gt;b&lt;/a&gt;"


def test_path_names_are_safe_and_unique() -> None:
    names = path_names(["a", "A", "../x", "b/c", "..", "", "ok_1.2"])
    assert names["ok_1.2"] == "ok_1.2"
    assert len({name.casefold() for name in names.values()}) == 7
    assert all(re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name) for name in names.values())


def test_blocks() -> None:
    found = blocks("# T\n\none\ntwo `x`\n\n- a\n  b\n- [c](d)\n\n```\n<k>\n```\n\n|h|\n|--|\n|1|")
    assert [block.kind for block in found] == ["heading", "paragraph", "list", "code", "table"]
    assert found[1].lines == ("one two x",) and found[2].lines == ("a b", "c (d)")
    assert found[3].lines == ("<k>",) and found[4].rows == (("h",), ("1",))


@pytest.mark.parametrize("path", ["../x", "/x", "a/../b", "a\\b", "a//b", "./a", ""])
def test_output_refuses_paths_that_lead_out(tmp_path: Path, path: str) -> None:
    with pytest.raises(ValueError, match="not a path inside"):
        open_output(tmp_path).add(path, b"")


def test_output_refuses_one_path_twice(tmp_path: Path) -> None:
    output = open_output(tmp_path)
    output.add("a.txt", b"1")
    with pytest.raises(ValueError, match="twice"):
        output.add("a.txt", b"1")


def test_tree_hash_by_hand() -> None:
    import hashlib

    text = f"{'a' * 64}  z\n{'b' * 64}  a\n"
    assert tree_sha256({"a": "b" * 64, "z": "a" * 64}) == hashlib.sha256(text.encode()).hexdigest()
    with pytest.raises(ValueError, match="found 0"):
        stamped(b"no place", "0")


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("bytes=0-", (0, 10)),
        ("bytes=2-4", (2, 5)),
        ("bytes=8-99", (8, 10)),
        ("bytes=-3", (7, 10)),
        ("bytes=-0", None),
        ("bytes=10-", None),
        ("bytes=5-2", None),
        ("lines=1-2", None),
        ("bytes=0-1,3-4", None),
    ],
)
def test_byte_range(header: str, expected: tuple[int, int] | None) -> None:
    assert byte_range(header, 10) == expected


def test_served_files_stay_inside(tmp_path: Path) -> None:
    site = (tmp_path / "site").resolve()
    (site / "sub").mkdir(parents=True)
    (site / "index.html").write_text("x")
    (site / ".hidden").write_text("x")
    (tmp_path / "secret.txt").write_text("x")
    (site / "link.txt").symlink_to(tmp_path / "secret.txt")
    assert find_file(site, "/") == site / "index.html" == find_file(site, "/index.html?x=1#y")
    for target in (
        "/../secret.txt",
        "/%2e%2e/secret.txt",
        "/.hidden",
        "/link.txt",
        "/sub",
        "/%00",
        "/..%5csecret.txt",
    ):
        assert find_file(site, target) is None
