"""Tracks for clips without annotations: one clip, then all of a folder into a `boxes` table.

Each finished clip leaves a part beside the table, so a run that was stopped goes on where it was. Parts
are written by this process, each as soon as it comes, and removed when the table is written.
"""

import json
import multiprocessing
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Literal, TypeAlias

import cv2
from av.video.reformatter import VideoReformatter

from pipeline.data.decode import decoded
from pipeline.data.detector import Detector, DetectorSettings, detected_boxes, detector_sha256
from pipeline.data.linking import LinkSettings, Track, distinct, link, named
from pipeline.data.motion import MotionSettings, motion_boxes
from pipeline.errors import CooolerError, InputError
from pipeline.files import sha256_file, sha256_of
from pipeline.interfaces import Executor
from pipeline.records import Kind, RgbImage, TrackBox
from pipeline.table import metadata
from pipeline.tables import BOXES
from pipeline.video import upright

Method: TypeAlias = Literal["motion", "detector", "both"]

_CODE = ("propose.py", "motion.py", "detector.py", "linking.py", "decode.py")


@dataclass(frozen=True, slots=True)
class ProposeSettings:
    """How tracks are found; `names` are the detector's classes, empty: those in its file.

    With both methods a motion track that lies on a detected one is dropped. So are detections, and tracks
    by their mean score, under `min_score`; scores of motion start at 0.5.
    """

    method: Method = "motion"
    detector: Path | None = None
    names: tuple[str, ...] = ()
    min_score: float = 0.25
    motion: MotionSettings = field(default_factory=MotionSettings)
    detecting: DetectorSettings = field(default_factory=DetectorSettings)
    linking: LinkSettings = field(default_factory=lambda: LinkSettings(min_sightings=6))
    linking_detected: LinkSettings = field(default_factory=lambda: LinkSettings(min_sightings=3))

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods by name, sorted."""
        return ("detector", "motion") if self.method == "both" else (self.method,)

    @property
    def sha256(self) -> str:
        """Hash of all that decides the tracks of a clip but the clip: settings, network and code."""
        network = detector_sha256(self.detector) if self.detector else ""
        return sha256_of(f"{asdict(replace(self, detector=None))} {network} {_code_sha256()}".encode())


@dataclass(frozen=True, slots=True)
class ProposeJob:
    """One clip; picklable."""

    video_id: str
    clip: Path
    settings: ProposeSettings


@dataclass(frozen=True, slots=True)
class Proposed:
    """What was found in a clip; `error` is empty when it could be looked at.

    `labels` counts the detector's tracks by class.
    """

    video_id: str
    frames: int = 0
    boxes: tuple[TrackBox, ...] = ()
    labels: Mapping[str, int] = field(default_factory=dict)
    reused: bool = False
    error: str = ""

    @property
    def tracks(self) -> int:
        """How many tracks the boxes are of."""
        return len({box.track_id for box in self.boxes})


def propose_clip(clip: Path, settings: ProposeSettings) -> tuple[int, list[Track]]:
    """How many frames a clip has, and its tracks, by first frame. Raises VideoError when it is broken."""
    count = 0
    tracks: list[Track] = []
    if "detector" in settings.methods:
        if settings.detector is None:
            raise InputError("found no detector; expected an ONNX file (--detector).")
        detector = _detector(settings.detector, settings.names, detector_sha256(settings.detector))
        sure = replace(settings.detecting, min_score=settings.min_score)
        seen = detected_boxes(_frames(clip), detector, sure)
        tracks += link(seen, settings.linking_detected)
    if "motion" in settings.methods:

        def counted() -> Iterator[RgbImage]:
            nonlocal count
            for rgb in _frames(clip):
                count += 1
                yield rgb

        moving = link(motion_boxes(counted(), settings.motion), settings.linking)
        tracks = distinct(moving, settings.linking, tracks)
    count = count or sum(1 for _ in decoded(clip))
    return count, [track for track in tracks if track.score >= settings.min_score]


def propose_one(job: ProposeJob) -> Proposed:
    """One clip. A broken one gives an outcome with an error, not an exception."""
    if multiprocessing.parent_process() is not None:
        cv2.setNumThreads(1)  # there is a process for every core
    try:
        count, tracks = propose_clip(job.clip, job.settings)
    except CooolerError as error:
        return Proposed(job.video_id, error=str(error))
    except Exception as error:  # one clip must not end the run of all
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return _lost(job, f"{type(error).__name__} at {where}: {error}")
    labels = Counter(track.label for track in tracks if track.label)
    boxes = tuple(sorted(named(job.video_id, tracks), key=BOXES.key))
    return Proposed(job.video_id, count, boxes, dict(sorted(labels.items())))


def propose_all(
    jobs: Sequence[ProposeJob],
    parts: Path,
    executor: Executor,
    done: Callable[[Proposed], None] = lambda outcome: None,
) -> list[Proposed]:
    """Every clip, sorted by id; what an earlier run left in the folder `parts` is used when it still holds.

    `done` is told of each clip. Raises InputError or OutsideError when the detector cannot be used.
    """
    if jobs and (path := jobs[0].settings.detector):
        Detector(path, jobs[0].settings.names)
    outcomes, todo, keys = [], [], {}
    for job in jobs:
        if not job.clip.is_file():
            outcomes.append(_lost(job, "no such file"))
            done(outcomes[-1])
            continue
        keys[job.video_id] = sha256_of(f"{sha256_file(job.clip)} {job.settings.sha256}".encode())
        if (kept := _read_part(parts, job.video_id, keys[job.video_id])) is None:
            todo.append(job)
        else:
            outcomes.append(kept)
            done(kept)
    for outcome in executor.run(propose_one, todo, _lost):
        if not outcome.error:
            found = {"frames": outcome.frames, "labels": outcome.labels}
            marks = {"part": keys[outcome.video_id], "found": json.dumps(found, sort_keys=True)}
            BOXES.write(parts / f"{outcome.video_id}.parquet", outcome.boxes, marks)
        outcomes.append(outcome)
        done(outcome)
    return sorted(outcomes, key=lambda outcome: outcome.video_id)


def remove_parts(parts: Path) -> None:
    """Take away what `propose_all` kept, once the table is written."""
    for part in sorted(parts.glob("*.parquet")):
        part.unlink()
    if parts.is_dir() and not any(parts.iterdir()):
        parts.rmdir()


def merged(
    before: Sequence[TrackBox],
    outcomes: Sequence[Proposed],
    settings: ProposeSettings,
    marks: Mapping[str, str],
) -> tuple[list[TrackBox], dict[str, str]]:
    """The rows of a `boxes` table with the proposals in place of what it had of these videos, and its marks.

    A video that failed keeps what it had. The mark `proposed_by` names the methods of all proposals in the
    table, as "motion" or "detector,motion"; `marks` are those the table had.
    """
    renewed = {outcome.video_id for outcome in outcomes if not outcome.error}
    rows = [box for box in before if box.video_id not in renewed]
    rows += [box for outcome in outcomes if not outcome.error for box in outcome.boxes]
    kept = {key: value for key, value in marks.items() if key not in ("schema_version", "table")}
    methods = set(settings.methods)
    if any(box.kind is Kind.PROPOSED and box.video_id not in renewed for box in before):
        methods |= set(kept.get("proposed_by", "").split(",")) - {""}
    return rows, {**kept, "proposed_by": ",".join(sorted(methods))}


def _read_part(parts: Path, video_id: str, key: str) -> Proposed | None:
    """What an earlier run found in a clip, or None."""
    path = parts / f"{video_id}.parquet"
    try:
        marks = metadata(path)
        if marks.get("part") != key:
            return None
        found = json.loads(marks["found"])
        return Proposed(video_id, found["frames"], tuple(BOXES.read(path)), found["labels"], reused=True)
    except (OSError, ValueError, KeyError, InputError):  # damaged or of another run: looked at again
        return None


def _frames(clip: Path) -> Iterator[RgbImage]:
    reformatter = VideoReformatter()
    for frame in decoded(clip):
        yield upright(frame, reformatter)


def _lost(job: ProposeJob, error: str) -> Proposed:
    return Proposed(job.video_id, error=f"{job.clip}: {error}")


@cache
def _detector(path: Path, names: tuple[str, ...], sha256: str) -> Detector:
    """Opened once a process; `sha256` tells a changed file from the one that was opened."""
    del sha256
    return Detector(path, names)


@cache
def _code_sha256() -> str:
    folder = Path(__file__).parent
    return sha256_of("".join(sha256_file(folder / name) for name in _CODE).encode())
