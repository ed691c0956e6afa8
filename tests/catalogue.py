"""The template of the catalogues, `templates/locale/coooler.pot`: `python -m tests.catalogue` writes it.

It holds every message of the templates, of the Python modules that make pages, and of the pages' scripts,
with the files where each stands. Run it after a text has changed.
"""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_file
from babel.messages.pofile import write_po
from jinja2.ext import babel_extract

from pipeline.files import write_bytes

ROOT = Path(__file__).parent.parent
TEMPLATE = ROOT / "templates" / "locale" / "coooler.pot"
HEADER = """\
The messages of COOOLER's pages. To add a language, see docs/languages.md.
Written by: python -m tests.catalogue"""

KEYWORDS: dict[str, Any] = {"_": None, "N_": None, "gettext": None, "ngettext": (1, 2), "plural": (2, 3)}
JINJA = {"newstyle_gettext": "true", "trim_blocks": "true", "lstrip_blocks": "true", "silent": "false"}
SOURCES = (
    ("templates", "*.html", "jinja2", JINJA),
    ("templates/assets", "*.js", "javascript", {}),
    ("sitegen", "*.py", "python", {}),
)


def files() -> Iterator[tuple[Path, str, dict[str, str]]]:
    """Every file that may hold messages, how it is read, and with which options."""
    for folder, pattern, method, options in SOURCES:
        for path in sorted((ROOT / folder).glob(pattern)):
            yield path, method, options


def messages_of(path: Path, method: str, options: dict[str, str]) -> Iterator[str | tuple[str, ...]]:
    """The messages of one file, as they come; one with a plural as both of its forms."""
    how: Any = babel_extract if method == "jinja2" else method
    for found in extract_from_file(how, path, keywords=KEYWORDS, options=options):
        yield found[1]


def extracted() -> Catalog:
    """All messages, by their text, with the files where they stand."""
    catalogue = Catalog(fuzzy=False)
    for path, method, options in files():
        for message in messages_of(path, method, options):
            catalogue.add(message, locations=[(path.relative_to(ROOT).as_posix(), 0)])
    for entry in catalogue:
        entry.flags.clear()  # what is guessed of "95 % of" is wrong; a build checks placeholders itself
    return catalogue


def as_pot(catalogue: Catalog) -> bytes:
    """The catalogue as the file's content: sorted, without dates, versions and line numbers."""
    out = BytesIO()
    write_po(out, catalogue, width=100, sort_output=True, omit_header=True, include_lineno=False)
    comment = "".join(f"# {line}\n" for line in HEADER.splitlines())
    fields = (
        "MIME-Version: 1.0",
        "Content-Type: text/plain; charset=utf-8",
        "Content-Transfer-Encoding: 8bit",
    )
    header = 'msgid ""\nmsgstr ""\n' + "".join(f'"{field}\\n"\n' for field in fields)
    return f"{comment}{header}\n".encode() + out.getvalue()


if __name__ == "__main__":
    TEMPLATE.parent.mkdir(exist_ok=True)
    write_bytes(TEMPLATE, as_pot(extracted()))
