"""Parsed sentences on disk, so that a rebuild parses only what is new. Losing them costs but time."""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from pipeline.chunks import language
from pipeline.files import sha256_of
from pipeline.graphs import cache_folder
from sitegen import phrases
from sitegen.phrases import Phrase

_TIMEOUT_S = 5.0


def phrases_of(sentences: Sequence[str]) -> dict[str, tuple[Phrase, ...]]:
    """As `phrases.phrases`, parsing only sentences that were never parsed on this machine."""
    found = {}
    with suppress(sqlite3.Error, OSError), _opened() as store:
        found = _read(store, sentences)
    new = phrases.phrases(sentence for sentence in sentences if sentence not in found)
    if new:
        with suppress(sqlite3.Error, OSError), _opened() as store:
            _write(store, new)
    return {sentence: found[sentence] if sentence in found else new[sentence] for sentence in sentences}


@contextmanager
def _opened() -> Iterator[sqlite3.Connection]:
    """The store of this parser: another spaCy model, or other code, has another file."""
    meta = language().meta
    code = Path(phrases.__file__).read_bytes()
    key = sha256_of(f"{meta['lang']}_{meta['name']} {meta['version']} ".encode() + code)
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(folder / f"phrases-{key[:16]}.sqlite", timeout=_TIMEOUT_S)) as store:
        store.execute("CREATE TABLE IF NOT EXISTS phrases (sentence TEXT PRIMARY KEY, found TEXT)")
        yield store


def _read(store: sqlite3.Connection, sentences: Sequence[str]) -> dict[str, tuple[Phrase, ...]]:
    found = {}
    for sentence in sentences:
        row = store.execute("SELECT found FROM phrases WHERE sentence = ?", (sentence,)).fetchone()
        with suppress(ValueError, TypeError):
            if row is not None:
                found[sentence] = tuple(Phrase(*map(str, phrase)) for phrase in json.loads(row[0]))
    return found


def _write(store: sqlite3.Connection, found: Mapping[str, tuple[Phrase, ...]]) -> None:
    rows = ((sentence, json.dumps(parsed)) for sentence, parsed in found.items())
    with store:
        store.executemany("INSERT OR REPLACE INTO phrases VALUES (?, ?)", rows)
