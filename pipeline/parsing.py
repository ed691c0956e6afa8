"""Any model answer -> items, and how it was parsed. Bounded, never raises, never evaluates code.

Tried in turn: JSON, a Python literal, numbered or bulleted lines, a comma list, plain prose.
"""

import ast
import json
import re
import warnings
from collections.abc import Iterable
from typing import Any

from pipeline.records import Item, Parse

MAX_ANSWER_CHARS = 65_536
MAX_ITEMS = 200
MAX_LABEL_CHARS = 120
MAX_DESCRIPTION_CHARS = 1_000
# Deeper nesting than any list of hazards has; parsers of nested text fail on very deep input.
MAX_DEPTH = 20

_THINKING = re.compile(r"<(think|thinking|thought)>.*?(</\1>|\Z)", re.DOTALL | re.IGNORECASE)
_FENCE = re.compile(r"```[\w-]*\n?(.*?)(?:```|\Z)", re.DOTALL)
_LINE = re.compile(r"^\s*(?:\d{1,3}[.):]|[-*+•–])\s+(.*\S)\s*$")
_SEPARATOR = re.compile(r"\s*(?::|\s[-–—]+)\s+")
_EMPHASIS = re.compile(r"\*\*|__|`")
_NOTHING = re.compile(
    r"^\W*(none|nothing|n/?a|no|there (are|is) no(ne|thing)?|no (anomal|hazard|object)\w*)\b", re.IGNORECASE
)
_LABEL_KEYS = ("label", "object", "name", "hazard", "item", "anomaly", "element")
_DESCRIPTION_KEYS = ("description", "action", "what", "details", "reason", "text", "caption")


def parse(text: str) -> tuple[tuple[Item, ...], Parse]:
    """Items in the order of the answer, ranks from 1, and how they were found.

    At most MAX_ITEMS items, labels and descriptions cut at their limits, repeats dropped.
    `Parse.EMPTY`: the answer is an empty list or says that there is nothing. `Parse.FAILED`:
    there was text, but no item in it.
    """
    answer = _THINKING.sub(" ", text[:MAX_ANSWER_CHARS]).strip()
    if not answer:
        return (), Parse.FAILED
    for candidate in _candidates(answer):
        for read, how in ((_json, Parse.JSON), (_literal, Parse.LITERAL)):
            found, value = read(candidate)
            if found:
                items = _ranked(_walk(value))
                return (items, how) if items else ((), Parse.EMPTY)
    plain = _FENCE.sub(r"\1", answer)
    items = _ranked(_split_pair(match.group(1)) for match in map(_LINE.match, plain.splitlines()) if match)
    if items:
        return items, Parse.LINES
    if _NOTHING.match(plain):
        return (), Parse.EMPTY
    if "\n" not in plain.strip() and "," in plain and len(plain) / (plain.count(",") + 1) < 60:
        items = _ranked((part.strip(" .;\"'[]"), "") for part in plain.split(","))
        if items:
            return items, Parse.COMMAS
    items = _ranked(("", sentence) for sentence in re.split(r"(?<=[.!?])\s+|\n+", plain))
    return (items, Parse.PROSE) if items else ((), Parse.FAILED)


def _candidates(answer: str) -> Iterable[str]:
    """The whole answer, its code blocks, and its outermost bracketed part."""
    yield answer
    for match in _FENCE.finditer(answer):
        yield match.group(1).strip()
    for opening, closing in ("[]", "{}"):
        start, end = answer.find(opening), answer.rfind(closing)
        if 0 <= start < end:
            yield answer[start : end + 1]


def _too_deep(text: str) -> bool:
    depth = deepest = 0
    for character in text:
        if character in "[{(":
            depth += 1
            deepest = max(deepest, depth)
        elif character in "]})":
            depth -= 1
    return deepest > MAX_DEPTH


def _json(text: str) -> tuple[bool, Any]:
    if text[:1] not in "[{" or _too_deep(text):
        return False, None
    try:
        return True, json.loads(text)
    except (ValueError, RecursionError):
        return False, None


def _literal(text: str) -> tuple[bool, Any]:
    if text[:1] not in "[{(" or _too_deep(text):
        return False, None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "invalid escape sequence" in what a model wrote
            return True, ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return False, None


def _walk(value: Any) -> Iterable[tuple[str, str]]:
    """(label, description) pairs in a parsed value: strings, dicts, pairs, and lists of them."""
    if isinstance(value, str):
        yield _split_pair(value)
    elif isinstance(value, dict):
        label = next((value[key] for key in _LABEL_KEYS if isinstance(value.get(key), str)), "")
        description = next((value[key] for key in _DESCRIPTION_KEYS if isinstance(value.get(key), str)), "")
        if label or description:
            yield label, description
            return
        for key, inner in value.items():
            if isinstance(inner, str):
                yield str(key), inner
            else:
                yield from _walk(inner)
    elif isinstance(value, list | tuple | set):
        for inner in sorted(value, key=str) if isinstance(value, set) else value:
            yield from _walk(inner)


def _split_pair(text: str) -> tuple[str, str]:
    """ "Cat: crossing the road" -> its two parts; a text without a separator is all label.

    A long text without a separator is a sentence, so it is all description.
    """
    plain = _EMPHASIS.sub("", text).strip()
    parts = _SEPARATOR.split(plain, maxsplit=1)
    if len(parts) == 2 and parts[0] and len(parts[0]) <= 60:
        return parts[0], parts[1]
    return ("", plain) if len(plain) > 60 or plain.endswith(".") else (plain, "")


def _ranked(pairs: Iterable[tuple[str, str]]) -> tuple[Item, ...]:
    items: list[Item] = []
    seen: set[tuple[str, str]] = set()
    for raw_label, raw_description in pairs:
        label = " ".join(raw_label.split())[:MAX_LABEL_CHARS]
        description = " ".join(raw_description.split())[:MAX_DESCRIPTION_CHARS]
        key = (label.casefold(), description.casefold())
        if not (any(c.isalnum() for c in label) or any(c.isalnum() for c in description)) or key in seen:
            continue
        seen.add(key)
        items.append(Item(len(items) + 1, label, description))
        if len(items) == MAX_ITEMS:
            break
    return tuple(items)
