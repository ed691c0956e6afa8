"""Boxes found frame by frame, linked to tracks: greedy by overlap, with constant velocity. Source: ours."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from pipeline.records import Box, Kind, TrackBox

_KEPT = 0.5  # of a track's velocity when the next box is seen: boxes jitter


@dataclass(frozen=True, slots=True)
class Candidate:
    """A box seen in one frame; `score` is in [0, 1], and only candidates of one label make a track."""

    frame_index: int
    box: Box
    score: float
    label: str = ""


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """`max_gap_frames` may pass between two sightings; what lies between them is interpolated.

    A track needs `min_sightings`. Of tracks that lie on one another (mean IoU over the shorter one's frames
    over `same_iou`) the one with the highest sum of scores is kept, and at most `max_tracks` of all.
    """

    min_iou: float = 0.3
    max_gap_frames: int = 6
    min_sightings: int = 8
    same_iou: float = 0.5
    max_tracks: int = 24


@dataclass(frozen=True, slots=True)
class Track:
    """A linked track: every frame from its first to its last sighting; `score` is the sightings' mean."""

    label: str
    score: float
    sightings: int
    boxes: tuple[tuple[int, Box], ...]


@dataclass(slots=True)
class _Open:
    """A track that may go on; `velocity` is of the four sides, in px a frame."""

    seen: list[Candidate]
    velocity: tuple[float, ...] = field(default=(0.0, 0.0, 0.0, 0.0))

    def overlap(self, candidate: Candidate) -> float:
        """IoU with where the track is going or, if that is better, with where it was last seen."""
        last = self.seen[-1]
        frames = candidate.frame_index - last.frame_index
        ahead = Box(*(s + v * frames for s, v in zip(_sides(last.box), self.velocity, strict=True)))
        return max(iou(last.box, candidate.box), iou(ahead, candidate.box))

    def take(self, candidate: Candidate) -> None:
        last = self.seen[-1]
        frames = candidate.frame_index - last.frame_index
        moved = ((b - a) / frames for a, b in zip(_sides(last.box), _sides(candidate.box), strict=True))
        self.velocity = tuple(
            _KEPT * old + (1 - _KEPT) * new for old, new in zip(self.velocity, moved, strict=True)
        )
        self.seen.append(candidate)


def iou(a: Box, b: Box) -> float:
    """Intersection over union, in [0, 1]; 0 for boxes without an area."""
    width = min(a.x2_px, b.x2_px) - max(a.x1_px, b.x1_px)
    height = min(a.y2_px, b.y2_px) - max(a.y1_px, b.y1_px)
    if width <= 0 or height <= 0:
        return 0.0
    shared = width * height
    return shared / (a.area_px2 + b.area_px2 - shared)


def link(candidates: Iterable[Candidate], settings: LinkSettings) -> list[Track]:
    """The tracks in `candidates`, by first frame, then place. The order of the candidates changes nothing.

    In every frame the pairs of a track and a candidate with the highest overlap go together first.
    """
    by_frame: dict[int, list[Candidate]] = {}
    for candidate in sorted(candidates, key=_order):
        by_frame.setdefault(candidate.frame_index, []).append(candidate)
    still_open: list[_Open] = []
    ended: list[_Open] = []
    for index, here in by_frame.items():
        lasting = [t for t in still_open if index - t.seen[-1].frame_index <= settings.max_gap_frames]
        ended += [track for track in still_open if track not in lasting]
        pairs = sorted(
            (-overlap, place, number)
            for place, track in enumerate(lasting)
            for number, candidate in enumerate(here)
            if track.seen[-1].label == candidate.label
            and (overlap := track.overlap(candidate)) >= settings.min_iou
        )
        taken: set[int] = set()
        grown: set[int] = set()
        for _, place, number in pairs:
            if place not in grown and number not in taken:
                lasting[place].take(here[number])
                grown.add(place)
                taken.add(number)
        still_open = lasting + [_Open([one]) for number, one in enumerate(here) if number not in taken]
    long_enough = [t for t in (*ended, *still_open) if len(t.seen) >= settings.min_sightings]
    tracks = [_track(t.seen) for t in sorted(long_enough, key=lambda t: _order(t.seen[0]))]
    return distinct(tracks, settings)


def distinct(tracks: Sequence[Track], settings: LinkSettings, sure: Sequence[Track] = ()) -> list[Track]:
    """The tracks without those that lie on a better one, at most `max_tracks`, by first frame, then place.

    Those of `sure` are kept and better than any; else a track is by its sum of scores, then by its order.
    """
    kept = list(sure)
    for track in sorted(tracks, key=lambda t: -t.score * t.sightings):
        if len(kept) >= settings.max_tracks:
            break
        if all(_shared(track, other) <= settings.same_iou for other in kept):
            kept.append(track)
    return sorted(kept, key=lambda t: (t.boxes[0][0], _sides(t.boxes[0][1]), t.label, -t.score))


def named(video_id: str, tracks: Sequence[Track]) -> tuple[TrackBox, ...]:
    """The boxes of tracks as proposals: the tracks are called p1, p2, … in their order."""
    return tuple(
        TrackBox(video_id, index, f"p{number}", Kind.PROPOSED, box)
        for number, track in enumerate(tracks, start=1)
        for index, box in track.boxes
    )


def _shared(a: Track, b: Track) -> float:
    """The mean IoU over the frames of the shorter track; 0 in a frame that the other does not have."""
    shorter, longer = sorted((a, b), key=lambda track: len(track.boxes))
    other = dict(longer.boxes)
    return sum(iou(box, other[at]) for at, box in shorter.boxes if at in other) / len(shorter.boxes)


def _track(seen: Sequence[Candidate]) -> Track:
    """The sightings with what lies between them."""
    boxes = [(seen[0].frame_index, seen[0].box)]
    for before, after in pairwise(seen):
        frames = after.frame_index - before.frame_index
        boxes += [
            (before.frame_index + step, _mix(before.box, after.box, step / frames))
            for step in range(1, frames)
        ]
        boxes.append((after.frame_index, after.box))
    score = sum(one.score for one in seen) / len(seen)
    return Track(seen[0].label, score, len(seen), tuple(boxes))


def _mix(a: Box, b: Box, share: float) -> Box:
    return Box(*(x + (y - x) * share for x, y in zip(_sides(a), _sides(b), strict=True)))


def _sides(box: Box) -> tuple[float, float, float, float]:
    return box.x1_px, box.y1_px, box.x2_px, box.y2_px


def _order(candidate: Candidate) -> tuple[int, tuple[float, float, float, float], str, float]:
    return candidate.frame_index, _sides(candidate.box), candidate.label, candidate.score
