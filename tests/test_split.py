"""Splits: every video in one part, shares kept in each stratum, the same whatever the order and machine."""

import math
from collections import Counter
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from pipeline.errors import InputError
from pipeline.records import Box, Kind, TrackBox, TruthHazard
from pipeline.tables import TRUTH
from sitegen.cli import app
from sitegen.readers import read_truth
from sitegen.split import NO_HAZARD, RARE, Part, read_parts, split, strata
from tests.site_fixtures import make_benchmark

THREE = read_parts("train=0.6,dev=0.15,test=0.25")


def hazard(video: str, label: str = "Car", number: int = 1, track: str | None = None) -> TruthHazard:
    return TruthHazard(video, f"h{number}", label, f"A {label} on the road" if label else "", track)


@given(
    st.dictionaries(st.text("abcdef0123456789", min_size=1, max_size=6), st.sampled_from("pqrs"), min_size=1),
    st.integers(-5, 5),
)
def test_a_partition_with_its_shares_in_every_stratum(stratum_of: dict[str, str], seed: int) -> None:
    made = split(stratum_of, THREE, seed)
    assert set(made.part_of) == set(stratum_of)
    assert set(made.part_of.values()) <= {part.name for part in THREE}
    sizes = Counter(stratum_of.values())
    for stratum, counts in made.table():
        assert sum(counts) == sizes[stratum]
        for part, count in zip(THREE, counts, strict=True):
            assert abs(count - part.share * sizes[stratum]) < 1


@settings(max_examples=30)
@given(st.permutations([f"v{number}" for number in range(30)]), st.integers(0, 3))
def test_neither_order_nor_run_matters(order: list[str], seed: int) -> None:
    by_number = {f"v{number}": str(number % 4) for number in range(30)}
    shuffled = {name: by_number[name] for name in order}
    assert split(shuffled, THREE, seed) == split(by_number, THREE, seed)


def test_known_by_heart() -> None:
    """A seed's split never changes, since others have published theirs: the order is that of SHA-256."""
    made = split({f"v{number}": "s" for number in range(8)}, read_parts("train=0.75,test=0.25"), 7)
    assert Counter(made.part_of.values()) == {"train": 6, "test": 2}
    order = sorted(made.part_of, key=lambda name: sha256(f"7\0video\0{name}".encode()).digest())
    assert {made.part_of[name] for name in order[:6]} == {"train"}


def test_another_seed_is_another_split() -> None:
    ids = dict.fromkeys((f"v{number}" for number in range(40)), "s")
    assert len({tuple(split(ids, THREE, seed).part_of.values()) for seed in range(10)}) == 10


@settings(max_examples=40)
@given(st.integers(0, 200))
def test_a_new_video_moves_few(seed: int) -> None:
    ids = {f"v{number}": str(number % 3) for number in range(60)}
    before = split(ids, THREE, seed).part_of
    after = split({**ids, "new": "1"}, THREE, seed).part_of
    moved = [name for name in ids if before[name] != after[name]]
    # Of each stratum at most two across each of two cuts; a fresh draw would move about half of all.
    assert max(Counter(ids[name] for name in moved).values(), default=0) <= 4


@given(st.integers(0, 50))
def test_what_belongs_together_stays_together(seed: int) -> None:
    ids = {f"v{number}": str(number % 3) for number in range(30)}
    groups = [["v1", "v2"], ["v2", "v9", "unknown"], ["v20", "v21"]]
    made = split(ids, THREE, seed, groups).part_of
    assert len({made[name] for name in ("v1", "v2", "v9")}) == 1
    assert made["v20"] == made["v21"] and "unknown" not in made


def test_totals_are_near_the_shares_over_many_small_strata() -> None:
    ids = {f"v{number}": str(number // 3) for number in range(90)}
    counts = Counter(split(ids, THREE, 1).part_of.values())
    assert all(abs(counts[part.name] - part.share * 90) <= 3 for part in THREE)


def test_strata_by_label() -> None:
    truth = [
        *(hazard(f"c{number}") for number in range(3)),
        hazard("c3", " CAR "),
        hazard("two", "Car", 1),
        hazard("two", "Dog", 2),
        hazard("d", "dog"),
        hazard("e", "Ox"),
        hazard("calm", ""),
    ]
    found = strata(truth, "label", 2)
    assert found == {
        **{f"c{number}": "car" for number in range(4)},
        "two": "dog",
        "d": "dog",
        "e": RARE,
        "calm": NO_HAZARD,
    }
    assert set(strata(truth, "none", 2).values()) == {"all videos"}


def test_strata_by_kind_and_size() -> None:
    truth = [hazard(f"v{number}", track="1") for number in range(3)]
    truth += [hazard("bare"), hazard("calm", ""), hazard("two", number=1), hazard("two", number=2)]
    boxes = [
        TrackBox(f"v{number}", 0, "1", Kind.CHALLENGE, Box(0, 0, 10 + number, 10)) for number in range(3)
    ]
    boxes.append(TrackBox("v0", 0, "2", Kind.TRAFFIC, Box(0, 0, 500, 500)))  # of another track
    assert strata(truth, "kind", 2) == {
        **{f"v{number}": "a hazard with a track" for number in range(3)},
        "bare": "a hazard without a track",
        "calm": NO_HAZARD,
        "two": "several hazards",
    }
    sizes = strata(truth, "size", 2, boxes)
    assert [sizes[f"v{number}"] for number in range(3)] == ["small box", "middle box", "large box"]
    assert (sizes["bare"], sizes["calm"]) == ("no box", NO_HAZARD)


@pytest.mark.parametrize(
    "text", ["", "train", "train=x", "a=0.5,b=0.4", "a=0.5,A=0.5", "../x=1", "a=1.5,b=-0.5", "a=nan"]
)
def test_wrong_parts_say_what_is_expected(text: str) -> None:
    with pytest.raises(InputError, match="expected"):
        read_parts(text)


def test_decimal_shares_are_exact() -> None:
    parts = (Part("a", 0.7), Part("b", 0.3))
    assert math.isclose(sum(part.share for part in parts), 1)
    for size in (10, 100, 1000):
        counts = Counter(split({str(n): "s" for n in range(size)}, parts).part_of.values())
        assert counts == {"a": size * 7 // 10, "b": size * 3 // 10}


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    benchmark = make_benchmark(tmp_path / "b", 2)
    monkeypatch.chdir(benchmark.root)
    (tmp_path / "groups.csv").write_text("video_id,group\nv1,g\nv2,g\nzz-gone,\n", encoding="utf-8")
    command = ["data", "split", "--parts", "a=0.5,b=0.5", "--by", "none"]
    more = ["--together", str(tmp_path / "groups.csv"), "--truths", "parts", "--out", "s.csv"]
    done = CliRunner().invoke(app, [*command, *more])
    assert done.exit_code == 0, done.output
    lines = (benchmark.root / "s.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "video_id,part" and len(lines) == 4
    parts = dict(line.split(",") for line in lines[1:])
    assert parts["v1"] == parts["v2"]
    rows = [row for name in "ab" for row in TRUTH.read(benchmark.root / "parts" / f"{name}.parquet")]
    assert sorted(rows, key=lambda row: (row.video_id, row.hazard_id)) == read_truth(benchmark.truth)
    again = CliRunner().invoke(app, [*command, *more])
    assert again.output == done.output
    assert (benchmark.root / "s.csv").read_text(encoding="utf-8").splitlines() == lines
    for wrong in (["--by", "colour"], ["--group-by", "("]):
        assert CliRunner().invoke(app, [*command, *wrong]).exit_code == 2
