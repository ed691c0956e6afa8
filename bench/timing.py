"""Interleaved medians: these machines are noisy, so only ratios within one run mean something."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from bench.machine import machine, versions


@dataclass(frozen=True, slots=True)
class Measure:
    """One comparison: ours against a peer, in seconds; `peer_s` is None where there is none."""

    what: str
    ours_s: float
    peer: str
    peer_s: float | None
    goal: str
    note: str = ""

    @property
    def ratio(self) -> float | None:
        """Ours / peer."""
        return None if not self.peer_s else self.ours_s / self.peer_s


def report(title: str, made_by: str, measures: list[Measure]) -> str:
    """The measurements as a Markdown table, under what they were measured on and what `made_by` says."""
    lines = [
        f"# {title}",
        "",
        f"{machine()}. {versions()}.",
        "",
        made_by,
        "Machines are noisy: the ratios count, the seconds do not.",
        "",
        "| what | ours | against | theirs | ratio | goal | note |",
        "|---|---:|---|---:|---:|---|---|",
    ]
    for one in measures:
        theirs = "" if one.peer_s is None else f"{one.peer_s:.4g} s"
        ratio = "" if one.ratio is None else f"{one.ratio:.3g}"
        lines.append(
            f"| {one.what} | {one.ours_s:.4g} s | {one.peer} | {theirs} | {ratio} | {one.goal} | {one.note} |"
        )
    return "\n".join(lines) + "\n"


def interleaved(functions: dict[str, Callable[[], object]], rounds: int = 5) -> dict[str, float]:
    """Median seconds of each function, one after the other in every round, after a warm-up round."""
    times: dict[str, list[float]] = {name: [] for name in functions}
    for turn in range(rounds + 1):
        for name, function in functions.items():
            start = time.perf_counter()
            function()
            if turn:
                times[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in times.items()}
