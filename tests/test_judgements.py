"""How far metrics agree with votes: by hand, against scipy, and what must not change it."""

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pipeline.scores import Evaluation, Scorecard, Signature, Submission, VideoScore
from sitegen.judgements import AgreementTable, Choice, Vote, Votes, agreement, agreement_table

A, B = "a" * 64, "b" * 64
IDS = [f"v{n:02d}" for n in range(20)]


def scored(name: str, values: dict[str, float], **fixed: float) -> Evaluation:
    """An evaluation whose BESM in each video is given; the other metrics are the same unless fixed."""
    videos = tuple(
        VideoScore(
            video_id,
            1,
            1,
            0,
            best=fixed.get("best", value),
            worst=0.0,
            mean=0.0,
            besm=value,
            sam=fixed.get("sam", value),
            detected=value > 0.8,
        )
        for video_id, value in sorted(values.items())
    )
    card = Scorecard(0.0, 0.0, 0.0, None, len(videos), Signature("1", "e", A, A, len(videos), 0.8))
    return Evaluation(Submission(name, "", "", "", "csv", ()), (), videos, card)


def judged(video_id: str, left: str, right: str, choice: Any, voter: int = 1) -> Vote:
    return Vote(voter, video_id, left, right, choice, A, B)


def test_agreement_by_hand() -> None:
    ids = [f"v{n:02d}" for n in range(14)]
    one = scored("one", dict.fromkeys(ids, 0.9), sam=0.5)
    two = scored("two", {**dict.fromkeys(ids, 0.6), ids[0]: 0.95, ids[1]: 0.9}, sam=0.5)
    # In v00 the metric prefers two, in v01 it has a tie, elsewhere it prefers one.
    choices = ["right", "left", *["left"] * 8, "right", "right", "tie", "tie"]
    votes = [judged(i, "one", "two", choice) for i, choice in zip(ids, choices, strict=True)]
    besm, sam, detection, best = agreement(
        [*votes, judged("v99", "one", "two", "left")], {"one": one, "two": two}
    )
    assert (besm.concordant, besm.discordant, besm.vote_ties, besm.metric_ties) == (9, 2, 2, 1)
    assert besm.tau == pytest.approx((9 - 2) / 11)
    assert besm.interval and -1 <= besm.interval.low < besm.tau < besm.interval.high <= 1
    assert (sam.tau, sam.interval, sam.metric_ties) == (None, None, 12)
    assert (detection.concordant, detection.discordant, detection.metric_ties) == (8, 2, 2)
    assert detection.tau == pytest.approx(0.6)
    assert (best.tau, best.interval) == (besm.tau, besm.interval)


def pair(seed: int) -> dict[str, Evaluation]:
    """Two systems whose scores in 20 videos are drawn from ten values, so that some are equal."""
    rng = np.random.default_rng(seed)
    return {
        name: scored(name, dict(zip(IDS, rng.integers(10, size=len(IDS)) / 10, strict=True)))
        for name in ("one", "two")
    }


@pytest.mark.parametrize("seed", range(5))
def test_a_full_ranking_has_scipys_tau(seed: int) -> None:
    """All pairs of systems on one video, voted as one ranking has it: Kendall's tau of two rankings."""
    rng = np.random.default_rng(seed)
    liking, value = rng.permutation(8), rng.permutation(8) / 10
    names = [f"s{n}" for n in range(8)]
    evaluations = {name: scored(name, {"v": float(value[n])}) for n, name in enumerate(names)}
    votes = [
        judged("v", names[a], names[b], "left" if liking[a] > liking[b] else "right", voter=n)
        for n, (a, b) in enumerate(combinations(range(8), 2))
    ]
    assert agreement(votes, evaluations)[0].tau == pytest.approx(stats.kendalltau(liking, value).statistic)


def test_ties_of_the_metric_are_left_out_as_in_goodman_and_kruskals_gamma() -> None:
    """Gamma from scipy's tau-b: both have the same numerator, concordant - discordant."""
    rng = np.random.default_rng(3)
    liking, value = rng.permutation(8), rng.integers(4, size=8) / 10
    names = [f"s{n}" for n in range(8)]
    evaluations = {name: scored(name, {"v": float(value[n])}) for n, name in enumerate(names)}
    votes = [
        judged("v", names[a], names[b], "left" if liking[a] > liking[b] else "right", voter=n)
        for n, (a, b) in enumerate(combinations(range(8), 2))
    ]
    one = agreement(votes, evaluations)[0]
    tied = sum(value[a] == value[b] for a, b in combinations(range(8), 2))
    assert one.metric_ties == tied > 0 and one.concordant + one.discordant == 28 - tied
    difference = stats.kendalltau(liking, value).statistic * np.sqrt(28 * (28 - tied))
    assert one.tau == pytest.approx(difference / (28 - tied))


CHOICES = st.lists(
    st.tuples(st.integers(0, 3), st.sampled_from(IDS), st.sampled_from(["left", "right", "tie"])),
    min_size=25,
    max_size=60,
)


@given(CHOICES, st.integers(0, 9), st.randoms())
def test_neither_sides_nor_order_nor_tied_votes_change_anything(
    choices: list[tuple[int, str, Choice]], seed: int, random: Any
) -> None:
    evaluations = pair(seed)
    votes = [judged(video, "one", "two", choice, voter) for voter, video, choice in choices]
    before = agreement(votes, evaluations, resamples=50)
    turned: dict[Choice, Choice] = {"left": "right", "right": "left", "tie": "tie"}
    changed = [
        replace(one, left=one.right, right=one.left, choice=turned[one.choice])
        if random.random() < 0.5
        else one
        for one in votes
    ]
    random.shuffle(changed)
    assert agreement(changed, evaluations, resamples=50) == before
    ties = [judged(video, "one", "two", "tie", 99) for video in IDS]
    after = agreement([*votes, *ties], evaluations, resamples=50)
    assert after == [replace(one, vote_ties=one.vote_ties + len(ties)) for one in before]
    for one in before:
        decided = one.concordant + one.discordant
        assert (one.tau is None) == (one.interval is None) == (decided < 10)
        assert decided + one.vote_ties + one.metric_ties == len(votes)


@given(CHOICES, st.integers(0, 9))
def test_opposite_votes_have_the_opposite_tau(choices: list[tuple[int, str, Choice]], seed: int) -> None:
    evaluations = pair(seed)
    turned: dict[Choice, Choice] = {"left": "right", "right": "left", "tie": "tie"}
    votes = [judged(video, "one", "two", choice, voter) for voter, video, choice in choices]
    opposite = [replace(one, choice=turned[one.choice]) for one in votes]
    for one, other in zip(
        agreement(votes, evaluations, resamples=50),
        agreement(opposite, evaluations, resamples=50),
        strict=True,
    ):
        assert (one.concordant, one.discordant) == (other.discordant, other.concordant)
        if one.tau is not None and one.interval and other.interval:
            assert one.tau == -(other.tau or 0.0)
            assert one.interval.low == pytest.approx(-other.interval.high)
            assert one.interval.high == pytest.approx(-other.interval.low)


def ten_to_six() -> list[Vote]:
    """16 votes on 16 videos, of which 10 agree with the scores of `clear`."""
    return [judged(video, "one", "two", "left" if n < 10 else "right") for n, video in enumerate(IDS[:16])]


CLEAR = {"one": scored("one", dict.fromkeys(IDS, 0.9)), "two": scored("two", dict.fromkeys(IDS, 0.1))}


def test_votes_of_one_person_on_one_video_are_no_more_certain() -> None:
    votes = ten_to_six()
    assert agreement(votes * 5, CLEAR)[0].interval == agreement(votes, CLEAR)[0].interval
    apart = [replace(one, voter=n) for n in range(5) for one in votes]
    wide, narrow = agreement(votes, CLEAR)[0].interval, agreement(apart, CLEAR)[0].interval
    assert wide and narrow and narrow.high - narrow.low < 0.6 * (wide.high - wide.low)


def test_the_interval_is_that_of_a_binomial() -> None:
    """With one vote a cluster, the votes that agree in a resample are binomial: 16 draws, 10 of 16 agree."""
    found = agreement(ten_to_six(), CLEAR, resamples=20_000)[0]
    assert found.tau == pytest.approx(0.25) and found.interval
    low, high = 2 * stats.binom.ppf([0.025, 0.975], 16, 10 / 16) / 16 - 1
    assert (found.interval.low, found.interval.high) == pytest.approx((low, high))


def test_seeds_and_resamples() -> None:
    votes = ten_to_six()
    assert agreement(votes, CLEAR, seed=1) == agreement(votes, CLEAR, seed=1)
    with pytest.raises(ValueError, match="0 resamples"):
        agreement(votes, CLEAR, resamples=0)


def test_nine_decided_votes_are_too_few() -> None:
    votes = ten_to_six()[:9] + [judged("v19", "one", "two", "tie")] * 5
    assert {one.tau for one in agreement(votes, CLEAR)} == {None}
    assert agreement([*votes, judged("v18", "one", "two", "left")], CLEAR)[0].tau == 1.0


def test_the_table_of_the_method_page() -> None:
    assert agreement_table(Votes(apart=2), CLEAR) == AgreementTable("", ())
    hidden = {slug: replace(one, videos=()) for slug, one in CLEAR.items()}
    assert agreement_table(Votes(tuple(ten_to_six())), hidden) == AgreementTable("", ())
    votes = [*ten_to_six(), judged("v01", "one", "two", "tie", voter=2)]
    table = agreement_table(Votes(tuple(votes), 3), CLEAR)
    assert table.summary == (
        "17 votes by 2 voters on 16 videos. 1 tie left out. "
        "3 votes on captions that have changed since, kept apart."
    )
    assert [line.name for line in table.lines] == ["BESM", "SAM", "Detection", "Best similarity"]
    besm, sam = table.lines[:2]
    assert (besm.tau, besm.n, besm.ties) == ("0.25", "16", "0")
    low, high = besm.interval.split(" to ")
    assert low.startswith("\u2212") and float(high) > 0.25
    assert (sam.tau, sam.interval, sam.n, sam.ties) == ("0.25", besm.interval, "16", "0")
    few = agreement_table(Votes(tuple(votes[:3])), CLEAR)
    assert (few.lines[0].tau, few.lines[0].interval, few.lines[0].n) == ("–", "–", "3")
