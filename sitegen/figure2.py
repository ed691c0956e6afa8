"""The paper's figure 2 for one system and video: snippets against COS labels, and what that groups.

Rows are snippets (box crops), columns the labels of the Critical Object Set, cells the image-text
cosines with the detected ones marked; detected labels are then grouped with their tracks and frames.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pipeline.records import Kind, Match, Snippet, Stage, StageOutput
from sitegen.language import fixed
from sitegen.language import gettext as _
from sitegen.numerals import plural
from sitegen.words import shorten, visible

MAX_ROWS = 48
MIN_ROWS_PER_TRACK = 3
MAX_ROWS_PER_TRACK = 8
MAX_COLUMNS = 16
MAX_GROUPS = 16
MAX_GROUP_TRACKS = 12
_FEW_FRAMES = 8
_LEVELS = 10

Place = tuple[str, int]
"""A snippet of a video: track id and frame index."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A snippet to look at: a file of its own, or the part `view` ("x y width height") of a keyframe's.

    `path` is from the site's root; `width` x `height` are the file's pixels, or the units of `view`.
    """

    path: str
    width: int
    height: int
    view: str = ""


@dataclass(frozen=True, slots=True)
class Column:
    """A label of the Critical Object Set."""

    label: str
    in_aos: bool


@dataclass(frozen=True, slots=True)
class Cell:
    """A cosine; `level` is 0 to 10 between the figure's lowest and highest."""

    text: str
    level: int
    detected: bool


@dataclass(frozen=True, slots=True)
class SnippetRow:
    """A snippet against every column shown."""

    frame: int
    picture: Picture | None
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class TrackRows:
    """The snippets of one track, by frame; `count` says how many of how many are shown."""

    track: str
    hazard: bool
    count: str
    rows: tuple[SnippetRow, ...]


@dataclass(frozen=True, slots=True)
class Group:
    """The detected snippets that share a label: (track, is a hazard, frames in words)."""

    label: str
    in_aos: bool
    tracks: tuple[tuple[str, bool, str], ...]
    more: str


@dataclass(frozen=True, slots=True)
class Figure2:
    """The whole figure; the texts in `left_out` say what was not drawn.

    `proposed` are the tracks, as they are named here, that nobody annotated.
    """

    summary: str
    low: str
    high: str
    columns: tuple[Column, ...]
    tracks: tuple[TrackRows, ...]
    groups: tuple[Group, ...]
    left_out: tuple[str, ...]
    proposed: tuple[str, ...] = ()


def figure2(
    stages: Sequence[StageOutput],
    snippets: Iterable[Snippet],
    matches: Sequence[Match],
    pictures: Mapping[Place, Picture],
) -> Figure2 | None:
    """The figure of one video's records, or None when nothing was compared.

    Tracks with hazards come first, then those detected under a label of the Anomalous Object Set. Of a
    track with many snippets the rows kept are those detected so, those with a picture of their own,
    and those with the highest cosine, in that order; they are shown by frame.
    """
    if not matches:
        return None
    kinds = {(s.track_box.track_id, s.track_box.kind) for s in snippets}
    hazards = {track for track, kind in kinds if kind is Kind.CHALLENGE}
    proposed = {track for track, kind in kinds if kind is Kind.PROPOSED} - hazards
    rows: dict[Place, dict[str, Match]] = {}
    for match in matches:
        rows.setdefault((match.track_id, match.frame_index), {})[match.label] = match
    anomalous = {match.label for match in matches if match.in_aos}
    columns, more_columns = _columns(stages, matches, anomalous)
    low, high = min(match.cosine for match in matches), max(match.cosine for match in matches)

    def row(place: Place) -> SnippetRow:
        cells = tuple(_cell(rows[place].get(label), low, high) for label in columns)
        return SnippetRow(place[1], pictures.get(place), cells)

    by_track: dict[str, list[Place]] = {}
    for place in rows:
        by_track.setdefault(place[0], []).append(place)
    accused = {match.track_id for match in matches if match.detected and match.in_aos}
    order = sorted(by_track, key=lambda track: (track not in hazards, track not in accused, _natural(track)))
    per_track = min(MAX_ROWS_PER_TRACK, max(MIN_ROWS_PER_TRACK, MAX_ROWS // len(order)))
    shown = order[: MAX_ROWS // per_track]
    tracks = []
    for track in shown:
        places = by_track[track]
        kept = sorted(places, key=lambda place: _worth(place, rows[place], pictures))[:per_track]
        count = plural(len(places), "{n} snippet", "{n} snippets")
        tracks.append(
            TrackRows(
                shorten(visible(track), 24),
                track in hazards,
                count if len(kept) == len(places) else _("{n} of {total}").format(n=len(kept), total=count),
                tuple(row(place) for place in sorted(kept, key=lambda place: place[1])),
            )
        )
    groups, more_groups = _groups(matches, columns, anomalous, hazards)
    rest = order[len(shown) :]
    left_out = [
        _("{tracks} with {snippets}").format(
            tracks=plural(len(rest), "{n} more track", "{n} more tracks"),
            snippets=plural(sum(len(by_track[t]) for t in rest), "{n} snippet", "{n} snippets"),
        )
        if rest
        else "",
        plural(more_columns, "{n} more label", "{n} more labels") if more_columns else "",
        plural(more_groups, "{n} more group", "{n} more groups") if more_groups else "",
    ]
    return Figure2(
        _("{snippets} of {tracks} against {labels}").format(
            snippets=plural(len(rows), "{n} snippet", "{n} snippets"),
            tracks=plural(len(order), "{n} track", "{n} tracks"),
            labels=plural(len(columns) + more_columns, "{n} label", "{n} labels"),
        ),
        _number(low),
        _number(high),
        tuple(Column(shorten(visible(label), 36), label in anomalous) for label in columns),
        tuple(tracks),
        groups,
        tuple(text for text in left_out if text),
        tuple(sorted(shorten(visible(track), 24) for track in proposed)),
    )


def _columns(
    stages: Sequence[StageOutput], matches: Sequence[Match], anomalous: set[str]
) -> tuple[list[str], int]:
    """The labels shown, in the COS's order, and how many more there are.

    Of too many, those in the AOS are kept first, then those that were detected most often.
    """
    said = next((output for output in reversed(stages) if output.stage is Stage.COS), None)
    ranks: dict[str, int] = {}
    for item in said.items if said else ():
        ranks.setdefault(item.label or item.description, len(ranks))
    counts: dict[str, int] = {}
    for match in matches:
        counts[match.label] = counts.get(match.label, 0) + match.detected
    labels = sorted(counts, key=lambda label: (ranks.get(label, len(ranks)), label))
    kept = sorted(labels, key=lambda label: (label not in anomalous, -counts[label]))[:MAX_COLUMNS]
    return [label for label in labels if label in set(kept)], len(labels) - len(kept)


def _groups(
    matches: Sequence[Match], columns: Sequence[str], anomalous: set[str], hazards: set[str]
) -> tuple[tuple[Group, ...], int]:
    """Detected labels with their tracks and frames, those in the AOS first; how many are not shown."""
    found: dict[str, dict[str, set[int]]] = {}
    for match in matches:
        if match.detected:
            found.setdefault(match.label, {}).setdefault(match.track_id, set()).add(match.frame_index)
    places = {label: at for at, label in enumerate(columns)}
    order = sorted(found, key=lambda label: (label not in anomalous, places.get(label, len(places)), label))
    groups = []
    for label in order[:MAX_GROUPS]:
        tracks = sorted(found[label], key=lambda track: (track not in hazards, _natural(track)))
        rest = tracks[MAX_GROUP_TRACKS:]
        groups.append(
            Group(
                shorten(visible(label), 80),
                label in anomalous,
                tuple(
                    (shorten(visible(track), 24), track in hazards, _frames(sorted(found[label][track])))
                    for track in tracks[:MAX_GROUP_TRACKS]
                ),
                plural(len(rest), "and {n} more track", "and {n} more tracks") if rest else "",
            )
        )
    return tuple(groups), max(0, len(order) - MAX_GROUPS)


def _worth(place: Place, row: Mapping[str, Match], pictures: Mapping[Place, Picture]) -> tuple[object, ...]:
    """Sorts the snippets of a track, the one most worth showing first."""
    accused = any(match.detected and match.in_aos for match in row.values())
    picture = pictures.get(place)
    own = picture is not None and not picture.view
    return (not accused, not own, -max(match.cosine for match in row.values()), place[1])


def _cell(match: Match | None, low: float, high: float) -> Cell:
    if match is None:
        return Cell("–", 0, False)
    share = (match.cosine - low) / (high - low) if high > low else 0.0
    return Cell(_number(match.cosine), round(share * _LEVELS), match.detected)


def _number(cosine: float) -> str:
    return fixed(round(cosine, 3), 3).replace("-", "−")


def _frames(frames: Sequence[int]) -> str:
    if len(frames) == 1:
        return _("frame {n}").format(n=frames[0])
    if len(frames) <= _FEW_FRAMES:
        return _("frames {list}").format(list=", ".join(map(str, frames)))
    return _("{n} frames, {first} to {last}").format(n=len(frames), first=frames[0], last=frames[-1])


def _natural(track: str) -> tuple[bool, int, str]:
    """Sorts "9" before "10" and "p9" before "p10", numbers before words."""
    numeric = track.removeprefix("p").isdecimal()
    return (not numeric, len(track) if numeric else 0, track)
