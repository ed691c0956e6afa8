"""Evaluations: which texts meet, what is counted, and the numbers of an independent computation."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.errors import FaultsError, InputError, OutsideError
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Submission
from sitegen.evaluate import embed_all, evaluate, texts_of, truth_sha256

REFERENCE = json.loads((Path(__file__).parent / "reference" / "score_reference.json").read_text("utf-8"))

# Directions in the plane, in degrees: the cosine of two texts is that of the angle between them.
DEGREES = {"cat": 0, "a cat": 10, "dog": 60, "truck": 90, "anti": 180, "bird": 37}


class FakeEmbedder:
    """Known vectors by text; keeps what it was asked."""

    name = "fake"
    sha256 = "f" * 64

    def __init__(self) -> None:
        self.asked: list[str] = []

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Unit vectors in the plane."""
        self.asked += texts
        angles = np.radians([DEGREES[text] for text in texts])
        return np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)


def _submission(*predictions: tuple[str, int, str]) -> Submission:
    return Submission("S", "", "", "2026-01-01", "csv", tuple(Prediction(*row) for row in predictions))


TRUTH = [
    TruthHazard("v3", "1", "", ""),
    TruthHazard("v1", "1", "cat", "cat"),
    TruthHazard("v2", "2", "dog", "dog"),
    TruthHazard("v2", "1", "cat", "cat"),
    TruthHazard("v4", "1", "truck", "truck"),
]


def _evaluate(submission: Submission, truth: Sequence[TruthHazard] = TRUTH) -> Any:
    return evaluate(submission, truth, FakeEmbedder(), 0.8, truth_sha256(truth))


def test_by_hand() -> None:
    evaluation = _evaluate(
        _submission(
            ("v2", 2, "truck"), ("v2", 1, "a cat"), ("v1", 1, "cat"), ("v1", 2, "anti"), ("v1", 3, "dog")
        )
    )
    assert [video.video_id for video in evaluation.videos] == ["v1", "v2", "v3", "v4"]
    one, two, three, four = evaluation.videos
    assert (one.best, one.worst, one.mean) == pytest.approx((1.0, 0.0, 0.5), abs=1e-6)
    assert (one.besm, one.sam, one.detected) == (pytest.approx(0.5), pytest.approx(0.5), True)
    cos10, cos30 = np.cos(np.radians(10)), np.cos(np.radians(30))
    assert (two.best, two.worst) == pytest.approx((cos10, cos30), abs=1e-6)
    assert (two.n_hazards, two.n_hazards_found) == (2, 2)  # the truck is 30 degrees from the dog
    assert (three.besm, three.detected) == (1.0, True)
    assert (four.besm, four.detected) == (0.0, False)
    card = evaluation.card
    assert card.besm == pytest.approx((0.5 + (cos10 + cos30) / 2 + 1 + 0) / 4, abs=1e-6)
    assert (card.detection_rate, card.hazard_recall, card.n_videos) == (3 / 4, 3 / 4, 4)
    pairs = [(pair.video_id, pair.prediction_rank, pair.hazard_id) for pair in evaluation.pairs]
    assert pairs == [
        ("v1", 1, "1"),
        ("v1", 2, "1"),
        ("v1", 3, "1"),
        ("v2", 1, "1"),
        ("v2", 1, "2"),
        ("v2", 2, "1"),
        ("v2", 2, "2"),
    ]
    assert evaluation.pairs[1].cosine == pytest.approx(-1.0)
    assert evaluation.pairs[1].similarity == 0.0


def test_nothing_predicted_counts_every_truth_video() -> None:
    card = _evaluate(_submission()).card
    assert (card.n_videos, card.besm, card.sam) == (4, 0.25, 0.25)
    assert (card.detection_rate, card.hazard_recall) == (0.25, 0.0)


def test_a_prediction_in_a_no_hazard_video_costs_it() -> None:
    evaluation = _evaluate(_submission(("v3", 1, "cat")))
    assert evaluation.card.besm == 0.0
    assert evaluation.pairs == ()


def test_only_no_hazard_videos() -> None:
    card = _evaluate(_submission(), TRUTH[:1]).card
    assert (card.besm, card.hazard_recall, card.n_videos) == (1.0, None, 1)


def test_each_distinct_text_is_embedded_once() -> None:
    embedder = FakeEmbedder()
    submissions = [
        _submission(("v1", 1, "cat"), ("v1", 2, "cat"), ("v2", 1, "bird")),
        _submission(("v4", 1, "bird")),
    ]
    vectors = embed_all(texts_of(submissions, TRUTH), embedder)
    for submission in submissions:
        evaluate(submission, TRUTH, embedder, 0.8, "x", vectors=vectors)
    assert embedder.asked == ["bird", "cat", "dog", "truck"]


def test_unknown_videos_and_ranks_given_twice_come_together() -> None:
    with pytest.raises(FaultsError) as caught:
        _evaluate(_submission(("v9", 1, "cat"), ("v1", 1, "cat"), ("v0", 1, "cat"), ("v1", 1, "dog")))
    faults = caught.value.faults
    assert [(fault.column, fault.found) for fault in faults] == [
        ("video_id", "'v0'"),
        ("video_id", "'v9'"),
        ("rank", "rank 1 twice in video 'v1'"),
    ]


def test_empty_truth_and_bad_threshold_are_refused() -> None:
    with pytest.raises(InputError, match="no rows"):
        evaluate(_submission(), [], FakeEmbedder(), 0.8, "x")
    with pytest.raises(InputError, match=r"1\.5"):
        evaluate(_submission(), TRUTH, FakeEmbedder(), 1.5, "x")


class BrokenEmbedder(FakeEmbedder):
    """Gives whatever array it was made with."""

    def __init__(self, vectors: NDArray[np.float32]) -> None:
        super().__init__()
        self.vectors = vectors

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """That array."""
        return self.vectors


@pytest.mark.parametrize(
    "vectors", [np.zeros((1, 2), np.float32), np.ones((2, 2), np.float32), np.ones(3, np.float32)]
)
def test_a_broken_embedder_is_named(vectors: NDArray[np.float32]) -> None:
    with pytest.raises(OutsideError, match="fake"):
        embed_all(["cat"], BrokenEmbedder(vectors))


def test_truth_hash_is_of_the_content_alone() -> None:
    assert truth_sha256(TRUTH) == truth_sha256(TRUTH[::-1])
    for change in ({"description": "a cat"}, {"label": "kitten"}, {"first_frame": 3}, {"hazard_id": "7"}):
        other = [*TRUTH[:-1], dataclasses.replace(TRUTH[-1], **change)]
        assert truth_sha256(other) != truth_sha256(TRUTH)
    assert truth_sha256(TRUTH[:-1]) != truth_sha256(TRUTH)


def test_signature_says_what_changes_a_number() -> None:
    signature = _evaluate(_submission()).card.signature
    assert str(signature) == (
        f"coooler:1|emb:fake@ffffffffffff|truth:{truth_sha256(TRUTH)[:12]}|n:4|thr:>0.8"
        "|nohaz:empty-is-1|clip:pair-0-1"
    )


ROWS = st.lists(
    st.tuples(st.sampled_from(["v1", "v2", "v3", "v4"]), st.integers(1, 4), st.sampled_from(sorted(DEGREES))),
    max_size=10,
    unique_by=lambda row: row[:2],
)


@settings(deadline=None)
@given(ROWS, st.randoms(use_true_random=False))
def test_order_of_rows_is_irrelevant_and_n_is_of_the_truth(
    rows: list[tuple[str, int, str]], random: Any
) -> None:
    shuffled, truth = rows.copy(), TRUTH.copy()
    random.shuffle(shuffled)
    random.shuffle(truth)
    one, other = _evaluate(_submission(*rows)), _evaluate(_submission(*shuffled), truth)
    assert (one.card, one.videos, one.pairs) == (other.card, other.videos, other.pairs)
    assert one.card.n_videos == len(one.videos) == 4
    assert sum(video.n_predictions for video in one.videos) == len(rows)


@pytest.fixture(scope="module")
def reference_evaluation() -> Any:
    """The cases of the reference file, scored with the real embedder."""
    from pipeline.minilm import open_embedder

    truth = []
    predictions = []
    for video in REFERENCE["videos"]:
        hazards = [
            TruthHazard(video["video_id"], str(number), "hazard", text)
            for number, text in enumerate(video["truth"], start=1)
        ]
        truth += hazards or [TruthHazard(video["video_id"], "", "", "")]
        predictions += [
            Prediction(video["video_id"], rank, text)
            for rank, text in enumerate(video["predictions"], start=1)
        ]
    submission = Submission("Reference", "", "", "2026-01-01", "csv", tuple(predictions))
    return evaluate(submission, truth, open_embedder(), REFERENCE["threshold"], truth_sha256(truth))


def test_agrees_with_torch_in_every_pair_and_video(reference_evaluation: Any) -> None:
    cosines = [cosine for video in REFERENCE["videos"] for row in video["cosines"] for cosine in row]
    assert [pair.cosine for pair in reference_evaluation.pairs] == pytest.approx(cosines, abs=1e-4)
    for video, score in zip(REFERENCE["videos"], reference_evaluation.videos, strict=True):
        assert score.video_id == video["video_id"]
        for name, value in video["scores"].items():
            assert getattr(score, name) == pytest.approx(value, abs=1e-4), (video["video_id"], name)


def test_agrees_with_torch_in_the_figures(reference_evaluation: Any) -> None:
    for name, value in REFERENCE["totals"].items():
        assert getattr(reference_evaluation.card, name) == pytest.approx(value, abs=1e-4), name


def test_reference_can_tell_the_metrics_apart() -> None:
    totals = REFERENCE["totals"]
    assert abs(totals["besm"] - totals["sam"]) > 2e-4
    found = [video["scores"]["detected"] for video in REFERENCE["videos"]]
    assert {True, False} <= set(found)
