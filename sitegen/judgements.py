"""How far the metrics agree with people who saw two captions, a clip, and no names. Pure NumPy; no I/O.

A vote says which of two systems' captions describes the hazard of a video better. A metric agrees with
it (concordant) when it scores that side higher in that video, and disagrees (discordant) when it scores
it lower. Kendall's tau over such judgements is (concordant - discordant) / (concordant + discordant),
with ties on either side left out: the variant of WMT13 (tau_13 in Deutsch et al. 2023, "Ties Matter"),
the same as Goodman and Kruskal's gamma. It does not punish a metric for ties, and detection has many,
so their number always stands beside it. The interval is a percentile bootstrap over voter and video:
votes of one person on one video are drawn together, since they are not independent. Seed and 95 % are ours.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from pipeline.scores import Evaluation, VideoScore
from sitegen.language import N_, fixed, whole
from sitegen.language import gettext as _
from sitegen.numerals import plural
from sitegen.score import Real
from sitegen.uncertainty import SAME, Interval, interval

Choice: TypeAlias = Literal["left", "right", "tie"]
Metric: TypeAlias = Literal["besm", "sam", "detection", "best"]

MIN_DECIDED = 10
"""Below this many concordant and discordant votes there is no tau."""

METRICS: dict[Metric, tuple[str, Callable[[VideoScore], float]]] = {
    "besm": ("BESM", lambda video: video.besm),
    "sam": ("SAM", lambda video: video.sam),
    "detection": (N_("Detection"), lambda video: float(video.detected)),
    "best": (N_("Best similarity"), lambda video: video.best),
}
"""Each metric's name and its value in [0, 1] for a video."""

_SIGNS: dict[Choice, int] = {"left": 1, "right": -1, "tie": 0}
_BATCH_DRAWS = 2**20


@dataclass(frozen=True, slots=True)
class Vote:
    """One judgement: whose captions of a video are better, those of `left` or of `right` (slugs).

    `voter` is the seed that tells voters apart; the hashes are of the predictions that were shown.
    """

    voter: int
    video_id: str
    left: str
    right: str
    choice: Choice
    left_sha256: str
    right_sha256: str


@dataclass(frozen=True, slots=True)
class Votes:
    """The votes on captions of the board, in a fixed order, and how many others are kept apart."""

    current: tuple[Vote, ...] = ()
    apart: int = 0


@dataclass(frozen=True, slots=True)
class Agreement:
    """Kendall's tau of a metric with the votes, in [-1, 1], and its 95 % interval.

    Both are None with fewer than 10 votes that are concordant or discordant. `vote_ties` are votes that
    chose no side, `metric_ties` those that chose one where the metric has none.
    """

    metric: Metric
    tau: float | None
    interval: Interval | None
    concordant: int
    discordant: int
    vote_ties: int
    metric_ties: int


@dataclass(frozen=True, slots=True)
class AgreementLine:
    """A metric's agreement as a page prints it; `tau` is "–" when there are too few votes."""

    name: str
    tau: str
    interval: str
    n: str
    ties: str


@dataclass(frozen=True, slots=True)
class AgreementTable:
    """What a page prints about votes; without votes `summary` and `lines` are empty."""

    summary: str = ""
    lines: tuple[AgreementLine, ...] = ()


def agreement(
    votes: Sequence[Vote],
    evaluations: Mapping[str, Evaluation],
    *,
    resamples: int = 1000,
    seed: int = 0,
) -> list[Agreement]:
    """How far each metric agrees with the votes; `evaluations` maps slugs to scores.

    Votes on a system or a video that is not scored are left out. The same seed gives the same numbers;
    neither the order of the votes nor their sides change any. Raises ValueError without a resample.
    """
    if resamples < 1:
        raise ValueError(f"{resamples} resamples; expected at least 1")
    scores = {slug: {video.video_id: video for video in one.videos} for slug, one in evaluations.items()}
    clusters: dict[tuple[int, str], int] = {}
    rows: list[tuple[int, int, list[float]]] = []
    for vote in sorted(votes, key=lambda vote: (vote.voter, vote.video_id)):
        left, right = (scores.get(slug, {}).get(vote.video_id) for slug in (vote.left, vote.right))
        if left is None or right is None:
            continue
        # Only votes that choose a side are drawn: those that do not change nothing, the interval neither.
        place = (
            clusters.setdefault((vote.voter, vote.video_id), len(clusters)) if vote.choice != "tie" else -1
        )
        apart = [value(left) - value(right) for _, value in METRICS.values()]
        rows.append((place, _SIGNS[vote.choice], apart))
    places = np.array([place for place, _, _ in rows], dtype=np.int64)
    signs = np.array([sign for _, sign, _ in rows], dtype=np.int64)
    apart_by = np.array([apart for _, _, apart in rows], dtype=np.float64).reshape(len(rows), len(METRICS))
    metric_signs = np.where(np.abs(apart_by) <= SAME, 0, np.sign(apart_by)).astype(np.int64)
    agrees = signs[:, np.newaxis] * metric_signs  # 1 concordant, -1 discordant, 0 neither
    decided = signs != 0
    sums = np.zeros((2, len(clusters), len(METRICS)))
    for part, sign in enumerate((1, -1)):
        np.add.at(sums[part], places[decided], agrees[decided] == sign)
    drawn = _resampled(sums, resamples, seed)
    return [
        _agreement(metric, sums[:, :, place], drawn[:, :, place], int((~decided).sum()), int(decided.sum()))
        for place, metric in enumerate(METRICS)
    ]


def _agreement(metric: Metric, sums: Real, drawn: Real, vote_ties: int, decided: int) -> Agreement:
    """One metric: `sums` (2, K) and `drawn` (2, R) hold concordant and discordant votes."""
    concordant, discordant = (int(total) for total in sums.sum(axis=1))
    n, tau, span = concordant + discordant, None, None
    if n >= MIN_DECIDED:
        tau = (concordant - discordant) / n
        kept = drawn[:, drawn.sum(axis=0) > 0]
        span = interval((kept[0] - kept[1]) / kept.sum(axis=0))
    return Agreement(metric, tau, span, concordant, discordant, vote_ties, decided - n)


def _resampled(sums: Real, resamples: int, seed: int) -> Real:
    """`sums` (2, K, M) over K clusters drawn with replacement: (2, R, M)."""
    n_clusters = sums.shape[1]
    if not n_clusters:
        return np.zeros((2, resamples, sums.shape[2]))
    rng = np.random.default_rng(seed)
    size = max(1, _BATCH_DRAWS // n_clusters)
    parts = []
    for start in range(0, resamples, size):
        drawn = rng.integers(n_clusters, size=(min(size, resamples - start), n_clusters))
        drawn += np.arange(len(drawn))[:, np.newaxis] * n_clusters
        counts = np.bincount(drawn.ravel(), minlength=drawn.size).reshape(drawn.shape).astype(np.float64)
        parts.append(counts @ sums)
    return np.concatenate(parts, axis=1)


def agreement_table(votes: Votes, evaluations: Mapping[str, Evaluation]) -> AgreementTable:
    """The method page's lines and a sentence on the votes; `evaluations` maps slugs to scores.

    Empty without votes, and when no video has a score (the organiser keeps the truth back).
    """
    current = votes.current
    if not current or not any(one.videos for one in evaluations.values()):
        return AgreementTable()
    found = agreement(current, evaluations)
    voters, videos = len({vote.voter for vote in current}), len({vote.video_id for vote in current})
    summary = _("{votes} by {voters} on {videos}.").format(
        votes=plural(len(current), "{n} vote", "{n} votes"),
        voters=plural(voters, "{n} voter", "{n} voters"),
        videos=plural(videos, "{n} video", "{n} videos"),
    )
    if ties := found[0].vote_ties:
        summary += " " + plural(ties, "{n} tie left out.", "{n} ties left out.")
    if votes.apart:
        summary += " " + plural(
            votes.apart,
            "{n} vote on captions that have changed since, kept apart.",
            "{n} votes on captions that have changed since, kept apart.",
        )
    return AgreementTable(summary, tuple(_line(one) for one in found))


def _line(one: Agreement) -> AgreementLine:
    tau = "–" if one.tau is None else _signed(one.tau)
    span = "–"
    if one.interval:
        low, high = _signed(one.interval.low), _signed(one.interval.high)
        span = _("{low} to {high}").format(low=low, high=high)
    name = _(METRICS[one.metric][0])
    return AgreementLine(name, tau, span, whole(one.concordant + one.discordant), whole(one.metric_ties))


def _signed(value: float) -> str:
    """Two digits, with a true minus; never "−0.00"."""
    return fixed(round(value, 2), 2).replace("-", "\u2212")
