"""How the local model does on the paper's four language prompts: `python -m bench.local_llm`.

Real clips, the embedded vision agent, and the packaged model over HTTP. It tells whether the
machinery holds with a real model, not how good the paper's method is: 270 million parameters are few.
"""

import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.agents import open_agents
from pipeline.benchmark import open_benchmark
from pipeline.classifier import open_classifier
from pipeline.config import RunConfig
from pipeline.embedded_vision import EmbeddedVisionAgent
from pipeline.local_llm import LocalServer, local_server
from pipeline.records import Stage, StageOutput, TrackBox
from pipeline.stages import Agents, run_stages
from pipeline.tables import BOXES
from pipeline.video import read_keyframes

DEMO = Path(__file__).parent.parent / "demo"
LANGUAGE_STAGES = (Stage.RHS, Stage.AES, Stage.COS, Stage.AOS)


def config_of(server: LocalServer, **role: float) -> RunConfig:
    """A run that asks the server in the four language roles; `role` overrides the paper's sampling."""
    default = RunConfig().roles.model_dump()
    names = ("rhs", "aes", "cos", "aos")
    where = {"endpoint": "local", "model": server.model}
    return RunConfig.model_validate(
        {
            "language": "http",
            "endpoints": {"local": {"base_url": server.base_url, "max_in_flight": 1, "timeout_s": 600}},
            "roles": {name: {**default[name], **where, **role} for name in names},
        }
    )


def language_outputs(clip: Path, boxes: Sequence[TrackBox], config: RunConfig) -> list[StageOutput]:
    """RHS, AES, COS and AOS of a clip, seen by the embedded vision agent."""
    by_frame: dict[int, list[TrackBox]] = defaultdict(list)
    for box in boxes:
        by_frame[box.frame_index].append(box)
    keyframes = read_keyframes(clip, clip.stem, config.frames.count)
    frames = [replace(frame, boxes=tuple(by_frame[frame.index])) for frame in keyframes.frames]
    vision = EmbeddedVisionAgent(open_classifier(threads=1), {clip.stem: boxes}, config.seed)
    agents = open_agents(config)
    assert agents.language
    try:
        outputs = run_stages(clip.stem, frames, Agents(vision, vision, agents.language), config)
    finally:
        agents.close()
    return [output for output in outputs if output.stage in LANGUAGE_STAGES]


def main() -> None:
    """All demo clips with the paper's sampling; prints a line a clip."""
    benchmark = open_benchmark(DEMO)
    boxes = BOXES.read(benchmark.boxes)
    parsed = asked = 0
    start = time.perf_counter()
    with local_server(threads=1) as server:  # two that wait for each other crawl on busy cores
        for clip in sorted(benchmark.videos.glob("*.mp4")):
            own = [box for box in boxes if box.video_id == clip.stem]
            outputs = language_outputs(clip, own, config_of(server))
            asked += len(outputs)
            parsed += sum(bool(output.items) for output in outputs)
            said = ", ".join(
                f"{one.stage} {len(one.items)} ({one.parse}, {one.reply.latency_s:.1f} s)" for one in outputs
            )
            sys.stdout.write(f"{clip.stem}: {said}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{parsed} of {asked} prompts gave items, {time.perf_counter() - start:.0f} s\n")


if __name__ == "__main__":
    main()
