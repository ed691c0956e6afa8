"""How close captions come to hazards of each size and of each kind: two charts of the leaderboard."""

from collections.abc import Callable, Iterator
from math import fsum

from pipeline.records import TruthHazard
from sitegen import charts
from sitegen.contexts import Chart
from sitegen.failure_files import SIZES, hazard_size
from sitegen.gathered import SiteData, System
from sitegen.language import N_, fixed
from sitegen.language import gettext as _
from sitegen.numerals import plural
from sitegen.words import shorten, visible

MAX_SYSTEMS = 6
MAX_KINDS = 10
OTHER = N_("other")
NO_LABEL = N_("no label")

Group = Callable[[TruthHazard], str]


def spreads(data: SiteData) -> Iterator[tuple[Chart, charts.Figure]]:
    """Mean best similarity by box size and by label, of the first systems; none without a hazard."""
    hazards = [row for video_id in data.video_ids for row in data.truth[video_id] if not row.is_no_hazard]
    if not hazards or not data.systems:
        return
    sizes = {size: _(words) for size, words in SIZES.items()}
    yield _spread(
        data,
        hazards,
        "by-size",
        _("By the size of the hazard's box"),
        _("The largest box of the hazard's track on a keyframe, as a share of the frame."),
        lambda row: sizes[hazard_size(data, row)],
        list(sizes.values()),
    )
    labels = _labels(hazards)
    yield _spread(
        data,
        hazards,
        "by-kind",
        _("By the kind of hazard"),
        _("The truth's label; the {n} most common, the rest together.").format(n=MAX_KINDS),
        lambda row: label if (label := _label(row)) in labels else _(OTHER),
        [*labels, _(OTHER)],
    )


def _label(row: TruthHazard) -> str:
    return shorten(visible(row.label), 28).casefold().strip() or _(NO_LABEL)


def _labels(hazards: list[TruthHazard]) -> list[str]:
    counts: dict[str, int] = {}
    for row in hazards:
        counts[_label(row)] = counts.get(_label(row), 0) + 1
    return sorted(counts, key=lambda label: (-counts[label], label))[:MAX_KINDS]


def _best(system: System) -> dict[tuple[str, str], float]:
    """(video, hazard) -> the best similarity of any caption."""
    best: dict[tuple[str, str], float] = {}
    for pair in system.evaluation.pairs:
        key = (pair.video_id, pair.hazard_id)
        best[key] = max(best.get(key, 0.0), pair.similarity)
    return best


def _spread(
    data: SiteData,
    hazards: list[TruthHazard],
    chart_id: str,
    title: str,
    about: str,
    group: Group,
    groups: list[str],
) -> tuple[Chart, charts.Figure]:
    members: dict[str, list[TruthHazard]] = {}
    for row in hazards:
        members.setdefault(group(row), []).append(row)
    groups = [name for name in groups if name in members]
    shown = data.systems[:MAX_SYSTEMS]
    means = []
    for system in shown:
        best = _best(system)
        values = [[best.get((row.video_id, row.hazard_id), 0.0) for row in members[name]] for name in groups]
        means.append([fsum(found) / len(found) for found in values])
    counted = ", ".join(f"{name} {len(members[name])}" for name in groups)
    first = max(zip(means[0], groups, strict=True))
    closest = _("{system} comes closest on “{group}”, with a mean best similarity of {mean}.")
    summary = (
        f"{about} {plural(len(hazards), '{n} hazard', '{n} hazards')}: {counted}. "
        f"{closest.format(system=visible(shown[0].name), group=first[1], mean=fixed(first[0], 2))}"
    )
    if len(data.systems) > MAX_SYSTEMS:
        summary += " " + _("The first {n} systems are shown.").format(n=MAX_SYSTEMS)
    table = tuple(
        (visible(system.name), *(fixed(value, 4) for value in row))
        for system, row in zip(shown, means, strict=True)
    )
    figure = charts.means_by_group([system.name for system in shown], groups, means, data.settings.threshold)
    return Chart(chart_id, title, summary, (_("Submission"), *groups), table), figure
