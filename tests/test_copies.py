"""Near copies: by hand and against naive loops over the definition; plain words; runs and blocks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitegen.copies import (
    MAX_COMPARED,
    nearest_copies,
    number_captions,
    number_forms,
    over_runs,
    plain,
    whole_blocks,
)
from tests.test_probes import GOOD, VIDEOS, probe, submission, vectors_of


def test_near_copies_carry_it_both() -> None:
    theirs = {video: [text.upper() + " !", "and more"] for video, (text,) in GOOD.items()}
    ours = {video: ["And  more", text] for video, (text,) in GOOD.items()} | {"v00": ["And more"]}
    found = probe(submission(ours, "mine"), submission({}, "none"), submission(theirs, "theirs"))
    assert [one["near-copy"].value for one in found] == [11 / 12, None, 11 / 12]
    assert [one["near-copy"].flagged for one in found] == [True, False, True]
    assert found[0]["near-copy"].sentence == "The same captions as “theirs” in 11 of 12 videos."
    assert found[2]["near-copy"].sentence == "The same captions as “mine” in 11 of 12 videos."


def test_near_copies_in_other_words_of_the_same_direction() -> None:
    theirs = {video: [" ".join(reversed(text.split()))] for video, (text,) in GOOD.items()}
    found = probe(submission(GOOD, "a"), submission(theirs, "b"))
    assert [one["near-copy"].value for one in found] == [1.0, 1.0]
    # A part of the captions is not the same captions.
    longer = {video: [*texts, "And that is all"] for video, texts in theirs.items()}
    assert probe(submission(GOOD, "a"), submission(longer, "b"))[0]["near-copy"].value == 0.0


def test_a_copy_of_some_videos_among_many() -> None:
    part = {video: GOOD[video] for video in VIDEOS[:9]}
    found = probe(submission(GOOD, "a"), submission(part, "b"))[1]["near-copy"]
    assert (found.value, found.flagged) == (9 / 12, False)
    assert found.sentence == "The same captions as “a” in 9 of 12 videos."
    two = {video: GOOD[video] for video in VIDEOS[:2]}
    assert probe(submission(two, "a"), submission(two, "b"))[0]["near-copy"].value is None


def test_names_from_outside_are_made_visible_and_short() -> None:
    name = "<b>\u202egnp.exe " + "x" * 70
    found = probe(submission(GOOD, "a"), submission(GOOD, name))[0]["near-copy"].sentence
    assert "\u202e" not in found
    assert "⟨U+202E⟩gnp.exe" in found
    assert len(found) < 90


def test_many_captions_are_compared_by_their_words() -> None:
    many = [f"Thing {n}" for n in range(MAX_COMPARED + 1)]
    turned = [f"{n} thing" for n in range(MAX_COMPARED + 1)]
    for last, expected in ((MAX_COMPARED, 1.0), (MAX_COMPARED + 1, 0.0)):
        pair = [
            submission(dict.fromkeys(VIDEOS[:3], texts[:last]), name)
            for name, texts in (("a", many), ("b", turned))
        ]
        assert probe(*pair)[0]["near-copy"].value == expected
    pair = [
        submission(dict.fromkeys(VIDEOS[:3], many), "a"),
        submission(dict.fromkeys(VIDEOS, many[::-1]), "b"),
    ]
    assert probe(*pair)[0]["near-copy"].value == 3 / 12


_SAID = st.lists(st.sampled_from(["A cat", "a cat.", "cat a", "dog", "Dog!", "tree", "a a cat"]), max_size=3)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.fixed_dictionaries(dict.fromkeys(VIDEOS[:4], _SAID)), min_size=2, max_size=5), st.booleans()
)
def test_nearest_copies_by_their_definition(board: list[dict[str, list[str]]], blocks: bool) -> None:
    submissions = [submission(captions, str(n)) for n, captions in enumerate(board)]
    vectors = vectors_of(submissions, [])
    if not vectors.row_of:
        return
    forms = number_forms(vectors.row_of)[0]
    number = {video: n for n, video in enumerate(VIDEOS)}
    numbered = [number_captions(one, number, vectors, forms) for one in submissions]
    with pytest.MonkeyPatch.context() as patch:
        if blocks:
            patch.setattr("sitegen.copies._BLOCK", 2)
        found = nearest_copies(numbered, vectors.units, len(VIDEOS))

    def partner(one: str, other: str) -> bool:
        cosine = vectors.units[vectors.row_of[one]] @ vectors.units[vectors.row_of[other]]
        return plain(one) == plain(other) or bool(cosine > 0.98)

    def alike(one: list[str], other: list[str]) -> bool:
        pairs = ((one, other), (other, one))
        return bool(one and other) and all(any(partner(x, y) for y in b) for a, b in pairs for x in a)

    for n, mine in enumerate(board):
        if not any(mine.values()):
            assert found[n] is None
            continue
        shares = {}
        for m, theirs in enumerate(board):
            same = sum(alike(mine[video], theirs[video]) for video in mine)
            either = sum(bool(mine[video] or theirs[video]) for video in mine)
            shares[m] = (same / either, same, either)
        del shares[n]
        best = max(shares, key=lambda m: (shares[m][0], -m))
        one = found[n]
        assert one is not None
        assert (one.other, one.same, one.either) == (best, *shares[best][1:])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("A Cat, crossing\tthe  ROAD!", "a cat crossing the road"),
        ("Ｆｕｌｌ ｗｉｄｔｈ", "full width"),
        ("c\u200bat\u202e and\u00adso on", "cat andso on"),
        ("Straße", "strasse"),
        ("🚗", "🚗"),
        ("की", "की"),
        ("“Car”—truck", "car truck"),
    ],
)
def test_plain_words(text: str, expected: str) -> None:
    assert plain(text) == expected
    assert plain(plain(text)) == expected


@given(st.lists(st.integers(1, 4), min_size=1, max_size=8), st.integers(0, 10**6), st.sampled_from([64, 2]))
def test_over_runs_is_reduceat(lengths: list[int], seed: int, short: int) -> None:
    values = np.random.default_rng(seed).random((sum(lengths), 3))
    kept = values.copy()
    starts = np.cumsum([0, *lengths[:-1]])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sitegen.copies._SHORT_RUN", short)
        found = over_runs(np.minimum, values, starts)
    assert (found == np.minimum.reduceat(values, starts, axis=0)).all()
    assert (values == kept).all()


@given(st.lists(st.integers(1, 5), max_size=8))
def test_blocks_hold_whole_runs(lengths: list[int]) -> None:
    keys = np.repeat(np.arange(len(lengths)), lengths)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sitegen.copies._BLOCK", 4)
        blocks = list(whole_blocks(keys))
    assert np.concatenate([[0][:0], *(keys[rows] for rows, _ in blocks)]).tolist() == keys.tolist()
    for rows, starts in blocks:
        part = keys[rows]
        assert [part[start] for start in starts] == sorted(set(part.tolist()))
        assert len(part) < 4 + 5
    assert len({key for rows, _ in blocks for key in set(keys[rows].tolist())}) == sum(
        len(starts) for _, starts in blocks
    )
