"""The language of the pages: where their words are looked up, and how their numbers are written.

Code and templates say everything in English, through `gettext` and its like; the language that is spoken at
the time decides what comes out. English needs no catalogue. Commands speak English: they choose no other.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from gettext import NullTranslations
from typing import Self


@dataclass(frozen=True, slots=True)
class Language:
    """A language: its BCP 47 tag, its messages, and the marks inside its numbers."""

    tag: str
    messages: NullTranslations
    decimal_mark: str = "."
    group_mark: str = ","


ENGLISH = Language("en", NullTranslations())

_spoken: ContextVar[Language] = ContextVar("_spoken", default=ENGLISH)


@contextmanager
def speaking(language: Language) -> Iterator[None]:
    """Inside, this thread's pages are in `language`."""
    before = _spoken.set(language)
    try:
        yield
    finally:
        _spoken.reset(before)


def speak(language: Language) -> None:
    """From now on this thread's pages are in `language`; for processes that make nothing else."""
    _spoken.set(language)


def spoken() -> Language:
    """The language of the pages that are being made."""
    return _spoken.get()


def gettext(message: str) -> str:
    """The message in the language of the page; as it is where the catalogue has none."""
    language = _spoken.get()
    return message if language is ENGLISH else language.messages.gettext(message) if message else ""


def ngettext(one: str, many: str, count: int) -> str:
    """The form for `count` things: of `one` and `many` in English, of as many as the language has."""
    return _spoken.get().messages.ngettext(one, many, count)


def N_(message: str) -> str:  # noqa: N802 - the name by which gettext's tools know it
    """The message as it is: marks a constant for the catalogue, to be translated where it is used."""
    return message


class Said(str):
    """A text in English that a page can say again in its own language: `make` gives it in the one spoken.

    For what is worked out once and shown by commands and pages alike. A copy is plain text.
    """

    make: Callable[[], str]

    def __new__(cls, make: Callable[[], str]) -> Self:
        """Made twice or more: now, in English, and by `said_again`."""
        with speaking(ENGLISH):
            text = super().__new__(cls, make())
        text.make = make
        return text

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        """Copied and pickled as the English text."""
        return str, (str(self),)


def said_again(text: str) -> str:
    """The text in the language of the page, where it knows how; else as it is."""
    return text.make() if isinstance(text, Said) else text


def whole(count: int) -> str:
    """A whole number with its thousands in groups."""
    return marked(f"{count:,}")


def grouped(value: float, digits: int) -> str:
    """A number with that many digits after the decimal mark, and its thousands in groups."""
    return marked(f"{value:,.{digits}f}")


def fixed(value: float, digits: int) -> str:
    """A number with that many digits after the decimal mark; not grouped, and never a negative zero."""
    return marked(f"{value + 0.0:.{digits}f}")


def marked(text: str) -> str:
    """A number as Python writes it, with the marks of the page's language."""
    language = _spoken.get()
    if language is ENGLISH:
        return text
    return text.translate({ord("."): language.decimal_mark, ord(","): language.group_mark})
