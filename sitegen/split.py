"""Divides the videos of a truth into parts: stratified, seeded, and steady when videos are added. Pure.

In every stratum the videos are put in the order of a hash of seed and id, and the order is cut where the
shares say; which way a cut is rounded depends on a hash too, and of 64 such roundings the one is taken
whose parts are nearest to their shares over all strata. Hence the order of the input does not matter;
each part has, in each stratum, its share of the videos rounded up or down; and since the order in a
stratum stays when videos are added, at most one or two others of a stratum move across each cut. Videos
that belong together (copies, one drive) are one unit with the place of its smallest id; what is said of
rounding then holds by weight only.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256

from pipeline.data.clip_hash import Groups
from pipeline.errors import InputError
from pipeline.records import TrackBox, TruthHazard
from sitegen.data_figures import NO_LABEL, label_key

NO_HAZARD = "no hazard"
RARE = "rare labels"
BY = ("label", "kind", "size", "none")

_PART = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
_ROUNDINGS = 64
_CLASSES = ("small box", "middle box", "large box")


@dataclass(frozen=True, slots=True)
class Part:
    """A part and its share, in (0, 1]."""

    name: str
    share: float


@dataclass(frozen=True, slots=True)
class Split:
    """Video id -> part, and video id -> stratum; both sorted by id."""

    parts: tuple[Part, ...]
    part_of: Mapping[str, str]
    stratum_of: Mapping[str, str]

    def table(self) -> list[tuple[str, tuple[int, ...]]]:
        """(stratum, videos in each part), sorted by stratum."""
        counts = Counter((self.stratum_of[name], part) for name, part in self.part_of.items())
        names = sorted(set(self.stratum_of.values()))
        return [(name, tuple(counts[name, part.name] for part in self.parts)) for name in names]


def read_parts(text: str) -> tuple[Part, ...]:
    """The parts of `train=0.7,test=0.3`. Raises InputError unless names are safe and shares add up to 1."""
    parts = []
    for piece in text.split(","):
        name, mark, share = (side.strip() for side in piece.partition("="))
        try:
            value = float(share)
        except ValueError:
            value = math.nan
        if not (mark and _PART.fullmatch(name) and 0 < value <= 1):
            raise InputError(
                f"parts: found '{piece}'; expected NAME=SHARE with a name of letters, digits, '-' and '_' "
                "and a share above 0, such as train=0.7,test=0.3."
            )
        parts.append(Part(name, value))
    total = math.fsum(part.share for part in parts)
    if abs(total - 1) > 1e-6:
        raise InputError(f"parts: the shares add up to {total:g}; expected 1.")
    if len({part.name.casefold() for part in parts}) < len(parts):
        raise InputError(f"parts: found one name twice in '{text}'; expected different names.")
    return tuple(parts)


def strata(
    truth: Sequence[TruthHazard], by: str, n_parts: int, boxes: Iterable[TrackBox] = ()
) -> dict[str, str]:
    """Video id -> stratum.

    `label`: the label of the video's rarest hazard; labels of fewer videos than there are parts are one
    stratum. `kind`: no hazard, one with a track, one without, several. `size`: thirds of the largest box
    of the hazard's track, over all videos. `none`: one stratum. Raises ValueError for another `by`.
    """
    rows: dict[str, list[TruthHazard]] = {}
    for row in truth:
        hazards = rows.setdefault(row.video_id, [])
        if not row.is_no_hazard:
            hazards.append(row)
    if by == "none":
        return dict.fromkeys(sorted(rows), "all videos")
    if by == "kind":
        return {name: _kind(found) for name, found in sorted(rows.items())}
    if by == "size":
        return _sizes(rows, boxes)
    if by != "label":
        raise ValueError(f"found {by!r}; expected one of {', '.join(BY)}")
    often = Counter(label_key(row.label) or NO_LABEL for found in rows.values() for row in found)
    labels = {name: _rarest(found, often) for name, found in sorted(rows.items())}
    videos = Counter(labels.values())
    return {
        name: RARE if label != NO_HAZARD and videos[label] < n_parts else label
        for name, label in labels.items()
    }


def _rarest(hazards: Sequence[TruthHazard], often: Mapping[str, int]) -> str:
    found = [label_key(row.label) or NO_LABEL for row in hazards]
    return min(found, key=lambda label: (often[label], label)) if found else NO_HAZARD


def _kind(hazards: Sequence[TruthHazard]) -> str:
    if len(hazards) != 1:
        return "several hazards" if hazards else NO_HAZARD
    return "a hazard with a track" if hazards[0].track_id is not None else "a hazard without a track"


def _sizes(rows: Mapping[str, Sequence[TruthHazard]], boxes: Iterable[TrackBox]) -> dict[str, str]:
    wanted = {(row.video_id, row.track_id) for found in rows.values() for row in found}
    areas: dict[str, float] = {}
    for box in boxes:
        if (box.video_id, box.track_id) in wanted:
            areas[box.video_id] = max(areas.get(box.video_id, 0.0), box.box.area_px2)
    order = sorted(areas, key=lambda name: (areas[name], name))
    classes = {name: _CLASSES[3 * place // len(order)] for place, name in enumerate(order)}
    return {name: classes.get(name, "no box" if found else NO_HAZARD) for name, found in sorted(rows.items())}


def split(
    stratum_of: Mapping[str, str],
    parts: Sequence[Part],
    seed: int = 0,
    together: Iterable[Sequence[str]] = (),
) -> Split:
    """Divide the videos. Each of `together` are ids that go to one part; unknown ids in them are ignored."""
    groups = Groups(stratum_of)
    for names in together:
        known = [name for name in names if name in stratum_of]
        for name in known[1:]:
            groups.join(known[0], name)
    units: dict[str, list[str]] = {}
    for name in sorted(stratum_of):
        units.setdefault(groups.root(name), []).append(name)
    members: dict[str, list[str]] = {}
    for unit in units:
        members.setdefault(stratum_of[unit], []).append(unit)
    ordered = {
        stratum: sorted(names, key=lambda name: (_number(seed, "video", name), name))
        for stratum, names in sorted(members.items())
    }
    weights = {name: len(found) for name, found in units.items()}
    made = (_assigned(ordered, weights, parts, seed, attempt) for attempt in range(_ROUNDINGS))
    best = min(made, key=lambda units_of: _error(units_of, weights, parts))  # the first of equals
    part_of = {name: part for unit, part in best.items() for name in units[unit]}
    return Split(tuple(parts), dict(sorted(part_of.items())), dict(sorted(stratum_of.items())))


def _assigned(
    ordered: Mapping[str, Sequence[str]],
    weights: Mapping[str, int],
    parts: Sequence[Part],
    seed: int,
    attempt: int,
) -> dict[str, str]:
    """Unit -> part, with one of the ways of rounding that a seed gives."""
    part_of = {}
    for stratum, names in ordered.items():
        rounding = _number(seed, f"rounding {attempt}", stratum) / 2**64
        total, before = sum(weights[name] for name in names), 0
        for name in names:
            part_of[name] = _part_at(parts, before + rounding * weights[name], total)
            before += weights[name]
    return part_of


def _error(part_of: Mapping[str, str], weights: Mapping[str, int], parts: Sequence[Part]) -> float:
    """How far the parts are from their shares, in videos, over all strata."""
    sums = Counter[str]()
    for name, part in part_of.items():
        sums[part] += weights[name]
    return round(sum(abs(sums[part.name] - part.share * sums.total()) for part in parts), 9)


def _number(seed: int, *names: str) -> int:
    """A number below 2^64 that depends on the seed and the names alone."""
    return int.from_bytes(sha256("\0".join((str(seed), *names)).encode()).digest()[:8], "big")


def _part_at(parts: Sequence[Part], place: float, total: int) -> str:
    """The part in whose share of the line from 0 to `total` the place lies."""
    end = 0.0
    for part in parts[:-1]:
        end += part.share
        # Shares are decimal: 0.7 of 10 is 7, whatever binary makes of it.
        if place < round(end * total, 9):
            return part.name
    return parts[-1].name
