"""Intervals, bands and ranks: by hand, by properties, and against scipy."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.scores import Evaluation, Scorecard, Signature, Submission, VideoScore
from sitegen.score import scorecard
from sitegen.uncertainty import (
    Interval,
    Key,
    bands,
    competition_ranks,
    flipped_means,
    on_grid,
    randomisation_p,
    resampled,
    uncertainties,
    video_columns,
)

SIGNATURE = Signature("1", "fake", "0" * 64, "1" * 64, 10, 0.8)
Real = NDArray[np.float64]


def evaluation(
    name: str,
    besm: Sequence[float],
    sam: Sequence[float] | None = None,
    found: Sequence[int] | None = None,
    hazards: Sequence[int] | None = None,
    signature: Signature = SIGNATURE,
) -> Evaluation:
    """One video a score; by default one hazard in each, found when the score is over 0.8."""
    sam = besm if sam is None else sam
    hazards = [1] * len(besm) if hazards is None else hazards
    found = [int(score > 0.8) for score in besm] if found is None else found
    videos = tuple(
        VideoScore(f"v{n:04}", 1, h, f, b, b, s, b, s, b > 0.8)
        for n, (b, s, f, h) in enumerate(zip(besm, sam, found, hazards, strict=True))
    )
    return Evaluation(
        Submission(name, "", "", "2026-01-01", "csv", ()), (), videos, scorecard(videos, signature)
    )


def _scores(seed: int, n: int = 60, shift: float = 0.0) -> list[float]:
    chance = np.random.default_rng(seed)
    return np.clip(chance.beta(2, 3, n) + shift, 0, 1).tolist()


def quantile_error(spread: float, resamples: int) -> float:
    """Five standard errors of the difference of two 2.5 % quantiles of near-normal resamples.

    The q-quantile of R draws has variance q (1 - q) / (R f**2), where f is the density at the
    quantile: 0.0584 / spread for a normal with this standard deviation.
    """
    return 5 * math.sqrt(2 * 0.025 * 0.975 / resamples) * spread / 0.0584


def share_error(p: float, resamples: int) -> float:
    """Five standard errors of a share p of the resamples, and the (count + 1) / (R + 1)."""
    return 5 * math.sqrt(p * (1 - p) / resamples) + 1 / resamples


def test_intervals_agree_with_scipy() -> None:
    one = evaluation("one", _scores(1), _scores(2))
    found = uncertainties([one], resamples=10_000)[0]
    for key in ("besm", "sam", "detection_rate"):
        name = "detected" if key == "detection_rate" else key
        values = np.array([float(getattr(video, name)) for video in one.videos])
        theirs = scipy.stats.bootstrap(
            (values,), np.mean, n_resamples=10_000, method="percentile", rng=np.random.default_rng(7)
        )
        ours: Interval = getattr(found, key)
        # A rate moves in steps of 1 / N.
        error = quantile_error(float(theirs.standard_error), 10_000) + (1 / 60 if name == "detected" else 0)
        assert ours.low == pytest.approx(theirs.confidence_interval.low, abs=error)
        assert ours.high == pytest.approx(theirs.confidence_interval.high, abs=error)


def test_hazard_recall_is_a_ratio_of_sums_as_in_scipy() -> None:
    chance = np.random.default_rng(3)
    hazards = chance.integers(0, 4, 80)
    found = chance.binomial(hazards, 0.4)
    one = evaluation("one", _scores(1, 80), found=found.tolist(), hazards=hazards.tolist())

    def recall(found: Real, hazards: Real, axis: int) -> Real:
        return np.asarray(found.sum(axis=axis) / hazards.sum(axis=axis))

    theirs = scipy.stats.bootstrap(
        (found, hazards),
        recall,
        paired=True,
        n_resamples=10_000,
        method="percentile",
        rng=np.random.default_rng(7),
    )
    ours = uncertainties([one], resamples=10_000)[0].hazard_recall
    assert ours is not None
    error = quantile_error(float(theirs.standard_error), 10_000) + 1 / hazards.sum()
    assert ours.low == pytest.approx(theirs.confidence_interval.low, abs=error)
    assert ours.high == pytest.approx(theirs.confidence_interval.high, abs=error)


def test_equal_scores_have_no_spread() -> None:
    found = uncertainties([evaluation("one", [0.3] * 7)])[0]
    assert (found.besm.low, found.besm.high) == pytest.approx((0.3, 0.3), abs=1e-12)
    assert found.detection_rate == found.hazard_recall == Interval(0.0, 0.0)
    assert (found.band, found.rank_low, found.rank_high, found.first_share) == (1, 1, 1, 1.0)


def test_two_videos_by_hand() -> None:
    # Of four equally likely resamples one holds 0 only, one 1 only: 25 % each, so the ends are reached.
    found = uncertainties([evaluation("one", [0.0, 1.0])])[0]
    assert found.besm == Interval(0.0, 1.0)


def test_resamples_without_a_hazard_are_left_out() -> None:
    # One hazard in two videos: it is found whenever it is drawn.
    one = evaluation("one", [0.0, 1.0], found=[0, 1], hazards=[0, 1])
    columns = video_columns([one])
    drawn = resampled(columns, 1_000, 0)
    assert (drawn["hazard_recall"] == 1.0).all()
    assert drawn["besm"].shape == (1, 1_000)
    assert drawn["hazard_recall"].shape[1] == pytest.approx(750, abs=1_000 * share_error(0.75, 1_000))
    assert uncertainties([one])[0].hazard_recall == Interval(1.0, 1.0)


def test_without_any_hazard() -> None:
    none = [0] * 5
    rows = [evaluation("a", [1.0] * 5, found=none, hazards=none), evaluation("b", [0.0] * 5, hazards=none)]
    for found in uncertainties(rows, "hazard_recall"):
        assert found.hazard_recall is None
        assert (found.band, found.rank_low, found.rank_high, found.first_share) == (1, 1, 1, 1.0)
    assert [found.rank_high for found in uncertainties(rows)] == [1, 2]


def test_numbers_depend_on_neither_order_nor_company() -> None:
    board = [evaluation(f"s{n}", _scores(n, 40), _scores(n + 50, 40)) for n in range(9)]
    found = uncertainties(board)
    assert uncertainties(board) == found
    assert uncertainties(board[::-1])[::-1] == found
    mixed = [4, 0, 8, 2, 6, 1, 3, 5, 7]
    assert uncertainties([board[n] for n in mixed]) == [found[n] for n in mixed]
    metrics: tuple[Key, ...] = ("besm", "sam", "detection_rate", "hazard_recall")
    for some in ([0], [3, 1], [5, 6, 7, 8, 0]):
        for alone, n in zip(uncertainties([board[n] for n in some]), some, strict=True):
            assert all(getattr(alone, key) == getattr(found[n], key) for key in metrics)
    assert uncertainties(board, seed=1) != found


def test_twins_share_everything() -> None:
    board = [evaluation("one", _scores(1)), evaluation("two", _scores(2)), evaluation("twin", _scores(1))]
    one, _, twin = uncertainties(board)
    assert one == twin


def test_rank_stability_by_its_definition() -> None:
    board = [evaluation(f"s{n}", _scores(n, 30, shift=n / 60)) for n in range(6)]
    found = uncertainties(board, resamples=400)
    drawn = resampled(video_columns(board), 400, 0)["besm"]
    for system, one in enumerate(found):
        ranks = sorted(1 + int((drawn[:, r] > drawn[system, r]).sum()) for r in range(400))
        # The smallest rank that 2.5 % (10) or 97.5 % (390) of the resamples do not exceed.
        assert (one.rank_low, one.rank_high) == (ranks[9], ranks[389])
        assert isinstance(one.rank_low, int)
        assert one.first_share == sum(rank == 1 for rank in ranks) / 400
    assert sum(one.first_share for one in found) == pytest.approx(1)  # no two of them ever tie


@given(
    st.lists(st.lists(st.integers(0, 4), min_size=3, max_size=3), min_size=1, max_size=9).map(
        lambda rows: np.array(rows, dtype=np.float64)
    )
)
def test_competition_ranks_are_scipys(values: Real) -> None:
    assert (competition_ranks(values) == scipy.stats.rankdata(-values, method="min", axis=0)).all()


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.randoms())
def test_sums_on_the_grid_are_exact_in_any_order(scores: list[float], chance: object) -> None:
    gridded = on_grid(np.array(scores), len(scores))
    assert np.abs(gridded - scores).max() <= 2.0**-46
    shuffled = gridded.copy()
    chance.shuffle(shuffled)  # type: ignore[attr-defined]
    assert sum(gridded.tolist()) == sum(shuffled.tolist()) == math.fsum(gridded.tolist())
    assert (on_grid(np.arange(9.0), 1_000_000) == np.arange(9.0)).all()


@pytest.mark.parametrize("seed", range(4))
def test_randomisation_agrees_with_scipys_exact_test(seed: int) -> None:
    chance = np.random.default_rng(seed)
    values = on_grid(chance.random((9, 2)) + np.array([0.1, 0.0]), 9)

    def difference(a: Real, b: Real, axis: int) -> Real:
        return np.asarray(a.mean(axis=axis) - b.mean(axis=axis))

    exact = scipy.stats.permutation_test(
        (values[:, 0], values[:, 1]), difference, permutation_type="samples", n_resamples=np.inf
    ).pvalue
    ours = randomisation_p(np.subtract(*values.mean(axis=0)), *flipped_means(values, 10_000, seed))
    assert ours == pytest.approx(exact, abs=share_error(exact, 10_000))


def _exact_p(differences: Sequence[float]) -> float:
    signs = np.array(list(itertools.product((1, -1), repeat=len(differences))))
    return float((np.abs(signs @ differences) >= abs(sum(differences)) - 1e-12).mean())


@pytest.mark.parametrize(
    ("differences", "expected"),
    [
        ([0.0, 0.0, 0.0], 1.0),
        ([0.3, -0.1, -0.2], 1.0),  # the sum is 0, though not in floating point
        ([0.1, 0.2, 0.3], 2 / 8),
        ([0.1, 0.2, -0.3, 0.6], 10 / 16),  # two of them only because 0.1 + 0.2 - 0.3 is 0
        ([0.5], 1.0),
    ],
)
def test_randomisation_counts_ties(differences: list[float], expected: float) -> None:
    values = on_grid(np.array([[max(d, 0.0), max(-d, 0.0)] for d in differences]), len(differences))
    ours = randomisation_p(np.subtract(*values.mean(axis=0)), *flipped_means(values, 20_000, 0))
    assert _exact_p(differences) == expected
    assert ours == pytest.approx(expected, abs=share_error(expected, 20_000))
    assert (ours == 1.0) == (expected == 1.0)


def _bands(*rows: Sequence[float]) -> list[int]:
    return bands(on_grid(np.array(rows, dtype=np.float64).T, len(rows[0])), 1_000, 0)


def test_bands_by_hand() -> None:
    # Better in each of 20 videos: 2 of 2**20 sign patterns are as extreme. In each of 4: 2 of 16.
    assert _bands([0.9] * 20, [0.8] * 20, [0.8] * 20, [0.1] * 20) == [1, 2, 2, 4]
    assert _bands([0.9] * 4, [0.8] * 4, [0.8] * 4, [0.1] * 4) == [1, 1, 1, 1]
    assert _bands([0.5]) == [1]


def test_a_band_is_measured_from_its_first() -> None:
    # Better in 5 of 20 videos, then in 5 others, and never worse: 2 of 2**5 patterns, p = 0.06; the
    # first against the third: 2 of 2**10, p = 0.002.
    first, second, third = [1.0] * 20, [0.0] * 5 + [1.0] * 15, [0.0] * 10 + [1.0] * 10
    assert _bands(first, second) == [1, 1]
    assert _bands(second, third) == [1, 1]
    assert _bands(first, second, third) == [1, 1, 3]


def test_bands_follow_the_key_and_the_names() -> None:
    good, bad = [0.9] * 20, [0.1] * 20
    rows = [
        evaluation("c", bad, good, found=[0] * 20),
        evaluation("b", good, bad, found=[0] * 20),
        evaluation("a", good, bad, found=[1] * 20),
    ]
    assert [one.band for one in uncertainties(rows)] == [3, 1, 1]
    assert [one.band for one in uncertainties(rows, "sam")] == [1, 2, 2]
    assert [one.band for one in uncertainties(rows, "hazard_recall")] == [2, 2, 1]
    assert [one.band for one in uncertainties(rows, "detection_rate")] == [3, 1, 1]


@settings(max_examples=30)
@given(st.integers(0, 10**6), st.integers(1, 8), st.integers(1, 12))
def test_bands_are_contiguous_and_so_are_the_facts(seed: int, systems: int, videos: int) -> None:
    chance = np.random.default_rng(seed)
    board = [evaluation(f"s{n}", (chance.integers(0, 11, videos) / 10).tolist()) for n in range(systems)]
    found = uncertainties(board, resamples=50)
    pairs = zip(board, found, strict=True)
    ordered = sorted(pairs, key=lambda pair: (-pair[0].card.besm, pair[0].submission.name))
    for above, (place, (_, one)) in zip([None, *ordered], enumerate(ordered, start=1), strict=False):
        assert one.band == place or (above is not None and one.band == above[1].band)
        assert one.besm.low <= one.besm.high
        assert 1 <= one.rank_low <= one.rank_high <= systems
        assert 0 <= one.first_share <= 1


def test_what_cannot_be_resampled() -> None:
    assert uncertainties([]) == []
    one = evaluation("one", [0.5, 0.6])
    with pytest.raises(ValueError, match="'one' and 'two'"):
        uncertainties([one, evaluation("two", [0.5])])
    with pytest.raises(ValueError, match="same videos"):
        uncertainties([one, dataclasses.replace(one, videos=one.videos[::-1])])
    with pytest.raises(ValueError, match="same videos"):
        uncertainties([one, evaluation("two", [0.5, 0.6], hazards=[1, 2])])
    with pytest.raises(ValueError, match="no videos"):
        uncertainties([Evaluation(one.submission, (), (), Scorecard(0, 0, 0, 0, 0, SIGNATURE))])
    with pytest.raises(ValueError, match="0 resamples"):
        uncertainties([one], resamples=0)
    other = evaluation("two", [0.5, 0.6], signature=dataclasses.replace(SIGNATURE, threshold=0.7))
    with pytest.raises(InputError, match="signatures differ"):
        uncertainties([one, other])


def test_batches_change_nothing_but_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    board = [evaluation(f"s{n}", _scores(n, 25)) for n in range(3)]
    whole = uncertainties(board, resamples=300)
    monkeypatch.setattr("sitegen.uncertainty._BATCH_DRAWS", 100)
    parts = uncertainties(board, resamples=300)
    for one, other in zip(parts, whole, strict=True):
        assert one.besm.low == pytest.approx(other.besm.low, abs=0.05)
    assert resampled(video_columns(board), 300, 0)["besm"].shape == (3, 300)
