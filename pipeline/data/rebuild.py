"""A benchmark's clips and boxes made again from their raw videos, and compared with what is there."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory

import av
import numpy as np
from numpy.typing import NDArray

from pipeline.data.cut import Cut, CutJob, chosen_frames, cut_clip, pictures
from pipeline.data.decode import decoded, read_header
from pipeline.data.keyboxes import interpolate, read_key_boxes
from pipeline.data.plan import Plan, find_sources, read_plan
from pipeline.errors import CooolerError, InputError, VideoError
from pipeline.files import write_bytes
from pipeline.interfaces import Executor
from pipeline.tables import BOXES

# How much further than the new clip one that is there may be from the raw pictures. Two builds of an
# encoder differ by hundredths of this, a clip that is shifted by one frame or made of others by more.
MEAN_DB = 1.0
FRAME_DB = 6.0


class Verdict(StrEnum):
    """How a file that is there compares with the one made again."""

    SAME = "same bytes"
    ALIKE = "same content, other encoder"
    DIFFERENT = "different"
    MISSING = "not there"
    EXTRA = "not in the plan"


@dataclass(frozen=True, slots=True)
class FileCheck:
    """The verdict on one file, by its path from the plan's folder, and what it rests on."""

    file: str
    verdict: Verdict
    note: str = ""

    @property
    def is_good(self) -> bool:
        """Whether the file holds what the plan makes."""
        return self.verdict in {Verdict.SAME, Verdict.ALIKE}


def cut_all(
    plan: Plan,
    sources: dict[str, Path],
    out: Path,
    executor: Executor,
    done: Callable[[], None],
    only: Sequence[str] = (),
) -> list[Cut]:
    """Cut the plan's clips (or `only` these) into `out`; in the plan's order. Raises InputError with
    every clip that could not be cut, or for a name that is not in the plan."""
    known = {clip.video_id for clip in plan.clips}
    if unknown := sorted(set(only) - known):
        raise InputError(f"found no clip {', '.join(unknown)} in the plan; expected one of its {len(known)}.")
    jobs = [
        CutJob(clip, plan, sources[clip.source], out / clip.file)
        for clip in plan.clips
        if not only or clip.video_id in only
    ]
    found: dict[str, Cut] = {}
    for cut in executor.run(cut_clip, jobs, _lost):
        found[cut.video_id] = cut
        done()
    cuts = [found[job.clip.video_id] for job in jobs]
    if errors := [cut.error for cut in cuts if cut.error]:
        raise InputError("\n  ".join([f"{len(errors)} of {len(cuts)} clips could not be cut.", *errors]))
    return cuts


def rebuild(
    plan_file: Path,
    sources_folder: Path | None,
    executor: Executor,
    done: Callable[[], None],
    *,
    replace: bool,
) -> list[FileCheck]:
    """Make clips and boxes of a plan again and compare them with those beside it.

    With `replace`, files that are missing or not the same bytes are replaced, each whole, after all
    could be made. Files that the plan does not know are told, and left. Raises InputError when
    something cannot be made; nothing is changed then.
    """
    plan, root = read_plan(plan_file), plan_file.parent
    boxes = _boxes(plan, root)
    sources = find_sources(plan, sources_folder)
    with TemporaryDirectory(prefix="coooler-rebuild-") as scratch:
        made = Path(scratch)
        cut_all(plan, sources, made, executor, done)
        checks = []
        for clip in plan.clips:
            target, name = root / plan.videos / clip.file, f"{plan.videos}/{clip.file}"
            job = CutJob(clip, plan, sources[clip.source], made / clip.file)
            checks.append(_check_clip(name, target, job))
            if replace and checks[-1].verdict is not Verdict.SAME:
                write_bytes(target, job.target.read_bytes())
    if boxes is not None:
        checks.append(_check_boxes(plan.boxes, root / plan.boxes, boxes))
        if replace and checks[-1].verdict is not Verdict.SAME:
            write_bytes(root / plan.boxes, boxes)
    known = {clip.file for clip in plan.clips}
    folder = root / plan.videos
    there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    return checks + [FileCheck(f"{plan.videos}/{name}", Verdict.EXTRA) for name in there if name not in known]


def _boxes(plan: Plan, root: Path) -> bytes | None:
    """The `boxes` table of a plan as the bytes of its file, None when it has no key boxes."""
    if plan.key_boxes is None:
        return None
    keys = read_key_boxes(root / plan.key_boxes)
    frames = {clip.video_id: clip.frames for clip in plan.clips}
    wrong = sorted(
        {
            f"track {key.track_id} of {key.video_id} at frame {key.frame_index}"
            for key in keys
            if key.frame_index >= frames.get(key.video_id, 0)
        }
    )
    if wrong:
        heading = f"{root / plan.key_boxes}: found key boxes that no clip of the plan has a frame for:"
        raise InputError("\n  ".join([heading, *wrong]))
    return BOXES.to_bytes(interpolate(keys, dict.fromkeys(frames, plan.size_px)))


def _check_boxes(name: str, there: Path, made: bytes) -> FileCheck:
    if not there.is_file():
        return FileCheck(name, Verdict.MISSING)
    if there.read_bytes() == made:
        return FileCheck(name, Verdict.SAME)
    try:
        rows = BOXES.read(there)
    except CooolerError as error:
        return FileCheck(name, Verdict.DIFFERENT, str(error))
    wanted = BOXES.from_bytes(made, name)
    if rows == wanted:
        return FileCheck(name, Verdict.ALIKE, f"{len(rows)} rows")
    return FileCheck(name, Verdict.DIFFERENT, f"{len(set(rows) ^ set(wanted))} rows differ")


def _check_clip(name: str, there: Path, made: CutJob) -> FileCheck:
    """Bytes first; when they differ, the pictures, against those of the raw video."""
    if not there.is_file():
        return FileCheck(name, Verdict.MISSING)
    if there.read_bytes() == made.target.read_bytes():
        return FileCheck(name, Verdict.SAME)
    try:
        losses = _losses(there, made)
    except VideoError as error:
        return FileCheck(name, Verdict.DIFFERENT, str(error))
    mean, worst = float(np.mean(losses)), float(np.max(losses))
    note = f"{len(losses)} frames; PSNR {mean:.2f} dB lower than if made here, {worst:.2f} dB in one frame"
    return FileCheck(
        name, Verdict.ALIKE if mean <= MEAN_DB and worst <= FRAME_DB else Verdict.DIFFERENT, note
    )


def _losses(there: Path, made: CutJob) -> list[float]:
    """How much lower the luma PSNR of each frame that is there is than that of the one made, in dB."""
    header = read_header(made.source)
    wanted = chosen_frames(header.seconds, made.clip.start, made.plan.rate, made.clip.frames)
    raw = pictures(made.source, [header.times[index] for index in wanted], made.plan.size_px)
    losses = []
    try:
        for truth, ours, theirs in zip(raw, decoded(made.target), decoded(there), strict=True):
            if (theirs.width, theirs.height) != made.plan.size_px:
                raise VideoError(f"{there}: found frames of {theirs.width}x{theirs.height} px")
            picture = _luma(truth)
            losses.append(_psnr_db(picture, _luma(ours)) - _psnr_db(picture, _luma(theirs)))
    except ValueError as error:
        raise VideoError(f"{there}: found another number of frames; expected {made.clip.frames}") from error
    return losses


def _luma(frame: av.VideoFrame) -> NDArray[np.float32]:
    return np.asarray(frame.reformat(format="yuv420p").to_ndarray()[: frame.height], np.float32)


def _psnr_db(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    """Peak signal-to-noise ratio of two 8-bit pictures, at most 99 dB."""
    error = float(np.mean((a - b) ** 2))
    return min(99.0, 10 * math.log10(255**2 / error)) if error else 99.0


def _lost(job: CutJob, why: str) -> Cut:
    return Cut(job.clip.video_id, 0, f"{job.clip.video_id}: {why}")
