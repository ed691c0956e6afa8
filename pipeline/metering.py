"""How many requests a server gets at once, and what the answers cost.

The limit follows the server: halved when it says "too many", one more after a round without
complaint (additive increase, multiplicative decrease). Source: ours.
"""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

from pipeline.config import Price
from pipeline.recording import Answer


class Slot:
    """One request on its way."""

    def __init__(self, epoch: int) -> None:
        """`epoch` counts how often the limit was lowered before."""
        self.epoch = epoch
        self.ok = True
        self.throttled = False

    def failed(self, *, throttled: bool) -> None:
        """The request brought no answer; `throttled` when the server had too many."""
        self.ok = False
        self.throttled = throttled


class Limiter:
    """At most so many requests in flight. Safe for many threads."""

    def __init__(self, maximum: int) -> None:
        """Starts at `maximum`, at least 1, and never exceeds it."""
        self.maximum = maximum
        self._limit = maximum
        self._in_flight = 0
        self._successes = 0
        self._epoch = 0
        self._changed = threading.Condition()

    @property
    def limit(self) -> int:
        """How many requests may be in flight now."""
        return self._limit

    @contextmanager
    def slot(self) -> Iterator[Slot]:
        """Wait for a place, and hold it; the slot is told how the request went."""
        with self._changed:
            while self._in_flight >= self._limit:
                self._changed.wait()
            self._in_flight += 1
            slot = Slot(self._epoch)
        try:
            yield slot
        finally:
            with self._changed:
                self._in_flight -= 1
                self._learn(slot)
                self._changed.notify(self._limit)

    def _learn(self, slot: Slot) -> None:
        # Requests that were sent before the last lowering say nothing new: a burst halves once.
        if slot.throttled and slot.epoch == self._epoch:
            self._limit = max(1, self._limit // 2)
            self._epoch += 1
            self._successes = 0
        elif slot.ok and self._limit < self.maximum:
            self._successes += 1
            if self._successes >= self._limit:
                self._limit += 1
                self._successes = 0


@dataclass(frozen=True, slots=True)
class Usage:
    """What a role has cost in this process.

    `calls` were answered by a server and `recorded` taken from a recording, which costs nothing;
    tokens, `seconds` (waiting for answers) and `money` (in the configuration's currency) are of the
    calls. `unmetered` of them came without token counts, and are not in the tokens and the money.
    `money` is None when the model has no price.
    """

    calls: int = 0
    recorded: int = 0
    unmetered: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    seconds: float = 0.0
    money: float | None = 0.0


class Ledger:
    """Usage by role. Safe for many threads."""

    def __init__(self, prices: Mapping[str, Price]) -> None:
        """`prices` by model."""
        self._prices = prices
        self._usage: dict[str, Usage] = {}
        self._guard = threading.Lock()

    def add(self, role: str, model: str, answer: Answer, *, recorded: bool = False) -> None:
        """Count one answer."""
        price = self._prices.get(model)
        read, written = answer.input_tokens, answer.output_tokens
        with self._guard:
            before = self._usage.get(role, Usage(money=0.0 if price else None))
            if recorded:
                self._usage[role] = replace(before, recorded=before.recorded + 1)
                return
            money = None
            if price and before.money is not None:
                cost = (read or 0) * price.input_per_million + (written or 0) * price.output_per_million
                money = before.money + cost / 1e6
            self._usage[role] = Usage(
                calls=before.calls + 1,
                recorded=before.recorded,
                unmetered=before.unmetered + (read is None or written is None),
                input_tokens=before.input_tokens + (read or 0),
                output_tokens=before.output_tokens + (written or 0),
                seconds=before.seconds + answer.latency_s,
                money=money,
            )

    def snapshot(self) -> dict[str, Usage]:
        """The usage so far, by role, in the order of the first answers."""
        with self._guard:
            return dict(self._usage)
