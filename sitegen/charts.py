"""Figures as plain plotly dicts, and the JavaScript file that carries them to a page.

Plotly reads a small HTML in labels, so every outside text goes through `label`. Colours are the
names of the page's own variables (`--chart-1`, ...), which the script resolves for each theme.
"""

import html
import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sitegen.language import fixed
from sitegen.language import gettext as _
from sitegen.words import shorten, visible

Figure = dict[str, Any]

COLOURS = 6
BINS = 20


def label(text: str, limit: int = 40) -> str:
    """Outside text for a plotly label: made visible, cut, and free of markup."""
    return html.escape(shorten(visible(text), limit))


def data_file(figures: Mapping[str, Figure]) -> bytes:
    """A script that hands the figures to the page; works without fetch, under file:// too."""
    return f"window.COOOLER_FIGURES = {script_json(figures)};\n".encode()


def script_json(value: Any) -> str:
    """JSON that is safe inside a script, in a file or in a page: no `<`, `>`, `&`, U+2028, U+2029."""
    text = json.dumps(value, ensure_ascii=True, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _colour(place: int) -> str:
    return f"--chart-{place % COLOURS + 1}"


class Point(NamedTuple):
    """A system's figures, all in [0, 1]; the intervals are (low, high)."""

    name: str
    besm: float
    sam: float
    detection_rate: float
    besm_interval: tuple[float, float]
    sam_interval: tuple[float, float]


def besm_against_sam(systems: Sequence[Point]) -> Figure:
    """A point a system, with its 95 % intervals."""
    traces = [
        {
            "type": "scatter",
            "mode": "markers+text",
            "x": [round(point.besm, 6)],
            "y": [round(point.sam, 6)],
            "error_x": _whiskers(point.besm, point.besm_interval, place),
            "error_y": _whiskers(point.sam, point.sam_interval, place),
            "name": label(point.name),
            "text": [label(point.name, 28)],
            "textposition": "top center" if place % 2 == 0 else "bottom center",
            "cliponaxis": False,
            "marker": {"size": 12, "color": _colour(place), "symbol": place % 8},
            "hovertemplate": f"{label(point.name)}<br>BESM %{{x:.4f}}<br>SAM %{{y:.4f}}"
            f"<br>{_('detection')} {point.detection_rate * 100:.1f} %<extra></extra>",
        }
        for place, point in enumerate(systems)
    ]
    ends = [end for point in systems for end in (*point.besm_interval, *point.sam_interval)]
    low, high = max(0.0, min(ends, default=0.0) - 0.05), min(1.0, max(ends, default=1.0) + 0.05)
    diagonal = {
        "type": "line",
        "x0": low,
        "y0": low,
        "x1": high,
        "y1": high,
        "line": {"color": "--line-strong", "width": 1, "dash": "dot"},
    }
    return {
        "data": traces,
        "layout": {
            "xaxis": {"title": {"text": "BESM"}, "range": [round(low, 3), round(high, 3)]},
            "yaxis": {"title": {"text": "SAM"}, "range": [round(low, 3), round(high, 3)]},
            "shapes": [diagonal],
            "showlegend": False,
        },
    }


def _whiskers(value: float, interval: tuple[float, float], place: int) -> Figure:
    low, high = interval
    return {
        "type": "data",
        "symmetric": False,
        "array": [round(max(0.0, high - value), 6)],
        "arrayminus": [round(max(0.0, value - low), 6)],
        "color": _colour(place),
        "thickness": 1,
        "width": 0,
    }


def score_distribution(systems: Sequence[tuple[str, Sequence[float]]], threshold: float) -> Figure:
    """How many videos have a best similarity in each bin of 0.05, a line a system."""
    edges = [place / BINS for place in range(BINS)]
    traces = [
        {
            "type": "bar",
            "x": [edge + 0.5 / BINS for edge in edges],
            "y": counts(values),
            "name": label(name),
            "marker": {"color": _colour(place)},
            "hovertemplate": _("{n} videos near {similarity}").format(n="%{y}", similarity="%{x:.2f}")
            + "<extra>"
            + label(name)
            + "</extra>",
        }
        for place, (name, values) in enumerate(systems)
    ]
    line = {
        "type": "line",
        "x0": threshold,
        "x1": threshold,
        "y0": 0,
        "y1": 1,
        "yref": "paper",
        "line": {"color": "--ink", "width": 1, "dash": "dash"},
    }
    note = {
        "x": threshold,
        "y": 1,
        "yref": "paper",
        "xanchor": "right",
        "yanchor": "top",
        "text": _("detected above {threshold}").format(threshold=fixed(threshold, 2)) + " ",
        "showarrow": False,
    }
    return {
        "data": traces,
        "layout": {
            "barmode": "group",
            "bargap": 0.15,
            "xaxis": {"title": {"text": _("best similarity in a video")}, "range": [0, 1]},
            "yaxis": {"title": {"text": _("videos")}, "rangemode": "tozero"},
            "shapes": [line],
            "annotations": [note],
            "showlegend": True,
        },
    }


def means_by_group(
    systems: Sequence[str], groups: Sequence[str], means: Sequence[Sequence[float]], threshold: float
) -> Figure:
    """A group of bars for each group of hazards; `means[system][group]` in [0, 1]."""
    names = [label(name, 28) for name in groups]
    traces = [
        {
            "type": "bar",
            "x": names,
            "y": [round(value, 4) for value in values],
            "name": label(name),
            "marker": {"color": _colour(place)},
            "hovertemplate": "%{x}: %{y:.2f}<extra>" + label(name) + "</extra>",
        }
        for place, (name, values) in enumerate(zip(systems, means, strict=True))
    ]
    line = {
        "type": "line",
        "x0": 0,
        "x1": 1,
        "xref": "paper",
        "y0": threshold,
        "y1": threshold,
        "line": {"color": "--ink", "width": 1, "dash": "dash"},
    }
    return {
        "data": traces,
        "layout": {
            "barmode": "group",
            "bargap": 0.25,
            "xaxis": {"type": "category", "tickangle": "auto"},
            "yaxis": {"title": {"text": _("mean best similarity")}, "range": [0, 1]},
            "shapes": [line],
            "showlegend": True,
        },
    }


def counts(values: Sequence[float]) -> list[int]:
    """Values in [0, 1] counted in 20 bins; 1 belongs to the last."""
    result = [0] * BINS
    for value in values:
        result[min(BINS - 1, int(value * BINS + 1e-9))] += 1
    return result
