"""When the driver reacts: the frame at which the vehicle begins to slow down (baseline, ours).

COOOL's first task asks for the frame from which the driver has slowed down, avoided or chosen to ignore
a hazard. This baseline sees the first of the three alone: it cuts the motion ahead (ego_motion.py) into
stretches of equal level and takes the first fall to `share` of the level or less. A driver who steers,
who reacts without braking, or who stands the whole time gives none.

The cuts are the exact optimum of squared error plus a price for each cut (optimal partitioning, Jackson
et al. 2005; PELT finds the same). It is written out here because the library for it, `ruptures`, needs
SciPy at run time, which is larger than all of this package and its clips.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from pipeline import __version__
from pipeline.data.ego_motion import Motion, Real, measure
from pipeline.errors import VideoError
from pipeline.files import sha256_file, sha256_of
from pipeline.interfaces import Executor
from pipeline.records import Reaction, TrackBox
from pipeline.tables import BOXES

MAX_FRAMES = 30_000  # the cuts take time with its square


@dataclass(frozen=True, slots=True)
class ReactionSettings:
    """How a fall is told from noise; `share` is of the level before, `least_hz` a motion worth the name."""

    smooth_s: float = 0.2
    least_s: float = 0.5
    price: float = 3.0
    share: float = 0.5
    least_hz: float = 0.05


BASELINE = ReactionSettings()


@dataclass(frozen=True, slots=True)
class ReactionJob:
    """A clip whose driver is looked at: picklable."""

    video_id: str
    clip: Path
    boxes: tuple[TrackBox, ...]
    settings: ReactionSettings = BASELINE

    @property
    def sha256(self) -> str:
        """Hash of all that the result depends on."""
        boxes = BOXES.to_arrow(self.boxes).to_pylist()
        settings = sorted(asdict(self.settings).items())
        return sha256_of(repr([self.video_id, sha256_file(self.clip), boxes, settings, _code()]).encode())


@dataclass(frozen=True, slots=True)
class Reacted:
    """What was found in a clip; `error` is empty when it could be decoded."""

    reaction: Reaction
    error: str = ""


@cache
def _code() -> str:
    here = Path(__file__)
    return __version__ + sha256_file(here) + sha256_file(here.with_name("ego_motion.py"))


def change_points(signal: Real, price: float, least: int) -> list[int]:
    """Where a signal (n,) changes its mean: the first index of each stretch but the first.

    The cuts of least squared error plus `price` for each, no stretch shorter than `least`. Exact; takes
    time with the square of n.
    """
    size = len(signal)
    sums, squares = (np.concatenate([[0.0], np.cumsum(signal**power)]) for power in (1, 2))
    best = np.full(size + 1, np.inf)
    best[0] = -price
    last = np.zeros(size + 1, np.int64)
    for end in range(least, size + 1):
        starts = np.arange(end - least + 1)
        error = squares[end] - squares[starts] - (sums[end] - sums[starts]) ** 2 / (end - starts)
        total = best[starts] + error + price
        last[end] = np.argmin(total)
        best[end] = total[last[end]]
    cuts = []
    at = int(last[size])
    while at > 0:
        cuts.append(at)
        at = int(last[at])
    return cuts[::-1]


def signal_of(motion: Motion, smooth_s: float = BASELINE.smooth_s) -> Real:
    """The motion ahead in 1/s for each frame, (n,): gaps closed in straight lines, single frames smoothed.

    From the flow where at least half of the frames have one, else from the tracks ahead; all 0 when
    neither has.
    """
    size = len(motion.flow_hz)
    known = [np.flatnonzero(np.isfinite(source)) for source in (motion.flow_hz, motion.boxes_hz)]
    for source, places in zip((motion.flow_hz, motion.boxes_hz), known, strict=True):
        if 2 * len(places) >= size > 1:
            filled = np.interp(np.arange(size), places, source[places])
            side = max(1, round(motion.fps_hz * smooth_s / 2))
            padded = np.pad(filled, side, mode="edge")
            windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * side + 1)
            return np.asarray(np.median(windows, axis=1))
    return np.zeros(size)


def reaction_in(
    signal: Real, fps_hz: float, settings: ReactionSettings = BASELINE
) -> tuple[int | None, float]:
    """The first frame at which a signal (n,) begins to fall to `share` of its level, and what share it lost.

    A fall may take several stretches, each lower than the one before; it begins with the first of them.
    (None, 0) when there is none. Raises VideoError for more than 30,000 frames.
    """
    if len(signal) > MAX_FRAMES:
        raise VideoError(f"found {len(signal):,} frames; expected at most {MAX_FRAMES:,}. Cut the clip.")
    least = max(2, round(fps_hz * settings.least_s))
    if len(signal) < 2 * least:
        return None, 0.0
    # A still picture has no noise at all, and everything would be a change.
    noise = max(
        1.4826 * float(np.median(np.abs(np.diff(signal)))) / np.sqrt(2),
        0.05 * float(np.median(np.abs(signal))),
        0.1 * settings.least_hz,
    )
    # Neighbours share what they were smoothed over, so a stretch has fewer numbers than frames.
    price = settings.price * noise**2 * np.log(len(signal)) * max(1.0, fps_hz * settings.smooth_s)
    cuts = change_points(signal, price, least)
    levels = [float(part.mean()) for part in np.split(signal, cuts)]
    top = 0
    for place in range(1, len(levels)):
        if levels[place] >= levels[place - 1]:
            top = place
        elif levels[top] >= settings.least_hz and levels[place] <= settings.share * levels[top]:
            return cuts[top], min(1.0, 1.0 - levels[place] / levels[top])
    return None, 0.0


def find_reaction(job: ReactionJob) -> Reacted:
    """The driver's reaction in a clip; a clip that cannot be decoded has none, and the reason is said."""
    try:
        motion = measure(job.clip, job.boxes)
        signal = signal_of(motion, job.settings.smooth_s)
        frame, score = reaction_in(signal, motion.fps_hz, job.settings)
    except VideoError as error:
        return Reacted(Reaction(job.video_id, None, 0.0), str(error))
    return Reacted(Reaction(job.video_id, frame, round(score, 4), tuple(np.round(signal, 4).tolist())))


def find_reactions(
    jobs: Sequence[ReactionJob], executor: Executor, done: Callable[[], None] = lambda: None
) -> list[Reacted]:
    """The reaction in every clip, sorted by video; `done` is told of each."""
    found = []
    for result in executor.run(find_reaction, jobs, _lost):
        found.append(result)
        done()
    return sorted(found, key=lambda result: result.reaction.video_id)


def _lost(job: ReactionJob, why: str) -> Reacted:
    return Reacted(Reaction(job.video_id, None, 0.0), why)
