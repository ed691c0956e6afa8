"""The compare page without a browser: tests equal to `compare`, data in bounds, counts by the definition."""

import dataclasses
import json
import re
from collections import Counter
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

from pipeline.records import Prediction
from sitegen.compare import compare
from sitegen.compare_files import SCALE, SHARD_BYTES, compare_files
from sitegen.gathered import SiteData
from sitegen.page_compare import ComparePage, compare_page, p_text, signed
from sitegen.paired import all_pairs
from sitegen.rendering import environment
from sitegen.uncertainty import Interval
from tests.compare_case import ODD_ID, SHELL, board


@pytest.fixture(scope="module")
def data() -> SiteData:
    return board(130, 5)


@pytest.fixture(scope="module")
def files(data: SiteData) -> dict[str, Any]:
    return dict(_values(data))


@pytest.fixture(scope="module")
def page(data: SiteData) -> ComparePage:
    return compare_page(data, SHELL)


def _values(data: SiteData) -> Iterator[tuple[str, Any]]:
    """The name of each data file with its value, as the page's script is given them."""
    for path, content in compare_files(data):
        assert len(content) <= SHARD_BYTES
        found = re.fullmatch(r'COOOLER_DATA\("([a-z0-9/-]+)",(.*)\);\n', content.decode("ascii"), re.DOTALL)
        assert found and path == f"data/{found[1]}.js"
        assert "<" not in content.decode()
        yield found[1], json.loads(found[2])


def _detected(data: SiteData) -> dict[str, frozenset[int]]:
    """Video id -> the places of the systems that detect it."""
    return {
        video_id: frozenset(
            place for place, system in enumerate(data.systems) if system.scores[video_id].detected
        )
        for video_id in data.video_ids
    }


def test_all_pairs_are_what_compare_says_to_the_last_bit(data: SiteData) -> None:
    evaluations = [system.evaluation for system in data.systems]
    found = all_pairs(evaluations)
    assert len(found) == 20
    for a, b in ((0, 1), (1, 0), (2, 4), (4, 3)):
        assert found[a, b] == compare(evaluations[a], evaluations[b])
    few = all_pairs(evaluations[:3], resamples=99, seed=7)
    assert few[2, 0] == compare(evaluations[2], evaluations[0], resamples=99, seed=7)
    assert all_pairs(evaluations[:1]) == {}


def test_equal_systems_and_no_hazard_at_all(data: SiteData) -> None:
    one = data.systems[0].evaluation
    empty = [dataclasses.replace(video, n_hazards=0, n_hazards_found=0) for video in one.videos]
    card = dataclasses.replace(one.card, hazard_recall=None)
    same = dataclasses.replace(one, videos=tuple(empty), card=card)
    found = all_pairs([same, same])[0, 1]
    assert list(found) == ["besm", "sam", "detection_rate"]
    assert found["besm"].interval == Interval(0, 0) and found["besm"].p_randomisation == 1


def test_the_files_hold_every_test_exactly(data: SiteData, files: dict[str, Any]) -> None:
    index = files["compare"]
    assert [row[0] for row in index["systems"]] == [system.slug for system in data.systems]
    for a, b in ((0, 3), (4, 1)):
        rows = files[f"compare/tests/{data.systems[a].slug}"][b]
        for key, one in compare(data.systems[a].evaluation, data.systems[b].evaluation).items():
            low, high, bootstrap, randomisation, wins, losses = rows[key]
            assert (low, high) == (one.interval.low, one.interval.high)
            draws = index["resamples"] + 1
            assert (bootstrap / draws, randomisation / draws) == (one.p_bootstrap, one.p_randomisation)
            assert (wins, losses, index["videos"] - wins - losses) == (one.wins, one.losses, one.ties)
            place = index["metrics"].index(key)
            assert index["systems"][a][2][place] - index["systems"][b][2][place] == one.difference
    assert files[f"compare/tests/{data.systems[2].slug}"][2] == {}


def test_scores_are_right_and_their_wins_are_those_of_the_test(data: SiteData, files: dict[str, Any]) -> None:
    assert files["compare"]["scale"] == SCALE and files["compare"]["block"] == 100
    columns = []
    for system in data.systems:
        shards = [files[f"compare/scores/{system.slug}/{number}"] for number in range(2)]
        for name in ("best", "besm", "sam"):
            values = [value / SCALE for shard in shards for value in shard[name]]
            assert values == pytest.approx(
                [getattr(video, name) for video in system.evaluation.videos], abs=0.51 / SCALE
            )
        found = "".join(shard["detection"] for shard in shards)
        assert [digit == "1" for digit in found] == [video.detected for video in system.evaluation.videos]
        digits = files[f"compare/found/{system.slug}"]
        bits = "".join(f"{int(digit, 16):04b}" for digit in digits)
        assert bits[:130] == found and set(bits[130:]) <= {"0"}
        columns.append([value for shard in shards for value in shard["besm"]])
    for a, b in combinations(range(5), 2):
        one = compare(data.systems[a].evaluation, data.systems[b].evaluation, resamples=1)["besm"]
        gaps = [x - y for x, y in zip(columns[a], columns[b], strict=True)]
        assert (sum(gap > 1 for gap in gaps), sum(gap < -1 for gap in gaps)) == (one.wins, one.losses)


def test_videos_and_captions_stand_at_their_places(data: SiteData, files: dict[str, Any]) -> None:
    first = files["compare"]["first"]
    entries = [entry for number in range(len(first)) for entry in files[f"compare/videos/{number}"]]
    assert len(entries) == 130
    for video_id, entry in zip(data.video_ids, entries, strict=True):
        assert entry[0] == data.names[video_id]
        assert (entry[4] if len(entry) > 4 else entry[1]) == video_id
        assert entry[2] == ("" if data.truth[video_id][0].is_no_hazard else data.truth[video_id][0].label)
    assert entries[data.video_ids.index(ODD_ID)][1] == "odd/⟨U+202E⟩id <b>"
    for system in data.systems:
        for number, start in ((0, 0), (1, 100)):
            cuts = files[f"compare/scores/{system.slug}/{number}"]["cuts"]
            parts = [files[f"compare/captions/{system.slug}/{number}-{cut}"] for cut in range(len(cuts))]
            for cut, part in zip(cuts, parts, strict=True):
                for video_id, said in zip(data.video_ids[cut:], part, strict=False):
                    rows = system.predictions.get(video_id, [])
                    assert (said == 0) == (not rows)
                    if rows:
                        assert said[1] == len(rows)
                    if len(rows) == 1:
                        assert said[0] == rows[0].description
            assert cuts[0] == start and sum(map(len, parts)) == min(100, 130 - start)


def test_the_caption_shown_is_the_closest(data: SiteData, files: dict[str, Any]) -> None:
    system = next(s for s in data.systems if any(len(rows) > 1 for rows in s.predictions.values()))
    place, video_id = next(
        (place, video_id)
        for place, video_id in enumerate(data.video_ids[:100])
        if len(system.predictions.get(video_id, [])) > 1 and not data.truth[video_id][0].is_no_hazard
    )
    closest = max(system.pairs[video_id], key=lambda pair: pair.cosine).prediction_rank
    shard = files[f"compare/captions/{system.slug}/0-0"]
    assert shard[place][0] == system.predictions[video_id][closest - 1].description


def test_long_captions_are_spread_over_parts(data: SiteData) -> None:
    evaluation = data.systems[0].evaluation
    rows = tuple(Prediction(video_id, 1, "猫" * 1000) for video_id in data.video_ids)
    submission = dataclasses.replace(evaluation.submission, predictions=rows)
    loud = dataclasses.replace(
        data.systems[0], evaluation=dataclasses.replace(evaluation, submission=submission)
    )
    files = dict(_values(dataclasses.replace(data, systems=(loud, data.systems[1]))))
    cuts = files[f"compare/scores/{loud.slug}/1"]["cuts"]
    parts = [files[f"compare/captions/{loud.slug}/1-{cut}"] for cut in range(len(cuts))]
    assert len(cuts) > 2 and [100 + sum(map(len, parts[:cut])) for cut in range(len(cuts))] == cuts
    assert {entry[0] for part in parts for entry in part} == {"猫" * 139 + "…"}


def test_all_against_the_first(data: SiteData, page: ComparePage) -> None:
    first = data.systems[0].evaluation
    assert page.first is not None and page.first.slug == data.systems[0].slug
    assert [row.slug for row in page.contenders] == [system.slug for system in data.systems[1:]]
    for row, system in zip(page.contenders, data.systems[1:], strict=True):
        one = compare(system.evaluation, first)["besm"]
        assert float(row.difference.replace("−", "-")) == pytest.approx(one.difference, abs=5e-5)
        ends = [float(end.replace("−", "-")) for end in row.interval.split(" to ")]
        assert ends == pytest.approx([one.interval.low, one.interval.high], abs=5e-5)
        assert (row.better, row.worse, row.equal) == tuple(map(str, (one.wins, one.losses, one.ties)))
        assert row.p == p_text(one.p_randomisation)
        assert row.apart == ("yes" if one.p_randomisation < 0.05 else "no")


def test_who_detects_what(data: SiteData, page: ComparePage) -> None:
    detected = _detected(data)
    sizes = Counter(len(systems) for systems in detected.values())
    assert [row.name for row in page.counts] == ["all 5", "4 of 5", "3 of 5", "2 of 5", "1 of 5", "none"]
    assert [row.videos for row in page.counts] == [sizes[number] for number in range(5, -1, -1)]
    for number, row in zip(range(5, -1, -1), page.counts, strict=True):
        ids = [video_id for video_id in data.video_ids if len(detected[video_id]) == number]
        assert [link.href for link in row.links] == [f"videos/{data.names[v]}.html" for v in ids[:6]]
        assert len(row.links) + row.more == len(ids)
    sets = Counter(systems for systems in detected.values() if systems)
    assert [row.videos for row in page.sets] == [count for _, count in sets.most_common(12)]
    left = len(sets) - 12
    assert page.sets_left_out == {1: "1 more set"}.get(left, f"{left} more sets" if left > 0 else "")
    for place, line in enumerate(page.matrix):
        assert line.detected == sum(place in systems for systems in detected.values())
        assert line.alone == sum(systems == {place} for systems in detected.values())
        for other, cell in enumerate(line.cells):
            ahead = sum(place in systems and other not in systems for systems in detected.values())
            assert (cell is None) == (other == place)
            assert cell is None or cell.videos == ahead


def test_more_than_twenty_systems() -> None:
    many = board(8, 22)
    page, files = compare_page(many, SHELL), dict(_values(many))
    assert (len(page.systems), len(page.contenders), len(page.matrix)) == (22, 19, 20)
    assert page.left_out == "the 20 best of 22 systems"
    assert [choice.chosen for choice in page.systems] == [True] * 20 + [False] * 2
    assert files["compare"]["tested"] == 20 and len(files["compare"]["systems"]) == 22
    last = many.systems[21].slug
    assert f"compare/scores/{last}/0" in files and f"compare/tests/{last}" not in files


def test_one_system_is_a_plain_note(data: SiteData, tmp_path: Path) -> None:
    for systems in ((), data.systems[:1]):
        alone = dataclasses.replace(data, systems=systems)
        assert dict(compare_files(alone)) == {}
        page = compare_page(alone, SHELL)
        text = environment().get_template("compare.html").render(page=page, shell=SHELL)
        assert "It takes two submissions" in text and "<select" not in text and "compare.js" not in text


def test_texts_cannot_break_out(page: ComparePage) -> None:
    text = environment().get_template("compare.html").render(page=page, shell=SHELL)
    assert "<script>" not in text and "onerror=alert(2)&gt;" in text and "\u202e" not in text


def test_numbers_as_words() -> None:
    assert [signed(value) for value in (0.12344, -0.5, 0.00004, -0.00004)] == [
        "+0.1234",
        "−0.5000",
        "0.0000",
        "0.0000",
    ]
    assert [p_text(value) for value in (1.0, 0.04999, 0.001, 0.0001)] == [
        "1.000",
        "0.050",
        "0.001",
        "< 0.001",
    ]
