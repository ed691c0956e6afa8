"""The leaderboard without a browser: what passes at each threshold, the board over time, bounds."""

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import pytest

from pipeline.config import BenchmarkSettings
from pipeline.records import TruthHazard
from sitegen.board_files import PART_BYTES, board_files, parts, threshold_text, thresholds
from sitegen.board_history import history
from sitegen.evaluate import evaluate, truth_sha256
from sitegen.gathered import SiteData
from tests.board_case import entry, page_text, site_data
from tests.site_fixtures import WordEmbedder


@pytest.fixture(scope="module")
def data() -> SiteData:
    return site_data()


def values(data: SiteData) -> list[dict[str, Any]]:
    """The value of each part, as the script is given it."""
    found = []
    for number, (path, content) in enumerate(board_files(data)):
        assert path == f"data/board/{number}.js" and len(content) <= PART_BYTES
        match = re.fullmatch(rf"COOOLER_BOARD\({number},(.*)\);\n", content.decode("ascii"))
        assert match and "<" not in match[1]
        found.append(json.loads(match[1]))
    return found


@pytest.mark.parametrize("threshold", [0.5, 0.8, 0.95])
def test_counts_are_those_of_a_new_evaluation(data: SiteData, threshold: float) -> None:
    place = thresholds(data).index(threshold)
    truth = [row for video_id in data.video_ids for row in data.truth[video_id]]
    (part,) = values(data)
    for system in data.systems:
        card = evaluate(
            system.evaluation.submission, truth, WordEmbedder(), threshold, truth_sha256(truth)
        ).card
        row = part["systems"][system.slug]
        assert row["detected"][place] / part["videos"] == card.detection_rate
        assert row["found"][place] / part["hazards"] == card.hazard_recall


def test_two_hazards_in_one_video_are_counted_one_by_one(data: SiteData) -> None:
    truth = [
        TruthHazard("v", "h1", "Cat", "A cat crosses"),
        TruthHazard("v", "h2", "Tyre", "Debris falls down"),
    ]
    system = data.systems[0]
    submission = replace(
        system.evaluation.submission,
        predictions=(
            replace(system.evaluation.submission.predictions[0], video_id="v", description="A cat crosses"),
        ),
    )
    one = evaluate(submission, truth, WordEmbedder(), 0.8, truth_sha256(truth))
    only = replace(
        data, truth={"v": tuple(truth)}, names={"v": "v"}, systems=(replace(system, evaluation=one),)
    )
    (part,) = values(only)
    row = part["systems"][system.slug]
    assert (part["videos"], part["hazards"]) == (1, 2)
    assert set(row["detected"]) == {1} and set(row["found"]) == {1} and "best" not in row


def test_best_and_worst_video(data: SiteData) -> None:
    (part,) = values(data)
    for system in data.systems:
        for name, choose in (("best", max), ("worst", min)):
            href, _, text = part["systems"][system.slug][name]
            besm = choose(video.besm for video in system.evaluation.videos)
            first = next(v.video_id for v in system.evaluation.videos if v.besm == besm)
            assert href == f"videos/{data.names[first]}.html#{system.slug}" and text == f"{besm:.2f}"


def test_an_own_threshold_joins_the_grid(data: SiteData) -> None:
    own = replace(data, settings=BenchmarkSettings(name="Own", threshold=0.805))
    assert len(thresholds(data)) == 46 and len(thresholds(own)) == 47
    assert [threshold_text(value) for value in thresholds(own)][30:32] == ["0.80", "0.805"]


def test_many_systems_are_spread_over_parts() -> None:
    many = site_data(8, 60)
    held = parts(many)
    found = values(many)
    assert len(found) > 1 and [held[system.slug] for system in many.systems] == sorted(held.values())
    assert all(slug in found[part]["systems"] for slug, part in held.items())


def test_a_hidden_truth_is_not_in_the_data(data: SiteData) -> None:
    settings = BenchmarkSettings(name="Hidden", hide_truth=True)
    systems = tuple(replace(s, evaluation=replace(s.evaluation, videos=(), pairs=())) for s in data.systems)
    hidden = replace(data, settings=settings, truth=dict.fromkeys(data.truth, ()), systems=systems)
    assert values(hidden) == [
        {
            "systems": {
                s.slug: {
                    "probes": [["Caption list", "7 captions a video", "It says <b>a lot</b>."]]
                    if s.probes
                    else []
                }
                for s in systems
            }
        }
    ]
    text = page_text(hidden)
    assert 'id="board-threshold"' not in text and 'id="board-metric"' in text and "compare.html" not in text


def test_long_boards_are_cut(data: SiteData) -> None:
    text = page_text(data)
    assert text.count('<li class="card"') == 24 and "All 130 videos" in text
    row = text[text.index('class="heat"') :]
    assert row.count('class="turn"') == 100 and "the first 100 of 130 videos" in text
    small = page_text(site_data(24, 2))
    assert small.count('<li class="card"') == 24 and "Search all videos" in small and "Shown:" not in small


def test_the_board_over_time() -> None:
    found = history(
        [
            entry("2026-01-01", "a", 0.3),
            entry("2026-01-02", "b", 0.5),
            entry("2026-01-02", "c", None),
            entry("2026-01-04", "b", None, "withdraw"),
            entry("no day", "d", 0.9),
        ]
    )
    assert found and found.summary == (
        "3 days on which the board changed, 2026-01-01 to 2026-01-04. "
        "Now A leads with BESM 0.3000. That is +0.0000 since 2026-01-01."
    )
    assert [(day.date, day.best, day.leader, day.systems, day.changes) for day in found.days] == [
        ("2026-01-04", "0.3000", "A", "1", "B withdrawn"),
        ("2026-01-02", "0.5000", "B", "2", "B 0.5000"),
        ("2026-01-01", "0.3000", "A", "1", "A 0.3000"),
    ]
    # 0.3 at the bottom (y 200), 0.5 at the top (y 0); three days and a little are 720 wide.
    assert [tick.text for tick in found.ticks] == ["0.30", "0.40", "0.50"]
    x2, x4 = (f"{720 * days / 3.12:.1f}" for days in (1, 3))
    assert found.best == f"M0 200H{x2}V0H{x4}V200H720"
    assert found.lines == (f"M{x2} 0H{x4}", f"M0 200H{x2}V200H{x4}V200H720")


def test_one_day_is_one_sentence() -> None:
    found = history([entry("2026-01-01", "a", 0.3), entry("2026-01-01", "b", 0.25)])
    assert found and found.days == () and found.best == ""
    assert found.summary.startswith("Everything on this board came on 2026-01-01: 2 submissions, A leads")
    assert history([]) is None and history([entry("2026-01-01", "a", None)]) is None


def test_the_drawn_board_is_valid_and_without_style(data: SiteData) -> None:
    text = page_text(data)
    svg = re.search(r'<svg viewBox="0 0 720 200".*?</svg>', text, re.DOTALL)
    assert svg and len(ET.fromstring(svg[0]).findall("path[@class='history-line']")) == 5
    assert "style=" not in text
