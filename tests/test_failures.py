"""Where hazards were lost: a record made by hand for every kind, and what must hold for any records."""

import random
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.records import Exclusion, Kind, Snippet, Stage, TruthHazard, VideoOutcome
from pipeline.scores import Evaluation, Submission
from sitegen.blame import BlameInput, blame_board
from sitegen.failures import NAMES, NEAR_MISS, SENTENCES, FailureKind
from sitegen.gathered import Records
from tests.blaming import CARD, DEER, EMBEDDER, alive_of, blame_of, only, output, snippets, stages, system

NO_HAZARD = TruthHazard("v", "h1", "", "")
LOST_BY_STEP = (
    {FailureKind.NOT_SEEN, FailureKind.NOTHING_SAID},
    {FailureKind.NOT_RANKED},
    {FailureKind.LOST_IN_MERGING},
    {FailureKind.NOT_ANOMALOUS},
    {FailureKind.TOO_SMALL, FailureKind.NEAR_MISS, FailureKind.OTHER_WORDS},
)


def test_every_kind_has_a_name_and_a_sentence() -> None:
    assert set(NAMES) == set(SENTENCES) == set(FailureKind)
    assert len({*NAMES.values(), *SENTENCES.values()}) == 2 * len(FailureKind)


def test_a_found_hazard_has_no_failure() -> None:
    blame = blame_of(system(["A dog"], [{"h1": 0.81}], Records(stages())))
    assert blame.failures == ()
    assert alive_of(blame) == [1, 1, 1, 1, 1, 1]


STEPS = [
    (dict[str, Sequence[str]](), FailureKind.NOT_SEEN, [1, 0, 0, 0, 0, 0]),
    ({"scene": ["No deer is visible."]}, FailureKind.NOT_SEEN, [1, 0, 0, 0, 0, 0]),
    ({"scene": ["A house.", "A deer is ahead."]}, FailureKind.NOT_RANKED, [1, 1, 0, 0, 0, 0]),
    ({"answer": ["car, deer"]}, FailureKind.NOT_RANKED, [1, 1, 0, 0, 0, 0]),
    ({"answer": ["deer"], "aes": ["deer"]}, FailureKind.NOT_RANKED, [1, 1, 0, 0, 0, 0]),
    ({"rhs": ["car", "two deer"]}, FailureKind.LOST_IN_MERGING, [1, 1, 1, 0, 0, 0]),
    ({"rhs": ["deer"], "aes": ["deer"]}, FailureKind.LOST_IN_MERGING, [1, 1, 1, 0, 0, 0]),
    ({"rhs": ["deer"], "cos": ["deer"]}, FailureKind.NOT_ANOMALOUS, [1, 1, 1, 1, 0, 0]),
    ({"cos": ["animal"]}, FailureKind.NOT_ANOMALOUS, [1, 1, 1, 1, 0, 0]),  # lost and back again
    ({"aos": ["deer"]}, FailureKind.OTHER_WORDS, [1, 1, 1, 1, 1, 0]),
]


@pytest.mark.parametrize(("said", "kind", "alive"), STEPS)
def test_the_step_after_the_last_mention(
    said: dict[str, Sequence[str]], kind: FailureKind, alive: list[int]
) -> None:
    blame = blame_of(system([], [], Records(stages(**said))))
    failure = only(blame)
    assert (failure.kind, failure.prediction_rank, failure.similarity) == (kind, None, 0.0)
    assert failure.stages_known
    assert alive_of(blame) == alive


def test_evidence_says_who_named_it_and_who_did_not() -> None:
    def evidence(**said: Sequence[str]) -> str:
        return only(blame_of(system([], [], Records(stages(**said))))).evidence

    assert evidence() == "None of 1 scene description and 1 video answer mentions it."
    assert evidence(scene=["A house.", "A big deer is ahead."], rhs=["car", "bus"]) == (
        "The description of frame 12 speaks of “a big deer”; the RHS names only “car”, “bus”."
    )
    assert evidence(answer=["car", "deer, car"]) == "Video answer 2 speaks of “deer”; the RHS is empty."
    assert evidence(rhs=["car", "deer"], aes=["deer"], cos=["car"]) == (
        "The RHS names, at rank 2, “deer”; the AES names it too; the COS names only “car”."
    )
    assert evidence(rhs=["deer"]) == (
        "The RHS names, at rank 1, “deer”; the AES does not name it; the COS is empty."
    )
    assert evidence(cos=["deer"], aos=["a", "b", "c", "d"]) == (
        "The COS names, at rank 1, “deer”; the AOS names only “a”, “b”, “c” and 1 more."
    )
    assert evidence(aos=["deer"]) == "The AOS names, at rank 1, “deer”: no caption does."


def test_a_caption_in_other_words() -> None:
    captions = ["An animal is near the kerb", "A wild deer", "A bus"]
    values = [{"h1": 0.5}, {"h1": 0.6}, {"h1": 0.65}]
    blame = blame_of(system(captions, values, Records(stages())))
    failure = only(blame)
    assert failure.kind is FailureKind.OTHER_WORDS
    assert failure.prediction_rank == 2  # the nearest of those that name it
    assert failure.similarity == 0.65  # the best of all
    assert failure.evidence == "Caption 2 names “a wild deer”: similarity 0.6000; more than 0.80 is needed."
    assert alive_of(blame) == [1, 1, 1, 1, 1, 0]
    wrong = [failure for failure in blame.failures if failure.hazard_id is None]
    assert [(f.kind, f.prediction_rank, f.similarity) for f in wrong] == [(FailureKind.WRONG_OBJECT, 3, 0.65)]


@pytest.mark.parametrize(
    ("similarity", "kind"),
    [
        (0.8 + 2e-6, None),
        (0.8, FailureKind.NEAR_MISS),
        (0.8 + 1e-7, FailureKind.NEAR_MISS),
        (0.8 - NEAR_MISS + 2e-6, FailureKind.NEAR_MISS),
        (0.8 - NEAR_MISS, FailureKind.NOT_SEEN),
        (0.0, FailureKind.NOT_SEEN),
    ],
)
def test_the_bounds_of_a_near_miss(similarity: float, kind: FailureKind | None) -> None:
    blame = blame_of(system(["A bus"], [{"h1": similarity}], Records(stages())))
    kinds = [failure.kind for failure in blame.failures]
    off = kind is FailureKind.NOT_SEEN
    assert kinds == ([kind] if kind else []) + ([FailureKind.WRONG_OBJECT] if off else [])
    if kind is FailureKind.NEAR_MISS:
        assert only(blame).prediction_rank == 1
        assert alive_of(blame) == [1, 1, 1, 1, 1, 0]


NARROW, LOW, OUTSIDE = Exclusion.TOO_NARROW, Exclusion.TOO_LOW, Exclusion.OUTSIDE_FRAME


@pytest.mark.parametrize(
    ("left_out", "is_small"),
    [
        (snippets("7", NARROW, LOW, OUTSIDE), True),
        (snippets("7", NARROW, None), False),  # one was compared
        (snippets("7", OUTSIDE), False),  # nothing to be seen: not the size
        (snippets("8", NARROW), False),  # another track
        ((), False),  # not recorded
        (snippets("7", NARROW) + snippets("8", None), True),
    ],
)
def test_too_small_is_what_is_named_at_the_end_and_was_never_compared(
    left_out: tuple[Snippet, ...], is_small: bool
) -> None:
    end = FailureKind.TOO_SMALL if is_small else FailureKind.OTHER_WORDS
    for said, kind in (({"aos": ["deer"]}, end), ({"cos": ["deer"]}, FailureKind.NOT_ANOMALOUS)):
        failure = only(blame_of(system([], [], Records(stages(**said), left_out))))
        assert failure.kind is kind
    captioned = blame_of(system(["A deer"], [{"h1": 0.6}], Records(stages(), left_out)))
    assert only(captioned).kind is end
    assert alive_of(captioned) == [1, 1, 1, 1, 1, 0]
    near = blame_of(system(["A deer"], [{"h1": 0.75}], Records(stages(), left_out)))
    assert only(near).kind is FailureKind.NEAR_MISS


def test_a_hazard_without_a_track_has_the_challenge_tracks_of_no_other() -> None:
    glare = TruthHazard("v", "h2", "Sun glare", "The sun blinds the driver")
    first = snippets("7", NARROW) + snippets("8", NARROW, kind=Kind.TRAFFIC)
    records = Records(stages(aos=["deer", "sun"]), first)
    blame = blame_of(system([], [], records), DEER, glare)
    assert [f.kind for f in blame.failures] == [FailureKind.TOO_SMALL, FailureKind.OTHER_WORDS]
    records = Records(stages(aos=["deer", "sun"]), first + snippets("9", NARROW, LOW))
    blame = blame_of(system([], [], records), DEER, glare)
    assert [f.kind for f in blame.failures] == [FailureKind.TOO_SMALL] * 2
    assert "all 2 snippets of track 9" in blame.failures[1].evidence
    assert "1 too narrow, 1 too low" in blame.failures[1].evidence


def test_without_records_only_the_captions_tell() -> None:
    silent = blame_of(system([], []))
    assert only(silent).kind is FailureKind.NOTHING_SAID
    assert not only(silent).stages_known
    assert alive_of(silent) == [1, None, None, None, None, 0]
    spoken = blame_of(system(["A bus", "A deer"], [{"h1": 0.1}, {"h1": 0.2}]))
    kinds = [(f.kind, f.hazard_id, f.prediction_rank) for f in spoken.failures]
    assert kinds == [(FailureKind.OTHER_WORDS, "h1", 2), (FailureKind.WRONG_OBJECT, None, 1)]
    other = blame_of(system(["A bus"], [{"h1": 0.1}]))
    assert [f.kind for f in other.failures] == [FailureKind.NOTHING_SAID, FailureKind.WRONG_OBJECT]
    assert "does not mention “Deer”" in other.failures[1].evidence


def test_a_run_that_failed_says_so() -> None:
    outcome = VideoOutcome("v", "v.mp4", 0, 0, 0, 0, "no such codec")
    failure = only(blame_of(system([], [], Records(outcome=outcome))))
    assert failure.kind is FailureKind.NOTHING_SAID
    assert "no such codec" in failure.evidence


def test_without_track_2_the_anomalies_follow_the_ranks() -> None:
    said = stages(answer=None, aes=None, cos=None, rhs=["deer"])
    blame = blame_of(system([], [], Records(said)))
    assert only(blame).kind is FailureKind.NOT_ANOMALOUS
    assert only(blame).evidence == "The RHS names, at rank 1, “deer”; the AOS is empty."
    assert alive_of(blame) == [1, 1, 1, None, 0, 0]


def test_the_repaired_list_counts() -> None:
    said = [*stages(rhs=None), output(Stage.RHS, 1, items=["deer"]), output(Stage.RHS, 0)]
    assert only(blame_of(system([], [], Records(tuple(said))))).kind is FailureKind.LOST_IN_MERGING


def test_captions_of_no_hazard() -> None:
    cat = TruthHazard("v", "h2", "Cat", "A cat sits on the road")
    values = [{"h1": 0.9, "h2": 0.1}, {"h1": 0.1, "h2": 0.2}, {"h1": 0.3, "h2": 0.4}]
    blame = blame_of(system(["A deer", "A bus", "The deer again"], values), DEER, cat)
    kinds = [(f.kind, f.hazard_id, f.prediction_rank, f.similarity) for f in blame.failures]
    assert kinds == [
        (FailureKind.NOTHING_SAID, "h2", None, 0.4),
        (FailureKind.WRONG_OBJECT, None, 2, 0.2),  # a cat is left to find
    ]
    blame = blame_of(system(["A deer", "A bus", "A deer too"], values), DEER)
    assert [(f.kind, f.prediction_rank) for f in blame.failures] == [(FailureKind.EXTRA, 2)]
    blame = blame_of(system(["A deer", "A bus"], [{}, {}]), NO_HAZARD)
    assert [(f.kind, f.prediction_rank) for f in blame.failures] == [
        (FailureKind.EXTRA, 1),
        (FailureKind.EXTRA, 2),
    ]
    assert alive_of(blame) == [0, None, None, None, None, 0]


def test_hostile_texts_are_shown_harmless_and_short() -> None:
    text = "A \u202ede\x00er, <script>" + "x" * 3_000
    truth = TruthHazard("v", "h1", "\u202e" * 900, "A deer runs", "\u202e" * 500)
    records = Records(stages(rhs=[text]), snippets("\u202e" * 500, NARROW))
    blame = blame_of(system([text, "A bus"], [{"h1": 0.1}, {"h1": 0.0}], records), truth)
    assert [f.kind for f in blame.failures] == [FailureKind.TOO_SMALL, FailureKind.WRONG_OBJECT]
    for failure in blame.failures:
        assert failure.evidence.isprintable()
        assert len(failure.evidence) < 500


WORDS = ["deer", "animal", "a small dog", "bus", "no deer", "car", ""]
LISTS = st.lists(st.sampled_from(WORDS), max_size=2)


@st.composite
def boards(draw: st.DrawFn) -> tuple[BlameInput, tuple[TruthHazard, ...]]:
    """A video with up to two hazards, captions of any similarity, and every stage recorded."""
    dog = TruthHazard("v", "h2", "Dog", "A dog sleeps on the road")
    truth = draw(st.sampled_from([(DEER,), (dog,), (DEER, dog)]))
    captions = draw(LISTS)
    values = [
        {row.hazard_id: draw(st.sampled_from([0.1, 0.5, 0.75, 0.85])) for row in truth} for _ in captions
    ]
    names = ("scene", "answer", "rhs", "aes", "cos", "aos")
    said = stages(**{name: draw(LISTS) for name in names})
    said = (*said, output(Stage.SCENE, 9), output(Stage.ANSWER, 9))
    left_out = snippets("7", *draw(st.lists(st.sampled_from([NARROW, None]), max_size=2)))
    return system(captions, values, Records(said, left_out)), truth


@settings(max_examples=60)
@given(boards(), st.randoms())
def test_what_holds_for_any_records(
    board: tuple[BlameInput, tuple[TruthHazard, ...]], chance: random.Random
) -> None:
    one, truth = board
    blame = blame_of(one, *truth)
    pairs = one.evaluation.pairs
    best = {
        row.hazard_id: max((p.similarity for p in pairs if p.hazard_id == row.hazard_id), default=0)
        for row in truth
    }
    lost = sorted(hazard_id for hazard_id, value in best.items() if value < 0.8)
    # Every hazard that is not found has exactly one failure, a found one none.
    assert sorted(f.hazard_id for f in blame.failures if f.hazard_id) == lost
    assert all(f.similarity == best[f.hazard_id] for f in blame.failures if f.hazard_id)
    # The funnel never rises, and each drop is the number of hazards with those failures.
    alive = [step.alive or 0 for step in blame.funnel]
    kinds = Counter(f.kind for f in blame.failures if f.hazard_id)
    drops = [before - after for before, after in pairwise(alive)]
    assert alive[0] == len(truth)
    assert alive[-1] == len(truth) - len(lost)
    assert drops == [sum(kinds[kind] for kind in of_step) for of_step in LOST_BY_STEP]
    # A caption that passes or is near is never blamed, and no order matters.
    for failure in blame.failures:
        if failure.hazard_id is None:
            assert failure.similarity < 0.7
            is_extra = not lost
            assert failure.kind is (FailureKind.EXTRA if is_extra else FailureKind.WRONG_OBJECT)

    def shuffled(rows: Sequence[object]) -> tuple[object, ...]:
        return tuple(chance.sample(list(rows), len(rows)))

    evaluation = one.evaluation
    records = one.records["v"]
    captions: tuple[Any, ...] = shuffled(evaluation.submission.predictions)
    mixed_pairs: tuple[Any, ...] = shuffled(pairs)
    outputs: tuple[Any, ...] = shuffled(records.stages)
    left_out: tuple[Any, ...] = shuffled(records.snippets)
    mixed = BlameInput(
        Evaluation(Submission("b", "", "", "", "", captions), mixed_pairs, (), CARD),
        {"v": Records(outputs, left_out)},
    )
    rows: tuple[Any, ...] = shuffled(truth)
    other = system([], [])
    assert blame_board([other, mixed], rows, EMBEDDER, 0.8)[1] == blame
