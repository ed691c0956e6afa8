"""What the submit page is given: the sample, and what it may know of the truth."""

import csv
import io
import json
from pathlib import Path
from typing import Any

from pipeline.config import BenchmarkSettings
from pipeline.records import TruthHazard
from sitegen.contexts import Shell
from sitegen.gathered import SiteData
from sitegen.page_submit import submit_files, submit_page
from sitegen.readers import read_predictions
from tests.submit_case import IDS, NO_HAZARD, TRUTH


def _data(truth: list[TruthHazard], hidden: bool = False) -> SiteData:
    by_video: dict[str, tuple[TruthHazard, ...]] = {}
    for row in truth:
        by_video[row.video_id] = () if hidden else (*by_video.get(row.video_id, ()), row)
    settings = BenchmarkSettings(hide_truth=hidden)
    return SiteData(settings, by_video, {}, {}, {video: video for video in by_video}, ())


def _known(data: SiteData) -> dict[str, Any]:
    script = dict(submit_files(data))["data/submit.js"].decode()
    assert script.startswith("window.COOOLER_SUBMIT = ")
    found = json.loads(script.removeprefix("window.COOOLER_SUBMIT = ").removesuffix(";\n"))
    assert isinstance(found, dict)
    return found


def test_the_sample_passes_the_check_and_speaks_of_every_video(tmp_path: Path) -> None:
    sample = dict(submit_files(_data(TRUTH)))["data/sample-predictions.csv"]
    (tmp_path / "p.csv").write_bytes(sample)
    read = read_predictions(tmp_path / "p.csv", TRUTH)
    assert {row.video_id for row in read.predictions} == set(IDS)
    assert read.warnings == ()
    assert read.predictions[0].track_ids == ("7", "9") and read.predictions[0].frame_indices == (12, 13)
    rows = list(csv.DictReader(io.StringIO(sample.decode(), newline="")))
    assert all("laceholder" in row["description"] for row in rows)


def test_the_page_knows_which_videos_have_a_hazard() -> None:
    known = _known(_data(TRUTH))
    assert known["ids"] == sorted(IDS)
    assert [video for video, found in zip(known["ids"], known["hazards"], strict=True) if found == "0"] == (
        sorted(NO_HAZARD)
    )


def test_a_hidden_truth_is_not_told() -> None:
    data = _data(TRUTH, hidden=True)
    assert _known(data) == {"ids": sorted(IDS)}
    shell = Shell("Submit", "", "", "submit", "Board", "1")
    assert submit_page(data, shell).hidden


def test_the_data_file_is_small() -> None:
    truth = [TruthHazard(f"video_{number:04d}", "1", "cat", "A cat.") for number in range(1_000)]
    assert len(dict(submit_files(_data(truth)))["data/submit.js"]) <= 10 * 10_000
