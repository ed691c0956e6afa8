"""The language of the pages: nothing is forgotten, catalogues are checked, a translation is shown."""

import json
import re
from pathlib import Path

import pytest
from babel.messages.pofile import read_po, write_po

from pipeline.benchmark import Benchmark
from pipeline.config import BenchmarkSettings, read_benchmark_settings
from pipeline.errors import ConfigError, Fault, FaultsError, InputError
from sitegen import build, intake_pages
from sitegen.build import build_site
from sitegen.catalogues import languages, read_language, script_messages
from sitegen.intake_records import Details, Report, Upload
from sitegen.language import (
    ENGLISH,
    Language,
    Said,
    fixed,
    gettext,
    grouped,
    ngettext,
    said_again,
    speaking,
    whole,
)
from sitegen.readers import FORMATS
from sitegen.rehearsal import report
from sitegen.rendering import find_locale
from tests.catalogue import TEMPLATE, as_pot, extracted, files, messages_of
from tests.language_case import MARKED, Unmarked, make_benchmark, make_board, unmarked, wide
from tests.site_fixtures import Board, WordEmbedder

HEADER = r"""msgid ""
msgstr ""
"Content-Type: text/plain; charset=utf-8\n"
"Plural-Forms: nplurals=2; plural=(n != 1);\n"
"""
SHIPPED = find_locale()


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Benchmark, Board]:
    benchmark = make_benchmark(tmp_path_factory.mktemp("small"))
    return benchmark, make_board(benchmark)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of catalogues with the template, and one in German."""
    made = tmp_path / "locale"
    made.mkdir()
    (made / "coooler.pot").write_bytes(TEMPLATE.read_bytes())
    put(made, 'msgid "Leaderboard"\nmsgstr "Rangliste & mehr"\n')
    return made


def put(folder: Path, messages: str, header: str = HEADER, tag: str = "de") -> None:
    (folder / f"{tag}.po").write_text(f"{header}\n{messages}", encoding="utf-8")


def with_settings(benchmark: Benchmark, **changes: object) -> Benchmark:
    return Benchmark(benchmark.root, benchmark.settings.model_copy(update=changes))


@pytest.mark.parametrize("kind", ["shown", "hidden", "empty", "rehearsed"])
def test_no_text_is_forgotten(
    small: tuple[Benchmark, Board], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(build, "read_language", lambda tag, folder: MARKED)
    benchmark, board = small
    if kind == "empty":
        board = []
    if kind == "rehearsed":
        board = [board[0]._replace(rehearsed=True), *board[1:]]
    benchmark = with_settings(benchmark, hide_truth=kind == "hidden")
    build_site(benchmark, tmp_path, board, jobs=1, embedder=WordEmbedder())
    left = list(unmarked(tmp_path))
    assert not left, "\n".join(left)
    assert wide("Leaderboard") in (tmp_path / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("state", ["queued", "working", "good", "accepted", "refused"])
def test_no_text_of_an_upload_is_forgotten(
    small: tuple[Benchmark, Board], monkeypatch: pytest.MonkeyPatch, state: str
) -> None:
    monkeypatch.setattr(intake_pages, "read_language", lambda tag, folder: MARKED)
    benchmark, board = small
    site = benchmark.root / "site"
    upload = Upload.model_validate(
        {
            "upload_id": "x" * 22,
            "number": 1,
            "details": Details(kind="check", name="Ένα", file_name="ένα"),
            "size": 1_000,
            "sha256": "0" * 64,
            "received": "2026-01-02",
            "state": state,
        }
    )
    scores = report(board, 0) if state == "good" else {}
    scores.pop("probes", None)  # they stand in the report in English
    faults = (Fault("ένα", 1, "–", "–", "–", "–", 2),) if state == "refused" else ()
    told = Report(faults=faults, source_format="–", scores=scores, warnings=("–",))
    pages = [
        intake_pages.status_page(benchmark, site, upload, told, before, behind)
        for before in (0, 2)
        for behind in (False, True)
    ]
    pages.append(intake_pages.upload_page(benchmark, site, {}, "–", True, 2**20))
    for page in pages:
        left = [one for one in Unmarked(page.decode()).left if one.rpartition(": ")[2] not in FORMATS]
        assert not left, "\n".join(left)


def test_a_forgotten_text_is_found() -> None:
    html = f'<p title="Hidden">{wide("Said")} <b>plain</b> BESM 0.5 <code>x --y</code></p><img alt="A cat">'
    assert [one.split(": ")[1] for one in Unmarked(html).left] == ["Hidden", "plain", "A cat"]


def test_the_template_is_up_to_date() -> None:
    assert TEMPLATE.read_bytes() == as_pot(extracted()), "Run: python -m tests.catalogue"


def test_no_message_is_plain_here_and_counted_there() -> None:
    plain: set[str] = set()
    counted: dict[str, set[str]] = {}
    for path, method, options in files():
        for message in messages_of(path, method, options):
            if isinstance(message, str):
                plain.add(message)
            else:
                counted.setdefault(message[0], set()).add(message[1])
    assert not plain & set(counted)
    assert [one for one, many in counted.items() if len(many) > 1] == []


def test_english_needs_no_catalogue(tmp_path: Path) -> None:
    assert read_language("en", tmp_path / "missing") is ENGLISH
    assert gettext("Leaderboard") == "Leaderboard" and gettext("") == ""
    assert ngettext("{n} video", "{n} videos", 1) == "{n} video"
    assert (whole(1_234_567), fixed(-0.00001, 2), grouped(1_234.5, 1)) == ("1,234,567", "-0.00", "1,234.5")


def test_an_unknown_language_is_said(small: tuple[Benchmark, Board], tmp_path: Path) -> None:
    benchmark, board = small
    with pytest.raises(InputError, match=r"'xx'.*there are: en.*coooler\.pot.*docs/languages\.md"):
        build_site(with_settings(benchmark, language="xx"), tmp_path / "site", board, jobs=1)
    assert not (tmp_path / "site").exists()
    for wrong in ("../../etc/passwd", "DE", "de_DE", ""):
        with pytest.raises(ValueError, match="language"):
            BenchmarkSettings(language=wrong)
    path = tmp_path / "coooler.toml"
    path.write_text('language = "de/.."\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="language"):
        read_benchmark_settings(path)


def test_what_is_no_language_or_no_catalogue(folder: Path) -> None:
    put(folder, "", tag="zzz")
    with pytest.raises(InputError, match="no language that is known"):
        read_language("zzz", folder)
    (folder / "nl.po").write_bytes(b'msgid "a"\nmsgstr "\xff\n')
    with pytest.raises(InputError, match=r"nl\.po.*gettext"):
        read_language("nl", folder)
    put(folder, "", HEADER.replace("n != 1", "__import__"), tag="it")
    with pytest.raises(InputError, match=r"it\.po"):
        read_language("it", folder)
    assert languages(folder) == ["de", "en", "it", "nl", "zzz"]


@pytest.mark.parametrize(
    ("message", "wrong"),
    [
        ('msgid "{a} of {b}"\nmsgstr "{a} von {c}"', "values {a} {c}; expected the values {a} {b}"),
        ('msgid "{a} of {b}"\nmsgstr "{a.__class__} {b}"', "values {b}"),
        ('msgid "At %(time)s"\nmsgstr "Um %(zeit)s"', "%(zeit)s"),
        ('msgid "At %(time)s"\nmsgstr "Um {time}"', "{time}"),
        ('msgid "Plain"\nmsgstr "100 % klar"', "a loose %"),
        ('msgid "Plain"\nmsgstr "offen {"', "a loose {"),
        ('msgid "A <b>word</b>"\nmsgstr "Ein <b>Wort"', "elements <b; expected the elements </b <b"),
        ('msgid "Plain"\nmsgstr "<script>x</script>"', "<script"),
        ('msgid "{n} cat"\nmsgid_plural "{n} cats"\nmsgstr[0] "{n} Katze"', "1 form(s)"),
        ('msgid "{n} cat"\nmsgid_plural "{n} cats"\nmsgstr[0] "{m} Katze"\nmsgstr[1] "{n} Katzen"', "{m}"),
    ],
)
def test_a_translation_that_would_break_a_page_is_refused(folder: Path, message: str, wrong: str) -> None:
    put(folder, message)
    with pytest.raises(FaultsError) as caught:
        read_language("de", folder)
    text = str(caught.value)
    assert wrong in text and "de.po, line 6" in text and len(caught.value.faults) == 1


def test_what_a_translation_may_do(folder: Path) -> None:
    messages = [
        'msgid "{a} of {b}"\nmsgstr "von {b} sind es {a}"',
        'msgid "{n} cat"\nmsgid_plural "{n} cats"\nmsgstr[0] "eine Katze"\nmsgstr[1] "{n} Katzen"',
        'msgid "95 %% of %(all)s"\nmsgstr "%(all)s zu 95 %%"',
        'msgid "95 % of {all}"\nmsgstr "{all}, 95 %"',
        '#, fuzzy\nmsgid "perhaps"\nmsgstr "{vielleicht"',
        'msgid "not yet"\nmsgstr ""',
    ]
    put(folder, "\n\n".join(messages))
    german = read_language("de", folder)
    assert (german.tag, german.decimal_mark, german.group_mark) == ("de", ",", ".")
    with speaking(german):
        assert gettext("{a} of {b}").format(a=1, b=2) == "von 2 sind es 1"
        assert [ngettext("{n} cat", "{n} cats", n) for n in (1, 2)] == ["eine Katze", "{n} Katzen"]
        assert gettext("95 %% of %(all)s") % {"all": "x"} == "x zu 95 %"
        assert gettext("95 % of {all}") == "{all}, 95 %"
        assert (gettext("perhaps"), gettext("not yet")) == ("perhaps", "not yet")
        assert (whole(1_234), fixed(0.5, 2)) == ("1.234", "0,50")
    assert gettext("{a} of {b}") == "{a} of {b}"


def test_what_was_said_in_english_is_said_again(folder: Path) -> None:
    put(folder, 'msgid "{n} cats"\nmsgstr "{n} Katzen"')
    with speaking(read_language("de", folder)):
        text = Said(lambda: gettext("{n} cats").format(n=fixed(2.5, 1)))
        assert text == "2.5 cats" and said_again(text) == "2,5 Katzen"
        assert said_again("2.5 cats") == "2.5 cats"


def test_scripts_get_their_messages_only(folder: Path) -> None:
    template = TEMPLATE.read_text(encoding="utf-8")
    entries = [entry for entry in template.split("\n\n") if ".js" in entry and "msgid_plural" not in entry]
    found = re.search(r'^msgid "([^{}"\\]+)"$', "\n".join(entries), re.MULTILINE)
    assert found
    forms = "".join(f'msgstr[{place}] "{word} {{n}}"\n' for place, word in enumerate("abc"))
    counted = f'msgid "{{n}} video"\nmsgid_plural "{{n}} videos"\n{forms}'
    header = HEADER.replace(
        "nplurals=2; plural=(n != 1)",
        "nplurals=3; plural=(n%10==1 && n%100!=11 ? 0 : "
        "n%10>=2 && n%10<=4 && (n%100<10 || n%100>=20) ? 1 : 2)",
    )
    said = f'msgid "{found[1]}"\nmsgstr "ja"\n\nmsgid "Skip to the content"\nmsgstr "nein"\n\n'
    put(folder, said + counted, header, tag="ru")
    messages = script_messages("ru", folder)
    assert messages[""] == {"one": 0, "few": 1, "many": 2}
    assert messages[found[1]] == "ja" and "Skip to the content" not in messages
    if re.search(r"#: .*\.js.*\nmsgid \"\{n\} video\"\n", template):
        assert messages["{n} video"] == ["a {n}", "b {n}", "c {n}"]


def test_a_site_in_german(
    small: tuple[Benchmark, Board], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(
        folder,
        'msgid "Leaderboard"\nmsgstr "Rangliste"\n\n'
        'msgid "Rightly silent"\nmsgstr "Zu Recht still & stumm"\n\n'
        'msgid "How to verify this site"\nmsgstr "Prüfen"\n\n'
        'msgid "{n} video"\nmsgid_plural "{n} videos"\nmsgstr[0] "{n} Video"\nmsgstr[1] "{n} Videos (dt.)"\n',
    )
    monkeypatch.setattr(build, "find_locale", lambda: folder)
    benchmark, board = small
    build_site(with_settings(benchmark, language="de"), tmp_path / "site", board, jobs=1)
    pages = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "site").glob("*.html")}
    for page in pages.values():
        assert '<html lang="de">' in page and ">Rangliste</a>" in page and "Leaderboard</a>" not in page
        assert 0 < page.index("assets/catalogue.js") < page.index("assets/words.js")
    assert ">Prüfen</a>" in pages["method.html"] and "S &gt; 0,80" in pages["method.html"]
    assert "5 Videos (dt.)" in pages["videos.html"]
    video = (tmp_path / "site" / "videos" / "2.html").read_text(encoding="utf-8")
    assert "Zu Recht still &amp; stumm" in video and "1,0000" in video
    script = (tmp_path / "site" / "assets" / "catalogue.js").read_text(encoding="utf-8")
    head, tail = "window.COOOLER_CATALOGUE = ", ";\n"
    assert script.startswith(head) and script.endswith(tail) and "<" not in script
    assert json.loads(script.removeprefix(head).removesuffix(tail))[""] == {"one": 0, "other": 1}
    board_csv = (tmp_path / "site" / "data" / "leaderboard.csv").read_text(encoding="utf-8")
    assert ",0.200000," in board_csv  # files for programs speak English


def test_every_message_can_be_translated(folder: Path) -> None:
    with TEMPLATE.open("rb") as file:
        catalogue = read_po(file, locale="de")
    for message in catalogue:
        if message.id:
            message.string = wide(message.id) if isinstance(message.id, str) else tuple(map(wide, message.id))
    with (folder / "de.po").open("wb") as file:
        write_po(file, catalogue)
    with speaking(read_language("de", folder)):
        assert gettext("Leaderboard") == wide("Leaderboard")
    assert len(script_messages("de", folder)) > 100


def test_the_catalogues_of_the_package_are_whole() -> None:
    """Every catalogue that comes along can be read, and its messages are those of the template."""
    for tag in languages(SHIPPED):
        assert isinstance(read_language(tag, SHIPPED), Language)
        assert tag == ENGLISH.tag or script_messages(tag, SHIPPED)
