"""The failures page without a browser: its data and its context, by hand and by property."""

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pipeline.config import BenchmarkSettings
from pipeline.records import Box, Kind, TrackBox, TruthHazard
from sitegen.data_shards import SHARD_BYTES
from sitegen.failure_files import failure_files, hazard_size, range_key, score_ranges
from sitegen.failures import NAMES, SENTENCES, Blame, FailureKind
from sitegen.gathered import SiteData, VideoMedia
from sitegen.page_failures import failures_page
from sitegen.rendering import environment
from tests.failures_case import KINDS, ODD_ID, SHELL, generated


def shards(data: SiteData, blames: Mapping[str, Blame]) -> dict[str, Any]:
    """What every data file registers, by name."""
    found = {}
    for path, content in failure_files(data, blames):
        match = re.fullmatch(r'COOOLER_FAILURES\("([^"]+)",(.*)\);\n', content.decode("ascii"))
        assert match and path == f"data/{match[1]}.js" and not set("<>&") & set(match[2])
        found[match[1]] = json.loads(match[2])
    return found


def test_ranges_end_at_the_threshold() -> None:
    keys = {
        threshold: [range_key(ends) for ends in score_ranges(threshold)] for threshold in (0.8, 0.85, 0.1)
    }
    assert keys[0.8] == ["0-0.2", "0.2-0.4", "0.4-0.6", "0.6-0.8"]
    assert keys[0.85] == [*keys[0.8], "0.8-0.85"] and keys[0.1] == ["0-0.1"]


def test_size_is_that_of_the_largest_box_within_the_frame() -> None:
    hazard = TruthHazard("v", "h", "Cat", "A cat", "7")
    media = VideoMedia("v", "v", 640, 480)
    data = SiteData(BenchmarkSettings(name="x"), {"v": (hazard,)}, {}, {"v": media}, {"v": "v"}, ())

    def size(*boxes: Box, track: str | None = "7", shot: VideoMedia = media) -> str:
        rows = tuple(TrackBox("v", n, "7", Kind.CHALLENGE, box) for n, box in enumerate(boxes))
        return hazard_size(
            replace(data, boxes={"v": rows}, media={"v": shot}), replace(hazard, track_id=track)
        )

    # COCO: small is under 32 x 32 px, large from 96 x 96 px, in 640 x 480 px.
    assert size(Box(0, 0, 32, 31.9)) == "small" and size(Box(0, 0, 32, 32)) == "medium"
    assert size(Box(0, 0, 96, 95.9)) == "medium" and size(Box(0, 0, 96, 96)) == "large"
    assert size(Box(0, 0, 5, 5), Box(9, 9, 109, 109)) == "large"
    assert size(Box(-1000, -1000, 10, 10)) == "small"
    assert size(Box(-20, 0, -10, 10)) == "unknown" == size() == size(Box(0, 0, 9, 9), track=None)
    assert size(Box(0, 0, 9, 9), track="8") == "unknown" == size(Box(0, 0, 9, 9), shot=VideoMedia("v", "v"))


def test_shards_tell_every_failure_and_are_small() -> None:
    data, blames = generated(230, 3, each=4)
    files = dict(failure_files(data, blames))
    index = shards(data, blames)["failures"]
    assert max(len(content) for path, content in files.items() if path != "data/failures.js") <= SHARD_BYTES
    assert index["failures"] == 230 * 3 * 4 and index["units"] == 10_000
    found = shards(data, blames)
    lists = {
        name: [row for n, _ in enumerate(ends) for row in found[f"failures/{name}/{n}"]]
        for name, ends in [("videos", index["videos"]), ("hazards", index["hazards"])]
        + [(f"rows/{slug}", ends) for slug, _, ends, _ in index["systems"]]
        + [(f"texts/{slug}", ends) for slug, _, _, ends in index["systems"]]
    }
    ids = data.video_ids
    for system in data.systems:
        rows, texts = lists[f"rows/{system.slug}"], lists[f"texts/{system.slug}"]
        assert len(texts) == len(set(texts)) and index["systems"][system.place - 1][2][-1] == len(rows)
        for failure, row in zip(blames[system.slug].failures, rows, strict=True):
            video, kind, hazard, rank, units, stages, said, evidence = row
            assert (ids[video], KINDS[kind]) == (failure.video_id, failure.kind)
            assert (hazard == 0) == (failure.hazard_id is None) and (rank or None) == failure.prediction_rank
            assert abs(units / 10_000 - failure.similarity) <= 5e-5 and bool(stages) != failure.stages_known
            assert texts[evidence - 1].startswith(failure.evidence.split(" in ")[0])
            assert (said > 0) == (failure.prediction_rank is not None)
            if hazard:
                of_video, label, *_ = lists["hazards"][hazard - 1]
                mine = next(one for one in data.truth[ids[video]] if one.hazard_id == failure.hazard_id)
                assert of_video == video and index["labels"][label] == mine.label
    assert lists["videos"][ids.index(ODD_ID)][1] == "odd/⟨U+202E⟩id <b>"
    assert {kind[0]: tuple(kind[1:]) for kind in index["kinds"]} == {
        kind.value: (NAMES[kind], SENTENCES[kind]) for kind in FailureKind
    }


def test_page_counts_and_draws() -> None:
    data, blames = generated(40, 5)
    page = failures_page(data, blames, SHELL)
    for line in page.systems:
        expected = Counter(failure.kind for failure in blames[line.slug].failures)
        assert [cell.count for cell in line.kinds] == [expected[kind] for kind in FailureKind]
        assert line.total.count == 40 == sum(cell.count for cell in line.kinds)
        assert line.kinds[0].href == f"failures.html?kind=not-seen&system={line.slug}"
        assert line.alive == ("40", "39", "20", "not recorded", "20", "1")
    assert (len(page.funnels), len(page.more_funnels), len(page.first)) == (3, 2, 50)
    funnel = page.funnels[0]
    assert funnel.summary.startswith("Of 40 hazards: seen 39, ranked 20, merged not recorded, anomalous 20")
    assert [bar.lost for bar in funnel.bars] == ["", "−1", "−19", "", "", "−19"]
    assert (funnel.bars[0].alive, funnel.bars[2].alive, funnel.bars[2].before) == ("196", "98", "191.1")
    best = sorted((round(f.similarity * 10_000) for b in blames.values() for f in b.failures), reverse=True)
    assert [one.score.text for one in page.first] == [f"{value / 10_000:.4f}" for value in best[:50]]
    assert page.more == "150 more failures"


def test_nothing_to_show() -> None:
    data, blames = generated(3, 2)
    none = {slug: Blame((), blame.funnel) for slug, blame in blames.items()}
    template = environment().get_template("failures.html")
    for given, words in (({}, "there are no submissions"), (none, "No submission has a failure")):
        assert not list(failure_files(data, given))
        page = failures_page(data, given, SHELL)
        html = template.render(page=page, shell=SHELL)
        assert words in html and "data/failures.js" not in html and 'id="search"' not in html
    assert SENTENCES[FailureKind.NEAR_MISS] in html
