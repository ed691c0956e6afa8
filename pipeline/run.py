"""One video through the pipeline, and all videos through an executor: resumable, atomic.

A run folder holds the tables, and in `parts/<video id>/` those of each finished video. A part
is used again when it was made from the same clip, boxes, configuration and models.
"""

import json
import re
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.classifier import ConseMatcher, CropClassifier, open_classifier
from pipeline.config import RunConfig
from pipeline.embedded_language import EmbeddedLanguageAgent
from pipeline.embedded_vision import EmbeddedVisionAgent
from pipeline.errors import AgentError, CooolerError, Fault, FaultsError, InputError, VideoError
from pipeline.files import sha256_file, sha256_of, write_text
from pipeline.interfaces import Embedder, Executor
from pipeline.minilm import open_embedder
from pipeline.records import Stage, StageOutput, TrackBox, VideoOutcome
from pipeline.stages import Agents, run_stages
from pipeline.table import Table, metadata
from pipeline.tables import BOXES, MATCHES, OUTCOMES, PREDICTIONS, SNIPPETS, STAGES
from pipeline.verify import verify
from pipeline.video import read_keyframes

VIDEO_SUFFIXES = frozenset({".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".ts"})
SAFE_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,127}")

RUN_TABLES: tuple[Table[Any], ...] = (STAGES, SNIPPETS, MATCHES, PREDICTIONS, OUTCOMES)


@dataclass(frozen=True, slots=True)
class Job:
    """One video to run: picklable, and all that its result depends on."""

    video_id: str
    path: Path
    boxes: tuple[TrackBox, ...]
    config: RunConfig
    part: Path


@dataclass(frozen=True, slots=True)
class VideoRun:
    """What the pipeline found in one video; `tables` are the rows by table name."""

    video_id: str
    reused: bool
    tables: Mapping[str, Sequence[Any]]

    @property
    def outcome(self) -> VideoOutcome:
        """How it fared."""
        found: VideoOutcome = self.tables[OUTCOMES.name][0]
        return found


def find_videos(folder: Path) -> list[Path]:
    """The video files in a folder, sorted by name.

    Raises FaultsError for names that cannot be an id and for two files with one stem.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected a folder of video files (--videos).")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in VIDEO_SUFFIXES)
    faults = [
        Fault(
            str(path), None, None, f"the file name {path.name!r}", "a stem of A-Z a-z 0-9 . _ -", "Rename it."
        )
        for path in paths
        if not SAFE_ID.fullmatch(path.stem)
    ]
    stems = [path.stem for path in paths]
    faults += [
        Fault(str(path), None, None, f"a second file for video {path.stem}", "one", "Remove or rename one.")
        for place, path in enumerate(paths)
        if path.stem in stems[:place]
    ]
    if faults:
        raise FaultsError(faults)
    if not paths:
        kinds = " ".join(sorted(VIDEO_SUFFIXES))
        raise InputError(f"{folder}: found no video file; expected files ending in {kinds}.")
    return paths


@cache
def _models() -> tuple[CropClassifier, Embedder, ConseMatcher]:
    """The embedded models, once a process; one thread each, since videos run in parallel."""
    classifier, embedder = open_classifier(threads=1), open_embedder(threads=1)
    return classifier, embedder, ConseMatcher(classifier, embedder)


def agent_names(config: RunConfig) -> str:
    """One line that says which agents a configuration uses; goes into files and onto pages."""
    track2 = "" if config.track2.enabled else "; without Track 2"
    return (
        f"{EmbeddedVisionAgent.name}; {EmbeddedLanguageAgent.name}; ConSE baseline in place of CLIP{track2}"
    )


def part_sha256(job: Job) -> str:
    """Hash of all that a video's result depends on."""
    classifier, embedder, _ = _models()
    boxes = BOXES.to_arrow(job.boxes).to_pylist()
    clip = sha256_file(job.path)
    key = [__version__, clip, boxes, job.config.sha256, classifier.sha256, embedder.sha256, _code_sha256()]
    return sha256_of(json.dumps(key).encode())


@cache
def _code_sha256() -> str:
    """Hash of this package's code and prompts: a changed rule makes old parts stale."""
    folder = Path(__file__).parent
    names = sorted(path.name for path in folder.iterdir() if path.suffix in {".py", ".toml", ".csv"})
    return sha256_of("".join(f"{name} {sha256_file(folder / name)}\n" for name in names).encode())


def run_video(job: Job) -> VideoRun:
    """One video: from its part when that still holds, else anew. A broken video gives an outcome
    with an error, not an exception."""
    key = part_sha256(job) if job.path.is_file() else ""
    if key and (tables := _read_part(job.part, key)) is not None:
        return VideoRun(job.video_id, True, tables)
    try:
        tables = _process(job)
    except (VideoError, AgentError) as error:
        return _failed(job, str(error))
    except CooolerError:
        raise
    except Exception as error:  # one video must not end the run of all
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return _failed(job, f"{job.path}: {type(error).__name__} at {where}: {error}")
    _write_part(job.part, tables, key)
    return VideoRun(job.video_id, False, tables)


def _failed(job: Job, error: str) -> VideoRun:
    outcome = VideoOutcome(job.video_id, job.path.name, 0, 0.0, 0, 0, error)
    tables: dict[str, Sequence[Any]] = {table.name: () for table in RUN_TABLES}
    return VideoRun(job.video_id, False, {**tables, OUTCOMES.name: (outcome,)})


def _process(job: Job) -> dict[str, Sequence[Any]]:
    config = job.config
    keyframes = read_keyframes(job.path, job.video_id, config.frames.count)
    by_frame: dict[int, list[TrackBox]] = {}
    for track_box in job.boxes:
        by_frame.setdefault(track_box.frame_index, []).append(track_box)
    frames = [
        replace(frame, boxes=tuple(sorted(by_frame.get(frame.index, []), key=lambda box: box.track_id)))
        for frame in keyframes.frames
    ]
    classifier, embedder, matcher = _models()
    vision = EmbeddedVisionAgent(classifier, {job.video_id: job.boxes}, config.seed)
    agents = Agents(vision, vision, EmbeddedLanguageAgent(embedder))
    outputs = run_stages(job.video_id, frames, agents, config)
    cos = _last(outputs, Stage.COS) or _last(outputs, Stage.RHS)
    aos = _last(outputs, Stage.AOS)
    assert cos is not None and aos is not None
    checked = verify(job.video_id, frames, cos.items, aos.items, matcher, config.verify)
    video = keyframes.video
    outcome = VideoOutcome(
        job.video_id,
        job.path.name,
        video.frame_count,
        video.fps_hz,
        video.width_px,
        video.height_px,
        "",
        keyframes.note,
    )
    return {
        STAGES.name: outputs,
        SNIPPETS.name: checked.snippets,
        MATCHES.name: checked.matches,
        PREDICTIONS.name: checked.predictions,
        OUTCOMES.name: (outcome,),
    }


def _last(outputs: Sequence[StageOutput], stage: Stage) -> StageOutput | None:
    return next((output for output in reversed(outputs) if output.stage is stage), None)


def _read_part(part: Path, key: str) -> dict[str, Sequence[Any]] | None:
    """The tables of a part made for `key`, or None. The outcome is written last: it vouches."""
    try:
        if metadata(part / "outcomes.parquet").get("part_sha256") != key:
            return None
        return {table.name: table.read(part / f"{table.name}.parquet") for table in RUN_TABLES}
    except (OSError, ValueError, FaultsError):
        return None


def _write_part(part: Path, tables: Mapping[str, Sequence[Any]], key: str) -> None:
    (part / "outcomes.parquet").unlink(missing_ok=True)
    for table in RUN_TABLES:
        table.write(part / f"{table.name}.parquet", tables[table.name], {"part_sha256": key})


@dataclass(frozen=True, slots=True)
class RunReport:
    """What a run did: outcomes sorted by id, how many videos were taken from parts."""

    outcomes: tuple[VideoOutcome, ...]
    reused: int
    predictions: int

    @property
    def failed(self) -> tuple[VideoOutcome, ...]:
        """The videos with an error."""
        return tuple(outcome for outcome in self.outcomes if outcome.error)


def predict(
    videos: Sequence[Path],
    boxes: Sequence[TrackBox],
    config: RunConfig,
    out: Path,
    executor: Executor,
    done: Callable[[VideoRun], None] = lambda run: None,
) -> RunReport:
    """Run all `videos` and write the tables of the run to `out`; `done` is told of each video.

    The bytes depend on the inputs alone, not on the executor or on what was resumed.
    """
    by_video: dict[str, list[TrackBox]] = {}
    for track_box in boxes:
        by_video.setdefault(track_box.video_id, []).append(track_box)
    jobs = [
        Job(path.stem, path, tuple(by_video.get(path.stem, [])), config, out / "parts" / path.stem)
        for path in videos
    ]
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / "run.json", json.dumps(config.model_dump(mode="json"), indent=2, sort_keys=True) + "\n")
    runs = []
    for run in _stream(executor, jobs):
        done(run)
        runs.append(run)
    marks = {
        "config_sha256": config.sha256,
        "config": json.dumps(config.model_dump(mode="json"), sort_keys=True),
        "agents": agent_names(config),
        "coooler_version": __version__,
    }
    for table in RUN_TABLES:
        rows = [row for run in runs for row in run.tables[table.name]]
        table.write(out / f"{table.name}.parquet", rows, marks)
    outcomes = tuple(sorted((run.outcome for run in runs), key=lambda outcome: outcome.video_id))
    return RunReport(
        outcomes, sum(run.reused for run in runs), sum(len(run.tables["predictions"]) for run in runs)
    )


def _stream(executor: Executor, jobs: Sequence[Job]) -> Iterator[VideoRun]:
    yield from executor.run(run_video, jobs)
