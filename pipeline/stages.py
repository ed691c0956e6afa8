"""The steps of both tracks: fill a prompt, ask, parse, and record what was said (paper, section 2).

    frames -> scene x N -> RHS ─┐
    frames -> answer x 20 -> chunks x 20 -> AES ─┴─> COS -> AOS

Every step gives `StageOutput`s; an answer without items makes an empty stage, never a crash.
"""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

from pipeline.chunks import noun_chunks, without_article
from pipeline.config import RunConfig
from pipeline.files import sha256_of
from pipeline.interfaces import LanguageAgent, Prompt, VisionAgent
from pipeline.parsing import parse
from pipeline.prompts import fill
from pipeline.records import Frame, Item, Parse, Reply, Stage, StageOutput

REPAIR_HINT = "Your last answer to this could not be read. "


@dataclass(frozen=True, slots=True)
class Agents:
    """Who answers in each role, and how many questions may be open at once."""

    scene: VisionAgent
    video: VisionAgent
    language: LanguageAgent
    in_flight: int = 1


def run_stages(
    video_id: str, frames: Sequence[Frame], agents: Agents, config: RunConfig
) -> list[StageOutput]:
    """Every stage output of a video, in order; the last is the AOS.

    Without Track 2 the RHS takes the place of the COS (ours), and no AES or COS is made.
    Raises AgentError when an agent does not answer.
    """

    # Hashed once: Track 2 shows all of them again with every question.
    pixels = [_pixels_sha256(frame) for frame in frames]

    def scene(call: int) -> StageOutput:
        frame, pixel = frames[call], pixels[call]
        return _look(agents.scene, "T1-VLM", Stage.SCENE, call, video_id, [frame], [pixel], frame.index)

    def answer(call: int) -> StageOutput:
        return _look(agents.video, "T2-VLM", Stage.ANSWER, call, video_id, frames, pixels, None)

    language = agents.language
    scenes = _all(scene, len(frames), agents.in_flight)
    prompt = fill("T1-LLM", {"descriptions": [said.reply.text for said in scenes]})
    rhs = _complete(language, Stage.RHS, video_id, prompt)
    outputs = [*scenes, *rhs]
    cos = rhs
    if config.track2.enabled:
        answers = _all(answer, config.track2.queries, agents.in_flight)
        chunks = [_chunk(said) for said in answers]
        lists = [", ".join(item.label for item in said.items) for said in chunks]
        aes = _complete(language, Stage.AES, video_id, fill("T2-LLM", {"lists": lists}))
        aes[-1] = _without_articles(aes[-1])
        cross = fill("X-LLM", {"rhs": entries(rhs[-1].items), "aes": entries(aes[-1].items)})
        cos = _complete(language, Stage.COS, video_id, cross)
        outputs += [*answers, *chunks, *aes, *cos]
    aos = _complete(language, Stage.AOS, video_id, fill("A-LLM", {"cos": entries(cos[-1].items)}))
    return [*outputs, *aos]


def _all(ask: Callable[[int], StageOutput], count: int, in_flight: int) -> list[StageOutput]:
    """The outputs of calls 0 .. count-1, in order, at most `in_flight` asked at once."""
    if in_flight == 1:
        return [ask(call) for call in range(count)]
    with ThreadPoolExecutor(in_flight) as pool:
        return list(pool.map(ask, range(count)))


def entries(items: Sequence[Item]) -> list[str]:
    """Items as they are put into the next prompt: "label: description", or whichever there is."""
    return [": ".join(filter(None, (item.label, item.description))) for item in items]


def request_sha256(agent: str, prompt: Prompt, pixels: Sequence[str], call: int) -> str:
    """Hash of all that a request depends on: agent, prompt, the frames' hashes, the number of the call."""
    parts = [agent, prompt.prompt_id, prompt.system, prompt.user, prompt.format_hint, call, *pixels]
    return sha256_of(json.dumps(parts).encode())


def _pixels_sha256(frame: Frame) -> str:
    return sha256_of(f"{frame.index}:{frame.rgb.shape}:".encode() + frame.rgb.tobytes())


def _look(
    agent: VisionAgent,
    prompt_id: str,
    stage: Stage,
    call: int,
    video_id: str,
    frames: Sequence[Frame],
    pixels: Sequence[str],
    frame_index: int | None,
) -> StageOutput:
    prompt = fill(prompt_id)
    reply = agent.look(frames, prompt, call)
    items, how = parse(reply.text)
    key = request_sha256(agent.name, prompt, pixels, call)
    return StageOutput(video_id, stage, call, prompt_id, key, reply, items, how, frame_index)


def _complete(agent: LanguageAgent, stage: Stage, video_id: str, prompt: Prompt) -> list[StageOutput]:
    """The answer, and when nothing in it could be parsed, the answer to one request to repair it."""
    outputs = []
    for call, asked in enumerate((prompt, replace(prompt, format_hint=REPAIR_HINT + prompt.format_hint))):
        reply = agent.complete(asked, call)
        items, how = parse(reply.text)
        key = request_sha256(agent.name, asked, [], call)
        outputs.append(StageOutput(video_id, stage, call, prompt.prompt_id, key, reply, items, how))
        if how is not Parse.FAILED:
            break
    return outputs


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
    return replace(output, items=items)
