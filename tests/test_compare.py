"""Two systems: by hand, by symmetry, against scipy and against every possible resample."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
import scipy.stats
from numpy.typing import NDArray

from pipeline.errors import InputError
from sitegen.compare import bootstrap_p, compare
from sitegen.uncertainty import Interval, uncertainties
from tests.test_uncertainty import SIGNATURE, evaluation, quantile_error, share_error

Real = NDArray[np.float64]


def _mean_difference(a: Real, b: Real, axis: int) -> Real:
    return np.asarray(a.mean(axis=axis) - b.mean(axis=axis))


def _pair(seed: int, n: int) -> tuple[Real, Real]:
    chance = np.random.default_rng(seed)
    common = chance.beta(2, 3, n)
    return np.clip(common + chance.normal(0.03, 0.15, n), 0, 1), common


def test_by_hand() -> None:
    a = evaluation("a", [0.9, 0.5, 0.4, 0.2], [0.1] * 4, found=[1, 0, 2, 0], hazards=[1, 1, 2, 0])
    b = evaluation("b", [0.5, 0.9, 0.4 + 1e-12, 0.1], [0.2] * 4, found=[0, 0, 1, 0], hazards=[1, 1, 2, 0])
    found = compare(a, b)
    assert list(found) == ["besm", "sam", "detection_rate", "hazard_recall"]
    besm = found["besm"]
    assert (besm.key, besm.a, besm.b) == ("besm", pytest.approx(0.5), pytest.approx(0.475))
    assert besm.difference == pytest.approx(0.025)
    assert (besm.wins, besm.losses, besm.ties) == (2, 1, 1)
    sam = found["sam"]
    assert (sam.wins, sam.losses, sam.ties) == (0, 4, 0)
    # The same difference in every video: no resample shows another one.
    assert (sam.interval.low, sam.interval.high) == pytest.approx((-0.1, -0.1))
    assert sam.p_bootstrap == 1 / 10_001
    assert sam.p_randomisation == pytest.approx(2 / 16, abs=share_error(2 / 16, 10_000))
    detected = found["detection_rate"]
    assert (detected.difference, detected.wins, detected.losses, detected.ties) == (0, 1, 1, 2)
    assert (detected.p_bootstrap, detected.p_randomisation) == (1.0, 1.0)
    recall = found["hazard_recall"]
    assert (recall.a, recall.b, recall.difference) == (0.75, 0.25, 0.5)
    assert (recall.wins, recall.losses, recall.ties) == (2, 0, 2)


def test_a_system_against_itself() -> None:
    a = evaluation("a", _pair(1, 30)[0].tolist())
    for one in compare(a, dataclasses.replace(a)).values():
        assert (one.difference, one.interval) == (0, Interval(0, 0))
        assert (one.p_bootstrap, one.p_randomisation) == (1, 1)
        assert (one.wins, one.losses, one.ties) == (0, 0, 30)


def test_the_other_way_round() -> None:
    a, b = (evaluation(name, row.tolist()) for name, row in zip("ab", _pair(2, 50), strict=True))
    there, back = compare(a, b, resamples=999), compare(b, a, resamples=999)
    for key, one in there.items():
        other = back[key]
        assert (one.a, one.b, one.difference) == (other.b, other.a, -other.difference)
        ends = pytest.approx((-other.interval.high, -other.interval.low), abs=1e-12)
        assert (one.interval.low, one.interval.high) == ends
        assert (one.p_bootstrap, one.p_randomisation) == (other.p_bootstrap, other.p_randomisation)
        assert (one.wins, one.losses, one.ties) == (other.losses, other.wins, other.ties)
        assert one.wins + one.losses + one.ties == 50


@pytest.mark.parametrize("seed", range(3))
def test_interval_agrees_with_scipys_paired_bootstrap(seed: int) -> None:
    a, b = _pair(seed, 80)
    theirs = scipy.stats.bootstrap(
        (a, b),
        _mean_difference,
        paired=True,
        n_resamples=10_000,
        method="percentile",
        rng=np.random.default_rng(seed),
    )
    ours = compare(evaluation("a", a.tolist()), evaluation("b", b.tolist()))["besm"].interval
    error = quantile_error(float(theirs.standard_error), 10_000)
    assert ours.low == pytest.approx(theirs.confidence_interval.low, abs=error)
    assert ours.high == pytest.approx(theirs.confidence_interval.high, abs=error)


@pytest.mark.parametrize("seed", range(4))
def test_randomisation_agrees_with_scipys_exact_test(seed: int) -> None:
    a, b = _pair(seed, 10)
    found = compare(evaluation("a", a.tolist()), evaluation("b", b.tolist()))
    for key, values in (("besm", (a, b)), ("hazard_recall", (a > 0.8, b > 0.8))):
        exact = scipy.stats.permutation_test(
            [row.astype(np.float64) for row in values],
            _mean_difference,
            permutation_type="samples",
            n_resamples=np.inf,
        ).pvalue
        assert found[key].p_randomisation == pytest.approx(exact, abs=share_error(exact, 10_000))


@pytest.mark.parametrize("seed", range(4))
def test_bootstrap_agrees_with_all_resamples_of_five_videos(seed: int) -> None:
    a, b = _pair(seed, 5)
    per_video = a - b
    observed = per_video.mean()
    every = np.array([per_video[list(drawn)].mean() for drawn in itertools.product(range(5), repeat=5)])
    exact = (np.abs(every - observed) >= abs(observed) - 1e-12).mean()
    found = compare(evaluation("a", a.tolist()), evaluation("b", b.tolist()))["besm"]
    assert found.p_bootstrap == pytest.approx(exact, abs=share_error(exact, 10_000))


def test_bootstrap_p_of_many_videos_is_that_of_a_normal() -> None:
    # Central limit: the resampled difference is normal, with the standard error of the mean.
    a, b = _pair(5, 2_000)
    a = np.clip(b + (a - b) / 3, 0, 1)
    shift = (a - b).mean() / ((a - b).std() / math.sqrt(2_000))
    b = b + (a - b).mean() * (1 - 1.5 / shift)  # a difference of one and a half standard errors
    found = compare(evaluation("a", a.tolist()), evaluation("b", b.tolist()))["besm"]
    expected = 2 * scipy.stats.norm.sf(abs((a - b).mean()) / ((a - b).std() / math.sqrt(2_000)))
    assert 0.1 < expected < 0.2
    assert found.p_bootstrap == pytest.approx(expected, abs=share_error(expected, 10_000) + 0.005)


def test_bootstrap_p_by_hand() -> None:
    assert bootstrap_p(0.5, np.array([0.5, 0.0, 1.0, 0.9, 0.2])) == 3 / 6
    assert bootstrap_p(-0.5, np.array([-0.5, -0.4, 0.0])) == 2 / 4
    assert bootstrap_p(0.0, np.array([0.1, -0.1])) == 1


def test_without_a_hazard_there_is_no_recall() -> None:
    none = [0, 0, 0]
    a, b = (evaluation(name, [0.5, 1.0, 0.0], found=none, hazards=none) for name in "ab")
    assert list(compare(a, b)) == ["besm", "sam", "detection_rate"]


def test_the_same_resamples_as_the_board() -> None:
    # Against a system that scores 0 everywhere the difference is the score itself.
    a = evaluation("a", _pair(3, 40)[0].tolist())
    board = uncertainties([a], resamples=500, seed=3)[0]
    one = compare(a, evaluation("zero", [0.0] * 40), resamples=500, seed=3)
    assert (one["besm"].interval, one["hazard_recall"].interval) == (board.besm, board.hazard_recall)
    assert compare(a, evaluation("zero", [0.0] * 40), resamples=500, seed=3) == one


def test_other_signatures_and_other_videos() -> None:
    a = evaluation("a", [0.1, 0.2])
    other = evaluation("b", [0.1, 0.2], signature=dataclasses.replace(SIGNATURE, embedder="other"))
    with pytest.raises(InputError, match=r"signatures differ(.|\n)*a: coooler(.|\n)*b: coooler"):
        compare(a, other)
    with pytest.raises(ValueError, match="same videos"):
        compare(a, evaluation("b", [0.1, 0.2, 0.3]))
