"""The steps of both tracks: fill a prompt, ask, parse, and record what was said (paper, section 2).

    frames -> scene x N -> RHS ─┐
    frames -> answer x 20 -> chunks x 20 -> AES ─┴─> COS -> AOS

Every step gives `StageOutput`s; an answer without items makes an empty stage, never a crash.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.chunks import noun_chunks, without_article
from pipeline.config import RunConfig
from pipeline.interfaces import LanguageAgent, Prompt, VisionAgent
from pipeline.parsing import parse
from pipeline.prompts import fill
from pipeline.records import Frame, Item, Parse, Reply, Stage, StageOutput


@dataclass(frozen=True, slots=True)
class Agents:
    """Who answers in each role."""

    scene: VisionAgent
    video: VisionAgent
    language: LanguageAgent


def run_stages(
    video_id: str, frames: Sequence[Frame], agents: Agents, config: RunConfig
) -> list[StageOutput]:
    """Every stage output of a video, in order; the last is the AOS.

    Without Track 2 the RHS takes the place of the COS (ours), and no AES or COS is made.
    Raises AgentError when an agent does not answer.
    """
    scenes = [
        _look(agents.scene, "T1-VLM", Stage.SCENE, call, video_id, [frame], frame.index)
        for call, frame in enumerate(frames)
    ]
    rhs = _complete(
        agents.language, Stage.RHS, video_id, fill("T1-LLM", {"descriptions": [s.reply.text for s in scenes]})
    )
    outputs = [*scenes, rhs]
    cos = rhs
    if config.track2.enabled:
        answers = [
            _look(agents.video, "T2-VLM", Stage.ANSWER, call, video_id, frames, None)
            for call in range(config.track2.queries)
        ]
        chunks = [_chunk(answer) for answer in answers]
        lists = [", ".join(item.label for item in output.items) for output in chunks]
        aes = _complete(agents.language, Stage.AES, video_id, fill("T2-LLM", {"lists": lists}))
        aes = _without_articles(aes)
        cross = fill("X-LLM", {"rhs": entries(rhs.items), "aes": entries(aes.items)})
        cos = _complete(agents.language, Stage.COS, video_id, cross)
        outputs += [*answers, *chunks, aes, cos]
    aos = _complete(agents.language, Stage.AOS, video_id, fill("A-LLM", {"cos": entries(cos.items)}))
    return [*outputs, aos]


def entries(items: Sequence[Item]) -> list[str]:
    """Items as they are put into the next prompt: "label: description", or whichever there is."""
    return [": ".join(filter(None, (item.label, item.description))) for item in items]


def request_sha256(agent: str, prompt: Prompt, frames: Sequence[Frame], call: int) -> str:
    """Hash of all that a request depends on: agent, prompt, pixels, and the number of the call."""
    digest = hashlib.sha256()
    digest.update(
        json.dumps([agent, prompt.prompt_id, prompt.system, prompt.user, prompt.format_hint, call]).encode()
    )
    for frame in frames:
        digest.update(f"{frame.index}:{frame.rgb.shape}".encode())
        digest.update(frame.rgb.tobytes())
    return digest.hexdigest()


def _look(
    agent: VisionAgent,
    prompt_id: str,
    stage: Stage,
    call: int,
    video_id: str,
    frames: Sequence[Frame],
    frame_index: int | None,
) -> StageOutput:
    prompt = fill(prompt_id)
    reply = agent.look(frames, prompt, call)
    items, how = parse(reply.text)
    key = request_sha256(agent.name, prompt, frames, call)
    return StageOutput(video_id, stage, call, prompt_id, key, reply, items, how, frame_index)


def _complete(agent: LanguageAgent, stage: Stage, video_id: str, prompt: Prompt) -> StageOutput:
    reply = agent.complete(prompt, 0)
    items, how = parse(reply.text)
    key = request_sha256(agent.name, prompt, [], 0)
    return StageOutput(video_id, stage, 0, prompt.prompt_id, key, reply, items, how)


def _chunk(answer: StageOutput) -> StageOutput:
    """Track 2 b: the noun chunks of an answer; spaCy speaks here, so there is no prompt."""
    chunks = noun_chunks(answer.reply.text)
    reply = Reply(", ".join(chunks), "spaCy noun chunks")
    items = tuple(Item(rank, chunk, "") for rank, chunk in enumerate(chunks, start=1))
    how = Parse.COMMAS if items else Parse.EMPTY
    return StageOutput(
        answer.video_id, Stage.CHUNKS, answer.call, "", answer.request_sha256, reply, items, how
    )


def _without_articles(output: StageOutput) -> StageOutput:
    """The AES with articles removed (paper), should the model have left them in."""
    labels = dict.fromkeys(without_article(item.label or item.description) for item in output.items)
    items = tuple(Item(rank, label, "") for rank, label in enumerate(filter(None, labels), start=1))
    return StageOutput(
        output.video_id,
        output.stage,
        output.call,
        output.prompt_id,
        output.request_sha256,
        output.reply,
        items,
        output.parse,
        output.frame_index,
    )
