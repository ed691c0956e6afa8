"""Frames of clips, or the boxes cut out of them, as picture files with a manifest.

Each clip's pictures lie in a folder of their own, made elsewhere and moved there whole, with the
rows of the manifest and a hash of all that they were made from: whoever runs again makes only what
is missing or was made from something else.
"""

import json
import shutil
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from av.video.reformatter import VideoReformatter

from pipeline.config import VerifySettings
from pipeline.data.decode import decoded
from pipeline.data.picture_files import PICTURES, PictureFile, safe_names
from pipeline.errors import CooolerError, InputError
from pipeline.files import locked, sha256_file, sha256_of
from pipeline.interfaces import Executor
from pipeline.records import Box, RgbImage, TrackBox
from pipeline.table import metadata
from pipeline.verify import exclusion
from pipeline.video import crop, read_keyframes, upright

MANIFEST = "frames.parquet"
VERSION = 1


@dataclass(frozen=True, slots=True)
class Sampling:
    """Which frames: `at` these indices, else one `every` so many, else `fps_hz` a second, else `count`
    at equal interval (paper: N = 25).

    `fps_hz` takes the first frame at or after each k / fps_hz, from the first frame on.
    """

    count: int = 25
    every: int = 0
    at: tuple[int, ...] = ()
    fps_hz: float = 0.0


@dataclass(frozen=True, slots=True)
class PictureSettings:
    """How pictures are written. `width_px` is the most they may have (0: as they are); a crop is grown by
    `margin` of its box's sides on each side; `limits` leaves out the boxes that the verification ignores."""

    what: Literal["frames", "crops"] = "frames"
    kind: Literal["jpg", "png", "webp"] = "jpg"
    quality: int = 90
    width_px: int = 0
    margin: float = 0.0
    limits: VerifySettings | None = None


@dataclass(frozen=True, slots=True)
class FramesJob:
    """One clip whose pictures are wanted."""

    video_id: str
    clip: Path
    boxes: tuple[TrackBox, ...]
    sampling: Sampling
    settings: PictureSettings
    out: Path


@dataclass(frozen=True, slots=True)
class FramesDone:
    """What became of a clip; `error` is empty when its pictures are there."""

    video_id: str
    pictures: int
    reused: bool = False
    error: str = ""


def write_pictures(
    jobs: Sequence[FramesJob], out: Path, executor: Executor, done: Callable[[FramesDone], None]
) -> list[FramesDone]:
    """Write the pictures of every clip and one manifest of all, `frames.parquet`, in `out`.

    Clips in `out` that are not among the jobs stay, and stay in the manifest; those that failed are
    not in it. What is wrong with a clip is in its result.
    """
    results: dict[str, FramesDone] = {}
    with locked(out):
        for result in executor.run(
            _write_clip, jobs, lambda job, why: FramesDone(job.video_id, 0, error=why)
        ):
            results[result.video_id] = result
            done(result)
        rows: list[PictureFile] = []
        for part in sorted(out.glob(f"*/{MANIFEST}")):
            video = part.parent.name
            if not video.startswith(".") and not (video in results and results[video].error):
                rows += PICTURES.read(part)
        PICTURES.write(out / MANIFEST, rows)
    return [results[job.video_id] for job in jobs]


def _write_clip(job: FramesJob) -> FramesDone:
    try:
        key = _key(job)
        part = job.out / job.video_id / MANIFEST
        rows = _from_before(job, part, key)
        if rows is not None:
            return FramesDone(job.video_id, len(rows), reused=True)
        if job.video_id == MANIFEST or (part.parent.exists() and not part.is_file()):
            raise InputError(
                f"{part.parent}: is taken and holds no {MANIFEST}; expected a free place (--out)."
            )
        fresh = job.out / f".{job.video_id}.partial"
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir(parents=True)
        try:
            made = list(_pictures(job, fresh))
            PICTURES.write(fresh / MANIFEST, made, {"made_from": key})
            shutil.rmtree(part.parent, ignore_errors=True)
            fresh.rename(part.parent)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    except (CooolerError, OSError) as error:
        return FramesDone(job.video_id, 0, error=str(error))
    return FramesDone(job.video_id, len(made))


def _key(job: FramesJob) -> str:
    """Hash of all that a clip's pictures depend on."""
    settings = {**asdict(job.settings), "limits": repr(job.settings.limits)}
    boxes = [repr(box) for box in job.boxes] if job.settings.what == "crops" else []
    parts = [VERSION, job.video_id, sha256_file(job.clip), asdict(job.sampling), settings, boxes]
    return sha256_of(json.dumps(parts, sort_keys=True).encode())


def _from_before(job: FramesJob, part: Path, key: str) -> list[PictureFile] | None:
    """The rows of an earlier run that made the same, None when there is none or a picture is missing."""
    try:
        if metadata(part).get("made_from") != key:
            return None
        rows = PICTURES.read(part)
    except (CooolerError, OSError, pa.ArrowException):
        return None
    return rows if all((job.out / row.file).is_file() for row in rows) else None


def _pictures(job: FramesJob, folder: Path) -> Iterator[PictureFile]:
    names = safe_names(box.track_id for box in job.boxes)
    boxes: dict[int, list[TrackBox]] = defaultdict(list)
    for box in sorted(job.boxes, key=lambda box: (box.track_id, box.kind, repr(box.box))):
        boxes[box.frame_index].append(box)
    for index, time_s, rgb in _sampled(job):
        if job.settings.what == "frames":
            name = f"{job.video_id}_{index:06d}.{job.settings.kind}"
            yield _written(job, folder, name, rgb, index, time_s)
            continue
        used: Counter[str] = Counter()
        for box in boxes[index]:
            cut = _cut(rgb, box.box, job.settings)
            if cut is None:
                continue
            stem = f"{index:06d}_{names[box.track_id]}"
            used[stem] += 1
            name = f"{stem}{f'_{used[stem]}' if used[stem] > 1 else ''}.{job.settings.kind}"
            yield _written(job, folder, name, cut, index, time_s, box)


def _sampled(job: FramesJob) -> Iterator[tuple[int, float, RgbImage]]:
    """The wanted frames as (index, time in s from the first, picture). Raises InputError for an index
    that the clip does not have."""
    sampling = job.sampling
    if not (sampling.at or sampling.every or sampling.fps_hz):
        for frame in read_keyframes(job.clip, job.video_id, sampling.count).frames:
            yield frame.index, frame.time_s, frame.rgb
        return
    reformatter, wanted = VideoReformatter(), set(sampling.at)
    start_s, taken, index = 0.0, 0, -1
    for index, picture in enumerate(decoded(job.clip)):
        start_s = (picture.time or 0.0) if index == 0 else start_s
        time_s = max(0.0, (picture.time or 0.0) - start_s)
        if sampling.at:
            take = index in wanted
        elif sampling.every:
            take = index % sampling.every == 0
        else:
            # Half a microsecond: times of frames are rounded to the file's time base.
            take = time_s + 5e-7 >= taken / sampling.fps_hz
        if take:
            while sampling.fps_hz and taken / sampling.fps_hz <= time_s + 5e-7:
                taken += 1
            yield index, time_s, upright(picture, reformatter)
    if wanted and max(wanted) > index:
        raise InputError(f"{job.clip}: found {index + 1} frames; expected one of index {max(wanted)} (--at).")


def _cut(rgb: RgbImage, box: Box, settings: PictureSettings) -> RgbImage | None:
    height_px, width_px = rgb.shape[:2]
    if not all(isfinite(side) for side in (box.x1_px, box.y1_px, box.x2_px, box.y2_px)):
        return None
    if settings.limits and exclusion(box, width_px, height_px, settings.limits):
        return None
    dx, dy = box.width_px * settings.margin, box.height_px * settings.margin
    return crop(rgb, Box(box.x1_px - dx, box.y1_px - dy, box.x2_px + dx, box.y2_px + dy))


def _written(
    job: FramesJob,
    folder: Path,
    name: str,
    rgb: RgbImage,
    index: int,
    time_s: float,
    box: TrackBox | None = None,
) -> PictureFile:
    picture = _fit(rgb, job.settings.width_px)
    (folder / name).write_bytes(_encoded(picture, job.settings))
    shown: dict[str, Any] = {}
    if box:
        shown = {"track_id": box.track_id, "kind": str(box.kind), **asdict(box.box)}
    height_px, width_px = picture.shape[:2]
    return PictureFile(
        job.video_id, index, round(time_s, 6), f"{job.video_id}/{name}", width_px, height_px, **shown
    )


def _fit(rgb: RgbImage, width_px: int) -> RgbImage:
    """At most `width_px` wide; never enlarged."""
    import cv2

    if not width_px or rgb.shape[1] <= width_px:
        return rgb
    size = (width_px, max(1, round(rgb.shape[0] * width_px / rgb.shape[1])))
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


def _encoded(rgb: RgbImage, settings: PictureSettings) -> bytes:
    import cv2

    options = {
        "jpg": [cv2.IMWRITE_JPEG_QUALITY, settings.quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1],
        "webp": [cv2.IMWRITE_WEBP_QUALITY, settings.quality],
        "png": [],
    }[settings.kind]
    try:
        done, data = cv2.imencode(f".{settings.kind}", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), options)
    except cv2.error:
        done = False
    if not done:
        raise InputError(
            f"found a picture of {rgb.shape[1]}x{rgb.shape[0]} px, too large for {settings.kind}."
        )
    return bytes(data.tobytes())
