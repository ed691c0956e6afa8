"""How far annotators agree: hazard or none, descriptions, labels and tracks, for each pair of them (ours).

Hazards of a video are matched one to one so that the cosines of their descriptions sum up highest; one
without a partner counts as 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Vectors: TypeAlias = Mapping[str, NDArray[np.float32]]

_EXACT_UP_TO = 6


@dataclass(frozen=True, slots=True)
class Named:
    """A hazard as it is compared."""

    label: str
    description: str
    track_id: str | None = None


Annotated: TypeAlias = Mapping[str, Sequence[Named]]  # video -> its hazards; none: no hazard


@dataclass(frozen=True, slots=True)
class VideoAgreement:
    """Two annotators on one video.

    `n_first` and `n_second` hazards; `cosine` in [-1, 1] (None: not known), `label` and `track` in
    [0, 1] are means over the larger number of hazards: 1 when both saw none, 0 when only one saw any.
    """

    video_id: str
    same_verdict: bool
    n_first: int
    n_second: int
    cosine: float | None
    label: float
    track: float


@dataclass(frozen=True, slots=True)
class PairAgreement:
    """Two annotators on the videos that both finished, most disputed first.

    `verdict` in [0, 1] is the share with the same word on hazard or none, `kappa` (Cohen's) the same
    beyond chance, None where chance explains all. `cosine`, `label` and `track` are means over the
    videos where both saw a hazard, None without any (cosine also when it is not known).
    """

    first: str
    second: str
    verdict: float
    kappa: float | None
    cosine: float | None
    label: float | None
    track: float | None
    videos: tuple[VideoAgreement, ...]

    @property
    def n_videos(self) -> int:
        """How many both finished."""
        return len(self.videos)


@dataclass(frozen=True, slots=True)
class AgreementReport:
    """Every pair with a video in common, by name. `problem` says why there are no cosines, or is empty."""

    pairs: tuple[PairAgreement, ...]
    problem: str = ""


def report(said: Mapping[str, Annotated], vectors: Vectors | None, problem: str = "") -> AgreementReport:
    """The agreement of every two authors; `vectors` holds a unit vector for every description, or is None."""
    pairs = (
        compare(first, second, said[first], said[second], vectors)
        for first, second in combinations(sorted(said), 2)
    )
    return AgreementReport(tuple(pair for pair in pairs if pair.videos), problem)


def compare(
    first: str, second: str, ours: Annotated, theirs: Annotated, vectors: Vectors | None
) -> PairAgreement:
    """The agreement of two authors on the videos of both."""
    videos = [
        compare_video(video_id, ours[video_id], theirs[video_id], vectors)
        for video_id in sorted(ours.keys() & theirs.keys())
    ]
    videos.sort(key=_dispute)
    both = [video for video in videos if video.n_first and video.n_second]
    cosines = [video.cosine for video in both if video.cosine is not None]
    return PairAgreement(
        first,
        second,
        _mean([float(video.same_verdict) for video in videos]) or 0.0,
        kappa([(video.n_first > 0, video.n_second > 0) for video in videos]),
        _mean(cosines),
        _mean([video.label for video in both]),
        _mean([video.track for video in both]),
        tuple(videos),
    )


def compare_video(
    video_id: str, ours: Sequence[Named], theirs: Sequence[Named], vectors: Vectors | None
) -> VideoAgreement:
    """The agreement on one video."""
    count = max(len(ours), len(theirs))
    if not count:
        return VideoAgreement(video_id, True, 0, 0, None if vectors is None else 1.0, 1.0, 1.0)
    alike = _cosines(ours, theirs, vectors)
    matched = match(alike)
    cosine = None if vectors is None else float(sum(alike[row, column] for row, column in matched)) / count
    partners = [(ours[row], theirs[column]) for row, column in matched]
    return VideoAgreement(
        video_id,
        bool(ours) == bool(theirs),
        len(ours),
        len(theirs),
        cosine,
        sum(_folded(one.label) == _folded(other.label) for one, other in partners) / count,
        sum(one.track_id == other.track_id for one, other in partners) / count,
    )


def _cosines(ours: Sequence[Named], theirs: Sequence[Named], vectors: Vectors | None) -> NDArray[np.float64]:
    """(len(ours), len(theirs)); without vectors, 1 for equal labels and 0 else."""
    if vectors is None:
        equal = [[_folded(one.label) == _folded(other.label) for other in theirs] for one in ours]
        return np.array(equal, np.float64).reshape(len(ours), len(theirs))
    if not ours or not theirs:
        return np.zeros((len(ours), len(theirs)))
    left = np.stack([vectors[one.description] for one in ours]).astype(np.float64)
    right = np.stack([vectors[other.description] for other in theirs]).astype(np.float64)
    return left @ right.T


def match(alike: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Pairs (row, column), each used once, as many as the shorter side has, with the highest sum.

    Exact up to 6 on the longer side, else greedy from the highest value; ties go to the first.
    """
    rows, columns = alike.shape
    if rows > columns:
        return sorted((row, column) for column, row in match(alike.T))
    if columns <= _EXACT_UP_TO:
        places = np.arange(rows)
        best = max(permutations(range(columns), rows), key=lambda chosen: _sum(alike, places, chosen))
        return list(enumerate(best))
    pairs: list[tuple[int, int]] = []
    left = alike.astype(np.float64)
    for _ in range(rows):
        row, column = (int(at) for at in np.unravel_index(np.argmax(left), left.shape))
        pairs.append((row, column))
        left[row, :] = left[:, column] = -np.inf
    return sorted(pairs)


def _sum(alike: NDArray[np.float64], rows: NDArray[np.int_], columns: Sequence[int]) -> float:
    return float(alike[rows, list(columns)].sum())


def kappa(verdicts: Sequence[tuple[bool, bool]]) -> float | None:
    """Cohen's kappa of two raters; None without verdicts or where both always say the same one thing."""
    if not verdicts:
        return None
    observed = sum(one == other for one, other in verdicts) / len(verdicts)
    first = sum(one for one, _ in verdicts) / len(verdicts)
    second = sum(other for _, other in verdicts) / len(verdicts)
    chance = first * second + (1 - first) * (1 - second)
    return None if chance == 1 else (observed - chance) / (1 - chance)


def _dispute(video: VideoAgreement) -> tuple[bool, float, float, float, str]:
    return video.same_verdict, video.cosine or 0.0, video.label, video.track, video.video_id


def _folded(label: str) -> str:
    return " ".join(label.casefold().split())


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
