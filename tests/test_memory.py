"""How often garbage is searched for is put back, whatever happens in between."""

import gc

import pytest

from pipeline.memory import NEW_OBJECTS, collected_rarely


def test_rarely_for_a_while() -> None:
    before = gc.get_threshold()
    with collected_rarely():
        assert gc.get_threshold() == (NEW_OBJECTS, *before[1:]) and gc.isenabled()
    assert gc.get_threshold() == before


def test_put_back_after_an_error() -> None:
    before = gc.get_threshold()
    with pytest.raises(ValueError, match="so"), collected_rarely():
        raise ValueError("so")
    assert gc.get_threshold() == before
