"""What a predictions file would score and where it would stand, as data and as Markdown for a comment."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pipeline.errors import Fault
from sitegen.language import N_
from sitegen.language import gettext as _
from sitegen.standings import Standing
from sitegen.uncertainty import Interval, uncertainties
from sitegen.words import shorten, visible

METRICS = {
    "besm": "BESM",
    "sam": "SAM",
    "detection_rate": N_("Detection rate"),
    "hazard_recall": N_("Hazard recall"),
}


def report(standings: Sequence[Standing], place: int) -> dict[str, Any]:
    """All that can be said of the submission number `place` of a board; plain values, for JSON too.

    Each of `metrics` is a value in [0, 1] with its 95 % interval, None where the truth has no hazard.
    """
    chances = uncertainties([standing.evaluation for standing in standings])
    standing, chance = standings[place], chances[place]
    card, submission = standing.evaluation.card, standing.evaluation.submission
    videos = standing.evaluation.videos
    ties = [
        other.evaluation.submission.name
        for other, theirs in zip(standings, chances, strict=True)
        if theirs.band == chance.band and other is not standing
    ]
    return {
        "name": submission.name,
        "format": submission.source_format,
        "metrics": {name: _metric(getattr(card, name), getattr(chance, name)) for name in METRICS},
        "band": chance.band,
        "band_with": sorted(ties),
        "rank_low": chance.rank_low,
        "rank_high": chance.rank_high,
        "first_share": chance.first_share,
        "of": len(standings),
        "predictions": len(submission.predictions),
        "videos_with_predictions": sum(video.n_predictions > 0 for video in videos),
        "n_videos": card.n_videos,
        "probes": [asdict(probe) for probe in standing.probes],
        "warnings": list(submission.warnings),
        "signature": str(card.signature),
    }


def rank_words(told: Mapping[str, Any]) -> str:
    """Where a submission would stand, in a sentence."""
    text = _("Rank {rank} of {total}; in 95 % of resamples {ranks}.")
    if told["band_with"]:
        text = _(
            "Rank {rank} of {total}, shared with {n} it cannot be told apart from; in 95 % of resamples "
            "{ranks}."
        )
    low, high = told["rank_low"], told["rank_high"]
    ranks = _("rank {low}") if low == high else _("ranks {low} to {high}")
    n = len(told["band_with"])
    return text.format(rank=told["band"], total=told["of"], n=n, ranks=ranks.format(low=low, high=high))


def markdown(told: Mapping[str, Any]) -> str:
    """A report as Markdown. Texts from outside stand in code, where they name nobody and format nothing."""
    lines = [f"### {_code(told['name'])}", "", rank_words(told), ""]
    lines += ["| figure | value | 95 % |", "|---|---|---|"]
    for name, title in METRICS.items():
        metric = told["metrics"][name]
        if metric is None:
            lines.append(f"| {title} | none | |")
        else:
            lines.append(f"| {title} | {metric['value']:.4f} | {metric['low']:.4f} to {metric['high']:.4f} |")
    lines += [
        "",
        f"{told['predictions']} predictions for {told['videos_with_predictions']} of {told['n_videos']} "
        "videos.",
        "",
        "| probe | value | speaks from | verdict |",
        "|---|---|---|---|",
    ]
    for probe in told["probes"]:
        verdict = "**speaks**" if probe["flagged"] else "quiet"
        lines.append(f"| {probe['name']} | {probe['text']} | {probe['threshold_text']} | {verdict} |")
    lines += ["", *(f"- {_code(probe['sentence'])}" for probe in told["probes"] if probe["flagged"])]
    lines += [f"- warning: {_code(warning)}" for warning in told["warnings"]]
    return "\n".join([*lines, "", f"Signature: `{told['signature']}`", ""])


def faults_markdown(name: str, faults: Sequence[Fault], shown: int = 50) -> str:
    """The faults of a file as Markdown, the first `shown` of them in full."""
    lines = [f"### {_code(name)}", "", f"{len(faults)} faults; nothing was scored.", ""]
    lines += ["| row | column | found | expected | mend |", "|---|---|---|---|---|"]
    for fault in faults[:shown]:
        row = "" if fault.row is None else str(fault.row)
        column = _code(fault.column) if fault.column else ""
        cells = (_code(text) for text in (fault.found, fault.expected, fault.mend))
        lines.append(f"| {row} | {column} | {' | '.join(cells)} |")
    if len(faults) > shown:
        lines += ["", f"And {len(faults) - shown} more: `coooler check` lists every one."]
    return "\n".join([*lines, ""])


def _metric(value: float | None, interval: Interval | None) -> dict[str, float] | None:
    if value is None or interval is None:
        return None
    return {"value": value, "low": interval.low, "high": interval.high}


def _code(text: str) -> str:
    plain = shorten(visible(text), 300).replace("`", "'").replace("|", "\\|")
    return f"`{plain}`" if plain.strip() else ""
