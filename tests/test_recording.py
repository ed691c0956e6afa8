"""A recording: paid once, replayed alike, exported the same, and never trusting what comes in."""

import json
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.agents import open_agents
from pipeline.config import RunConfig, Track2Settings
from pipeline.errors import AgentError, OutsideError
from pipeline.files import sha256_of
from pipeline.prompts import fill
from pipeline.recording import Answer, Message, Record, Recording, Request
from pipeline.records import Frame, StageOutput
from pipeline.stages import Agents, run_stages
from tests.chat_server import Act, Body, asking, http_config, say, status

PROMPT = fill("A-LLM", {"cos": ["cat: runs"]})
DEAD = "http://127.0.0.1:9/v1"


def request(text: str = "hello", seed: int = 0) -> Request:
    message = Message(role="user", content=text)
    return Request(model="m", temperature=0.2, max_tokens=9, seed=seed, answer_schema="", messages=(message,))


def answer(text: str = "hi") -> Answer:
    return Answer(outcome="answered", text=text, latency_s=0.25, input_tokens=3, output_tokens=1)


def replayed(folder: Path, **settings: object):
    """Agents that may ask nobody."""
    agents = open_agents(http_config(DEAD, **settings), Recording(folder), replay=True)  # type: ignore[arg-type]
    assert agents.language is not None
    assert agents.vision is not None
    return agents


def test_the_key_is_the_hash_of_canonical_json() -> None:
    text = (
        '{"answer_schema":"","max_tokens":9,"messages":[{"content":"h\\u00e9","role":"user"}],'
        '"model":"m","seed":0,"temperature":0.2}'
    )
    assert request("hé").sha256 == sha256_of(text.encode())
    keys = {request().sha256, request("other").sha256, request(seed=1).sha256}
    keys |= {
        request().model_copy(update=one).sha256 for one in ({"model": "n"}, {"answer_schema": "items-1"})
    }
    keys |= {request().model_copy(update=one).sha256 for one in ({"temperature": 0.3}, {"max_tokens": 8})}
    assert len(keys) == 7


@given(st.text(st.characters(exclude_categories=["Cs"])), st.floats(0, 1e6))
def test_a_record_comes_back_as_it_was(text: str, latency_s: float) -> None:
    record = Record(request=request(text), answer=Answer(outcome="refused", text=text, latency_s=latency_s))
    assert Record.model_validate_json(record.as_bytes()) == record
    assert Record.model_validate_json(record.as_bytes()).name == record.name


def test_an_answer_is_paid_once_across_processes(tmp_path: Path) -> None:
    with asking(lambda body, number: say(f"[{number}]"), Recording(tmp_path)) as asked:
        first = asked.language.complete(PROMPT, 0)
        assert asked.language.complete(PROMPT, 0) == first  # the latency, too
        assert asked.language.complete(PROMPT, 1) != first
        assert asked.agents.usage()["aos"].calls == 2
        assert asked.agents.usage()["aos"].recorded == 1
    with asking(lambda *_: say("[]"), Recording(tmp_path)) as again:  # as after a crash
        assert again.language.complete(PROMPT, 0) == first
    assert len(again.server.requests) == 0
    assert replayed(tmp_path).language.complete(PROMPT, 0) == first
    files = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.json")]
    assert len(files) == 2
    assert all(name[:2] == name[3:5] and len(name) == 72 for name in files)


def test_a_file_holds_no_picture_and_no_address(tmp_path: Path) -> None:
    frame = Frame("v", 0, 0.0, np.zeros((90, 160, 3), np.uint8))
    with asking(lambda *_: say("a cat"), Recording(tmp_path)) as asked:
        asked.vision.look([frame], fill("T2-VLM"), 3)
    (path,) = tmp_path.rglob("*.json")
    record = json.loads(path.read_text())
    assert record["request"]["messages"][0]["content"][1]["type"] == "image"
    assert record["request"]["seed"] == 3
    assert record["answer"]["text"] == "a cat"
    assert "base64" not in path.read_text()
    assert "127.0.0.1" not in path.read_text()
    assert path.stat().st_size < 1_000


def test_two_threads_with_one_request_send_it_once(tmp_path: Path) -> None:
    gate = threading.Barrier(8)

    def ask(_: int) -> str:
        gate.wait(10)
        return asked.language.complete(PROMPT, 0).text

    script: Callable[[Body, int], Act] = lambda *_: Act(body=say("[]").body, wait_s=0.05)  # noqa: E731
    with asking(script, Recording(tmp_path)) as asked, ThreadPoolExecutor(8) as pool:
        assert list(pool.map(ask, range(8))) == ["[]"] * 8
        assert asked.agents.usage()["aos"].recorded == 7
    assert len(asked.server.requests) == 1


def test_a_thread_that_fails_leaves_the_request_to_the_next(tmp_path: Path) -> None:
    recording = Recording(tmp_path)
    with asking(lambda _, number: status(400) if number == 0 else say("[]"), recording) as asked:
        with pytest.raises(AgentError):
            asked.language.complete(PROMPT, 0)
        assert asked.language.complete(PROMPT, 0).text == "[]"
    assert recording._asking == {}


@pytest.mark.parametrize("knows", [True, False])
def test_a_replay_does_not_care_what_the_server_knew(knows: bool, tmp_path: Path) -> None:
    def script(body: Body, _: int) -> Act:
        return say("[]") if knows or "response_format" not in body else status(400, "response_format?")

    with asking(script, Recording(tmp_path)) as asked:
        first = asked.language.complete(PROMPT, 0)
    assert replayed(tmp_path).language.complete(PROMPT, 0) == first
    never = replayed(tmp_path, endpoint={"json_schema": "never"}, role={"endpoint": "elsewhere"})
    assert never.language.complete(PROMPT, 0) == first


def test_a_replay_names_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(
        AgentError, match=r"role aos, model tiny: the recording lacks the request [0-9a-f]{64}"
    ):
        replayed(tmp_path).language.complete(PROMPT, 0)


def test_a_replay_goes_the_way_of_the_run(tmp_path: Path) -> None:
    """Over a context that was too long, and into a refusal; a run after it asks the refused again."""

    def script(body: Body, _: int) -> Act:
        if len(body["messages"]) == 1:
            return say(None, refusal="Not this picture.")
        return (
            say("[]") if body["messages"][-1]["content"].count("car") < 3 else status(400, "context length")
        )

    prompt = fill("T1-LLM", {"descriptions": ["car"] * 9})
    clip = [Frame("v", 0, 0.0, np.zeros((9, 16, 3), np.uint8))]
    with asking(script, Recording(tmp_path)) as asked:
        first = asked.language.complete(prompt, 0)
        with pytest.raises(AgentError) as refused:
            asked.vision.look(clip, fill("T1-VLM"), 0)
    assert first.model == "tiny (2 of 9 descriptions: context too long)"
    again = replayed(tmp_path)
    assert again.language.complete(prompt, 0) == first
    with pytest.raises(AgentError) as refused_again:
        again.vision.look(clip, fill("T1-VLM"), 0)
    assert str(refused_again.value) == str(refused.value)
    with asking(lambda *_: say("a cat"), Recording(tmp_path)) as later:
        assert later.language.complete(prompt, 0) == first
        assert later.vision.look(clip, fill("T1-VLM"), 0).text == "a cat"
    assert len(later.server.requests) == 1


CORRUPT = {
    "empty": lambda data: b"",
    "cut": lambda data: data[: len(data) // 2],
    "binary": lambda data: b"\xff\x00" * 50,
    "another's": lambda data: Record(request=request(), answer=answer()).as_bytes(),
    "tampered": lambda data: data.replace(b"cat: runs", b"cat: sits"),
    "a key more": lambda data: data.replace(b'"format"', b'"extra": 1, "format"'),
    "other version": lambda data: data.replace(b'"format": 1', b'"format": 2'),
}


@pytest.mark.parametrize("spoil", CORRUPT.values(), ids=CORRUPT)
def test_a_corrupt_file_is_asked_again_and_named_in_a_replay(spoil, tmp_path: Path) -> None:
    with asking(lambda *_: say("[]"), Recording(tmp_path)) as asked:
        first = asked.language.complete(PROMPT, 0)
    (path,) = tmp_path.rglob("*.json")
    whole = path.read_bytes()
    path.write_bytes(spoil(whole))
    with pytest.raises(AgentError, match=path.name):
        replayed(tmp_path).language.complete(PROMPT, 0)
    with asking(lambda *_: say("[]"), Recording(tmp_path)) as asked:
        assert asked.language.complete(PROMPT, 0).text == first.text
    assert len(asked.server.requests) == 1
    assert Record.model_validate_json(path.read_bytes()).answer.text == "[]"


def test_a_disk_that_takes_nothing_is_an_error_from_outside(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutsideError, match="could not be recorded"):
        Recording(tmp_path / "file").keep(request(), answer())


def test_both_tracks_replay_to_the_same_outputs(tmp_path: Path) -> None:
    def script(body: Body, _: int) -> Act:
        content = body["messages"][-1]["content"]
        if isinstance(content, list):
            return say(f"a cat, the car, {body['seed']} cones")
        return say(json.dumps({"items": [{"label": "cat", "description": "A cat runs."}]}))

    clip = [Frame("v", 12 * i, 0.4 * i, np.full((18, 32, 3), 40 * i, np.uint8)) for i in range(4)]
    config = RunConfig(track2=Track2Settings(queries=5))

    def run(agents) -> list[StageOutput]:
        return run_stages("v", clip, Agents(agents.vision, agents.vision, agents.language), config)

    with asking(script, Recording(tmp_path)) as asked:
        outputs = run(asked.agents)
        assert len({output.reply.text for output in outputs if output.stage == "answer"}) == 5
        calls = {role: usage.calls for role, usage in asked.agents.usage().items()}
    assert calls == {"scene": 4, "rhs": 1, "video": 5, "aes": 1, "cos": 1, "aos": 1}
    assert outputs[-1].items[0].description == "A cat runs."
    agents = replayed(tmp_path)
    assert run(agents) == outputs
    assert {role: usage.recorded for role, usage in agents.usage().items()} == calls
