"""Parsed sentences on disk, so that a rebuild parses only what is new. Losing them costs but time."""

import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from pipeline.chunks import language
from pipeline.files import sha256_of
from pipeline.graphs import cache_folder
from sitegen import phrases
from sitegen.phrases import Phrase

_TIMEOUT_S = 5.0
_TABLES = ("phrases", "topics")


def phrases_of(sentences: Sequence[str]) -> dict[str, tuple[Phrase, ...]]:
    """As `phrases.phrases`, parsing only sentences that were never parsed on this machine."""
    return _kept("phrases", sentences, phrases.phrases)


def topics_of(texts: Sequence[str]) -> dict[str, tuple[Phrase, ...]]:
    """Text -> `phrases.topics` of it, parsing only texts that were never parsed on this machine.

    What cannot all be seen is not kept: lone surrogates, which no database takes, are such.
    """
    found = _kept("topics", [text for text in texts if text.isprintable()], _topics)
    return found | _topics([text for text in texts if text not in found])


def _topics(texts: Sequence[str]) -> dict[str, tuple[Phrase, ...]]:
    return {text: phrases.topics(text) for text in texts}


def _kept(
    table: str,
    texts: Sequence[str],
    parse: Callable[[Sequence[str]], Mapping[str, tuple[Phrase, ...]]],
) -> dict[str, tuple[Phrase, ...]]:
    """What `parse` gives for each text; what it gave before is kept in that table."""
    found = {}
    with suppress(sqlite3.Error, OSError), _opened() as store:
        found = _read(store, table, texts)
    new = parse([text for text in texts if text not in found])
    if new:
        with suppress(sqlite3.Error, OSError), _opened() as store:
            _write(store, table, new)
    return {text: found[text] if text in found else new[text] for text in texts}


@contextmanager
def _opened() -> Iterator[sqlite3.Connection]:
    """The store of this parser: another spaCy model, or other code, has another file."""
    meta = language().meta
    code = Path(phrases.__file__).read_bytes()
    key = sha256_of(f"{meta['lang']}_{meta['name']} {meta['version']} ".encode() + code)
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(folder / f"phrases-{key[:16]}.sqlite", timeout=_TIMEOUT_S)) as store:
        for table in _TABLES:
            store.execute(f"CREATE TABLE IF NOT EXISTS {table} (sentence TEXT PRIMARY KEY, found TEXT)")
        yield store


def _read(store: sqlite3.Connection, table: str, sentences: Sequence[str]) -> dict[str, tuple[Phrase, ...]]:
    found = {}
    query = f"SELECT found FROM {table} WHERE sentence = ?"  # noqa: S608 - one of ours
    for sentence in sentences:
        row = store.execute(query, (sentence,)).fetchone()
        with suppress(ValueError, TypeError):
            if row is not None:
                found[sentence] = tuple(Phrase(*map(str, phrase)) for phrase in json.loads(row[0]))
    return found


def _write(store: sqlite3.Connection, table: str, found: Mapping[str, tuple[Phrase, ...]]) -> None:
    rows = ((sentence, json.dumps(parsed)) for sentence, parsed in found.items())
    with store:
        store.executemany(f"INSERT OR REPLACE INTO {table} VALUES (?, ?)", rows)  # noqa: S608
