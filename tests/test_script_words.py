"""The words of the pages' scripts: all go through the catalogue; numbers are as Python writes them."""

import re
from collections.abc import Iterator
from gettext import NullTranslations
from pathlib import Path
from typing import Any

import pytest
from babel.messages.extract import extract_from_file
from playwright.sync_api import BrowserContext

from sitegen.language import Language, speaking
from sitegen.numerals import percent
from sitegen.rendering import find_templates
from tests.board_case import site_data, write_page

ASSETS = find_templates() / "assets"
SCRIPTS = sorted(ASSETS.glob("*.js"))
KEYWORDS = {"_": None, "plural": (2, 3)}
MOST_BYTES = 1_600  # every page loads it

# A piece of a script: comment, text, text with values, regular expression, name that is called, bracket.
PIECE = re.compile(
    r"""
    //[^\n]* | /\*.*?\*/ | "(?:[^"\\\n]|\\.)*" | '(?:[^'\\\n]|\\.)*' | `(?:[^`\\]|\\.)*`
    | [\w$]+(?=\() | [()\[\]{}]
    | (?:(?<=[(\[!])|(?<=[=>?:,&|][ ])|(?<=return[ ])) /(?:[^/\\\n\[]|\\.|\[(?:[^\]\\\n]|\\.)*\])+/
    """,
    re.DOTALL | re.VERBOSE,
)
# Where words may stand: as messages, and in selectors.
FITTING = {"_", "plural", "closest", "matches", "matchMedia", "querySelector", "querySelectorAll"}
CLASSES = re.compile(r"[a-z0 -]*[a-z]-[a-z0][a-z0 -]*")
PROSE = re.compile(r"[^\W\d_]{2,}[:,.;]? +[^\W\d_]{2,}|^[A-Z][a-z]")
NO_PROSE = {"use strict", "Enter", "Escape", "Arrow", "Files", "JSON Lines"}
# What the submit page says of a file is, word for word, what the command says of it, in English.
FAULTS = {path for path in SCRIPTS if path.name.startswith("submit-")}
NAMES = {"BESM", "SAM", "BESM 0", "detection", "detection_rate", "hazard_recall", "\\usepackage{booktabs}"}


def literals(script: str) -> Iterator[tuple[str, str]]:
    """Each text of a script, values as 0, and the name of the call that it stands in directly."""
    inside: list[str] = []
    name = ""
    for piece in PIECE.findall(script):
        if piece in ("(", "[", "{"):
            inside.append(name if piece == "(" else "")
        elif piece in (")", "]", "}"):
            inside.pop()
        elif piece[0] in "\"'":
            yield inside[-1], re.sub(r"\\(.)", r"\1", piece[1:-1])
        elif piece[0] == "`":
            yield inside[-1], re.sub(r"\$\{[^}]*\}", "0", piece[1:-1])
        name = piece if re.match(r"[\w$]", piece) else ""
    assert not inside


@pytest.mark.parametrize("path", sorted(set(SCRIPTS) - FAULTS), ids=lambda path: path.name)
def test_no_words_go_past_the_catalogue(path: Path) -> None:
    bare = {text for call, text in literals(path.read_text("utf-8")) if call not in FITTING}
    if path.name.endswith("-words.js"):
        assert {text for text in bare if re.search("[A-Za-z]{2}", text)} - NAMES == {"use strict"}
    found = {text for text in bare - NO_PROSE if PROSE.search(text) and not CLASSES.fullmatch(text)}
    assert {text for text in found if not text.startswith("<?xml ")} == set()


def test_the_scan_finds_words() -> None:
    script = r"""f("Bare words", _("Good words", { a: `Bare ${1} too` })); g.closest("p b");
    h(/"[(]/, 'it\'s "so"'); plural(n, "{n} good word", "{n} good " + "words"); // "No words"
    """
    found = [(call, text) for call, text in literals(script) if call not in FITTING]
    assert found == [("f", "Bare words"), ("", "Bare 0 too"), ("h", 'it\'s "so"')]


def test_babel_finds_every_message() -> None:
    plain: set[str] = set()
    counted: set[str] = set()
    for path in SCRIPTS:
        script = path.read_text("utf-8")
        found = [row[1] for row in extract_from_file("javascript", path, keywords=KEYWORDS)]
        calls = [piece for piece in PIECE.findall(script) if piece in KEYWORDS]
        assert len(found) == len(calls) - script.count("function plural("), path.name
        plain |= {one for one in found if isinstance(one, str)}
        counted |= {one[0] for one in found if not isinstance(one, str)}
        # A part of a message alone would be found too.
        written = "".join(text for call, text in literals(script) if call in {"_", "plural"})
        assert written == "".join(one if isinstance(one, str) else "".join(one) for one in found), path.name
    assert plain and counted and not plain & counted


# The functions themselves, in pages of several languages.


def said(context: BrowserContext, lang: str, catalogue: dict[str, Any] | None, call: str, *given: Any) -> Any:
    """What the function `call` gives in a page of that language."""
    page = context.new_page()
    page.evaluate("lang => { document.documentElement.lang = lang }", lang)
    page.evaluate("given => { if (given) window.COOOLER_CATALOGUE = given }", catalogue)
    page.add_script_tag(path=ASSETS / "words.js")
    return page.evaluate("([call, given]) => COOOLER_I18N[call](...given)", [call, list(given)])


@pytest.mark.browser
@pytest.mark.parametrize(
    ("message", "values", "text"),
    [
        ("A {b}.", [], "A {b}."),
        ("A {b}, {c}.", [{"b": "x"}], "A x, {c}."),
        ("{a}{b}{a}", [{"a": "{b}", "b": "$& $1 <i>{a}</i>"}], "{b}$& $1 <i>{a}</i>{b}"),
        ("{constructor} {__proto__} {{a}}", [{"a": 0}], "{constructor} {__proto__} {0}"),
    ],
)
def test_values_are_filled_in(context: BrowserContext, message: str, values: list[Any], text: str) -> None:
    assert said(context, "en", None, "_", message, *values) == text
    there = {message: f"«{message}»"}
    assert said(context, "de", there, "_", message, *values) == f"«{text}»"
    assert said(context, "de", {"other": "x"}, "_", message, *values) == text


ONE, MANY = "{n} video of {of}", "{n} videos of {of}"
FORMS = ["{n} film z {of}", "{n} filmy z {of}", "{n} filmów z {of}"]
PLACES = {"one": 0, "few": 1, "many": 2, "other": 2}


@pytest.mark.browser
@pytest.mark.parametrize(
    ("lang", "catalogue", "n", "text"),
    [
        ("en", None, 0, "0 videos of {n}"),
        ("en", None, 1, "1 video of {n}"),
        ("", None, 1_234, "1,234 videos of {n}"),
        ("pl", {"": PLACES, ONE: FORMS}, 1, "1 film z {n}"),
        ("pl", {"": PLACES, ONE: FORMS}, 22, "22 filmy z {n}"),
        ("pl", {"": PLACES, ONE: FORMS}, 112, "112 filmów z {n}"),
        ("pl", {"": PLACES}, 1, "1 video of {n}"),  # not translated
        ("pl", {"": PLACES}, 22, "22 videos of {n}"),
        ("pl", {ONE: FORMS}, 1, "1 filmów z {n}"),  # without places the last form
        ("pl", {"": PLACES, ONE: FORMS[:1]}, 5, "5 film z {n}"),
        ("ja", {"": {"other": 0}, ONE: ["{of} 本中 {n} 本"]}, 1, "{n} 本中 1 本"),
        ("pt-BR", {"": {"one": 0, "many": 1, "other": 1}, ONE: ["um", "{n}"]}, 0, "um"),
    ],
)
def test_plurals_are_those_of_the_language(
    context: BrowserContext, lang: str, catalogue: dict[str, Any] | None, n: int, text: str
) -> None:
    assert said(context, lang, catalogue, "plural", n, ONE, MANY, {"of": "{n}"}) == text


@pytest.mark.browser
def test_numbers_are_those_of_the_language(context: BrowserContext) -> None:
    assert said(context, "de", None, "whole", 1_234_567) == "1.234.567"
    assert said(context, "es", None, "whole", 1_234) == "1.234"
    assert said(context, "ar", None, "whole", 12) == "12"
    assert said(context, "de", None, "fixed", 0.5, 4) == "0,5000"
    assert said(context, "en", None, "fixed", 1234.5, 1) == "1234.5"
    assert said(context, "de", None, "marked", "1e-05 0.25") == "1e-05 0,25"
    assert said(context, "de", None, "percent", 0.0625) == "6,2\u202f%"


@pytest.mark.browser
def test_shares_are_written_as_python_writes_them(context: BrowserContext) -> None:
    shares = [part / whole for whole in (3, 16, 80, 400, 1346, 2000) for part in range(whole + 1)]
    page = context.new_page()
    page.add_script_tag(path=ASSETS / "words.js")
    assert page.evaluate("all => all.map(COOOLER_I18N.percent)", shares) == [*map(percent, shares)]


@pytest.mark.browser
def test_a_page_and_its_script_write_numbers_alike(context: BrowserContext, tmp_path: Path) -> None:
    with speaking(Language("de", NullTranslations(), ",", ".")):
        index = write_page(site_data(40, 5), tmp_path) / "index.html"
    index.write_text(index.read_text("utf-8").replace('<html lang="en">', '<html lang="de">'), "utf-8")
    page = context.new_page()
    page.goto(index.as_uri())
    cells = page.locator("#board tbody td").filter(has=page.locator(".bar"))
    before = cells.all_inner_texts()
    page.locator("#board-threshold").press("End")
    page.get_by_text(re.compile(r"published \d+,\d\u202f%")).first.wait_for()
    after = cells.all_inner_texts()
    assert before != after
    for text in (*before, *after):
        assert re.match(r"\d{1,3},(\d\u202f%|\d{4})\n", text)


def test_words_js_is_small() -> None:
    assert (ASSETS / "words.js").stat().st_size < MOST_BYTES
