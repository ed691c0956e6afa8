"""A whole run over HTTP on the demo's clips, and the same again from its recording with no network."""

import hashlib
import json
import socket
from pathlib import Path
from typing import Any

import pytest

from pipeline.benchmark import open_benchmark
from pipeline.errors import InputError
from pipeline.execute import ThreadExecutor
from pipeline.places import Place
from pipeline.recording import Recording
from pipeline.recording_zip import export, import_zip
from pipeline.records import Stage
from pipeline.run import RUN_TABLES, RunReport, find_videos, predict
from pipeline.tables import BOXES, STAGES, USAGE
from pipeline.team import NO_SERVICES, Services, close_connections, open_team
from sitegen.about import Sender
from sitegen.board import submit_file
from tests.chat_server import Act, Body, http_config, say, serving, status

DEMO = Path(__file__).parent.parent / "demo"
THINGS = ("motorcycle", "car", "deer", "ladder", "truck", "cyclist")
PRICES = {"tiny": {"input_per_million": 1.0, "output_per_million": 2.0}}


def answer(body: Body, number: int) -> Act:
    """What a model might say: it depends on the pictures, the question and the seed, on nothing else."""
    seen = hashlib.sha256(json.dumps(body["messages"], sort_keys=True).encode()).digest()
    text = json.dumps(body["messages"])
    first, second = THINGS[seen[0] % 6], THINGS[seen[1] % 6]
    if "image_url" in text:
        if "separated by commas" in text:
            return say(f"the {first}, a {second}, {THINGS[body.get('seed', 0) % 6]}")
        return say(f"A {first} is on the road. A {second} waits.")
    known = [thing for thing in THINGS if thing in text] or [first]
    if "Return only the best list" in text:
        return say(json.dumps({"items": known}))
    return say(
        json.dumps({"items": [{"label": thing, "description": f"A {thing} moves."} for thing in known]})
    )


def _run(out: Path, base_url: str, services: Services = NO_SERVICES, **settings: Any) -> RunReport:
    config = http_config(base_url, endpoint={"max_in_flight": 4}, prices=PRICES, **settings)
    clips = find_videos(Place(str(DEMO / "videos")))
    boxes = BOXES.read(DEMO / "boxes.parquet")
    return predict(clips, boxes, config, Place(str(out)), ThreadExecutor(2), services=services)


def test_all_clips_over_http_then_from_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = str(tmp_path / "recording")
    with serving(answer) as server:
        report = _run(tmp_path / "live", server.base_url, Services(recording))
    assert not report.failed
    assert len(report.outcomes) == 14
    assert report.tables["predictions"]
    assert server.most_in_flight <= 4

    def no_network(*_: Any) -> None:
        raise AssertionError("the network was used in a replay")

    monkeypatch.setattr(socket.socket, "connect", no_network)
    replayed = _run(tmp_path / "replay", "http://127.0.0.1:9/v1", Services(recording, replay=True))
    assert not replayed.failed
    for table in RUN_TABLES:
        files = [tmp_path / name / f"{table.name}.parquet" for name in ("live", "replay")]
        rows = [table.read(file) for file in files]
        assert rows[0] == rows[1], table.name

    outputs = STAGES.read(tmp_path / "live" / "stages.parquet")
    assert sum(output.stage is Stage.SCENE for output in outputs) == 14 * 25
    rows = USAGE.read(tmp_path / "live" / "usage.parquet")
    assert {row.role for row in rows} == {"scene", "video", "rhs", "aes", "cos", "aos"}
    scene = next(row for row in rows if row.role == "scene")
    assert (scene.calls, scene.input_tokens, scene.output_tokens) == (25, 2_500, 500)
    assert scene.cost == pytest.approx(2_500 / 1e6 * 1.0 + 500 / 1e6 * 2.0)


def test_a_recording_travels_with_a_submission(tmp_path: Path) -> None:
    """Run, export, submit with the zip; elsewhere: import it, replay, and get the same predictions."""
    clips = find_videos(Place(str(DEMO / "videos")))[:2]
    boxes = BOXES.read(DEMO / "boxes.parquet")
    recording = tmp_path / "recording"
    with serving(answer) as server:
        config = http_config(server.base_url, frames={"count": 3}, track2={"queries": 2})
        services = Services(str(recording))
        predict(clips, boxes, config, Place(str(tmp_path / "run")), ThreadExecutor(2), services=services)
    assert export(Recording(recording), tmp_path / "answers.zip").count > 0
    (tmp_path / "coooler.toml").write_text("")
    (tmp_path / "truth.csv").write_bytes((DEMO / "truth.csv").read_bytes())
    stored = submit_file(
        open_benchmark(tmp_path),
        tmp_path / "run",
        Sender("Mine", date="2026-01-02"),
        recording=tmp_path / "answers.zip",
    ).stored
    import_zip(stored.folder / "recording.zip", tmp_path / "elsewhere")
    services = Services(str(tmp_path / "elsewhere"), replay=True)
    again = Place(str(tmp_path / "again"))
    predict(clips, boxes, config, again, ThreadExecutor(1), services=services)
    assert (again / "predictions.parquet").read() == (tmp_path / "run" / "predictions.parquet").read_bytes()
    (tmp_path / "answers.zip").write_bytes(b"PK no zip")
    with pytest.raises(InputError):
        submit_file(
            open_benchmark(tmp_path),
            tmp_path / "run",
            Sender("Other", date="2026-01-02"),
            recording=tmp_path / "answers.zip",
        )


def test_what_failed_is_recorded_with_its_reason_and_can_be_run_alone(tmp_path: Path) -> None:
    clips = find_videos(Place(str(DEMO / "videos")))[:2]
    boxes = BOXES.read(DEMO / "boxes.parquet")
    broken = {"on": True}

    def script(body: Body, number: int) -> Act:
        return status(404, "no such model") if broken["on"] else answer(body, number)

    with serving(script) as server:
        config = http_config(server.base_url, frames={"count": 3}, track2={"queries": 2})
        out = Place(str(tmp_path / "run"))
        report = predict(clips, boxes, config, out, ThreadExecutor(2))
        assert [outcome.video_id for outcome in report.failed] == ["demo_0001", "demo_0002"]
        assert all("404" in outcome.error and "tiny" in outcome.error for outcome in report.failed)
        broken["on"] = False
        report = predict(clips, boxes, config, out, ThreadExecutor(2), only=["demo_0002"])
        assert (report.failed, report.not_run) == ((), 1)
        report = predict(clips, boxes, config, out, ThreadExecutor(2))
        assert (report.failed, report.reused) == ((), 1)


def test_the_team_says_who_answers() -> None:
    config = http_config("http://127.0.0.1:9/v1")
    names = open_team(config, NO_SERVICES).names
    close_connections()
    assert "tiny" in names
    assert "ConSE baseline" in names
