"""Results in JSON as others write them: the paper's scripts and COCO (PAPER, section 4)."""

import json
from pathlib import Path
from typing import Any

import pytest

from sitegen.readers import read_predictions
from tests.faulty import faults, lines, places, write

AOS: list[tuple[object, tuple[tuple[str, str | None], ...], bool]] = [
    ("['A cat runs', 'a dog']", (("A cat runs", None), ("a dog", None)), False),
    ('["It\'s a cat", \'say "no"\',]', (("It's a cat", None), ('say "no"', None)), False),
    ('["A cat: it runs", "x, y, z"]', (("A cat: it runs", None), ("x, y, z", None)), False),
    (["A cat runs"], (("A cat runs", None),), False),
    ("[]", (), False),
    ([], (), False),
    ("['None']", (), True),
    ("1. A cat: running\n2. A dog: asleep", (("running", "A cat"), ("asleep", "A dog")), True),
    ([{"object": "cat", "description": "it runs"}], (("it runs", "cat"),), True),
    ("```python\n['a cat on the road']\n```", (("a cat on the road", None),), True),
]


@pytest.mark.parametrize(("aos", "items", "loose"), AOS, ids=range(len(AOS)))
def test_the_lists_of_the_papers_scripts(tmp_path: Path, aos: object, items: Any, loose: bool) -> None:
    text = json.dumps({"v0": ["", "['x']"], "video_0173": ["a cat", aos]}, indent=2)
    read = read_predictions(write(tmp_path, "results.json", text))
    found = [row for row in read.predictions if row.video_id == "video_0173"]
    captions = [(row.rank, row.description) for row in found]
    assert captions == [(rank, text) for rank, (text, _) in enumerate(items, start=1)]
    if not loose or len(found) > 1:
        assert [row.label for row in found] == [label for _, label in items]
    assert (read.source_format, read.ending) == ("scripts", "json")
    assert bool(read.warnings) == loose
    assert not loose or "'video_0173'" in read.warnings[0]


def test_wrong_lists_of_the_papers_scripts(tmp_path: Path) -> None:
    values = [7, "A cat runs over the road.", "", ["x" * 2001], "[" * 100_000, "['a' + 'b']", None]
    wrong = {f"v{number}": ["", value] for number, value in enumerate(values)}
    path = write(
        tmp_path, "r.json", json.dumps({**wrong, "w": "[]", "x": ["[]"], "a/b": ["", "[]"]}, indent=0)
    )
    found = faults(lambda: read_predictions(path))
    aos = [(row, "AOS") for row in range(1, 8)]
    assert [fault[:2] for fault in found] == [*aos, (8, None), (9, None), (10, None)]
    assert all(f"'v{row - 1}'" in text for row, _, text in found if row in {1, 2, 3, 5, 6, 7})
    assert lines(lambda: read_predictions(path)) == [2 + 4 * row for row in range(3)] + [
        14,
        20,
        24,
        28,
        32,
        33,
        36,
    ]


def test_coco_captions_are_ranked_as_they_stand(tmp_path: Path) -> None:
    entries = [(2, "b"), ("v1", " a "), (2, "c"), ("2", "d")]
    text = json.dumps([{"image_id": key, "caption": text, "id": 1} for key, text in entries])
    read = read_predictions(write(tmp_path, "captions.json", text))
    assert [(row.video_id, row.rank, row.description) for row in read.predictions] == [
        ("2", 1, "b"),
        ("2", 2, "c"),
        ("2", 3, "d"),
        ("v1", 1, "a"),
    ]
    assert (read.source_format, read.warnings) == ("coco", ("Ignored unknown columns: id.",))
    nothing = read_predictions(write(tmp_path, "n.json", " [\n] "))
    assert (nothing.predictions, nothing.warnings) == ((), ("The file holds no prediction.",))


WRONG_JSON: list[tuple[str, list[tuple[int | None, str | None]]]] = [
    (
        '[{"image_id": 1, "caption": "a"}, 7, {"image_id": 2}, {"caption": "a"}]',
        [(2, None), (3, "caption"), (4, "image_id")],
    ),
    (
        '[{"image_id": 1.5, "caption": NaN}, {"image_id": 1, "caption": null}]',
        [(1, "image_id"), (1, "caption"), (2, "caption")],
    ),
    ('[{"image_id": 1, "caption": "a", "caption": "b"}]', [(1, None)]),
    ('[{"image_id": 1, "caption": "a", "score": NaN}]', [(None, None)]),
    ('[{"image_id": "a/b", "caption": "a"}]', [(1, "image_id")]),
    ('[{"image_id": 1, "caption": "a"}', [(None, None)]),
    ('[{"image_id": 1, "caption": "a"}] x', [(None, None)]),
    ('[{"image_id": 1, "caption": "a", "x": ' + "[" * 100_000 + "]" * 100_000 + "}]", [(None, None)]),
    ('[{"image_id": ' + "9" * 5_000 + ', "caption": "a"}]', [(None, None)]),
    ('{"v1": ["", "[\'a\']"], "v2": ["", "[]"], "v1": ["", "[\'b\']"]}', [(3, None)]),
    ('{"v1": ["", "[\'a\']"], "v1 ": ["", "[]"]}', [(2, None)]),
    ('{"v1": ["", [{"object": "a", "object": "b"}]]}', [(1, "AOS")]),
    ('{"v1": [NaN, "[\'a\']"]}', [(None, None)]),
]


@pytest.mark.parametrize(("text", "expected"), WRONG_JSON, ids=range(len(WRONG_JSON)))
def test_wrong_json(tmp_path: Path, text: str, expected: list[Any]) -> None:
    assert places(lambda: read_predictions(write(tmp_path, "p.json", text))) == expected


def test_lines_in_json(tmp_path: Path) -> None:
    path = write(tmp_path, "p.json", '\n[\n{"image_id": 1, "caption": ""},\n\n {"image_id":\n 2}, 3\n]')
    assert lines(lambda: read_predictions(path)) == [3, 5, 6]
    broken = write(tmp_path, "b.json", '[{"image_id": 1,\n"caption" "a"}]')
    assert lines(lambda: read_predictions(broken)) == [2]
    latin = write(tmp_path, "l.json", b'[{"image_id": 1,\n"caption": "caf\xe9"}]')
    assert lines(lambda: read_predictions(latin)) == [2]


def test_json_with_too_many_items_is_not_parsed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sitegen.texts.MAX_JSON_MARKS", 10)
    path = write(tmp_path, "p.json", '[{"image_id": 1, "caption": [' + "1," * 10 + "1]}]")
    assert faults(lambda: read_predictions(path)) == [(None, None, "14 commas and brackets")]
    monkeypatch.setattr("sitegen.texts.MAX_ROWS", 1)
    rows = write(tmp_path, "r.json", '[{"image_id": 1, "caption": "a"}, {"image_id": 2}]')
    assert faults(lambda: read_predictions(rows)) == [(None, None, "more than 1 rows")]


def test_json_lines_that_begin_with_a_list_are_json_lines(tmp_path: Path) -> None:
    record = {"frame_indices": list(range(5_000)), "video_id": "v1", "rank": 1, "description": "a"}
    other = {"scores": [1, 2], "video_id": "v1", "rank": 2, "description": "b"}
    for rows in ([record, other], [other, record]):
        text = "\n".join(map(json.dumps, rows))
        assert read_predictions(write(tmp_path, "p.json", text)).source_format == "jsonl"
