"""The embedded pipeline in one process, stage by stage, against its bare model calls and a bare decode.

The models' sessions are wrapped, so that their calls are timed where they are made: the pipeline's time
and that of its model calls are of the same run.
"""

import os
import shutil
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

from bench.keyframes import plain_decode
from bench.timing import Measure
from pipeline import classifier, minilm, run, team
from pipeline.benchmark import Benchmark
from pipeline.config import read_run_config
from pipeline.execute import SerialExecutor
from pipeline.graphs import cache_folder
from pipeline.places import Place
from pipeline.tables import BOXES

ROUNDS = 5
STEP = 2  # every other clip is enough for the ratios
STAGES = {"keyframes": "read_keyframes", "both tracks": "run_stages", "verification": "verify"}
"""What the pipeline does with a video, and the function that does it."""


@dataclass(slots=True)
class Clock:
    """Seconds by what they were spent on."""

    spent: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def timed(self, what: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, its time noted."""

        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                self.spent[what] += time.perf_counter() - start

        return timed


class TimedSession:
    """An onnxruntime session whose calls are timed."""

    def __init__(self, session: Any, clock: Clock, what: str) -> None:
        """`what` names the model."""
        self._session = session
        self.run = clock.timed(what, session.run)
        self.get_inputs, self.get_outputs = session.get_inputs, session.get_outputs


@contextmanager
def timed_pipeline(clock: Clock) -> Iterator[None]:
    """The models' calls and the stages are timed while this is open; the models are opened anew in it."""
    with ExitStack() as stack:
        for module, what in ((classifier, "classifier"), (minilm, "embedder")):
            real = module.open_session

            def opened(model: Any, threads: Any = None, real: Any = real, what: str = what) -> TimedSession:
                return TimedSession(real(model, threads), clock, what)

            stack.enter_context(patch.object(module, "open_session", opened))
        for what, name in STAGES.items():
            stack.enter_context(patch.object(run, name, clock.timed(what, getattr(run, name))))
        yield


def measure(benchmark: Benchmark) -> list[Measure]:
    """Whole runs in new folders, no vector known before; the decode takes turns with them."""
    boxes = BOXES.read(benchmark.boxes)
    clips = run.find_videos(Place(str(benchmark.videos)))[::STEP]
    settings = read_run_config(benchmark.root / benchmark.settings.demo[0].run)
    videos = [Path(clip.where) for clip in clips]
    rounds: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as name, patch.dict(os.environ, {"COOOLER_CACHE": f"{name}/cache"}):
        clock = Clock()
        with timed_pipeline(clock):
            for turn in range(ROUNDS + 1):
                shutil.rmtree(cache_folder() / "vectors", ignore_errors=True)
                for opened in team._TEAMS.values():
                    for kept in ("_embedder", "matcher"):
                        vars(opened).pop(kept, None)
                clock.spent.clear()
                out = Place(f"{name}/{turn}")
                predict = clock.timed("whole", run.predict)
                predict(clips, boxes, settings, out, SerialExecutor())
                clock.timed("decode", lambda: [plain_decode(path, "SLICE", 1) for path in videos])()
                rounds.append(dict(clock.spent))
    # The first round opened the models; of the others the one in the middle, so that its parts add up.
    spent = sorted(rounds[1:], key=lambda one: one["whole"])[ROUNDS // 2]
    models = spent["classifier"] + spent["embedder"]
    rest = spent["whole"] - sum(spent[what] for what in STAGES)
    shares = {**{what: spent[what] for what in STAGES}, "tables and keys": rest}
    by_stage = ", ".join(f"{what} {seconds / len(clips) * 1e3:.0f} ms" for what, seconds in shares.items())
    return [
        Measure(
            f"embedded pipeline, {len(clips)} clips, one process",
            spent["whole"],
            "its bare model calls and a bare decode",
            models + spent["decode"],
            "at most 1.15",
            f"a clip: {by_stage}; classifier {spent['classifier'] / len(clips) * 1e3:.0f} ms, "
            f"embedder {spent['embedder'] / len(clips) * 1e3:.0f} ms",
        ),
        Measure("its keyframes", spent["keyframes"], "bare decode", spent["decode"], ""),
        Measure(
            "its two tracks and verification",
            spent["both tracks"] + spent["verification"],
            "their bare model calls",
            models,
            "",
        ),
    ]
