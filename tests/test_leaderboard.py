"""Ranks: competition ranking, ties, and what must not be compared."""

import dataclasses

import pytest

from pipeline.errors import InputError
from pipeline.scores import Evaluation, Scorecard, Signature, Submission
from sitegen.leaderboard import Key, rank

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
