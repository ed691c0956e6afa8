"""Data within the words of a model: JSON, Python literals, and either of them cut short or bent.

Bounded, never raises, never evaluates code.
"""

import ast
import json
import re
import warnings
from collections.abc import Iterator
from itertools import islice
from typing import Any

from pipeline.records import Parse

# Deeper nesting than any list of hazards has; parsers of nested text fail on very deep input.
MAX_DEPTH = 20
MAX_TRIES = 40  # places in an answer where a JSON value may start, or end when it was cut

FENCE = re.compile(r"```[\w-]*\n?(.*?)(?:```|\Z)", re.DOTALL)
# That there is nothing, however a model says it.
NOTHING = re.compile(
    r"^\W*(none|nothing|n/?a|null|no)\W*$|^\W*(none|nothing|n/?a)\b"
    r"|\bno (\w+ ){0,3}(anomal|hazard(?!s? (light|flasher))|obstacle|object|item|danger|threat)"
    r"|\bnone of the\b|list is empty"
    r"|\b(not|n't|cannot) (see|detect|identify|find|contain|include|observe) any\b"
    r"|^\W*there (are|is) no(ne|thing)?\b",
    re.IGNORECASE,
)


def structured(answer: str) -> Iterator[tuple[list[Any], Parse]]:
    """What may be meant as data: the whole, code blocks, values within words, a value cut short."""
    whole = [answer, *(match.group(1).strip() for match in islice(FENCE.finditer(answer), MAX_TRIES))]
    for candidate in whole:
        for read, how in ((_json, Parse.JSON), (_literal, Parse.LITERAL)):
            found, value = read(candidate)
            if found:
                yield [value], how
    if values := list(_values(answer)):
        yield values, Parse.JSON
    for opening, closing in ("[]", "{}"):
        start, end = answer.find(opening), answer.rfind(closing)
        if 0 <= start < end:
            found, value = _literal(answer[start : end + 1])
            if found:
                yield [value], Parse.LITERAL
    for mended in _mended(answer):
        for read, how in ((_json, Parse.JSON), (_literal, Parse.LITERAL)):
            found, value = read(mended)
            if found:
                yield [value], how


def _values(answer: str) -> Iterator[Any]:
    """JSON lists and objects that stand in an answer, one after the other."""
    if _too_deep(answer):
        return
    decoder = json.JSONDecoder()
    place = 0
    for _ in range(MAX_TRIES):
        starts = [at for at in (answer.find("[", place), answer.find("{", place)) if at >= 0]
        if not starts:
            return
        place = min(starts)
        try:
            value, place = decoder.raw_decode(answer, place)
            yield value
        except (ValueError, RecursionError):
            place += 1


def _mended(answer: str) -> Iterator[str]:
    """A value with bare keys quoted and commas put in, or cut back to its last whole element and closed."""
    starts = [at for at in (answer.find("["), answer.find("{")) if at >= 0]
    if not starts or _too_deep(answer):
        return
    text = answer[min(starts) :]
    end = max(text.rfind("]"), text.rfind("}")) + 1
    keyed = re.sub(r"([{,]\s*)([A-Za-z_]{1,30})(\s*:)", r'\1"\2"\3', text[: end or None])
    yield keyed
    yield re.sub(r'(["}])(\s+)(?=["{])', r"\1,\2", keyed)
    quote, skip, closers, cuts = "", False, "", list[tuple[int, str]]()
    for at, character in enumerate(text):
        if skip or quote:
            ends = not skip and character == quote
            skip = not skip and character == "\\"
            quote = "" if ends else quote
        elif character in "\"'":
            quote = character
        elif character in "[{":
            closers = ("]" if character == "[" else "}") + closers
        elif character in "]}":
            closers = closers[1:]
        elif character == ",":
            cuts.append((at, closers))
    if not quote and closers:
        yield text + closers
    for at, open_then in reversed(cuts[-MAX_TRIES // 4 :]):
        if open_then:
            yield text[:at] + open_then


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
    if not (text == "null" or text[:1] in "[{") or _too_deep(text):
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


def is_empty(value: Any) -> bool:
    """Whether a parsed value says that there is nothing."""
    if isinstance(value, dict):
        return all(is_empty(inner) for inner in value.values())
    if isinstance(value, list | tuple | set):
        return not value or all(isinstance(inner, str | dict) and is_empty(inner) for inner in value)
    return value is None or (
        isinstance(value, str) and (not value.strip() or bool(NOTHING.search(value[:500])))
    )
