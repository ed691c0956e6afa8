"""The data of the compare page: an index, and shards that its script loads when they are needed.

    data/compare.js                          systems, and where the shards of videos begin
    data/compare/tests/<slug>.js             the paired tests of a system against every other one
    data/compare/scores/<slug>/<n>.js        its scores of 100 videos
    data/compare/captions/<slug>/<n>-<k>.js  its captions in the videos of part k of these 100
    data/compare/found/<slug>.js             which of all videos it detects
    data/compare/videos/<k>.js               names and labels of videos

Each file calls `COOOLER_DATA(name, value)`, where name is its path without `data/` and `.js`. Videos
are known by their place among all ids, in order.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

from pipeline.scores import PairScore, VideoScore
from sitegen.charts import script_json
from sitegen.compare import Comparison
from sitegen.gathered import SiteData, System
from sitegen.language import gettext as _
from sitegen.paired import RESAMPLES, SEED, all_pairs
from sitegen.uncertainty import SIGNIFICANT, Key
from sitegen.verdicts import best_pairs, title_of
from sitegen.words import shorten, visible

INDEX_FILE = "data/compare.js"
TESTED = 20
"""So many systems, the best, are tested against each other."""

BLOCK = 100
SHARD_BYTES = 10 * 1024
SCALE = 10_000_000
"""Scores are whole numbers of this part: embeddings are right to about 1e-7. A coarser step would
call some videos equal in which the paired test counts a win."""

CAPTION_CHARS = 140
LABEL_CHARS = 60
ID_CHARS = 120
SHORT_CHARS = 32

_METRICS: tuple[Key, ...] = ("besm", "sam", "detection_rate", "hazard_recall")
_CALL_BYTES = 160  # at most, around the value of a shard


def tested(data: SiteData) -> tuple[System, ...]:
    """The systems that are tested against each other, best first."""
    return data.systems[:TESTED]


@lru_cache(maxsize=1)
def tests(systems: tuple[System, ...]) -> dict[tuple[int, int], dict[Key, Comparison]]:
    """All pairs of these systems by their places; systems are the same only when they are one object."""
    return all_pairs([system.evaluation for system in systems])


def shown_name(system: System) -> str:
    """The name of a system as pages show it; a preview says so."""
    name = visible(system.name)
    return _("{system} (rehearsal)").format(system=name) if system.rehearsed else name


def short_name(system: System) -> str:
    """The same, cut for the heads of tables."""
    return shorten(shown_name(system), SHORT_CHARS)


def video_href(data: SiteData, video_id: str) -> str:
    """The path of a video's page."""
    return f"videos/{data.names[video_id]}.html"


def compare_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The page's data: (path, content); none with fewer than two systems."""
    if len(data.systems) < 2:
        return
    first: list[int] = []
    video_ids = data.video_ids
    entries = [_video(data, video_id) for video_id in video_ids]
    for number, (start, part) in enumerate(_parts(entries, 0)):
        first.append(start)
        yield _file(f"videos/{number}", part)
    yield INDEX_FILE, f'COOOLER_DATA("compare",{script_json(_index(data, first))});\n'.encode()
    for place, system in enumerate(tested(data)):
        yield _file(f"tests/{system.slug}", script_json(_tests(data, place)))
    for system in data.systems:
        scores = [system.scores[video_id] for video_id in video_ids]
        yield _file(f"found/{system.slug}", script_json(_bits([score.detected for score in scores])))
        for block in range(0, len(scores), BLOCK):
            number = block // BLOCK
            ids = video_ids[block : block + BLOCK]
            parts = list(_parts([_captions(system, video_id) for video_id in ids], block))
            for cut, (_start, part) in enumerate(parts):
                yield _file(f"captions/{system.slug}/{number}-{cut}", part)
            content = _scores(scores[block : block + BLOCK], [start for start, _part in parts])
            yield _file(f"scores/{system.slug}/{number}", script_json(content))


def _file(name: str, value: str) -> tuple[str, bytes]:
    return f"data/compare/{name}.js", f'COOOLER_DATA("compare/{name}",{value});\n'.encode()


def _index(data: SiteData, first: list[int]) -> dict[str, Any]:
    return {
        "benchmark": data.settings.name,
        "signature": str(data.systems[0].evaluation.card.signature),
        "systems": [
            [
                system.slug,
                shown_name(system),
                [getattr(system.evaluation.card, key) for key in _METRICS],
                short_name(system),
            ]
            for system in data.systems
        ],
        "metrics": _METRICS,
        "tested": len(tested(data)),
        "resamples": RESAMPLES,
        "seed": SEED,
        "significant": SIGNIFICANT,
        "videos": len(data.truth),
        "first": first,
        "block": BLOCK,
        "scale": SCALE,
    }


def _tests(data: SiteData, place: int) -> list[Any]:
    """For each system its tests: a metric's interval, both p-values times resamples + 1, wins, losses.

    All else follows from these and the index. A system against itself has none.
    """
    found: list[Any] = []
    for other in range(len(tested(data))):
        rows = tests(tested(data)).get((place, other), {}).values()
        found.append(
            {
                row.key: [
                    row.interval.low,
                    row.interval.high,
                    round(row.p_bootstrap * (RESAMPLES + 1)),
                    round(row.p_randomisation * (RESAMPLES + 1)),
                    row.wins,
                    row.losses,
                ]
                for row in rows
            }
        )
    return found


def _scores(scores: Sequence[VideoScore], cuts: list[int]) -> dict[str, Any]:
    """The scores of one block; `cuts` are the places where its parts of captions begin."""
    columns = {
        name: [round(getattr(score, name) * SCALE) for score in scores] for name in ("best", "besm", "sam")
    }
    return {**columns, "detection": "".join("01"[score.detected] for score in scores), "cuts": cuts}


def _captions(system: System, video_id: str) -> str:
    """The caption that comes closest, and how many there are; 0 when nothing was said."""
    rows = system.predictions.get(video_id, [])
    if not rows:
        return "0"
    pairs: dict[int, PairScore] = best_pairs(system, video_id)
    closest = max(rows, key=lambda row: pairs[row.rank].cosine if row.rank in pairs else -1.0)
    return script_json([shorten(visible(closest.description), CAPTION_CHARS), len(rows)])


def _video(data: SiteData, video_id: str) -> str:
    """A video's path name, id as shown, labels (empty: no hazard), card, and its id where that differs."""
    truth = data.truth[video_id]
    labels = "" if all(row.is_no_hazard for row in truth) else shorten(visible(title_of(truth)), LABEL_CHARS)
    shown = shorten(visible(video_id), ID_CHARS)
    entry = [data.names[video_id], shown, labels, data.media[video_id].card]
    return script_json(entry if shown == video_id else [*entry, video_id])


def _parts(entries: Sequence[str], start: int) -> Iterator[tuple[int, str]]:
    """JSON entries in order as lists of at most 100 that fit into a shard: (place of the first, list)."""
    part: list[str] = []
    size = _CALL_BYTES
    for place, entry in enumerate(entries, start):
        if part and (size + len(entry) + 1 > SHARD_BYTES or len(part) == BLOCK):
            yield place - len(part), f"[{','.join(part)}]"
            part, size = [], _CALL_BYTES
        part.append(entry)
        size += len(entry) + 1
    if part:
        yield start + len(entries) - len(part), f"[{','.join(part)}]"


def _bits(values: Sequence[bool]) -> str:
    """Four values a hexadecimal digit, the first as its highest bit; the last digit is filled with zeros."""
    text = "".join("01"[value] for value in values)
    padded = text + "0" * (-len(text) % 4)
    return "".join(f"{int(padded[i : i + 4], 2):x}" for i in range(0, len(padded), 4))
