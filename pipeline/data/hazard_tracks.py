"""Which tracks are hazards, in which frames, under which name: COOOL's second task, from a run.

The verification (paper) ties a prediction to the tracks whose snippets were detected for its label, at
the sampled frames. Ours is what follows from that for every frame: a track that was tied is a hazard in
all frames in which it has a box, not only from the first sampled frame on. The verification says what a
thing is, not since when it is dangerous, and it looks at every twelfth frame or so, and at no small snippet.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.records import Match, Prediction, TrackBox


@dataclass(frozen=True, slots=True)
class HazardTrack:
    """A track that is a hazard: the frames with a box of it, rising, and what it is called.

    `sampled` counts the sampled frames in which it was detected, `cosine` in [-1, 1] is their mean
    similarity to the label (0 where the run has no matches of it).
    """

    video_id: str
    track_id: str
    description: str
    label: str
    frame_indices: tuple[int, ...]
    sampled: int
    cosine: float

    @property
    def first_frame(self) -> int:
        """The first frame with a box."""
        return self.frame_indices[0]

    @property
    def last_frame(self) -> int:
        """The last frame with a box."""
        return self.frame_indices[-1]


def hazard_tracks(
    predictions: Iterable[Prediction], matches: Iterable[Match], boxes: Iterable[TrackBox]
) -> dict[str, list[HazardTrack]]:
    """The hazard tracks of each video that has some, most confident first.

    Confidence (ours): the more sampled frames it was detected in, then the higher its mean cosine, then
    the rank of its prediction and its id. A track has one name, that of the prediction it is most
    confident for. A tied track without any box is left out: there is nothing that it could mark.
    """
    frames: dict[tuple[str, str], set[int]] = defaultdict(set)
    for box in boxes:
        frames[box.video_id, box.track_id].add(box.frame_index)
    cosines = _cosines(matches)
    found: dict[tuple[str, str], tuple[tuple[float, ...], HazardTrack]] = {}
    for prediction in sorted(predictions, key=lambda row: (row.video_id, row.rank)):
        name = prediction.label or prediction.description
        for track in sorted(set(prediction.track_ids)):
            place = (prediction.video_id, track)
            if not frames.get(place):
                continue
            seen = cosines.get((*place, _same(name)), ())
            sampled, cosine = len(seen), float(np.mean(seen)) if len(seen) else 0.0
            hazard = HazardTrack(
                prediction.video_id,
                track,
                prediction.description,
                prediction.label or "",
                tuple(sorted(frames[place])),
                sampled,
                cosine,
            )
            order = (-sampled, -cosine, prediction.rank)
            if place not in found or order < found[place][0]:
                found[place] = (order, hazard)
    videos: dict[str, list[HazardTrack]] = defaultdict(list)
    for place, (_, hazard) in sorted(found.items(), key=lambda item: (item[1][0], item[0])):
        videos[place[0]].append(hazard)
    return {video: videos[video] for video in sorted(videos)}


def hazards_by_frame(tracks: Sequence[HazardTrack], frame_count: int) -> list[list[HazardTrack]]:
    """The hazards of each of a video's frames, in the order of `tracks`; boxes past the end are ignored."""
    frames: list[list[HazardTrack]] = [[] for _ in range(frame_count)]
    for track in tracks:
        for index in track.frame_indices:
            if 0 <= index < frame_count:
                frames[index].append(track)
    return frames


def _cosines(matches: Iterable[Match]) -> Mapping[tuple[str, str, str], Sequence[float]]:
    """Video, track and label -> the cosines where it was detected."""
    found: dict[tuple[str, str, str], list[tuple[int, float]]] = defaultdict(list)
    for match in matches:
        if match.detected:
            found[match.video_id, match.track_id, _same(match.label)].append(
                (match.frame_index, match.cosine)
            )
    return {place: [cosine for _, cosine in sorted(rows)] for place, rows in found.items()}


def _same(label: str) -> str:
    return " ".join(label.casefold().split())
