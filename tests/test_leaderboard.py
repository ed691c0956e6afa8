"""Ranks: competition ranking, ties, and what must not be compared."""

import dataclasses

import pytest

from pipeline.errors import InputError
from pipeline.scores import Evaluation, Scorecard, Signature, Submission
from sitegen.leaderboard import rank
from sitegen.uncertainty import Interval, Key, Uncertainty, uncertainties
from tests import test_uncertainty

SIGNATURE = Signature("1", "fake", "0" * 64, "1" * 64, 10, 0.8)


def _evaluation(
    name: str, besm: float, sam: float = 0.0, recall: float | None = 0.0, signature: Signature = SIGNATURE
) -> Evaluation:
    submission = Submission(name, "", "", "2026-01-01", "csv", ())
    return Evaluation(submission, (), (), Scorecard(besm, sam, 0.0, recall, 10, signature))


def _ranks(evaluations: list[Evaluation], key: Key = "besm") -> list[tuple[int, str]]:
    return [(row.rank, row.evaluation.submission.name) for row in rank(evaluations, key)]


def test_ties_share_a_rank_and_the_next_is_skipped() -> None:
    rows = [_evaluation("d", 0.1), _evaluation("c", 0.5), _evaluation("b", 0.5), _evaluation("a", 0.9)]
    assert _ranks(rows) == [(1, "a"), (2, "b"), (2, "c"), (4, "d")]
    assert _ranks(rows[::-1]) == _ranks(rows)


def test_almost_equal_is_no_tie() -> None:
    assert _ranks([_evaluation("a", 0.3), _evaluation("b", 0.1 + 0.2)]) == [(1, "b"), (2, "a")]


def test_other_keys() -> None:
    rows = [
        _evaluation("a", 0.9, 0.1, None),
        _evaluation("b", 0.1, 0.9, 0.0),
        _evaluation("c", 0.0, 0.0, 1.0),
    ]
    assert _ranks(rows, "sam") == [(1, "b"), (2, "a"), (3, "c")]
    assert _ranks(rows, "hazard_recall") == [(1, "c"), (2, "b"), (3, "a")]
    assert [row.value for row in rank(rows, "hazard_recall")] == [1.0, 0.0, None]


def test_nothing_to_rank() -> None:
    assert rank([]) == []
    assert rank([], "besm", uncertainties([])) == []


def test_places_count_on_through_ties() -> None:
    rows = rank([_evaluation("b", 0.5), _evaluation("a", 0.5), _evaluation("c", 0.9)])
    assert [(row.place, row.rank, row.uncertainty) for row in rows] == [
        (1, 1, None),
        (2, 2, None),
        (3, 2, None),
    ]


def _sure(band: int) -> Uncertainty:
    span = Interval(0.0, 1.0)
    return Uncertainty(span, span, span, None, band, 1, 3, 0.5)


def test_the_band_is_the_rank_and_goes_with_its_evaluation() -> None:
    rows = [_evaluation("c", 0.1), _evaluation("a", 0.9), _evaluation("b", 0.8)]
    known = [_sure(3), _sure(1), _sure(1)]
    found = rank(rows, "besm", known)
    assert [(row.rank, row.place, row.evaluation.submission.name) for row in found] == [
        (1, 1, "a"),
        (1, 2, "b"),
        (3, 3, "c"),
    ]
    assert [row.uncertainty for row in found] == [known[1], known[2], known[0]]


def test_bands_of_real_uncertainties_begin_at_their_place() -> None:
    scores = {"low": 0.1, "high": 0.9, "middle": 0.5, "also middle": 0.5}
    rows = [test_uncertainty.evaluation(name, [score] * 20) for name, score in scores.items()]
    found = rank(rows, "besm", uncertainties(rows))
    assert [(row.rank, row.place, row.evaluation.submission.name) for row in found] == [
        (1, 1, "high"),
        (2, 2, "also middle"),
        (2, 3, "middle"),
        (4, 4, "low"),
    ]


def test_one_uncertainty_for_each() -> None:
    with pytest.raises(ValueError, match="zip"):
        rank([_evaluation("a", 0.1), _evaluation("b", 0.2)], "besm", [_sure(1)])


@pytest.mark.parametrize(
    "change",
    [{"metric_version": "2"}, {"embedder_sha256": "f" * 64}, {"truth_sha256": "2" * 64}, {"threshold": 0.7}],
)
def test_other_signatures_are_refused_and_both_are_named(change: dict[str, str]) -> None:
    other = dataclasses.replace(SIGNATURE, **change)  # type: ignore[arg-type]
    with pytest.raises(InputError) as caught:
        rank([_evaluation("one", 0.5), _evaluation("two", 0.4, signature=other)])
    assert f"one: {SIGNATURE}" in str(caught.value)
    assert f"two: {other}" in str(caught.value)
