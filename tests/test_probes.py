"""Probes: by hand, against naive loops over the definitions, and against the scores themselves."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Submission
from sitegen.copies import NumberedCaptions, number_captions, number_forms, plain
from sitegen.evaluate import TextVectors, evaluate, texts_of
from sitegen.probes import Probe, exchange, is_bag, probe_board, word_bags
from sitegen.score import unit_rows

KINDS = ["constant", "word-bag", "shuffled", "stuffing", "near-copy", "truth-copy"]
VIDEOS = [f"v{n:02}" for n in range(12)]
HAZARDS = ["cat", "dog", "deer", "tree", "tyre", "box", "van", "bus", "man", "child", "cone", "bird"]
TRUTH = [
    TruthHazard(video, "1", hazard, f"A {hazard} is lying on the road")
    for video, hazard in zip(VIDEOS, HAZARDS, strict=True)
]


def submission(captions: dict[str, Sequence[str]], name: str = "S") -> Submission:
    rows = [(video, rank, text) for video, texts in captions.items() for rank, text in enumerate(texts, 1)]
    return Submission(name, "", "", "2026-01-01", "csv", tuple(Prediction(*row) for row in rows))


def vectors_of(submissions: Sequence[Submission], truth: Sequence[TruthHazard] = TRUTH) -> TextVectors:
    """Counts of words: texts of the same words have a cosine of 1, without a common word of 0."""
    texts = sorted(texts_of(submissions, truth))
    words = sorted({word for text in texts for word in plain(text).split()})
    if not texts:
        return TextVectors({}, np.zeros((0, 0)))
    counts = np.array([[plain(text).split().count(word) for word in words] for text in texts])
    return TextVectors({text: row for row, text in enumerate(texts)}, unit_rows(counts.astype(np.float64)))


def probe(*submissions: Submission, truth: Sequence[TruthHazard] = TRUTH) -> list[dict[str, Probe]]:
    found = probe_board(submissions, truth, vectors_of(submissions, truth), 0.8)
    assert all([one.kind for one in row] == KINDS for row in found)
    return [{one.kind: one for one in row} for row in found]


GOOD = {v: [f"We see a {h} which has stopped"] for v, h in zip(VIDEOS, HAZARDS, strict=True)}


def test_an_honest_system_is_not_flagged() -> None:
    other = submission({video: ["Nothing of note happens over there"] for video in VIDEOS[:4]}, "other")
    found = probe(submission(GOOD), other)[0]
    assert not any(one.flagged for one in found.values())
    values = {kind: one.value for kind, one in found.items() if kind != "shuffled"}
    assert values == {
        "constant": 1 / 12,
        "word-bag": 0.0,
        "stuffing": 1.0,
        "near-copy": 0.0,
        "truth-copy": 0.0,
    }
    assert 0 < (found["shuffled"].value or 0) < 0.9
    assert found["near-copy"].sentence == "In no video the same captions as another submission."


def test_nothing_said_is_nothing_found() -> None:
    nothing, little = probe(submission({}), submission({"v00": ["A cat"], "v01": ["A dog"]}))
    unsaid = [
        *nothing.values(),
        *(little[kind] for kind in ("constant", "word-bag", "shuffled", "near-copy")),
    ]
    for one in unsaid:
        assert (one.value, one.text, one.flagged) == (None, "cannot be said", False)
        assert one.sentence.endswith(".")
    assert (little["stuffing"].value, little["truth-copy"].value) == (1.0, 0.0)
    assert probe(submission(GOOD))[0]["near-copy"].sentence == "There is no other submission."
    assert probe_board([], TRUTH, vectors_of([]), 0.8) == []


def test_constant_caption() -> None:
    captions = {video: ["A car ahead!", "It rains"] for video in VIDEOS[:5]}
    captions |= {"v05": ["a  CAR, ahead", "A car ahead"], "v06": ["A bus is parked"], "v07": ["It rains"]}
    found = probe(submission(captions))[0]["constant"]
    assert (found.value, found.text, found.flagged) == (6 / 8, "75.0\u202f%", True)
    assert found.sentence == "The most common caption is given in 6 of the 8 videos that have captions."
    half = {video: ["One thing here" if n < 4 else f"Thing {n} there"] for n, video in enumerate(VIDEOS[:8])}
    assert probe(submission(half))[0]["constant"].flagged
    under = half | {"v08": ["Thing 8 there"]}
    assert not probe(submission(under))[0]["constant"].flagged


ORDINARY = """A cat crossing the road
Deer standing on road shoulder
Deer crossing road
Large deer crossing wet road
Truck braking suddenly ahead
A large fallen tree blocks the right lane
Pedestrian with umbrella steps off the curb
Fallen tree blocking road
White car ahead
Small brown dog
Debris on the road
The car in front of us brakes hard
Motorcyclist overtaking from behind
Broken-down white van, hazard lights flashing
An oncoming motorcyclist appears from behind a white car
Kangaroo
Two cyclists riding side by side
Person pushing shopping cart
Low sun hides the road
Car and truck collide
Traffic cones mark closed lane near exit
Overturned trailer blocking two lanes""".splitlines()
BAGS = """car road person truck debris
car, truck, person, animal
animal debris pedestrian vehicle road hazard
deer dog cat bird kangaroo animal road
car vehicle pedestrian crossing road animal
Truck car bus van motorcycle bicycle
person people man woman child road street car
road car lane building tree truck""".splitlines()


@pytest.mark.parametrize("text", ORDINARY)
def test_ordinary_captions_are_no_bags(text: str) -> None:
    assert not is_bag(plain(text).split())


@pytest.mark.parametrize("text", BAGS)
def test_words_strung_together_are_bags(text: str) -> None:
    assert is_bag(plain(text).split())


def test_word_bag_needs_the_words_of_the_truth() -> None:
    common = "road lying cat dog"  # half of the words suffices
    captions = {video: [f"{common} zebra yak emu gnu"] for video in VIDEOS[:3]}
    captions |= {video: ["zebra yak emu gnu okapi road"] for video in VIDEOS[3:5]}
    found = probe(submission(captions | {"v05": ["A cat is here"]}))[0]["word-bag"]
    assert (found.value, found.flagged) == (3 / 6, True)
    assert found.sentence == "Common words strung together without a sentence: 3 of 6 captions."
    assert not probe(submission(captions | {"v05": ["A cat"], "v06": ["A dog"]}))[0]["word-bag"].flagged


def test_only_the_fifty_most_common_words_count() -> None:
    # Letters make words of equal count; the first fifty in the alphabet are common.
    names = [a + b for a in "bcd" for b in "abcdefghijklmnopqrst"]
    truth = [" ".join(["the", *names]), *(["the cat"] * 3)]
    forms = number_forms([*truth, "cat ba bb cz", "ds dt ca db", "dp dq dr cat"])
    bags = word_bags(forms[1], [forms[0][text] for text in truth])
    assert bags is not None
    # cat, ba to bt, ca to ct, da to di are fifty.
    assert [bags[forms[0][text]] for text in ("cat ba bb cz", "ds dt ca db", "dp dq dr cat")] == [
        True,
        True,
        False,
    ]


def test_word_bag_is_silent_where_the_truth_has_no_sentences_it_knows() -> None:
    truth = [dataclasses.replace(row, description=f"Ein {row.label} liegt auf der Straße") for row in TRUTH]
    found = probe(submission({video: ["Auto Straße Hund Katze"] for video in VIDEOS}), truth=truth)
    assert found[0]["word-bag"].value is None
    assert "English" in found[0]["word-bag"].sentence


def test_shuffled_videos_of_a_constant_caption_lose_nothing() -> None:
    found = probe(submission({video: ["A thing is lying on the road"] for video in VIDEOS}))[0]["shuffled"]
    assert found.value == pytest.approx(1)
    assert found.flagged
    some = probe(submission({video: ["A thing is lying on the road"] for video in VIDEOS[:5]}))[0]["shuffled"]
    assert some.value == pytest.approx(1)
    few = probe(submission({video: ["A thing is lying on the road"] for video in VIDEOS[:4]}))[0]["shuffled"]
    assert (few.value, few.flagged) == (None, False)


def test_shuffled_videos_of_what_fits_one_video_only() -> None:
    truth = [dataclasses.replace(row, description=row.label) for row in TRUTH]
    found = probe(submission({row.video_id: [row.label] for row in truth}), truth=truth)[0]["shuffled"]
    assert (found.value, found.text, found.flagged) == (0.0, "0.0\u202f%", False)
    assert found.sentence == (
        "With the captions of other videos BESM is 0.0000 instead of 1.0000, and 0.0 instead of 12 "
        "of the 12 videos with a hazard are detected."
    )
    useless = probe(submission({row.video_id: ["x"] for row in truth}), truth=truth)[0]["shuffled"]
    assert (useless.value, useless.flagged) == (None, False)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_exchange_is_what_the_scores_say_of_every_rotation(seed: int, blocks: bool) -> None:
    """Rotated by 1, ..., V - 1, every video has the captions of every other one once."""
    chance = np.random.default_rng(seed)
    words = ["cat", "dog", "deer", "tree", "road"]

    def say(most: int) -> list[str]:
        return [" ".join(chance.choice(words, 3)) for _ in range(chance.integers(0, most + 1))]

    truth = [
        TruthHazard(video, str(n), "x", text)
        for video in VIDEOS[:7]
        for n, text in enumerate([*say(2), "a cat"])
    ]
    truth += [TruthHazard("v20", "1", "", "")]
    captions = {video: say(3) for video in [*VIDEOS[:7], "v20"]}
    vectors = vectors_of([submission(captions)], truth)
    number = {video: n for n, video in enumerate([*VIDEOS[:7], "v20"])}
    forms = number_forms(vectors.row_of)[0]
    numbered = number_captions(submission(captions), number, vectors, forms)
    rows = [row for row in truth if row.description]
    with pytest.MonkeyPatch.context() as patch:
        if blocks:
            patch.setattr("sitegen.copies._BLOCK", 3)
        found = exchange(
            numbered,
            np.array([number[row.video_id] for row in rows]),
            vectors.rows(row.description for row in rows),
            vectors.units,
            0.8,
        )
    besm, detected = [], []
    for turn in range(7):
        turned = {video: captions[VIDEOS[(n + turn) % 7]] for n, video in enumerate(VIDEOS[:7])}
        scored = evaluate(submission(turned), rows, Embedder(), 0.8, "0", vectors=vectors)
        besm.append(scored.card.besm)
        detected.append(scored.card.detection_rate * 7)
    assert (found.videos, found.said) == (7, sum(bool(captions[video]) for video in VIDEOS[:7]))
    assert (found.own_besm, found.own_detected) == pytest.approx((besm[0], detected[0]), abs=1e-6)
    expected = np.mean(besm[1:]), np.mean(detected[1:])
    assert (found.other_besm, found.other_detected) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("most", [3, 4])
def test_exchange_in_groups(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Where all videos are alike it does not matter with which of them captions are exchanged."""
    videos = np.repeat(np.arange(7), 2)
    captions = NumberedCaptions(videos, np.tile([0, 1], 7), np.tile([0, 1], 7))
    units = np.array([[1.0, 0.0], [0.6, 0.8], [0.0, 1.0]])
    hazards = np.arange(7), np.full(7, 2)
    whole = exchange(captions, *hazards, units, 0.7)
    monkeypatch.setattr("sitegen.probes.EXCHANGED", most)
    found = exchange(captions, *hazards, units, 0.7)
    assert (found.videos, found.said) == (7, 7)
    assert (found.own_besm, found.other_besm) == pytest.approx((0.4, 0.4), abs=1e-6)  # (0.8 + 0) / 2
    assert (whole.own_besm, whole.other_besm) == pytest.approx((0.4, 0.4), abs=1e-6)
    assert (found.own_detected, found.other_detected) == pytest.approx((7, 7))


class Embedder:
    """Never asked: all vectors are given."""

    name = "none"
    sha256 = "0" * 64

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        raise AssertionError


def test_stuffing() -> None:
    found = probe(submission({"v00": [f"Thing {n}" for n in range(8)], "v01": ["A cat", "A cat"]}))[0]
    assert (found["stuffing"].value, found["stuffing"].flagged) == (5.0, False)
    assert found["stuffing"].text == "5.0 captions a video"
    assert found["stuffing"].sentence == "Over 2 videos with captions: 5.0 captions on average, 8 at most."
    more = probe(submission({"v00": [f"Thing {n}" for n in range(9)], "v01": ["A cat", "A cat"]}))[0]
    assert more["stuffing"].flagged


def test_truth_copies() -> None:
    captions = {video: ["Who knows", "a CAT is: lying, on the road"] for video in VIDEOS[:3]}
    captions |= {"v01": ["A dog is lying on the road."], "v02": ["A cat is lying on the road"]}
    found = probe(submission(captions))[0]["truth-copy"]
    assert (found.value, found.flagged) == (2 / 12, True)
    assert found.sentence == "Described in exactly the words of the truth: 2 of 12 hazards."
    one = probe(submission({"v00": captions["v00"], "v04": ["A cat"]}))[0]["truth-copy"]
    assert (one.value, one.flagged) == (1 / 12, False)


def test_short_descriptions_are_no_copies() -> None:
    short = [dataclasses.replace(row, description=f"A big {row.label}") for row in TRUTH]
    said = submission({row.video_id: [row.description] for row in short})
    assert probe(said, truth=short)[0]["truth-copy"].value is None
    mixed = [*short[:2], *TRUTH[2:]]
    found = probe(submission({row.video_id: [row.description] for row in mixed[:3]}), truth=mixed)
    assert found[0]["truth-copy"].value == 1 / 10


def test_no_sentence_quotes_the_truth() -> None:
    said = submission({row.video_id: [row.description] for row in TRUTH})
    for found in probe(said, said):
        for one in found.values():
            text = " ".join((one.name, one.text, one.threshold_text, one.sentence)).casefold()
            assert not any(row.description.casefold() in text or f" {row.label} " in text for row in TRUTH)


def test_videos_without_a_hazard_count_for_copies_only() -> None:
    truth = [*TRUTH, *(TruthHazard(f"w{n}", "1", "", "") for n in range(4))]
    quiet = {f"w{n}": ["A cat is lying on the road"] for n in range(4)}
    found = probe(submission(quiet, "a"), submission(quiet, "b"), truth=truth)[0]
    assert (found["near-copy"].value, found["constant"].value) == (1.0, 1.0)
    assert (found["shuffled"].value, found["truth-copy"].value) == (None, 0.0)
