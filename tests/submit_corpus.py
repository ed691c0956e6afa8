"""Predictions files, right and wrong, that the Python check and the submit page must judge alike."""

import random
import re
from collections.abc import Iterator

from tests.submit_case import Case
from tests.submit_others import others
from tests.submit_ours import ours


def cases() -> list[Case]:
    """The whole table: made by hand, and these with small damages."""
    made = [*ours(), *others()]
    return [*made, *damaged(made)]


_NEWER = re.compile(rb",\s*[\]}]")  # Python 3.13 has other words for a comma too many
_BITS = [
    *'",\n\r\\[]{}:;. 019-+eEnNa\t\0\x1c',
    "\u00a0",
    "\u202e",
    "\u2028",
    "🐈",
    "\ufeff",
    '""',
    "\\u",
    "NaN",
    "null",
]


def damaged(made: list[Case], count: int = 400, seed: int = 7) -> Iterator[Case]:
    """Files of the table with small damages, the same every time."""
    chance = random.Random(seed)
    short = [case for case in made if len(case.content) < 2_000 and not (case.close or case.closed)]
    # An archive gives other words in each library; half a character is one character to JavaScript.
    odd = (b"\x1f\x8b", b"PK", b"\\ud83d")
    short = [case for case in short if not any(bit in case.content for bit in odd)]
    for _ in range(count):
        case = chance.choice(short)
        content = bytearray(case.content)
        for _ in range(chance.randint(1, 3)):
            place = chance.randint(0, len(content))
            bit = chance.choice(_BITS).encode() if chance.random() < 0.9 else bytes([chance.randrange(256)])
            content[place : place + chance.choice((0, 0, 1, 2))] = bit
        if not _NEWER.search(content):
            yield Case(case.name, bytes(content))
