"""Texts as pages show them: outside text made harmless to the eye, and word-level differences."""

import re
import unicodedata
from collections.abc import Sequence
from difflib import SequenceMatcher
from typing import TypeAlias

Diff: TypeAlias = tuple[tuple[str, str], ...]
"""Runs of words as (kind, text); kind is `same`, `added` (caption only) or `missing` (truth only)."""

_WORD = re.compile(r"\w+(?:['’-]\w+)*|[^\w\s]+", re.UNICODE)
_JOINERS = "\u200c\u200d"  # scripts and emoji need them, and they cannot reorder anything
_HIDDEN = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}
_MAX_DIFF_WORDS = 400


def visible(text: str) -> str:
    """Outside text for a page: control, bidirectional and other unseen characters are spelled out.

    U+202E becomes "⟨U+202E⟩"; line breaks and tabs become spaces, as HTML would show them.
    Printable text comes back as it is.
    """
    if text.isprintable():
        return text
    return "".join(map(_shown, text))


def _shown(char: str) -> str:
    if char in "\n\r\t":
        return " "
    if char in _JOINERS or unicodedata.category(char) not in _HIDDEN:
        return char
    return f"⟨U+{ord(char):04X}⟩"


def shorten(text: str, limit: int) -> str:
    """`text`, cut to `limit` characters with an ellipsis when it is longer."""
    return text if len(text) <= limit else text[: limit - 1].rstrip() + "…"


def difference(truth: str, caption: str) -> Diff:
    """The words of `caption` against those of `truth`, in reading order.

    Words are compared without case; punctuation that only one side has is not a difference worth
    showing. Runs of one kind are joined. Texts of more than 400 words are not compared: the
    caption comes back as one `added` run.
    """
    old, new = _words(truth), _words(caption)
    if max(len(old), len(new)) > _MAX_DIFF_WORDS:
        return (("added", caption),)
    ours, theirs = [word.casefold() for word in old], [word.casefold() for word in new]
    if ours == theirs:
        return (("same", " ".join(new)),) if new else ()
    matcher = SequenceMatcher(None, ours, theirs, autojunk=False)
    runs: list[tuple[str, str]] = []
    for tag, i1, i2, j1, j2 in matcher.get_opcodes():
        if tag == "equal":
            runs.append(("same", " ".join(new[j1:j2])))
            continue
        if i2 > i1:
            runs.append(("missing", " ".join(old[i1:i2])))
        if j2 > j1:
            runs.append(("added", " ".join(new[j1:j2])))
    return tuple(runs)


def _words(text: str) -> Sequence[str]:
    return [word for word in _WORD.findall(text) if word[0].isalnum() or word[0] in "_⟨"]
