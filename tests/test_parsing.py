"""Answers of models to items: a table of real-looking answers, and that nothing breaks it."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.parsing import MAX_ANSWER_CHARS, MAX_ITEMS, parse
from pipeline.records import Parse

TABLE = [
    ('[{"label": "Cat", "description": "crossing the road"}]', Parse.JSON, [("Cat", "crossing the road")]),
    ('```json\n["car", "dog"]\n```', Parse.JSON, [("car", ""), ("dog", "")]),
    ('Here you are:\n["car", "dog"]\nAnything else?', Parse.JSON, [("car", ""), ("dog", "")]),
    ('{"hazards": [{"object": "deer", "action": "leaps"}]}', Parse.JSON, [("deer", "leaps")]),
    ('{"Cat": "sits", "Dog": "runs"}', Parse.JSON, [("Cat", "sits"), ("Dog", "runs")]),
    ("['car', \"dog's ball\"]", Parse.LITERAL, [("car", ""), ("dog's ball", "")]),
    ("('car', 'dog')", Parse.LITERAL, [("car", ""), ("dog", "")]),
    ("1. **Motorcycle**: crosses the line\n2. Car - parked", Parse.LINES,
     [("Motorcycle", "crosses the line"), ("Car", "parked")]),
    ("Sure!\n- Cat\n- Dog\n", Parse.LINES, [("Cat", ""), ("Dog", "")]),
    ("* A person is walking along the very edge of the road towards us, waving.", Parse.LINES,
     [("", "A person is walking along the very edge of the road towards us, waving.")]),
    ("car, truck, person", Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ("car, car, Car", Parse.COMMAS, [("car", "")]),
    ("A cat is on the road. It runs.", Parse.PROSE, [("", "A cat is on the road."), ("", "It runs.")]),
    ("<think>cars, maybe [1, 2]</think>['dog']", Parse.LITERAL, [("dog", "")]),
    ("<think>never closed, [1]", Parse.FAILED, []),
    ("[]", Parse.EMPTY, []),
    ("```json\n[]\n```", Parse.EMPTY, []),
    ("None.", Parse.EMPTY, []),
    ("There are no anomalies in the list.", Parse.EMPTY, []),
    ("", Parse.FAILED, []),
    ("  \n ", Parse.FAILED, []),
    ("!!!", Parse.FAILED, []),
    ("__import__('os').system('true')", Parse.PROSE, [("", "__import__('os').system('true')")]),
    ("[__import__('os')]", Parse.PROSE, [("", "[__import__('os')]")]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "how", "expected"), TABLE)
def test_table(text: str, how: Parse, expected: list[tuple[str, str]]) -> None:
    items, found = parse(text)
    assert (found, [(item.label, item.description) for item in items]) == (how, expected)
    assert [item.rank for item in items] == list(range(1, len(items) + 1))


_SYNTAX = st.text(alphabet="[]{}()\"'\\,:-*`<>think/ \n0123456789ab🚗", max_size=400)


@given(st.one_of(st.text(max_size=400), _SYNTAX))
def test_never_raises_and_is_bounded(text: str) -> None:
    items, how = parse(text)
    assert len(items) <= MAX_ITEMS
    assert bool(items) == (how not in (Parse.EMPTY, Parse.FAILED))


@pytest.mark.parametrize(
    "piece", ["[", '{"a":', "(", "<think>", "```", "1. ", "a, ", "**", "- a\n", "\\", "["]
)
def test_long_answers_are_cut_and_quick(piece: str) -> None:
    start = time.process_time()
    parse(piece * (2 * MAX_ANSWER_CHARS // len(piece)))
    assert time.process_time() - start < 5  # a guard against blow-up, not a benchmark
