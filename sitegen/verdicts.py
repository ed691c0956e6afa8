"""How a system did, in words and numbers, and the match that each caption is judged by."""

from collections.abc import Sequence
from dataclasses import replace

from pipeline.records import TruthHazard
from pipeline.scores import PairScore, VideoScore
from sitegen.contexts import LedgerLine, Measure
from sitegen.gathered import SiteData, System
from sitegen.language import N_, fixed, whole
from sitegen.language import gettext as _
from sitegen.ledger import Entry
from sitegen.numerals import Score, percent, rate, score
from sitegen.score import TOLERANCE
from sitegen.uncertainty import Interval
from sitegen.words import shorten, visible


def title_of(truth: Sequence[TruthHazard]) -> str:
    """The labels of a video's hazards, or that there is none."""
    labels = [hazard.label or shorten(hazard.description, 40) for hazard in truth if not hazard.is_no_hazard]
    return ", ".join(labels) or _("No hazard")


def verdict(video: VideoScore) -> tuple[str, str]:
    """How a system did on a video: `pass`, `fail` or `silent`, and the same in words."""
    if video.n_hazards == 0:
        return ("pass", _("Rightly silent")) if video.n_predictions == 0 else ("fail", _("False alarm"))
    if video.detected:
        if video.n_hazards_found < video.n_hazards:
            found, there = whole(video.n_hazards_found), whole(video.n_hazards)
            return "pass", _("Detected {n} of {total}").format(n=found, total=there)
        return "pass", _("Detected")
    return ("silent", _("Said nothing")) if video.n_predictions == 0 else ("fail", _("Not detected"))


def best_pairs(system: System, video_id: str) -> dict[int, PairScore]:
    """Prediction rank -> its pair with the highest cosine; the first truth hazard wins ties."""
    best: dict[int, PairScore] = {}
    for pair in system.pairs.get(video_id, ()):
        held = best.get(pair.prediction_rank)
        if held is None or pair.cosine > held.cosine:
            best[pair.prediction_rank] = pair
    return best


def cosine_score(pair: PairScore, threshold: float) -> Score:
    """A pair's cosine, with the verdict that its similarity earns."""
    return score(pair.cosine, pair.similarity > threshold + TOLERANCE)


def measure(value: float, interval: Interval) -> Measure:
    """A mean of similarities in [0, 1] with its interval, to two digits."""
    return _measure(score(value), interval, f"{fixed(interval.low, 2)}–{fixed(interval.high, 2)}")


def rate_measure(value: float, interval: Interval) -> Measure:
    """A share in [0, 1] with its interval, in whole percent."""
    low, high = (f"{end * 100:.0f}" for end in (interval.low, interval.high))
    return _measure(rate(value), interval, f"{low}–{high}\u202f%" if low != high else f"{low}\u202f%")


def _measure(number: Score, interval: Interval, text: str) -> Measure:
    low, high = (round(min(max(end, 0.0), 1.0) * 100) for end in (interval.low, interval.high))
    return Measure(number, text, low, high)


def rank_text(data: SiteData, system: System) -> str:
    """The rank of a system's band; `=` says that others share it."""
    shared = sum(other.rank == system.rank for other in data.systems) > 1
    return f"{system.rank}=" if shared else str(system.rank)


def first_share(system: System) -> Score:
    """How often a system is first in the resamples, in whole percent."""
    share = system.uncertainty.first_share
    return replace(rate(share), text=f"{share * 100:.0f}\u202f%")


def ranks_text(system: System) -> str:
    """The ranks that a system takes in 95 % of the resamples."""
    low, high = system.uncertainty.rank_low, system.uncertainty.rank_high
    return _("{low} to {high}").format(low=low, high=high) if low < high else f"{low}"


_EVENTS = {
    "add": N_("added"),
    "replace": N_("replaced"),
    "rescore": N_("rescored"),
    "withdraw": N_("withdrawn"),
}


def ledger_line(data: SiteData, entry: Entry) -> LedgerLine:
    """A line of the ledger with the scores that it notes."""
    scores = (("BESM", entry.besm), ("SAM", entry.sam))
    parts = [f"{name} {fixed(value, 4)}" for name, value in scores if value is not None]
    shares = ((_("detection"), entry.detection_rate), (_("hazard recall"), entry.hazard_recall))
    parts += [f"{name} {percent(value)}" for name, value in shares if value is not None]
    on_board = any(system.slug == entry.slug for system in data.systems)
    return LedgerLine(
        date=visible(entry.date),
        event=_(_EVENTS[entry.event]),
        name=visible(entry.name),
        slug=entry.slug if on_board else "",
        reason=visible(entry.reason),
        sha256=visible(entry.predictions_sha256),
        scores=", ".join(parts),
        signature=visible(entry.signature),
    )
