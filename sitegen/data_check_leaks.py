"""Where the truth shows through before a clip is watched: in names, in tags, in the order of the videos."""

import random
import re
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

from sitegen.data_figures import STOP_WORDS, label_key, words_of
from sitegen.data_findings import CheckInput, Finding, Severity, some

MIN_LETTERS = 3
SHUFFLES = 999
RARELY = 0.005  # share of shuffles that put equal labels together as often as the ids do
MIN_SORTED = 8  # videos with a hazard from which on an order can be told from chance

_LETTERS = re.compile(r"[^\W\d_]+")
_TAGS = ("title", "comment", "description", "synopsis", "keywords", "album", "artist", "subject", "genre")


def leak_findings(given: CheckInput) -> Iterator[Finding]:
    """Findings about what gives the truth away."""
    ids = given.video_ids
    tokens = {name: _tokens(name) for name in ids}
    usual = Counter(word for found in tokens.values() for word in found)
    common = {word for word, count in usual.items() if len(ids) > 1 and 2 * count >= len(ids)}
    told = _telling(given)
    hits = {name: sorted((tokens[name] - common) & told[name]) for name in ids}
    if found := tuple(name for name in ids if hits[name]):
        words = sorted({word for name in found for word in hits[name]})
        message = f"The names of {len(found)} clips hold words of their truth ({some(words)}): {some(found)}."
        yield Finding(Severity.ERROR, "truth in file names", found, message, "Number the videos instead.")
    tags = {
        clip.video_id: sorted(
            {word for name, value in clip.tags if name.lower() in _TAGS for word in _tokens(value)}
            & told.get(clip.video_id, set())
        )
        for clip in given.clips or ()
    }
    if found := tuple(name for name, words in sorted(tags.items()) if words):
        words = sorted({word for name in found for word in tags[name]})
        message = (
            f"The metadata of {len(found)} clips holds words of their truth ({some(words)}): {some(found)}."
        )
        mend = "Strip it: ffmpeg -i IN -map_metadata -1 -c copy OUT."
        yield Finding(Severity.ERROR, "truth in metadata", found, message, mend)
    yield from _sequence(given)


def _tokens(text: str) -> set[str]:
    """The runs of letters in a text, in lower case, without a plural's s."""
    words = (word.casefold() for word in _LETTERS.findall(text) if len(word) >= MIN_LETTERS)
    return {word.removesuffix("s") if len(word) > MIN_LETTERS else word for word in words}


def _telling(given: CheckInput) -> dict[str, set[str]]:
    """Video id -> the words of its labels and descriptions that say something."""
    told: dict[str, set[str]] = {name: set() for name in given.video_ids}
    for row in given.truth:
        for word in words_of(f"{row.label} {row.description}"):
            if word not in STOP_WORDS:
                told[row.video_id] |= _tokens(word)
    return told


def _sequence(given: CheckInput) -> Iterator[Finding]:
    """Whether neighbours in the order of the ids share a label more often than chance has it."""
    first: dict[str, str] = {}
    for row in sorted(given.truth, key=lambda row: (row.video_id, row.hazard_id)):
        first.setdefault(row.video_id, "" if row.is_no_hazard else label_key(row.label))
    labels = list(first.values())
    if len(labels) < MIN_SORTED or len(set(labels)) < 2:
        return
    seen = _pairs(labels)
    chance = random.Random(0)  # noqa: S311  (a permutation test, no secret)
    shuffled = list(labels)
    as_often = 0
    for _ in range(SHUFFLES):
        chance.shuffle(shuffled)
        as_often += _pairs(shuffled) >= seen
    if (as_often + 1) / (SHUFFLES + 1) <= RARELY:
        message = (
            f"In the order of the ids {seen} of {len(labels) - 1} neighbours share a label; {as_often} of "
            f"{SHUFFLES} shuffles have as many. An id tells what to expect."
        )
        yield Finding(Severity.WARNING, "videos in order of label", (), message, "Number them at random.")


def _pairs(labels: list[str]) -> int:
    return sum(one == other for one, other in pairwise(labels))
