"""Agreement of annotators, by hand."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitegen.agreement import Named, compare, compare_video, kappa, match, report

EAST, NORTH, MIDDLE = (np.array(v, np.float32) for v in ([1, 0], [0, 1], [0.6, 0.8]))
VECTORS = {"east": EAST, "north": NORTH, "middle": MIDDLE}


def named(label: str, description: str, track: str | None = None) -> Named:
    return Named(label, description, track)


def test_the_descriptions_are_matched_so_that_their_cosines_sum_up_highest() -> None:
    ours = [named("Car", "middle", "1"), named("Dog", "north", "2")]
    theirs = [named("dog", "north", "2"), named("  CAR ", "east", "7")]
    found = compare_video("v", ours, theirs, VECTORS)
    # middle-north is 0.8, but then north-east is 0; middle-east 0.6 with north-north 1 is more.
    assert found.cosine == pytest.approx((0.6 + 1) / 2)
    assert (found.label, found.track, found.same_verdict) == (1.0, 0.5, True)


def test_a_hazard_without_a_partner_counts_as_0() -> None:
    found = compare_video(
        "v", [named("Car", "east", "1")], [named("Cat", "north"), named("car", "east", "1")], VECTORS
    )
    assert (found.n_first, found.n_second) == (1, 2)
    assert (found.cosine, found.label, found.track) == (0.5, 0.5, 0.5)


def test_no_hazard_agrees_with_no_hazard_and_with_nothing_else() -> None:
    none = compare_video("v", [], [], VECTORS)
    assert (none.same_verdict, none.cosine, none.label, none.track) == (True, 1.0, 1.0, 1.0)
    one = compare_video("v", [], [named("Car", "east")], VECTORS)
    assert (one.same_verdict, one.cosine, one.label, one.track) == (False, 0.0, 0.0, 0.0)


def test_a_pair_is_summed_up_over_the_videos_of_both_most_disputed_first() -> None:
    ada = {
        "a": [named("Car", "east", "1")],
        "b": [],
        "c": [],
        "d": [named("Car", "east")],
        "e": [named("Car", "middle", "3")],
    }
    bob = {
        "a": [named("Van", "east", "1")],
        "b": [named("Dog", "north")],
        "c": [],
        "e": [named("Car", "north", "4")],
    }
    pair = compare("ada", "bob", ada, bob, VECTORS)
    assert [video.video_id for video in pair.videos] == ["b", "e", "a", "c"]
    assert pair.n_videos == 4
    assert pair.verdict == 0.75
    # Observed 3/4; by chance 2/4 * 3/4 + 2/4 * 1/4 = 1/2.
    assert pair.kappa == pytest.approx(0.5)
    assert pair.cosine == pytest.approx((1 + 0.8) / 2)
    assert (pair.label, pair.track) == (0.5, 0.5)


def test_without_vectors_there_are_no_cosines_and_labels_are_matched() -> None:
    said = {"bob": {"v": [named("Dog", "?"), named("Car", "?")]}, "ada": {"v": [named("car", "!")]}, "cy": {}}
    found = report(said, None, "no model")
    assert found.problem == "no model"
    (pair,) = found.pairs
    assert (pair.first, pair.second, pair.cosine, pair.label) == ("ada", "bob", None, 0.5)


def test_kappa_by_hand() -> None:
    assert kappa([]) is None
    assert kappa([(True, True)] * 3) is None
    assert kappa([(True, True), (False, False)]) == 1
    assert kappa([(True, False), (False, True)]) == -1
    assert kappa([(True, True), (False, True), (False, False)]) == pytest.approx(0.4)


@given(st.integers(0, 4), st.integers(0, 4), st.integers(0, 2**32 - 1))
def test_matching_is_the_best_there_is(rows: int, columns: int, seed: int) -> None:
    alike = np.random.default_rng(seed).uniform(-1, 1, (rows, columns))
    pairs = match(alike)
    short, long = sorted((rows, columns))
    assert len({row for row, _ in pairs}) == len({column for _, column in pairs}) == short
    wide = alike if rows <= columns else alike.T
    best = max(sum(wide[at, column] for at, column in enumerate(p)) for p in permutations(range(long), short))
    assert sum(alike[row, column] for row, column in pairs) == pytest.approx(best)


def test_many_hazards_are_matched_greedily() -> None:
    alike = np.eye(9, 8)[::-1]
    assert match(alike) == [(row, 8 - row) for row in range(1, 9)]
