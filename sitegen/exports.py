"""The board to take away: CSV, JSON, Parquet, LaTeX and Markdown, with the intervals and what the probes say.

The published row of the paper is of other data: it is no row of the CSV and Parquet tables, has a key of
its own in JSON, and stands below the others with a note in LaTeX and Markdown.
"""

import csv
import io
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, TypeAlias

import pyarrow as pa
import pyarrow.parquet as pq

from sitegen.gathered import PUBLISHED, SiteData, System
from sitegen.numerals import percent
from sitegen.uncertainty import Interval
from sitegen.verdicts import rank_text
from sitegen.words import visible

Row: TypeAlias = dict[str, Any]

_NOTE = "published, other data"

_TEXT, _REAL, _INT = pa.string(), pa.float64(), pa.int32()
SCHEMA = pa.schema(
    [
        ("rank", _INT),
        ("place", _INT),
        ("rank_low", _INT),
        ("rank_high", _INT),
        ("first_share", _REAL),
        ("submission", _TEXT),
        ("authors", _TEXT),
        ("agents", _TEXT),
        *(
            (f"{metric}{end}", _REAL)
            for metric in ("besm", "sam", "detection_rate", "hazard_recall")
            for end in ("", "_low", "_high")
        ),
        ("n_videos", _INT),
        ("flags", pa.list_(_TEXT)),
        ("date", _TEXT),
        ("url", _TEXT),
        ("licence", _TEXT),
        ("signature", _TEXT),
        ("predictions_sha256", _TEXT),
    ]
)
"""The columns of every format. `rank` is the band's, `place` that of the score alone; `*_low` and `*_high`
are the ends of the 95 % intervals, `flags` the kinds of the probes that speak."""


def rows(data: SiteData) -> list[Row]:
    """A row a system, best first, with the columns of `SCHEMA`; texts as they were given."""
    return [_row(system) for system in data.systems]


def _row(system: System) -> Row:
    card, submission, sure = system.evaluation.card, system.evaluation.submission, system.uncertainty
    return {
        "rank": system.rank,
        "place": system.place,
        "rank_low": sure.rank_low,
        "rank_high": sure.rank_high,
        "first_share": sure.first_share,
        "submission": submission.name,
        "authors": submission.authors,
        "agents": system.agents,
        **_measured("besm", card.besm, sure.besm),
        **_measured("sam", card.sam, sure.sam),
        **_measured("detection_rate", card.detection_rate, sure.detection_rate),
        **_measured("hazard_recall", card.hazard_recall, sure.hazard_recall),
        "n_videos": card.n_videos,
        "flags": [probe.kind for probe in system.probes if probe.flagged],
        "date": submission.date,
        "url": submission.url,
        "licence": system.licence,
        "signature": str(card.signature),
        "predictions_sha256": system.predictions_sha256,
    }


def _measured(name: str, value: float | None, interval: Interval | None) -> Row:
    low, high = (interval.low, interval.high) if interval else (None, None)
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def board_csv(data: SiteData) -> bytes:
    """CSV in UTF-8; a text that a spreadsheet would run as a formula starts with `'`."""
    out = io.StringIO()
    writer = csv.DictWriter(out, SCHEMA.names, lineterminator="\r\n")
    writer.writeheader()
    for row in rows(data):
        writer.writerow({name: _cell(value) for name, value in row.items()})
    return out.getvalue().encode()


def _cell(value: str | int | float | list[str] | None) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return " ".join(value)
    if isinstance(value, str):
        text = visible(value)
        return f"'{text}" if text.lstrip()[:1] in {"=", "+", "-", "@"} else text
    return f"{value:.6f}" if isinstance(value, float) else str(value)


def board_json(data: SiteData) -> bytes:
    """An object with `benchmark`, `threshold`, `rows` and, apart from them, `published`."""
    board = {
        "benchmark": data.settings.name,
        "threshold": data.settings.threshold,
        "rows": rows(data),
        "published": [{**asdict(PUBLISHED), "note": _NOTE}],
    }
    return (json.dumps(board, ensure_ascii=True, indent=1, allow_nan=False) + "\n").encode()


def board_parquet(data: SiteData) -> bytes:
    """Parquet (zstd) with the columns of `SCHEMA`."""
    sink = io.BytesIO()
    table = pa.Table.from_pylist(rows(data), schema=SCHEMA)
    pq.write_table(table, sink, compression="zstd", compression_level=3)
    return sink.getvalue()


_HEAD = ("Rank", "System", "BESM", "SAM", "Detection", "Hazard recall")
_NONE = "–"


def board_latex(data: SiteData) -> bytes:
    """A `tabular` for the package booktabs, with the interval of BESM in small type."""
    lines = [
        f"% {visible(data.settings.name)}: needs \\usepackage{{booktabs}}",
        "% In brackets: 95 % bootstrap interval. Systems that share a rank cannot be told apart.",
        *(f"% {visible(signature)}" for signature in _signatures(data)),
        "\\begin{tabular}{rlrrrr}",
        "\\toprule",
        _latex_row(_HEAD),
        "\\midrule",
        *(_latex_row(_latex_cells(data, system)) for system in data.systems),
        "\\midrule",
        f"\\multicolumn{{6}}{{l}}{{\\emph{{{_NOTE}: {PUBLISHED.n_videos} videos}}}} \\\\",
        _latex_row(_published_cells(latex)),
        "\\bottomrule",
        "\\end{tabular}",
    ]
    return "\n".join([*lines, ""]).encode()


def _latex_cells(data: SiteData, system: System) -> tuple[str, ...]:
    rank, name, besm, *others = _cells(data, system)
    interval = system.uncertainty.besm
    small = f"{{\\scriptsize [{interval.low:.4f}, {interval.high:.4f}]}}"
    return rank, latex(name), f"{latex(besm)} {small}", *map(latex, others)


def _latex_row(cells: Sequence[str]) -> str:
    return f"{' & '.join(cells)} \\\\"


_LATEX = {
    "\\": "\\textbackslash{}",
    "~": "\\textasciitilde{}",
    "^": "\\textasciicircum{}",
    "<": "\\textless{}",
    ">": "\\textgreater{}",
    "|": "\\textbar{}",
    "⟨": "$\\langle$",
    "⟩": "$\\rangle$",
    "–": "--",
    "\u202f": "\\,",
    **{char: f"\\{char}" for char in "#$%&_{}"},
}


def latex(text: str) -> str:
    """Outside text for LaTeX: every character that means something to it is spelled out."""
    return "".join(_LATEX.get(char, char) for char in visible(text))


def board_markdown(data: SiteData) -> bytes:
    """A Markdown table, with the interval of each metric behind it."""
    rule = "|---:|---|---:|---:|---:|---:|"
    signatures = [line for one in _signatures(data) for line in ("", f"Signature: {markdown(one)}")]
    lines = [
        f"# {markdown(data.settings.name)}",
        "",
        _markdown_row(_HEAD),
        rule,
        *(_markdown_row(_markdown_cells(data, system)) for system in data.systems),
        "",
        "In brackets: 95 % bootstrap intervals. Systems that share a rank cannot be told apart.",
        *signatures,
        "",
        f"Apart from these: {_NOTE}.",
        "",
        _markdown_row(_HEAD),
        rule,
        _markdown_row(_published_cells(markdown)),
        "",
        f"On {PUBLISHED.n_videos} videos, threshold {PUBLISHED.threshold:.2f}; {PUBLISHED.source}.",
    ]
    return "\n".join([*lines, ""]).encode()


def _markdown_cells(data: SiteData, system: System) -> tuple[str, ...]:
    rank, name, *values = _cells(data, system)
    sure = system.uncertainty
    intervals = (
        f"{sure.besm.low:.4f}–{sure.besm.high:.4f}",
        f"{sure.sam.low:.4f}–{sure.sam.high:.4f}",
        _share_interval(sure.detection_rate),
        _share_interval(sure.hazard_recall),
    )
    shown = [f"{value} ({span})" if span else value for value, span in zip(values, intervals, strict=True)]
    return rank, markdown(name), *shown


def _share_interval(interval: Interval | None) -> str:
    return f"{interval.low * 100:.1f}–{interval.high * 100:.1f}" if interval else ""


def _markdown_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


_MARKDOWN = re.compile(r"""[&<>"\\`*_\[\]|~#@:$]|(?<=www)\.""", re.IGNORECASE)


def markdown(text: str) -> str:
    """Outside text for Markdown: no HTML, link, mark or new cell can start in it."""
    return _MARKDOWN.sub(lambda found: f"&#{ord(found.group())};", visible(text))


def _cells(data: SiteData, system: System) -> tuple[str, ...]:
    """A system's plain texts under `_HEAD`."""
    card = system.evaluation.card
    return (
        rank_text(data, system),
        system.name,
        f"{card.besm:.4f}",
        f"{card.sam:.4f}",
        percent(card.detection_rate),
        _NONE if card.hazard_recall is None else percent(card.hazard_recall),
    )


def _published_cells(text: Callable[[str], str]) -> tuple[str, ...]:
    values = (_NONE, PUBLISHED.system, f"{PUBLISHED.besm:.4f}", f"{PUBLISHED.sam:.4f}", _NONE, _NONE)
    return tuple(map(text, values))


def _signatures(data: SiteData) -> list[str]:
    """The one signature of all systems; none when there is no system."""
    return list(dict.fromkeys(str(system.evaluation.card.signature) for system in data.systems))


FORMATS: tuple[tuple[str, str, Callable[[SiteData], bytes]], ...] = (
    ("CSV", "data/leaderboard.csv", board_csv),
    ("JSON", "data/leaderboard.json", board_json),
    ("Parquet", "data/leaderboard.parquet", board_parquet),
    ("LaTeX", "data/leaderboard.tex", board_latex),
    ("Markdown", "data/leaderboard.md", board_markdown),
)
"""Every format: its name, its path from the site's root, and what makes its content."""
