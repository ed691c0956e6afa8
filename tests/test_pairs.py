"""Pairs as columns: in every use the tuple of the same records, and the scores of each by its own cosine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.records import Prediction, TruthHazard
from pipeline.scores import PairScore, Submission
from pipeline.tables import PAIRS
from sitegen.evaluate import evaluate
from tests.site_fixtures import WordEmbedder

TEXTS = ["a cat", "a dog", "a cat and a dog", "the road"]
WORDS = WordEmbedder()


def cosine(a: str, b: str) -> float:
    one, other = np.asarray(WORDS.embed([a, b]), dtype=np.float64)
    return float(one @ other / np.linalg.norm(one) / np.linalg.norm(other))


@settings(max_examples=60)
@given(data=st.data())
def test_they_are_the_tuple_of_each_prediction_with_each_hazard(data: st.DataObject) -> None:
    numbers = st.integers(1, 4)
    keys = st.tuples(st.sampled_from(["v1", "v2", "é"]), numbers)
    said = data.draw(st.lists(keys, unique=True, max_size=6))
    true = data.draw(st.lists(keys, unique=True, min_size=1, max_size=6))
    truth = [TruthHazard(video, str(n), "x", data.draw(st.sampled_from(TEXTS))) for video, n in true]
    videos = {hazard.video_id for hazard in truth}
    rows = [
        Prediction(video, rank, data.draw(st.sampled_from(TEXTS))) for video, rank in said if video in videos
    ]
    expected = [
        PairScore(row.video_id, row.rank, hazard.hazard_id, cosine(row.description, hazard.description), 0)
        for row in sorted(rows, key=lambda row: (row.video_id, row.rank))
        for hazard in sorted(truth, key=lambda hazard: hazard.hazard_id)
        if hazard.video_id == row.video_id
    ]
    pairs = evaluate(Submission("a", "", "", "", "csv", tuple(rows)), truth, WORDS, 0.8, "0" * 64).pairs
    assert [(p.video_id, p.prediction_rank, p.hazard_id) for p in pairs] == [
        (p.video_id, p.prediction_rank, p.hazard_id) for p in expected
    ]
    assert [p.cosine for p in pairs] == pytest.approx([p.cosine for p in expected], abs=1e-6)
    assert all(p.similarity == min(max(p.cosine, 0.0), 1.0) for p in pairs)
    made = tuple(pairs)
    assert pairs == made and pairs[1:] == made[1:]
    assert PAIRS.to_bytes(pairs) == PAIRS.to_bytes(made)
