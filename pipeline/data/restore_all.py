"""Restoring all clips of a folder: in parallel, one failing clip not stopping the others, resumable.

Every clip has a record, OUT/restoration/<stem>.restore.json, written after all its other files. A clip
is skipped when its record was made from the same source, settings, networks and code and its files are
those that the record names. One process at a time works on a folder.
"""

import multiprocessing
import os
import threading
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2

from pipeline.data.decode import read_header
from pipeline.data.nafnet import TiledNetwork, network_sha256
from pipeline.data.restore import FOLDER, restore_clip
from pipeline.data.restore_record import RestoreJob, clear, finished, key_of, write_record
from pipeline.errors import CooolerError, InputError, VideoError
from pipeline.files import locked, sha256_file
from pipeline.interfaces import Executor

_PROGRESS = ".progress"  # one byte a finished frame: what a dead process leaves of it is harmless
_POLL_S = 0.5


@dataclass(frozen=True, slots=True)
class RestoreOutcome:
    """How a clip fared: `error` is empty when its files are there, `notes` say what was odd about it."""

    video_id: str
    reused: bool
    error: str
    notes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    watermarks: int = 0


def restore_all(
    jobs: Sequence[RestoreJob],
    executor: Executor,
    *,
    done: Callable[[RestoreOutcome], None] = lambda outcome: None,
    frames_done: Callable[[int, int], None] = lambda finished, total: None,
) -> list[RestoreOutcome]:
    """Restore the clips of one folder, skipping those that are finished; outcomes sorted by id.

    `done` is told of each clip, `frames_done` from time to time how many frames are finished, and
    of how many. Raises InputError or OutsideError when a network cannot be used, and InputError when
    the folder holds videos that were not restored.
    """
    if not jobs:
        return []
    for model in {job.settings.denoise_model for job in jobs} | {job.settings.deblur_model for job in jobs}:
        if model:
            network_sha256(model)
            TiledNetwork(model)
    out = jobs[0].out
    if not (out / FOLDER).is_dir() and any(out.glob("*.mp4")):
        raise InputError(f"{out}: found videos that were not restored; expected a folder of its own (--out).")
    with locked(out / FOLDER):
        for left in (*out.glob(".*.tmp"), *(out / FOLDER).glob(".*.tmp"), out / FOLDER / _PROGRESS):
            left.unlink(missing_ok=True)
        outcomes, todo = [], []
        for job in jobs:
            if (record := finished(job)) is None:
                todo.append(job)
            else:
                outcomes.append(_outcome(job, record, reused=True))
                done(outcomes[-1])
        total = sum(_frames(job.clip) for job in todo)
        stop = threading.Event()
        watcher = threading.Thread(target=_watch, args=(out, stop, total, frames_done), daemon=True)
        watcher.start()
        try:
            for outcome in executor.run(restore_one, todo, _lost):
                outcomes.append(outcome)
                done(outcome)
        finally:
            stop.set()
            watcher.join()
            (out / FOLDER / _PROGRESS).unlink(missing_ok=True)
    return sorted(outcomes, key=lambda outcome: outcome.video_id)


def _watch(out: Path, stop: threading.Event, total: int, frames_done: Callable[[int, int], None]) -> None:
    while not stop.wait(_POLL_S):
        with suppress(OSError):
            frames_done((out / FOLDER / _PROGRESS).stat().st_size, total)


def _frames(clip: Path) -> int:
    """How many a file says it holds; 0 for a broken one, which will fail soon."""
    try:
        return len(read_header(clip).times)
    except VideoError:
        return 0


def _outcome(job: RestoreJob, record: dict[str, Any], reused: bool) -> RestoreOutcome:
    methods = tuple(f"{step['step']}: {step['method']}" for step in record["steps"])
    marks = sum(len(step["settings"].get("boxes_px", ())) for step in record["steps"])
    return RestoreOutcome(job.stem, reused, "", tuple(record["notes"]), methods, marks)


def _lost(job: RestoreJob, error: str) -> RestoreOutcome:
    return RestoreOutcome(job.stem, False, f"{job.clip}: {error}")


def restore_one(job: RestoreJob) -> RestoreOutcome:
    """One clip. A broken one gives an outcome with an error, not an exception."""
    if multiprocessing.parent_process() is not None:
        cv2.setNumThreads(1)  # there is a process for every core
        _end_with_parent()
    try:
        return _outcome(job, _restore(job), reused=False)
    except CooolerError as error:
        return RestoreOutcome(job.stem, False, str(error))
    except Exception as error:  # one clip must not end the run of all
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return _lost(job, f"{type(error).__name__} at {where}: {error}")


@cache
def _end_with_parent() -> None:
    """A killed run must not leave workers that go on writing beside the next run."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _restore(job: RestoreJob) -> dict[str, Any]:
    key = key_of(job)
    clear(job)
    with (job.out / FOLDER / _PROGRESS).open("ab", buffering=0) as progress:

        def tick() -> None:
            progress.write(b".")

        made = restore_clip(job.clip, job.out, job.settings, job.boxes, tick)
    if sha256_file(job.clip) != key["source_sha256"]:
        raise InputError(f"{job.clip}: it changed meanwhile; expected a clip that nothing writes to.")
    return write_record(job, key, made)
