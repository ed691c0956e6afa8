"""Predictions as columns: in every use the tuple of the same rows."""

import copy
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.predictions import Predictions
from pipeline.records import Prediction
from pipeline.tables import PREDICTIONS

ROWS = st.lists(
    st.builds(
        Prediction,
        st.sampled_from(["v1", "v2", "a", "Z", "é", "\U0001f697"]),
        st.integers(1, 2**31 - 1),
        st.sampled_from(["A cat", "a dog", "é"]),
        st.sampled_from([None, "car"]),
        st.lists(st.sampled_from(["7", "9"]), max_size=3).map(tuple),
        st.lists(st.integers(0, 2**31 - 1), max_size=3).map(tuple),
    ),
    max_size=8,
    unique_by=lambda row: (row.video_id, row.rank),
)


@given(rows=ROWS, data=st.data())
def test_they_are_the_sorted_tuple(rows: list[Prediction], data: st.DataObject) -> None:
    found = Predictions.of(rows)
    expected = tuple(sorted(rows, key=lambda row: (row.video_id, row.rank)))
    assert found == expected and expected == found and hash(found) == hash(expected)
    assert tuple(found) == expected and len(found) == len(expected) and bool(found) == bool(expected)
    assert found == Predictions.of(reversed(rows)) and Predictions.of(found) is found
    assert found.video_ids == sorted({row.video_id for row in rows})
    part = data.draw(st.slices(len(rows)))
    assert found[part] == expected[part]
    for place in range(-len(rows), len(rows)):
        assert found[place] == expected[place]
    with pytest.raises(IndexError):
        found[len(rows)]
    assert pickle.loads(pickle.dumps(found)) == expected and copy.deepcopy(found) == expected
    assert PREDICTIONS.to_bytes(found) == PREDICTIONS.to_bytes(rows)
    assert list(reversed(found)) == list(reversed(expected))


def test_others_are_not_equal() -> None:
    row = Prediction("v1", 1, "A cat")
    assert Predictions.of([row]) != (Prediction("v1", 1, "A dog"),)
    assert Predictions.of([row]) != () and Predictions.of([row]) != [row]
    assert repr(Predictions.of([row] * 4)).endswith("... 4 in all)")
