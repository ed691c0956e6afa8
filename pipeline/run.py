"""One video through the pipeline, and all videos through an executor: resumable, atomic.

A run folder holds the tables, and in `parts/<video id>/` those of each finished video. Parts are
written here and not by the workers, each as soon as it comes, the `outcomes` table last: it vouches
for the others. A part is used again when it was made from the same clip, boxes, configuration and
models, so a run that was stopped in any way goes on where it was.
"""

import io
import json
import re
import traceback
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.config import RunConfig
from pipeline.errors import AgentError, CooolerError, Fault, FaultsError, InputError, VideoError
from pipeline.files import sha256_file, sha256_of
from pipeline.interfaces import Executor
from pipeline.places import Place
from pipeline.records import Stage, TrackBox, VideoOutcome
from pipeline.stages import run_stages
from pipeline.table import Table, metadata
from pipeline.tables import BOXES, MATCHES, OUTCOMES, PREDICTIONS, SNIPPETS, STAGES, USAGE
from pipeline.team import NO_SERVICES, Services, close_connections, open_team
from pipeline.usage import usage_of
from pipeline.verify import verify
from pipeline.video import read_keyframes

VIDEO_SUFFIXES = frozenset({".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".ts"})
SAFE_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,127}")

NOT_RUN = "not run yet"

# The outcome comes last: it vouches for the rest of a part.
RUN_TABLES: tuple[Table[Any], ...] = (STAGES, SNIPPETS, MATCHES, PREDICTIONS, USAGE, OUTCOMES)


@dataclass(frozen=True, slots=True)
class Job:
    """One video to run: picklable, and all that its result depends on."""

    video_id: str
    clip: Place
    boxes: tuple[TrackBox, ...]
    config: RunConfig
    services: Services = NO_SERVICES


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


def find_videos(folder: Place) -> list[Place]:
    """The video files in a folder, sorted by name.

    Raises FaultsError for names that cannot be an id and for two files with one stem.
    """
    if not folder.is_folder():
        raise InputError(f"{folder}: no such folder; expected a folder of video files (--videos).")
    places = [place for place in folder.files() if Path(place.name).suffix.lower() in VIDEO_SUFFIXES]
    faults = []
    stems: set[str] = set()
    for place in places:
        stem = video_id_of(place)
        if not SAFE_ID.fullmatch(stem):
            found, expected = f"the file name {place.name!r}", "a stem of A-Z a-z 0-9 . _ -"
            faults.append(Fault(str(place), None, None, found, expected, "Rename it."))
        if stem in stems:
            found = f"a second file for video {stem}"
            faults.append(Fault(str(place), None, None, found, "one", "Remove or rename one."))
        stems.add(stem)
    if faults:
        raise FaultsError(faults)
    if not places:
        kinds = " ".join(sorted(VIDEO_SUFFIXES))
        raise InputError(f"{folder}: found no video file; expected files ending in {kinds}.")
    return places


def video_id_of(clip: Place) -> str:
    """A video's id is its file's stem."""
    return Path(clip.name).stem


def part_sha256(job: Job) -> str:
    """Hash of all that a video's result depends on."""
    boxes = BOXES.to_arrow(job.boxes).to_pylist()
    team = open_team(job.config, job.services).sha256
    prices = {model: price.model_dump() for model, price in job.config.prices.items()}
    key = [__version__, job.clip.identity(), boxes, job.config.sha256, prices, team, _code_sha256()]
    return sha256_of(json.dumps(key).encode())


@cache
def _code_sha256() -> str:
    """Hash of this package's code and prompts: a changed rule makes old parts stale."""
    folder = Path(__file__).parent
    names = sorted(path.name for path in folder.iterdir() if path.suffix in {".py", ".toml", ".csv"})
    return sha256_of("".join(f"{name} {sha256_file(folder / name)}\n" for name in names).encode())


def run_video(job: Job) -> VideoRun:
    """One video. A broken one gives an outcome with an error, not an exception."""
    try:
        with job.clip.as_path() as path:
            return VideoRun(job.video_id, False, _process(job, path))
    except (VideoError, AgentError, FileNotFoundError) as error:
        return lost_video(job, str(error))
    except CooolerError:
        raise
    except Exception as error:  # one video must not end the run of all
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return lost_video(job, f"{job.clip}: {type(error).__name__} at {where}: {error}")


def lost_video(job: Job, error: str) -> VideoRun:
    """The run of a video that could not be run, with the reason in its outcome."""
    outcome = VideoOutcome(job.video_id, job.clip.name, 0, 0.0, 0, 0, error)
    tables: dict[str, Sequence[Any]] = {table.name: () for table in RUN_TABLES}
    return VideoRun(job.video_id, False, {**tables, OUTCOMES.name: (outcome,)})


def _process(job: Job, path: Path) -> dict[str, Sequence[Any]]:
    config = job.config
    keyframes = read_keyframes(path, job.video_id, config.frames.count)
    by_frame: dict[int, list[TrackBox]] = {}
    for track_box in job.boxes:
        by_frame.setdefault(track_box.frame_index, []).append(track_box)
    frames = [
        replace(frame, boxes=tuple(sorted(by_frame.get(frame.index, []), key=lambda box: box.track_id)))
        for frame in keyframes.frames
    ]
    team = open_team(config, job.services)
    outputs = run_stages(job.video_id, frames, team.agents({job.video_id: job.boxes}), config)
    # Without Track 2 the RHS stands in for the COS.
    cos = [output for output in outputs if output.stage in (Stage.COS, Stage.RHS)][-1]
    checked = verify(job.video_id, frames, cos.items, outputs[-1].items, team.matcher, config.verify)
    video = keyframes.video
    outcome = VideoOutcome(
        job.video_id,
        job.clip.name,
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
        USAGE.name: usage_of(outputs, config.models, config.prices),
        OUTCOMES.name: (outcome,),
    }


def _read_part(part: Place, job: Job) -> dict[str, Sequence[Any]] | None:
    """The tables of a part that was made from what `job` has now, or None."""
    try:
        marked = metadata(io.BytesIO((part / "outcomes.parquet").read())).get("part_sha256")
        if marked != part_sha256(job):
            return None
        files = {table: part / f"{table.name}.parquet" for table in RUN_TABLES}
        return {table.name: table.from_bytes(place.read(), str(place)) for table, place in files.items()}
    except (OSError, ValueError, FaultsError):
        return None


def _write_part(part: Place, tables: Mapping[str, Sequence[Any]], key: str) -> None:
    (part / "outcomes.parquet").remove()
    for table in RUN_TABLES:
        (part / f"{table.name}.parquet").write(table.to_bytes(tables[table.name], {"part_sha256": key}))


@dataclass(frozen=True, slots=True)
class RunReport:
    """What a run did: outcomes sorted by id, how many videos were taken from parts, what is there."""

    outcomes: tuple[VideoOutcome, ...]
    reused: int
    tables: Mapping[str, Sequence[Any]]

    @property
    def failed(self) -> tuple[VideoOutcome, ...]:
        """The videos with an error."""
        return tuple(outcome for outcome in self.outcomes if outcome.error not in ("", NOT_RUN))

    @property
    def not_run(self) -> int:
        """How many videos `only` left out that no earlier run had finished."""
        return sum(outcome.error == NOT_RUN for outcome in self.outcomes)


def predict(
    clips: Sequence[Place],
    boxes: Sequence[TrackBox],
    config: RunConfig,
    out: Place,
    executor: Executor,
    *,
    services: Services = NO_SERVICES,
    only: Collection[str] = (),
    done: Callable[[VideoRun], None] = lambda run: None,
) -> RunReport:
    """Run the clips and write the tables of the run to `out`; `done` is told of each video.

    With `only`, just these videos are run, and of the others what earlier runs left is kept. The
    bytes depend on the inputs and the answers alone, not on the executor or on what was resumed.
    """
    by_video: dict[str, list[TrackBox]] = {}
    for track_box in boxes:
        by_video.setdefault(track_box.video_id, []).append(track_box)
    jobs = [
        Job(video_id_of(clip), clip, tuple(by_video.get(video_id_of(clip), [])), config, services)
        for clip in clips
    ]
    unknown = sorted(set(only) - {job.video_id for job in jobs})
    if unknown:
        raise InputError(f"found no clip for {', '.join(unknown)}; expected ids of the videos (--only).")
    settings = json.dumps(config.model_dump(mode="json"), indent=2, sort_keys=True)
    (out / "run.json").write(f"{settings}\n".encode())
    marks = {
        "config_sha256": config.sha256,
        "config": json.dumps(config.model_dump(mode="json"), sort_keys=True),
        "agents": open_team(config, services).names,
        "coooler_version": __version__,
    }
    runs = []
    try:
        for run in _runs(jobs, out / "parts", executor, only):
            done(run)
            runs.append(run)
    finally:
        close_connections()
    rows = {table.name: [row for run in runs for row in run.tables[table.name]] for table in RUN_TABLES}
    for table in RUN_TABLES:
        (out / f"{table.name}.parquet").write(table.to_bytes(rows[table.name], marks))
    outcomes = tuple(sorted(rows[OUTCOMES.name], key=lambda outcome: outcome.video_id))
    return RunReport(outcomes, sum(run.reused for run in runs), rows)


def _runs(jobs: Sequence[Job], parts: Place, executor: Executor, only: Collection[str]) -> Iterator[VideoRun]:
    """The run of each job: from its part when that still holds, else from the executor."""
    todo = []
    for job in jobs:
        tables = None if job.video_id in only else _read_part(parts / job.video_id, job)
        if tables is not None:
            yield VideoRun(job.video_id, True, tables)
        elif only and job.video_id not in only:
            yield lost_video(job, NOT_RUN)
        else:
            todo.append(job)
    keys: dict[str, str] = {}

    def drawn() -> Iterator[Job]:
        # Most boxes first, so that no long clip is left over at the end; a clip is hashed when it is
        # drawn, while others are at work: all clips of a large run are many gigabytes.
        for job in sorted(todo, key=lambda job: -len(job.boxes)):
            keys[job.video_id] = part_sha256(job)
            yield job

    for run in executor.run(run_video, drawn(), lost_video):
        if not run.outcome.error:
            _write_part(parts / run.video_id, run.tables, keys.pop(run.video_id))
        yield run
