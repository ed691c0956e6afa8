"""Any model answer -> items, and how it was parsed. Bounded, never raises, never evaluates code.

Tried in turn: data (see structured.py), numbered or bulleted lines, a table, short lines, a comma
list, plain prose. Thoughts and marks that templates leave are dropped first.
"""

import re
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any

from pipeline.records import Item, Parse
from pipeline.structured import FENCE, NOTHING, is_empty, structured

MAX_ANSWER_CHARS = 65_536
MAX_ITEMS = 200
MAX_LABEL_CHARS = 120
MAX_DESCRIPTION_CHARS = 1_000

_THOUGHTS = (
    re.compile(r"<(think|thinking|thought)>.*?(</\1>|\Z)", re.DOTALL | re.IGNORECASE),
    re.compile(r"\[THINK\].*?(\[/THINK\]|\Z)", re.DOTALL),
    re.compile(r"◁think▷.*?(◁/think▷|\Z)", re.DOTALL),
)
# Templates that open the thoughts themselves leave only the end; channels name the last one.
_THOUGHTS_END = re.compile(
    r"\A.*(</think(?:ing)?>|<\|channel\|>final<\|message\|>)", re.DOTALL | re.IGNORECASE
)
_MARKS = re.compile(
    r"<\|[\w ]{1,30}\|>|</?s>|<(?:end|start)_of_turn>|</?(?:answer|ul|ol|p|b|strong|em)>|</li>|\[/?INST\]"
)
_LIST_ITEM = re.compile(r"<li>|<br ?/?>")
_LINE = re.compile(
    r"^([ \t]*)[*_#>]{0,3}[ \t]{0,3}"
    r"(?:(\(?\d{1,3}(?:[.):](?!\d)|[ ]?[-–—](?=\s))\)?|\(?[a-z]\)|[ivx]{1,4}[.)](?=\s))"
    r"|[-*+–](?=\s)|[•·▪●◦‣])\s*(.*\S)\s*$",
    re.IGNORECASE,
)
_INLINE = re.compile(r"(?:^|\s)\(?(\d{1,2})[.)]\s+")
_SEPARATOR = re.compile(r"\s*(?::|\s[-–—]+)\s+|\s*：\s*")
_IN_BRACKETS = re.compile(r"([^()]{1,60}?)\s+\(([^()]+\s[^()]+|\w+ing)\)\.?")
_COMMA = re.compile(r"[,、，]")
_LEAD = re.compile(
    r"[^,:;]{0,60}:\s+(?=\S)"
    r"|(?:the |these )?(?:objects|elements|items|things)\b[^,:;]{0,40}?\b(?:are|include)\s+",
    re.IGNORECASE,
)
_NAME = re.compile(r"[\w' -]+")
_EMPHASIS = re.compile(r"\*\*|__|`")
_SENTENCE_END = re.compile(r"(?<=[.!?])\s+|\n+")
_CONTRAST = re.compile(
    r"\b(but|however|although|though|except|only|apart from|(?<=no )(other|further|additional|more))\b",
    re.IGNORECASE,
)
_GENERIC = re.compile(r"anomal|hazard|obstacle|danger|threat|none|nothing|n/?a\b|empty", re.IGNORECASE)
_REFUSAL = re.compile(
    r"^\W*(i.?m (very )?sorry|i am sorry|sorry|i apologi[sz]e|as an ai"
    r"|i (can.?t|cannot) (help|assist|provide|process)|i.?m unable|i am unable)\b",
    re.IGNORECASE,
)
_LABEL_KEYS = ("label", "object", "name", "hazard", "item", "anomaly", "element")
_DESCRIPTION_KEYS = ("description", "action", "what", "details", "reason", "text", "caption", "behavior")
_NO_LABEL = re.compile(
    r"\W*(\d+|items?|answers?|results?|responses?|outputs?|lists?\d?|final\w*|hazards?|anomal(y|ies)|objects?"
    r"|elements?|rank\w*|(item|object|hazard)[ _]?\d+)\W*",
    re.IGNORECASE,
)

Pairs = Iterable[tuple[str, str]]


def parse(text: str) -> tuple[tuple[Item, ...], Parse]:
    """Items in the order of the answer, ranks from 1, and how they were found.

    At most MAX_ITEMS items, labels and descriptions cut at their limits, repeats dropped.
    `Parse.EMPTY`: the answer is an empty list or says that there is nothing. `Parse.FAILED`:
    there was text, but no item in it.
    """
    answer = text[:MAX_ANSWER_CHARS]
    for thought in _THOUGHTS:
        answer = thought.sub(" ", answer)
    answer = _LIST_ITEM.sub("\n- ", _MARKS.sub(" ", _THOUGHTS_END.sub("", answer))).strip()
    if answer[:1] == '"' == answer[-1:] and answer.count('"') == 2:
        answer = answer[1:-1].strip()
    if not answer:
        return (), Parse.FAILED
    empty = False
    for values, how in structured(answer):
        items = _ranked(pair for value in values for pair in _walk(value))
        if items:
            return items, how
        empty = empty or any(is_empty(value) for value in values)
    if empty:
        return (), Parse.EMPTY
    plain = FENCE.sub(r"\1", answer).strip()
    for pairs, how in ((_lines(plain), Parse.LINES), (_commas(plain), Parse.COMMAS)):
        found = list(islice(pairs, 10 * MAX_ITEMS))
        items = _ranked(found)
        if found:
            return (items, how) if items else ((), Parse.EMPTY)
    return _prose(plain)


def _prose(plain: str) -> tuple[tuple[Item, ...], Parse]:
    sentences = [
        part for part in _SENTENCE_END.split(plain) if part.strip() and not part.rstrip().endswith(":")
    ]
    nothing = [bool(NOTHING.search(part[:500]) and not _CONTRAST.search(part[:500])) for part in sentences]
    if nothing and nothing[0] and (all(nothing) or _GENERIC.search(sentences[0][:500])):
        return (), Parse.EMPTY
    if _REFUSAL.match(plain) and len(plain) < 500:
        return (), Parse.FAILED
    said = [part for part, no in zip(sentences, nothing, strict=True) if not no]
    items = _ranked(("", part) for part in said if any(character.isalpha() for character in part))
    return (items, Parse.PROSE) if items else ((), Parse.FAILED)


def _walk(value: Any, label: str = "", longest: int = 4) -> Pairs:
    """(label, description) pairs in a parsed value: strings, dicts, pairs, and lists of them.

    A string of three or more parts between commas, of `longest` words at most, is a list itself.
    """
    if isinstance(value, str):
        parts = [part.strip() for part in value[:MAX_ANSWER_CHARS].split(",")]
        if label:
            yield label, value
        elif len(parts) > 2 and all(1 <= len(part.split()) <= longest for part in parts):
            yield from ((part, "") for part in parts)
        else:
            yield _split_pair(value)
    elif isinstance(value, dict):
        yield from _walk_dict(value, label)
    elif isinstance(value, list | tuple | set):
        inner = sorted(value, key=str) if isinstance(value, set) else list(value)
        pairs = [one for one in inner if isinstance(one, list | tuple) and [*map(type, one)] == [str, str]]
        if pairs and len(pairs) == len(inner) and any(" " in one[1].strip() for one in pairs):
            yield from ((str(one[0]), str(one[1])) for one in pairs)
        else:
            for one in inner:
                yield from _walk(one, longest=2)


def _walk_dict(value: dict[Any, Any], outer: str) -> Pairs:
    by_key = {str(key).strip().lower(): inner for key, inner in value.items()}
    label = next((by_key[key] for key in _LABEL_KEYS if isinstance(by_key.get(key), str)), outer)
    description = next(
        (by_key[key] for key in _DESCRIPTION_KEYS if isinstance(by_key.get(key), str | list)), ""
    )
    if isinstance(description, list):
        words = [one for one in description if isinstance(one, str)]
        description = "; ".join(words) if label or len(words) == len(description) else ""
    if label or description:
        yield (label, description) if description or outer else _split_pair(label)
        return
    for key, inner in value.items():
        named = "" if _NO_LABEL.fullmatch(str(key)) or isinstance(inner, list) else str(key)
        yield from _walk(inner, named)


def _lines(plain: str) -> Pairs:
    """Numbered or bulleted lines, a table, "label: words" lines, or short lines."""
    lines = [line for line in plain.splitlines() if line.strip()]
    numbers = list(islice(_INLINE.finditer(plain), MAX_ITEMS))
    if (
        len(lines) == 1
        and len(numbers) > 1
        and [int(one[1]) for one in numbers] == list(range(1, len(numbers) + 1))
    ):
        ends = [*(one.start() for one in numbers[1:]), len(plain)]
        for one, end in zip(numbers, ends, strict=True):
            yield _split_pair(plain[one.end() : end].strip(" ,;\n"))
        return
    marked = [(place, match) for place, line in enumerate(lines) if (match := _LINE.match(line[:2_000]))]
    if marked:
        yield from _marked(lines, marked)
        return
    rows = [[cell.strip() for cell in line.strip(" |").split("|")] for line in lines if line.count("|") > 1]
    if len(rows) > 1 and len(rows) == len(lines):
        yield from _table(rows)
        return
    lines = [line for line in lines if not (line.rstrip().endswith(":") or line.startswith("#"))]
    if len(lines) < 2 or any(line.rstrip().endswith(",") or line.count(",") > 1 for line in lines):
        return
    if all(0 < line.find(": ") <= 40 for line in lines):
        yield from map(_split_pair, lines)
    elif all(len(line.split()) <= 4 and line.rstrip()[-1] not in ".!?:;}])>" for line in lines):
        yield from ((line, "") for line in lines)


def _marked(lines: Sequence[str], marked: Sequence[tuple[int, re.Match[str]]]) -> Pairs:
    """List lines; what is indented below a number, or stands below every line, describes it."""
    first = marked[0][1]
    heads = [(place, match) for place, match in marked if not (first[2] and not match[2] and match[1])]
    ends = [*(place for place, _ in heads[1:]), len(lines)]
    below = [lines[place + 1] if place + 1 < end else "" for (place, _), end in zip(heads, ends, strict=True)]
    nested = len(heads) < len(marked)
    for (_, match), words in zip(heads, below, strict=True):
        label, description = _split_pair(match[3])
        if label and not description and (nested or (len(heads) > 1 and all(below))):
            label = label.rstrip(" :")
            sub = _LINE.match(words[:2_000])
            description = _EMPHASIS.sub("", sub[3] if sub else words).strip()
            _, _, rest = description.partition(": ")
            description = rest if rest and description.lower().startswith(_DESCRIPTION_KEYS) else description
        yield label, description


def _table(rows: Sequence[Sequence[str]]) -> Pairs:
    """The rows of a Markdown table, by the names of its columns where those are known."""
    ruled = len(rows) > 2 and all(set(cell) <= set("-: ") for cell in rows[1])
    names = [cell.lower() for cell in rows[0]] if ruled else []
    at = next((place for place, name in enumerate(names) if name.startswith(_LABEL_KEYS)), None)
    for row in rows[2:] if ruled else rows:
        words = [cell for cell in row if cell and not cell.strip("#.").isdigit()]
        label = row[at] if at is not None and at < len(row) else (words[0] if words else "")
        yield label, next((cell for cell in words if cell != label), "")


def _commas(plain: str) -> Pairs:
    """A list on one line, or on lines that end in commas; a short name alone is a list of one."""
    kept = [
        line for line in plain.splitlines() if not line.startswith("#") and not line.rstrip().endswith(":")
    ]
    paragraphs = re.split(r"\n\s*\n", "\n".join(kept).strip())
    alone = len(paragraphs) == 1
    for paragraph in paragraphs[:5]:
        pairs = list(_listed(paragraph, alone=alone))
        if pairs:
            return pairs
    return []


def _listed(paragraph: str, *, alone: bool) -> Pairs:
    joined = " ".join(paragraph.split())
    broken = [not line.rstrip().endswith(",") for line in paragraph.splitlines()[:-1]]
    if any(broken) or re.search(r"[.!?]\s+\S", joined) or len(joined) > 20_000:
        return
    listed = _LEAD.sub("", joined, count=1) if _LEAD.match(joined) else joined
    for mark in (";", "|"):
        if mark in listed:
            yield from map(_split_pair, (part.strip(" .\"'[]") for part in listed.split(mark)))
            return
    parts = [
        re.sub(r"^(and|or)\s+", "", part.strip(" .;\"'[]*"), flags=re.I) for part in _COMMA.split(listed)
    ]
    words = [len(part.split()) for part in parts]
    label, _, rest = joined.partition(": ")
    if len(parts) > 2 and max(words) <= 8 and sum(words) <= 4 * len(words):
        yield from ((part, "") for part in parts if any(character.isalpha() for character in part))
    elif (
        alone
        and rest
        and len(label.split()) <= 4
        and _NAME.fullmatch(label)
        and not _NO_LABEL.fullmatch(label)
    ):
        yield label, rest
    elif alone and max(words) <= 4 and not NOTHING.search(joined) and not _REFUSAL.match(joined):
        named = all(_NAME.fullmatch(part) for part in parts if part)
        yield from ((part, "") for part in parts if named and any(character.isalpha() for character in part))


def _split_pair(text: str) -> tuple[str, str]:
    """ "Cat: crossing the road" -> its two parts; a text without a separator is all label.

    A long text without a separator is a sentence, so it is all description.
    """
    plain = _EMPHASIS.sub("", text[: 2 * MAX_DESCRIPTION_CHARS]).strip()
    parts = _SEPARATOR.split(plain, maxsplit=1)
    if len(parts) == 2 and parts[0] and len(parts[0]) <= 60:
        return parts[0], parts[1]
    if inside := _IN_BRACKETS.fullmatch(plain):
        return inside[1], inside[2]
    return ("", plain) if len(plain) > 60 or plain.endswith(".") else (plain, "")


def _ranked(pairs: Pairs) -> tuple[Item, ...]:
    items: list[Item] = []
    seen: set[tuple[str, str]] = set()
    for raw_label, raw_description in pairs:
        label = " ".join(_EMPHASIS.sub("", raw_label).split())[:MAX_LABEL_CHARS]
        description = " ".join(raw_description.split())[:MAX_DESCRIPTION_CHARS]
        key = (label.casefold(), description.casefold())
        if not (any(c.isalnum() for c in label) or any(c.isalnum() for c in description)) or key in seen:
            continue
        if _is_nothing(label or description, description):
            continue
        seen.add(key)
        items.append(Item(len(items) + 1, label, description))
        if len(items) == MAX_ITEMS:
            break
    return tuple(items)


def _is_nothing(label: str, description: str) -> bool:
    """Whether an item only says that there is none ("None: no anomalies are present")."""
    said = f"{label} {description}"
    return bool(NOTHING.match(label) and not _CONTRAST.search(said)) and len(label.split()) <= 12
