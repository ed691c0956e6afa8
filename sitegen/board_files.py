"""The data of the leaderboard's script: what a row opens to, and what passes at every threshold.

    data/board/<n>.js    calls `COOOLER_BOARD(n, value)` with the systems of part n, in board order

Whether a caption passes is decided here, by the rule of every score, and only counted: a few hundred
bytes a system however many videos there are. The script never compares a similarity with a threshold.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from sitegen.charts import script_json
from sitegen.gathered import SiteData, System
from sitegen.language import gettext as _
from sitegen.language import said_again
from sitegen.numerals import score
from sitegen.score import passes
from sitegen.words import shorten, visible

PART_BYTES = 10 * 1024
_CALL_BYTES = 100  # at most, around the systems of a part
_NAME_CHARS = 80


def thresholds(data: SiteData) -> tuple[float, ...]:
    """0.50 to 0.95 in steps of 0.01, and the benchmark's own; none when the truth is kept back."""
    if data.hidden:
        return ()
    return tuple(sorted({*(step / 100 for step in range(50, 96)), data.settings.threshold}))


def threshold_text(value: float) -> str:
    """A threshold to two digits, or to as many as it has."""
    short = f"{value:.2f}"
    return short if float(short) == value else repr(value)


def parts(data: SiteData) -> dict[str, int]:
    """Slug -> the part that holds the system."""
    return {slug: number for number, part in enumerate(_parts(data)) for slug in part}


def board_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """Each part: (path, content), at most 10 KB unless one system alone is larger."""
    hazards = sum(not hazard.is_no_hazard for rows in data.truth.values() for hazard in rows)
    totals = {} if data.hidden else {"videos": len(data.truth), "hazards": hazards}
    for number, part in enumerate(_parts(data)):
        value = script_json({"systems": part, **totals})
        yield f"data/board/{number}.js", f"COOOLER_BOARD({number},{value});\n".encode()


def _parts(data: SiteData) -> Iterator[dict[str, Any]]:
    steps = thresholds(data)
    part: dict[str, Any] = {}
    size = _CALL_BYTES
    for system in data.systems:
        value = _system(data, system, steps)
        more = len(script_json(value)) + len(system.slug) + 4
        if part and size + more > PART_BYTES:
            yield part
            part, size = {}, _CALL_BYTES
        part[system.slug] = value
        size += more
    if part:
        yield part


def _system(data: SiteData, system: System, steps: tuple[float, ...]) -> dict[str, Any]:
    probes = [
        [_(probe.name), visible(said_again(probe.text)), visible(said_again(probe.sentence))]
        for probe in system.probes
        if probe.flagged
    ]
    found: dict[str, Any] = {"probes": probes}
    if data.hidden:
        return found
    rows = system.evaluation.videos
    judged = [video.best for video in rows if video.n_hazards]
    silent = sum(not video.n_hazards and not video.n_predictions for video in rows)
    found["detected"] = [count + silent for count in _passing(judged, steps)]
    found["found"] = _passing(_hazard_bests(system), steps)
    if len(rows) > 1:
        order = sorted(rows, key=lambda video: (-video.besm, video.video_id))
        found["best"] = _video(data, system, order[0].video_id)
        least = min(video.besm for video in rows)
        found["worst"] = _video(data, system, next(v.video_id for v in order if v.besm == least))
    return found


def _hazard_bests(system: System) -> list[float]:
    """The best similarity of each hazard that any caption was compared with."""
    best: dict[tuple[str, str], float] = {}
    for pair in system.evaluation.pairs:
        key = pair.video_id, pair.hazard_id
        best[key] = max(best.get(key, 0.0), pair.similarity)
    return list(best.values())


def _passing(similarities: Iterable[float], steps: tuple[float, ...]) -> list[int]:
    values = np.array(list(similarities), dtype=np.float64)
    return [int(np.count_nonzero(passes(values, step))) for step in steps]


def _video(data: SiteData, system: System, video_id: str) -> list[str]:
    shown = score(system.scores[video_id].besm, digits=2)
    path = f"videos/{data.names[video_id]}.html#{system.slug}"
    return [path, shorten(visible(video_id), _NAME_CHARS), shown.text]
