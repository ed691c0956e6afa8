"""What a finished site must keep to: budgets, links, ids, titles, and no markup that no template wrote."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from sitegen.rendering import find_templates

OPEN_BYTES = 300 * 1024
"""What opening a video page may load, all its pictures included; a clip loads when it is played.

A link to one keyframe shows that in place of the one that the page begins with, and loads both.
"""

INDEX_BYTES = 10 * 1024
"""Size of one file of index data, which covers at most 100 videos."""

_PICTURES = (".jpg", ".webp")
_ELEMENT = re.compile(r"<([a-zA-Z][a-zA-Z0-9]*)")


@dataclass(slots=True)
class _Seen:
    """What one page holds that the rules ask about."""

    title: str = ""
    description: str = ""
    canonical: str = ""
    ids: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)
    odd: list[str] = field(default_factory=list)


class _Reader(HTMLParser):
    def __init__(self, page: str, known: frozenset[str]) -> None:
        super().__init__(convert_charrefs=True)
        self.seen = _Seen()
        self.known = known
        self._in_title = False
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        seen, given = self.seen, {name: value or "" for name, value in attrs}
        self._in_title = tag == "title" and not seen.title
        seen.odd += [f"<{tag}>"] if tag not in self.known else []
        seen.odd += [f"<{tag} {name}>" for name in given if name.startswith("on") or name == "style"]
        seen.odd += ["<script> without src"] if tag == "script" and "src" not in given else []
        seen.ids += [given["id"]] if "id" in given else []
        if tag == "meta" and given.get("name") == "description":
            seen.description = given.get("content", "").strip()
        if tag == "link" and given.get("rel") == "canonical":
            seen.canonical = given.get("href", "")
            return
        for name in ("href", "src", "poster"):
            address = given.get(name, "")
            if not address:
                continue
            seen.links.append(address)
            clip = tag in {"source", "video"} and name == "src"
            if (name != "href" and not clip) or (
                tag == "link" and given.get("rel") in {"stylesheet", "icon"}
            ):
                seen.loaded.append(address)

    def handle_data(self, data: str) -> None:
        if self._in_title:
            self.seen.title += data.strip()

    def handle_endtag(self, tag: str) -> None:
        if tag == "title":
            self._in_title = False


def strict_faults(site: Path) -> list[str]:
    """Every rule that a built site breaks, a line each, in the order of its pages; none is good."""
    site = site.resolve()
    known = _elements()
    pages = {
        path: _Reader(path.read_text(encoding="utf-8"), known).seen for path in sorted(site.rglob("*.html"))
    }
    faults: list[str] = []
    for path, seen in pages.items():
        name = path.relative_to(site).as_posix()
        faults += [f"{name}: {fault}" for fault in _page(site, path, seen, pages)]
        if name.startswith("videos/"):
            faults += [f"{name}: {fault}" for fault in _weight(path, seen)]
    for path in sorted((site / "data").rglob("*.js")) if (site / "data").is_dir() else []:
        if path.parent != site / "data" and path.stat().st_size > INDEX_BYTES:
            size = path.stat().st_size
            faults.append(f"{path.relative_to(site).as_posix()}: {size:,} bytes; at most {INDEX_BYTES:,}")
    return faults


def _elements() -> frozenset[str]:
    """The elements that the templates write; any other came in with a text that was not escaped."""
    texts = (path.read_text(encoding="utf-8") for path in find_templates().glob("*.html"))
    return frozenset(name.lower() for text in texts for name in _ELEMENT.findall(text))


def _page(site: Path, path: Path, seen: _Seen, pages: dict[Path, _Seen]) -> Iterator[str]:
    yield from (f"no {what}" for what in ("title", "description", "canonical") if not getattr(seen, what))
    if seen.canonical and not unquote(urlsplit(seen.canonical).path).endswith(path.name):
        yield f"its canonical link {seen.canonical!r} is not its own"
    yield from (
        f"id {name!r} {count} times" for name, count in sorted(Counter(seen.ids).items()) if count > 1
    )
    yield from (f"markup that no template writes: {what}" for what in sorted(set(seen.odd)))
    for address in sorted(set(seen.links)):
        parts = urlsplit(address)
        if parts.scheme in {"http", "https"}:
            continue
        if parts.scheme or parts.netloc:
            yield f"a link to {address!r}; only http and https lead out"
            continue
        target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        if not target.is_file() or not target.is_relative_to(site):
            yield f"a dead link to {address!r}"
        elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
            yield f"a link to {address!r}, where there is no such place"


def _weight(path: Path, seen: _Seen) -> Iterator[str]:
    files, pictures = (
        {(path.parent / unquote(urlsplit(address).path)).resolve() for address in addresses}
        for addresses in (seen.loaded, [link for link in seen.links if link.endswith(_PICTURES)])
    )
    total = sum(file.stat().st_size for file in sorted({path, *files}) if file.is_file())
    total += max((file.stat().st_size for file in pictures - files if file.is_file()), default=0)
    if total > OPEN_BYTES:
        yield f"loads {total:,} bytes when it opens at a keyframe; at most {OPEN_BYTES:,}"
