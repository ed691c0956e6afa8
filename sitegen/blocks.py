"""A small part of Markdown to blocks, so that a text file can be shown without letting any HTML in."""

import re
from dataclasses import dataclass

_HEADING = re.compile(r"#{1,6}\s+(.+?)\s*#*$")
_ITEM = re.compile(r"(?:[-*+]|\d+[.)])\s+(.+)")
_RULE = re.compile(r"\|?\s*:?-{2,}:?\s*(\|\s*:?-{2,}:?\s*)*\|?$")
_MARKS = re.compile(r"\*\*(.+?)\*\*|`([^`]+)`|\[([^\]]+)\]\((\S+?)\)")


@dataclass(frozen=True, slots=True)
class Block:
    """A piece of text: `kind` is `heading`, `paragraph`, `list`, `code` or `table`.

    `lines` holds a heading's or paragraph's one text, a list's items, a code block's one text;
    `rows` a table's cells, its header first.
    """

    kind: str
    lines: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()


def blocks(text: str) -> tuple[Block, ...]:
    """The blocks of a Markdown text, in order; emphasis and links become plain text."""
    found: list[Block] = []
    lines = text.splitlines()
    place = 0
    while place < len(lines):
        block, place = _next(lines, place)
        if block is not None:
            found.append(block)
    return tuple(found)


def _next(lines: list[str], place: int) -> tuple[Block | None, int]:
    """The block that starts at a line, and the line after it."""
    line = lines[place].strip()
    if not line:
        return None, place + 1
    if line.startswith("```"):
        end = next((i for i in range(place + 1, len(lines)) if lines[i].strip() == "```"), len(lines))
        return Block("code", ("\n".join(lines[place + 1 : end]),)), end + 1
    if found := _HEADING.match(line):
        return Block("heading", (_plain(found.group(1)),)), place + 1
    end = place
    while end < len(lines) and lines[end].strip() and not lines[end].lstrip().startswith(("#", "```")):
        end += 1
    part = [raw.strip() for raw in lines[place:end]]
    if part[0].startswith("|"):
        rows = [row for row in part if not _RULE.match(row)]
        cells = tuple(tuple(_plain(cell.strip()) for cell in row.strip("|").split("|")) for row in rows)
        return Block("table", rows=cells), end
    if _ITEM.match(part[0]):
        return Block("list", tuple(_plain(item) for item in _items(part))), end
    return Block("paragraph", (_plain(" ".join(part)),)), max(end, place + 1)


def _items(part: list[str]) -> list[str]:
    """A list's items; a line that starts none goes on with the item before."""
    items: list[str] = []
    for line in part:
        if found := _ITEM.match(line):
            items.append(found.group(1))
        else:
            items[-1] += f" {line}"
    return items


def _plain(text: str) -> str:
    def words(found: re.Match[str]) -> str:
        strong, code, link, address = found.groups()
        return str(strong or code or f"{link} ({address})")

    return _MARKS.sub(words, text)
