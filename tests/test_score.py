"""Scores from the definition: hand-computed tables, edges, and properties."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.scores import Signature, VideoScore
from sitegen.score import (
    TOLERANCE,
    pair_cosines,
    pair_rows,
    passes,
    score_pairs,
    score_video,
    scorecard,
    unit_rows,
)

SIGNATURE = Signature("1", "fake", "0" * 64, "1" * 64, 1, 0.8)


def _score(*rows: tuple[float, ...], hazards: int = 1, threshold: float = 0.8) -> VideoScore:
    return score_video("v", np.array(rows, dtype=np.float64).reshape(len(rows), hazards), threshold)


# predictions' cosines -> best, worst, mean, BESM, SAM, detected; worked out by hand
TABLE = [
    ((), (0.0, 0.0, 0.0, 0.0, 0.0, False)),
    ((0.5,), (0.5, 0.5, 0.5, 0.5, 0.5, False)),
    ((0.9,), (0.9, 0.9, 0.9, 0.9, 0.9, True)),
    ((0.9, 0.5), (0.9, 0.5, 0.7, 0.7, 0.7, True)),
    ((0.5, 0.5), (0.5, 0.5, 0.5, 0.5, 0.5, False)),
    ((0.9, 0.5, 0.1), (0.9, 0.1, 0.5, 0.5, 0.5, True)),
    ((0.9, 0.5, 0.4), (0.9, 0.4, 0.6, 0.65, 0.6, True)),
    ((0.3, 0.3, 0.6), (0.6, 0.3, 0.4, 0.45, 0.4, False)),
    ((0.2, 0.4, 0.8, 0.6), (0.8, 0.2, 0.5, 0.5, 0.5, False)),
    ((0.1, 0.1, 0.1, 0.9), (0.9, 0.1, 0.3, 0.5, 0.3, True)),
    ((-0.5,), (0.0, 0.0, 0.0, 0.0, 0.0, False)),
    ((-0.5, 0.5), (0.5, 0.0, 0.25, 0.25, 0.25, False)),
    ((-1.0, -0.2, 0.9), (0.9, 0.0, 0.3, 0.45, 0.3, True)),
]


@pytest.mark.parametrize(("cosines", "expected"), TABLE)
def test_one_hazard(cosines: tuple[float, ...], expected: tuple[float | bool, ...]) -> None:
    score = _score(*((cosine,) for cosine in cosines))
    assert (score.n_predictions, score.n_hazards) == (len(cosines), 1)
    found = (score.best, score.worst, score.mean, score.besm, score.sam)
    assert found == pytest.approx(expected[:5], abs=1e-12)
    assert score.detected is expected[5]
    assert score.n_hazards_found == int(score.detected)


def test_besm_and_sam_differ_only_from_three_predictions_on() -> None:
    assert _score((0.9,), (0.4,)).besm == _score((0.9,), (0.4,)).sam
    three = _score((0.9,), (0.5,), (0.4,))
    assert three.besm - three.sam == pytest.approx(0.05)


def test_two_hazards_take_the_best_match() -> None:
    score = _score((0.9, 0.1), (0.2, 0.6), hazards=2)
    assert (score.best, score.worst) == (0.9, 0.6)
    assert score.besm == score.sam == pytest.approx(0.75)
    assert (score.n_hazards, score.n_hazards_found, score.detected) == (2, 1, True)


def test_one_prediction_can_find_two_hazards() -> None:
    score = _score((0.85, 0.95), hazards=2)
    assert (score.best, score.besm, score.n_hazards_found) == (0.95, 0.95, 2)


def test_two_hazards_without_predictions() -> None:
    score = score_video("v", np.zeros((0, 2)), 0.8)
    assert score == VideoScore("v", 0, 2, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


def test_no_hazard_and_nothing_predicted_is_right() -> None:
    score = score_video("v", np.zeros((0, 0)), 0.8)
    assert score == VideoScore("v", 0, 0, 0, 1.0, 1.0, 1.0, 1.0, 1.0, True)


@pytest.mark.parametrize("predictions", [1, 2, 5])
def test_no_hazard_but_something_predicted_is_wrong(predictions: int) -> None:
    score = score_video("v", np.zeros((predictions, 0)), 0.0)
    assert score == VideoScore("v", predictions, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


def test_threshold_is_strict() -> None:
    assert not _score((0.8,)).detected
    assert not _score((np.nextafter(0.8, 1),)).detected
    assert not _score((float(np.float32(0.8)),)).detected  # 0.800000012
    assert not _score((0.1 + 0.7,)).detected
    assert not _score((0.8 + TOLERANCE / 2,)).detected
    assert _score((0.8 + 2 * TOLERANCE,)).detected
    assert not _score((0.0,), threshold=0.0).detected
    assert not _score((1.0,), threshold=1.0).detected


def test_a_cosine_of_exactly_the_threshold_from_vectors_does_not_pass() -> None:
    angle = np.linspace(0.1, 1.4, 400)
    left = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    right = np.stack([np.cos(angle + math.acos(0.8)), np.sin(angle + math.acos(0.8))], axis=1)
    units = unit_rows(np.concatenate([left, right]).astype(np.float32))
    cosines = pair_cosines(units, np.arange(400), np.arange(400, 800))
    assert np.abs(cosines - 0.8).max() < 1e-6
    assert (cosines > 0.8).any()  # rounding alone would let some pass
    assert not passes(cosines, 0.8).any()


def test_a_text_with_itself_has_cosine_one() -> None:
    vectors = np.random.default_rng(1).standard_normal((50, 384)).astype(np.float32)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    rows = np.arange(50)
    cosines = pair_cosines(unit_rows(vectors), rows, rows)
    assert cosines == pytest.approx(np.ones(50), abs=1e-14)
    assert cosines.max() <= 1.0


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_vectors_without_direction_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="vector 1"):
        unit_rows(np.array([[1.0, 0.0], [bad, bad]]))


def test_pair_rows_by_hand() -> None:
    predictions, hazards = pair_rows(np.array([0, 0, 1, 3]), np.array([0, 2, 3, 3]), 4)
    assert predictions.tolist() == [0, 1, 3, 3]
    assert hazards.tolist() == [0, 0, 2, 3]


def test_wrong_number_of_cosines_is_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        score_pairs(np.zeros(3), np.array([0]), np.array([0]), 1, 0.8)


def test_scorecard_by_hand() -> None:
    videos = [
        _score((0.9,), (0.5,), (0.4,)),  # besm 0.65, sam 0.6, found
        _score(),  # missing: 0
        _score((0.7, 0.9), hazards=2),  # 0.9, one of two found
        score_video("n", np.zeros((0, 0)), 0.8),  # 1
        score_video("m", np.zeros((2, 0)), 0.8),  # 0
    ]
    card = scorecard(videos, SIGNATURE)
    assert card.besm == pytest.approx((0.65 + 0 + 0.9 + 1 + 0) / 5)
    assert card.sam == pytest.approx((0.6 + 0 + 0.9 + 1 + 0) / 5)
    assert card.detection_rate == 3 / 5
    assert card.hazard_recall == 2 / 4
    assert card.n_videos == 5


def test_scorecard_without_hazards_has_no_recall() -> None:
    card = scorecard([score_video("n", np.zeros((0, 0)), 0.8)], SIGNATURE)
    assert (card.besm, card.hazard_recall) == (1.0, None)


def test_scorecard_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="no videos"):
        scorecard([], SIGNATURE)


COSINE = st.floats(-1, 1, allow_nan=False)
COSINES = st.lists(COSINE, min_size=1, max_size=8)


@settings(deadline=None)
@given(COSINES, st.floats(0, 1))
def test_scores_lie_between_worst_and_best(cosines: list[float], threshold: float) -> None:
    score = _score(*((cosine,) for cosine in cosines), threshold=threshold)
    assert 0 <= score.worst <= score.besm <= score.best <= 1
    assert score.worst <= score.sam <= score.best
    if len(set(np.clip(cosines, 0, 1).tolist())) == 1 or len(cosines) == 2:
        assert score.besm == score.sam
    assert score.detected == (score.best - threshold > TOLERANCE)


@settings(deadline=None)
@given(COSINES.flatmap(lambda cosines: st.tuples(st.just(cosines), st.permutations(cosines))))
def test_order_of_predictions_does_not_matter(orders: tuple[list[float], list[float]]) -> None:
    one, other = (_score(*((cosine,) for cosine in order)) for order in orders)
    assert one == other  # to the last bit


@settings(deadline=None)
@given(st.permutations([0.0, -0.0, 0.0, -0.0]))
def test_a_zero_has_no_sign(cosines: list[float]) -> None:
    score = _score(*((cosine,) for cosine in cosines))
    zeros = score.best, score.worst, score.mean, score.besm
    assert all(math.copysign(1.0, zero) == 1.0 for zero in zeros)


@settings(deadline=None)
@given(COSINE, st.integers(2, 9))
def test_repeating_the_only_prediction_changes_nothing(cosine: float, times: int) -> None:
    once, often = _score((cosine,)), _score(*[(cosine,)] * times)
    assert (once.besm, once.sam, once.best, once.worst) == (often.besm, often.sam, often.best, often.worst)
    assert once.detected == often.detected


@settings(deadline=None)
@given(COSINES)
def test_a_better_prediction_never_lowers_the_best(cosines: list[float]) -> None:
    rows = [(cosine,) for cosine in cosines]
    assert _score(*rows, (1.0,)).best >= _score(*rows).best


VIDEO = st.integers(0, 3).flatmap(
    lambda hazards: st.lists(
        st.lists(COSINE, min_size=hazards, max_size=hazards), max_size=5 if hazards else 2
    ).map(lambda rows: np.array(rows, dtype=np.float64).reshape(len(rows), hazards))
)


@settings(deadline=None)
@given(st.lists(VIDEO, min_size=1, max_size=7))
def test_many_videos_at_once_are_each_on_its_own(videos: list[np.ndarray]) -> None:
    """The flat computation agrees with plain Python, video by video."""
    prediction_video = np.repeat(np.arange(len(videos)), [len(video) for video in videos])
    hazard_video = np.repeat(np.arange(len(videos)), [video.shape[1] for video in videos])
    cosines = np.concatenate([video.ravel() for video in videos])
    scores = score_pairs(cosines, prediction_video, hazard_video, len(videos), 0.8).records(
        [str(number) for number in range(len(videos))]
    )
    assert len(scores) == len(videos)
    for number, (video, score) in enumerate(zip(videos, scores, strict=True)):
        assert score == score_video(str(number), video, 0.8)
        _same_as_plain_python(video, score)


def _same_as_plain_python(cosines: np.ndarray, score: VideoScore) -> None:
    m, k = cosines.shape
    clipped = [[min(1.0, max(0.0, cosine)) for cosine in row] for row in cosines.tolist()]
    if k == 0:
        values = [0.0 if m else 1.0]
    elif m == 0:
        values = [0.0]
    else:
        values = [max(row) for row in clipped]
    assert (score.n_predictions, score.n_hazards) == (m, k)
    assert (score.best, score.worst) == (max(values), min(values))
    assert score.besm == pytest.approx((max(values) + min(values)) / 2, abs=1e-15)
    assert score.sam == pytest.approx(sum(values) / len(values), abs=1e-15)
    found = sum(any(row[hazard] - 0.8 > TOLERANCE for row in clipped) for hazard in range(k))
    assert score.n_hazards_found == found
    assert score.detected == (found > 0 if k else m == 0)
