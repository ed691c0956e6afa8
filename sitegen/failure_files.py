"""The data of the failures page: an index, and shards that its script loads when they are needed.

    data/failures.js                       what can be filtered by, and where the shards begin
    data/failures/videos/<k>.js            names and pictures of videos
    data/failures/hazards/<k>.js           labels, descriptions and sizes of the truth's hazards
    data/failures/rows/<slug>/<k>.js       the failures of a system in at most 100 videos, as numbers
    data/failures/texts/<slug>/<k>.js      its captions and the evidence, each text once

Each file calls `COOOLER_FAILURES(name, value)`, where name is its path without `data/` and `.js`. Videos
and hazards are known by their place, texts by their place within the system, from 1.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any, NamedTuple

from pipeline.records import TruthHazard
from sitegen.charts import script_json
from sitegen.data_shards import Shards
from sitegen.failures import Blame, Failure, FailureKind, meaning_of, name_of
from sitegen.gathered import SiteData, System
from sitegen.language import N_, marked
from sitegen.language import gettext as _
from sitegen.words import shorten, visible

INDEX_FILE = "data/failures.js"
UNITS = 10_000
"""Similarities are whole numbers of this part: the four digits that the page prints."""

RANGE = 0.2
SMALL, LARGE = 32**2 / (640 * 480), 96**2 / (640 * 480)
"""COCO's limits of small and large, 32² and 96² px, as shares of its usual frame of 640 x 480 px."""

LABEL_CHARS = 60
TRUTH_CHARS = 240
CAPTION_CHARS = 240
EVIDENCE_CHARS = 360
ID_CHARS = 60

SIZES: dict[str, str] = {
    "small": N_("Small, under 0.33\u202f%"),
    "medium": N_("Medium, under 3\u202f%"),
    "large": N_("Large, 3\u202f% or more"),
    "unknown": N_("Unknown"),
    "none": N_("None: a caption’s failure"),
}
STAGES: dict[str, str] = {"known": N_("Stages recorded"), "unknown": N_("Stages not recorded")}
NO_LABEL = N_("Without a label")
NOT_A_HAZARD = N_("None: a caption’s failure")

_SHARDS = Shards("COOOLER_FAILURES", "failures")
_KINDS = tuple(FailureKind)
_SIZES = tuple(SIZES)


class Hazard(NamedTuple):
    """A hazard of the truth as the page shows it; `size` is a key of SIZES."""

    video_id: str
    hazard_id: str
    label: str
    description: str
    size: str


@dataclass(frozen=True, slots=True)
class Shown:
    """What the page shows: systems with their failures, best system first, and the truth's hazards."""

    systems: tuple[System, ...]
    failures: tuple[tuple[Failure, ...], ...]
    hazards: tuple[Hazard, ...]


def shown(data: SiteData, blames: Mapping[str, Blame]) -> Shown:
    """All of the systems that have a blame, by their slug; failures in the order of the videos."""
    systems = tuple(system for system in data.systems if system.slug in blames)
    places = {video_id: place for place, video_id in enumerate(data.video_ids)}
    failures = tuple(
        tuple(sorted(blames[system.slug].failures, key=lambda failure: places[failure.video_id]))
        for system in systems
    )
    hazards = tuple(
        Hazard(video_id, row.hazard_id, *_words(row), hazard_size(data, row))
        for video_id in data.video_ids
        for row in data.truth[video_id]
        if not row.is_no_hazard
    )
    return Shown(systems, failures, hazards)


def _words(row: TruthHazard) -> tuple[str, str]:
    label = shorten(" ".join(visible(row.label).split()), LABEL_CHARS) or _(NO_LABEL)
    return label, shorten(visible(row.description), TRUTH_CHARS)


def hazard_size(data: SiteData, hazard: TruthHazard) -> str:
    """A key of SIZES: the largest box of the hazard's track on a keyframe, as a share of the frame.

    Only what lies within the frame counts. It is unknown where the truth names no track, no keyframe
    shows it, or the clip could not be read.
    """
    media = data.media[hazard.video_id]
    area = media.width_px * media.height_px
    shares = []
    for row in data.boxes.get(hazard.video_id, ()):
        if area and hazard.track_id is not None and row.track_id == hazard.track_id:
            box = row.box
            width = min(box.x2_px, media.width_px) - max(box.x1_px, 0)
            height = min(box.y2_px, media.height_px) - max(box.y1_px, 0)
            shares.append(max(width, 0) * max(height, 0) / area)
    largest = max(shares, default=0.0)
    if largest <= 0:
        return "unknown"
    return "small" if largest < SMALL else "medium" if largest < LARGE else "large"


def units(similarity: float) -> int:
    """A similarity in [0, 1] as a whole number of UNITS."""
    return round(min(max(similarity, 0.0), 1.0) * UNITS)


def score_ranges(threshold: float) -> tuple[tuple[float, float], ...]:
    """Steps of 0.2 up to the threshold; a similarity at a limit belongs to the range that starts there."""
    count = max(1, ceil(threshold / RANGE - 1e-9))
    return tuple((number * RANGE, min((number + 1) * RANGE, threshold)) for number in range(count))


def range_key(ends: tuple[float, float]) -> str:
    """A range as it stands in an address: `0.2-0.4`."""
    low, high = ends
    return f"{low:.4g}-{high:.4g}"


def _range_words(ends: tuple[float, float]) -> str:
    low, high = (marked(f"{end:.4g}") for end in ends)
    return _("{low} to {high}").format(low=low, high=high)


def caption_of(system: System, failure: Failure) -> str:
    """The caption that a failure means; empty when there is none."""
    rows = system.predictions.get(failure.video_id, ())
    found = next((row for row in rows if row.rank == failure.prediction_rank), None)
    return shorten(visible(found.description), CAPTION_CHARS) if found else ""


def evidence_of(failure: Failure) -> str:
    """The evidence as it is shown."""
    return shorten(visible(failure.evidence), EVIDENCE_CHARS)


def shown_id(video_id: str) -> str:
    """A video's id as it is shown."""
    return shorten(visible(video_id), ID_CHARS)


def system_name(system: System) -> str:
    """A system's name as it is shown; a preview says so."""
    name = visible(system.name)
    return _("{system} (rehearsal)").format(system=name) if system.rehearsed else name


def failure_files(data: SiteData, blames: Mapping[str, Blame]) -> Iterator[tuple[str, bytes]]:
    """The page's data: (path, content); none when there is no failure."""
    found = shown(data, blames)
    if not any(found.failures):
        return
    places = {video_id: place for place, video_id in enumerate(data.video_ids)}
    labels = sorted({row.label.casefold(): row.label for row in reversed(found.hazards)}.items())
    codes = {folded: code for code, (folded, _) in enumerate(labels, start=1)}
    index = _index(data, found, [_(NOT_A_HAZARD), *(label for _, label in labels)])
    ends: dict[str, list[int]] = {"videos": [], "hazards": []}
    videos = [_video(data, video_id) for video_id in data.video_ids]
    hazards = [_hazard(row, places, codes) for row in found.hazards]
    of_videos = list(range(len(videos)))
    of_hazards = [places[row.video_id] for row in found.hazards]
    yield from _SHARDS.cut("videos", videos, of_videos, ends["videos"])
    yield from _SHARDS.cut("hazards", hazards, of_hazards, ends["hazards"])
    numbers = {(row.video_id, row.hazard_id): n for n, row in enumerate(found.hazards, start=1)}
    systems: list[Any] = []
    for system, failures in zip(found.systems, found.failures, strict=True):
        texts: dict[str, int] = {}
        rows = [_row(system, failure, places, numbers, texts) for failure in failures]
        of_system: tuple[list[int], list[int]] = ([], [])
        of_rows = [places[failure.video_id] for failure in failures]
        yield from _SHARDS.cut(f"rows/{system.slug}", rows, of_rows, of_system[0])
        written = [script_json(text) for text in texts]
        yield from _SHARDS.cut(f"texts/{system.slug}", written, [0] * len(texts), of_system[1])
        systems.append([system.slug, system_name(system), *of_system])
    index |= {**ends, "systems": systems}
    yield INDEX_FILE, f'COOOLER_FAILURES("failures",{script_json(index)});\n'.encode()


def _index(data: SiteData, found: Shown, labels: list[str]) -> dict[str, Any]:
    """What comes with the page, but for where each shard ends."""
    ranges = score_ranges(data.settings.threshold)
    return {
        "kinds": [[kind.value, name_of(kind), meaning_of(kind)] for kind in _KINDS],
        "stages": [[stage, _(words)] for stage, words in STAGES.items()],
        "ranges": [[range_key(ends), _range_words(ends)] for ends in ranges],
        "range": round(RANGE * UNITS),
        "sizes": [[size, _(words)] for size, words in SIZES.items()],
        "labels": labels,
        "threshold": data.settings.threshold,
        "units": UNITS,
        "failures": sum(len(failures) for failures in found.failures),
    }


def _video(data: SiteData, video_id: str) -> str:
    return script_json([data.names[video_id], shown_id(video_id), data.media[video_id].card])


def _hazard(row: Hazard, places: Mapping[str, int], codes: Mapping[str, int]) -> str:
    """Video, label by its number, size by its number, label and description as they stand in the truth."""
    label = codes[row.label.casefold()]
    return script_json([places[row.video_id], label, _SIZES.index(row.size), row.label, row.description])


def _row(
    system: System,
    failure: Failure,
    places: Mapping[str, int],
    numbers: Mapping[tuple[str, str], int],
    texts: dict[str, int],
) -> str:
    """Video, kind, hazard (0: a caption's failure), caption's rank (0: none), similarity, stages, texts."""
    hazard = 0 if failure.hazard_id is None else numbers[failure.video_id, failure.hazard_id]
    said, evidence = (
        texts.setdefault(text, len(texts) + 1) if text else 0
        for text in (caption_of(system, failure), evidence_of(failure))
    )
    return script_json(
        [
            places[failure.video_id],
            _KINDS.index(failure.kind),
            hazard,
            failure.prediction_rank or 0,
            units(failure.similarity),
            0 if failure.stages_known else 1,
            said,
            evidence,
        ]
    )
