"""The catalogues that pages are translated by: gettext's `.po` files, read with Babel and checked.

What a translation may not do is break a page: it has to name the same values as the English message, and to
hold the same elements. It is trusted otherwise; catalogues come with the package.
"""

import re
from collections.abc import Iterator
from functools import cache
from gettext import GNUTranslations, c2py
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import Fault, FaultsError, InputError, OutsideError
from sitegen.language import ENGLISH, Language
from sitegen.words import shorten

if TYPE_CHECKING:
    from babel import Locale
    from babel.messages.catalog import Catalog, Message

TEMPLATE = "coooler.pot"

_VALUE = re.compile(r"%\((\w+)\)s|\{(\w+)\}")
_TAG = re.compile(r"</?[a-z]\w*")
_LOOSE = re.compile(r"%%|%\(\w+\)s|\{\w+\}")
_COUNTED = 1_001  # how many numbers are asked for their plural category and form


def languages(folder: Path) -> list[str]:
    """The tags of the languages that pages can be in: English, and those with a catalogue in `folder`."""
    return sorted({ENGLISH.tag, *(path.stem for path in folder.glob("*.po"))})


@cache
def read_language(tag: str, folder: Path) -> Language:
    """The language `tag` (BCP 47) with its catalogue `folder/tag.po`; English needs none.

    Messages that are not translated, or marked as fuzzy, stay English. Raises InputError when there is no
    such catalogue or it cannot be read, FaultsError for the translations that would break a page, and
    OutsideError without Babel.
    """
    if tag == ENGLISH.tag:
        return ENGLISH
    catalogue, locale = _catalogue(tag, folder)
    from babel.messages.mofile import write_mo
    from babel.numbers import get_decimal_symbol, get_group_symbol

    compiled = BytesIO()
    write_mo(compiled, catalogue)
    compiled.seek(0)
    return Language(tag, GNUTranslations(compiled), get_decimal_symbol(locale), get_group_symbol(locale))


def script_messages(tag: str, folder: Path) -> dict[str, object]:
    """What the pages' scripts need of a catalogue: English message -> translation.

    Of a message with a plural, the English singular leads to the list of the language's forms, in the order
    of gettext; "" leads to the place in that list of each category of `Intl.PluralRules`. Which messages the
    scripts have is said by the catalogue's template, which names their files. Raises as `read_language`.
    """
    catalogue, locale = _catalogue(tag, folder)
    form_of = c2py(catalogue.plural_expr)
    places: dict[str, int] = {}
    for count in range(_COUNTED):
        places.setdefault(locale.plural_form(count), form_of(count))
    said: dict[str, object] = {"": places}
    for message in read_template(folder):
        one, *_ = _forms(message.id)
        found = catalogue.get(one)
        if one and found and _is_said(found) and any(path.endswith(".js") for path, _ in message.locations):
            said[one] = found.string if isinstance(found.string, str) else list(_forms(found.string))
    return said


def read_template(folder: Path) -> "Catalog":
    """The catalogue's template: each message of pages and scripts. Raises OutsideError when it is missing."""
    from babel.messages.pofile import read_po

    try:
        with (folder / TEMPLATE).open("rb") as file:
            return read_po(file)
    except OSError as error:
        raise OutsideError(f"{folder / TEMPLATE}: {error.strerror}. Install COOOLER again.") from error


def _catalogue(tag: str, folder: Path) -> "tuple[Catalog, Locale]":
    path = folder / f"{tag}.po"
    if tag not in languages(folder):
        there = ", ".join(languages(folder))
        raise InputError(
            f"language {tag!r}: there is no catalogue {path}; there are: {there}. Choose one of these, or "
            f"translate a copy of {TEMPLATE} there, as docs/languages.md says."
        )
    try:
        from babel import Locale, UnknownLocaleError
        from babel.messages.pofile import PoFileError, read_po
    except ImportError as error:
        raise OutsideError("Pages in other languages than English need Babel: pip install babel.") from error
    try:
        locale = Locale.parse(tag, sep="-")
        with path.open("rb") as file:
            catalogue = read_po(file, locale=locale, abort_invalid=True)
        c2py(catalogue.plural_expr)
    except UnknownLocaleError as error:
        raise InputError(
            f"{path}: {tag!r} is no language that is known; expected a tag such as de."
        ) from error
    except (OSError, ValueError, LookupError, PoFileError) as error:
        raise InputError(f"{path}: not readable as a catalogue of gettext: {error}") from error
    if faults := list(_faults(path, catalogue)):
        raise FaultsError(faults)
    return catalogue, locale


def _is_said(message: "Message") -> bool:
    """Whether it is translated, in all of its forms, and not only perhaps."""
    return not message.fuzzy and all(_forms(message.string))


def _forms(texts: str | tuple[str, ...] | list[str] | None) -> tuple[str, ...]:
    """A message's texts: one, or the forms of its plural."""
    return (texts,) if isinstance(texts, str) else tuple(texts or ())


def _faults(path: Path, catalogue: "Catalog") -> Iterator[Fault]:
    for message in catalogue:
        if not message.id or not any(_forms(message.string)) or message.fuzzy:
            continue
        english = _forms(message.id)
        given = _forms(message.string)
        wanted = catalogue.num_plurals if len(english) > 1 else 1
        if len(given) != wanted or not all(given):
            expected = f"{wanted} form(s), each with words, as Plural-Forms says"
            yield _fault(path, message, f"{len([form for form in given if form])} form(s)", expected)
            continue
        for form in given:
            for what, found, expected in _differences(english[-1], form, counted=len(english) > 1):
                yield _fault(
                    path, message, f"{form!r} with {what} {found or 'none'}", f"{what} {expected or 'none'}"
                )


def _differences(english: str, form: str, *, counted: bool) -> Iterator[tuple[str, str, str]]:
    """What a page relies on and the translation has otherwise: (what it is, what it has, what it should)."""
    values, named = _values(english), _values(form)
    needed = values - {"{n}", "%(n)s"} if counted else values  # "one cat" needs no number
    if not needed <= named <= values:
        yield "the values", " ".join(sorted(named)), " ".join(sorted(values))
    tags, marked = (sorted(_TAG.findall(text)) for text in (english, form))
    if tags != marked:
        yield "the elements", " ".join(marked), " ".join(tags)
    loose = [mark for mark in "%{}" if mark in _LOOSE.sub("", form) and mark not in _LOOSE.sub("", english)]
    if loose and named == values:
        yield "a loose", " ".join(loose), ""


def _values(text: str) -> set[str]:
    """The places that are filled in, with their way of writing: `%(name)s` and `{name}`."""
    return {found.group() for found in _VALUE.finditer(text)}


def _fault(path: Path, message: "Message", found: str, expected: str) -> Fault:
    place = f"{path}, line {message.lineno} ({shorten(_forms(message.id)[0], 60)!r})"
    mend = "Take these over from the English as they are."
    return Fault(place, None, None, found, expected, mend, message.lineno)
