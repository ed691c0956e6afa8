"""COOOL's three figures for a results file, by the challenge's published rules.

Official (the rules in the challenge's repository): driver state, correct frames / all frames; hazards, per
frame, correct / max(known, predicted); names, per frame, correct / max(known, predicted), of which 35
characters count; the final score is a macro average. The scorer itself is not published, so these are ours:

- A figure is the mean over the frames of a video, then over videos; the score is the mean of those of the
  three figures for which there is truth. `per_frame` is the mean over all frames at once.
- A frame with neither a known nor a predicted hazard (0/0) counts in no mean. Silence is right there and
  earns nothing, a false alarm counts as 0.
- A name is right when it shares a word with the label of a known hazard of the frame (its description
  where there is no label). Each known hazard is named once, whatever track the name stands with.
- The truth's hazards stand from `first_frame` to `last_frame`, open ends reach to the clip's. Frames with a
  hazard that has no track id are left out of the hazards' figure: no track could be right.
- What a file says of no frame is no hazard, and a state that has not changed.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from pipeline.records import TruthHazard
from sitegen.coool_results import SILENT, FrameSay, Results
from sitegen.coool_write import NAME_CHARS

FIGURES = ("driver_state", "hazards", "names")

_WORD = re.compile(r"\w+")
_STOP_WORDS = "a an the of on in at to by for from with and or is are it its our"
_STOP = frozenset(_STOP_WORDS.split())


@dataclass(frozen=True, slots=True)
class VideoFigures:
    """A video's sum of frame scores and the number of frames that counted, for each figure with truth."""

    video_id: str
    sums: Mapping[str, float]
    frames: Mapping[str, int]

    def mean(self, figure: str) -> float | None:
        """The figure of this video in [0, 1], None where no frame counted."""
        return self.sums[figure] / self.frames[figure] if self.frames.get(figure) else None


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure over all videos, in [0, 1]: `value` of videos alike, `per_frame` of frames alike."""

    value: float
    per_frame: float
    videos: int
    frames: int


@dataclass(frozen=True, slots=True)
class CooolScore:
    """The figures for which there is truth, their mean, and each video's, sorted."""

    figures: Mapping[str, Figure]
    macro: float | None
    videos: tuple[VideoFigures, ...]


def coool_score(
    results: Results,
    truth: Sequence[TruthHazard],
    driver_states: Mapping[str, int | None],
    frame_counts: Mapping[str, int],
) -> CooolScore:
    """Score a results file against every video of `truth`.

    `driver_states` has the frame of the change, None for never, for the videos of which it is known;
    `frame_counts` the length of every video of the truth. Frames past it are not looked at.
    """
    hazards: dict[str, list[TruthHazard]] = {}
    for hazard in truth:
        hazards.setdefault(hazard.video_id, []).append(hazard)
    videos = []
    for video in sorted(hazards):
        said = results.videos.get(video, {})
        says = [said.get(frame, SILENT) for frame in range(frame_counts[video])]
        scores = _hazard_scores(says, [row for row in hazards[video] if not row.is_no_hazard])
        if video in driver_states:
            at = driver_states[video]
            scores["driver_state"] = [
                float(say.changed == (at is not None and frame >= at)) for frame, say in enumerate(says)
            ]
        sums = {name: sum(values) for name, values in scores.items()}
        videos.append(VideoFigures(video, sums, {name: len(values) for name, values in scores.items()}))
    figures = {name: figure for name in FIGURES if (figure := _figure(videos, name))}
    macro = sum(figure.value for figure in figures.values()) / len(figures) if figures else None
    return CooolScore(figures, macro, tuple(videos))


def _figure(videos: Sequence[VideoFigures], name: str) -> Figure | None:
    means = [mean for video in videos if (mean := video.mean(name)) is not None]
    if not means:
        return None
    frames = sum(video.frames.get(name, 0) for video in videos)
    total = sum(video.sums.get(name, 0.0) for video in videos)
    return Figure(sum(means) / len(means), total / frames, len(means), frames)


def _hazard_scores(says: Sequence[FrameSay], hazards: Sequence[TruthHazard]) -> dict[str, list[float]]:
    """The scores of the frames that count, for tracks and for names."""
    scores: dict[str, list[float]] = {"hazards": [], "names": []}
    for frame, say in enumerate(says):
        known = [row for row in hazards if _stands(row, frame)]
        names = [row.label or row.description for row in known]
        tracks = {row.track_id for row in known if row.track_id is not None}
        if (known or say.tracks) and all(row.track_id is not None for row in known):
            scores["hazards"].append(_share(len(tracks & set(say.tracks)), len(tracks), len(say.tracks)))
        if known or say.names:
            right = named(tuple(names), say.names)
            scores["names"].append(_share(right, len(names), len(say.names)))
    return scores


def _stands(hazard: TruthHazard, frame: int) -> bool:
    first, last = hazard.first_frame or 0, hazard.last_frame
    return first <= frame and (last is None or frame <= last)


def _share(right: int, known: int, predicted: int) -> float:
    return right / max(known, predicted)


@lru_cache(maxsize=100_000)
def named(known: tuple[str, ...], predicted: tuple[str, ...]) -> int:
    """How many known hazards are named, each by another of the predicted names: the most there can be."""
    wanted = [_words(name) for name in known]
    fits = [
        [place for place, words in enumerate(wanted) if words & _words(name[:NAME_CHARS])]
        for name in predicted
    ]
    taken: dict[int, int] = {}

    def take(name: int, tried: set[int]) -> bool:
        for place in fits[name]:
            if place not in tried:
                tried.add(place)
                if place not in taken or take(taken[place], tried):
                    taken[place] = name
                    return True
        return False

    return sum(take(name, set()) for name in range(len(predicted)))


@lru_cache(maxsize=100_000)
def _words(text: str) -> frozenset[str]:
    """The words of a name that say something, in lower case, without the s of a plural."""
    words = {word for word in _WORD.findall(text.casefold()) if word not in _STOP}
    return frozenset(word[:-1] if len(word) > 3 and word.endswith("s") else word for word in words)
