"""The flow of both tracks, with agents that answer by rote and remember what they were asked."""

from collections.abc import Sequence

import numpy as np
import pytest

from pipeline.config import RunConfig, Track2Settings
from pipeline.errors import AgentError
from pipeline.interfaces import Prompt
from pipeline.records import Frame, Parse, Reply, Stage
from pipeline.stages import Agents, entries, run_stages


class Rote:
    """Answers by prompt id; keeps every prompt it was given."""

    name = "rote"

    def __init__(self, answers: dict[str, str]) -> None:
        self.answers = answers
        self.asked: list[Prompt] = []
        self.seen: list[list[int]] = []

    def complete(self, prompt: Prompt, call: int) -> Reply:
        self.asked.append(prompt)
        return Reply(self.answers[prompt.prompt_id], self.name)

    def look(self, frames: Sequence[Frame], prompt: Prompt, call: int) -> Reply:
        self.seen.append([frame.index for frame in frames])
        if prompt.prompt_id == "T1-VLM":
            return Reply(f"Frame {frames[0].index}: a cat.", self.name)
        return Reply(self.answers[prompt.prompt_id], self.name)


ANSWERS = {
    "T1-LLM": '[{"label": "cat", "description": "runs"}, {"label": "car", "description": "waits"}]',
    "T2-VLM": "a cat, the car",
    "T2-LLM": '["the car", "a cat"]',
    "X-LLM": '[{"label": "cat", "description": "The cat runs."}]',
    "A-LLM": '[{"label": "cat", "description": "A cat runs across."}]',
}


def _frames(count: int) -> list[Frame]:
    return [Frame("v", 12 * i, 0.4 * i, np.full((8, 8, 3), i, np.uint8)) for i in range(count)]


def _run(answers: dict[str, str], config: RunConfig) -> tuple[Rote, list]:
    rote = Rote(answers)
    return rote, run_stages("v", _frames(3), Agents(rote, rote, rote), config)


def test_both_tracks_meet_and_every_answer_is_kept() -> None:
    config = RunConfig(track2=Track2Settings(queries=4))
    rote, outputs = _run(ANSWERS, config)
    stages = [output.stage for output in outputs]
    assert stages == [
        *[Stage.SCENE] * 3,
        Stage.RHS,
        *[Stage.ANSWER] * 4,
        *[Stage.CHUNKS] * 4,
        Stage.AES,
        Stage.COS,
        Stage.AOS,
    ]
    assert rote.seen == [[0], [12], [24], *[[0, 12, 24]] * 4]
    t1, t2, cross, anomaly = rote.asked
    assert t1.inputs["descriptions"] == ("Frame 0: a cat.", "Frame 12: a cat.", "Frame 24: a cat.")
    assert t2.inputs["lists"] == ("a cat, the car",) * 4
    assert cross.inputs["rhs"] == ("cat: runs", "car: waits")
    assert cross.inputs["aes"] == ("car", "cat")  # articles removed
    assert anomaly.inputs["cos"] == ("cat: The cat runs.",)
    assert [output.frame_index for output in outputs[:4]] == [0, 12, 24, None]
    assert len({output.request_sha256 for output in outputs[:3]}) == 3


def test_without_track2_the_rhs_goes_to_the_anomaly_step() -> None:
    rote, outputs = _run(ANSWERS, RunConfig(track2=Track2Settings(enabled=False)))
    assert [output.stage for output in outputs] == [*[Stage.SCENE] * 3, Stage.RHS, Stage.AOS]
    assert rote.asked[-1].inputs["cos"] == ("cat: runs", "car: waits")


@pytest.mark.parametrize("nonsense", ["", "None.", "[]"])
def test_an_answer_without_items_is_an_empty_stage(nonsense: str) -> None:
    _, outputs = _run({**ANSWERS, "X-LLM": nonsense}, RunConfig(track2=Track2Settings(queries=1)))
    cos = next(output for output in outputs if output.stage is Stage.COS)
    assert cos.items == ()
    assert cos.parse in (Parse.EMPTY, Parse.FAILED)


def test_an_agent_that_fails_is_not_hidden() -> None:
    class Broken(Rote):
        def complete(self, prompt: Prompt, call: int) -> Reply:
            raise AgentError("no answer")

    broken = Broken(ANSWERS)
    with pytest.raises(AgentError):
        run_stages("v", _frames(1), Agents(broken, broken, broken), RunConfig())


def test_entries_hold_what_there_is() -> None:
    _, outputs = _run(ANSWERS, RunConfig(track2=Track2Settings(enabled=False)))
    assert entries(outputs[3].items) == ["cat: runs", "car: waits"]
