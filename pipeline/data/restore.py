"""One clip without its watermark, noise and blur: frame by frame, in that order, into H.264.

The order is the paper's. The clip keeps its frames, their times and their size as it is shown; sound
is dropped, and a clip that is stored turned comes out upright.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from av.error import FFmpegError
from av.video.reformatter import VideoReformatter

from pipeline.data.decode import ClipHeader, decoded, read_header
from pipeline.data.denoise import Method, deblurrer, denoiser
from pipeline.data.encode import EXACT, even_size, write_h264
from pipeline.data.restored_pictures import before_after
from pipeline.data.watermark import Eraser, eraser, mask_from_boxes, mask_png
from pipeline.data.watermark_find import SAMPLES, Mask, PixelBox, find_watermark
from pipeline.errors import VideoError
from pipeline.files import write_bytes
from pipeline.records import RgbImage
from pipeline.video import frame_indices, upright

STEPS = ("watermark", "denoise", "deblur")
FOLDER = "restoration"  # beside the clips: records, masks, pictures

ERASING = "un-blending by temporal statistics, Telea inpainting where opaque"
BLUR_SAMPLES = 5  # frames that are denoised to see how blurred a clip is

# Files with millisecond times, as Matroska's, show a constant rate as 33, 33, 34 ms.
_JITTER_S = Fraction(1, 1000)


@dataclass(frozen=True, slots=True)
class RestoreSettings:
    """What is done to every clip; without a model a step takes the plain method."""

    steps: tuple[str, ...] = STEPS
    denoise_model: Path | None = None
    deblur_model: Path | None = None
    crf: int = 18
    preset: str = "medium"


@dataclass(frozen=True, slots=True)
class Timeline:
    """The frames of a clip as decoding gives them: how many, (width, height) as shown, and when.

    Frame i is shown at `pts[i] * time_base_s`, from 0 on, or at i / `rate_hz` where `pts` is None.
    """

    frames: int
    size_px: tuple[int, int]
    rate_hz: Fraction
    pts: tuple[int, ...] | None
    time_base_s: Fraction
    sample_aspect: Fraction
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """What is done to the frames of one clip: `steps` says it for the record."""

    mask: Mask
    erase: Eraser | None
    methods: tuple[Method, ...]
    steps: tuple[dict[str, Any], ...]

    def restored(self, rgb: RgbImage) -> RgbImage:
        """A frame (H, W, 3) after all steps."""
        if self.erase:
            rgb = self.erase(rgb)
        for method in self.methods:
            rgb = method(rgb)
        return rgb


@dataclass(frozen=True, slots=True)
class Restored:
    """What was done to a clip, for its record; `files` are the names in the folder of records."""

    timeline: Timeline
    steps: tuple[dict[str, Any], ...]
    files: tuple[str, ...]


def read_timeline(path: Path, header: ClipHeader) -> Timeline:
    """Decode a clip once for its frames' number and times. Raises VideoError when it cannot be decoded."""
    times: list[int | None] = []
    size, turned, corrupt = (0, 0), 0, 0
    for frame in decoded(path):
        turned = round(frame.rotation / 90) % 2
        size = (frame.height, frame.width) if turned else (frame.width, frame.height)
        times.append(frame.pts)
        corrupt += bool(frame.is_corrupt)
    notes = []
    if header.times and len(header.times) != len(times):
        notes.append(f"the file holds {len(header.times)} packets, {len(times)} frames were decoded")
    if corrupt:
        notes.append(f"{corrupt} frames are damaged")
    if even_size(size) != size:
        wide, high = even_size(size)
        notes.append(f"an odd size: {size[0]}x{size[1]} px became {wide}x{high}, as H.264 4:2:0 asks for")
    known = [time for time in times if time is not None]
    base, rate = header.time_base_s, header.rate_hz
    pts: tuple[int, ...] | None = None
    if len(known) < len(times) or any(a >= b for a, b in pairwise(known)):
        notes.append("its frames have no rising times: they are shown at the rate that the file states")
    else:
        off = max(abs((time - known[0]) * base - index / rate) for index, time in enumerate(known))
        if off > max(base, _JITTER_S):
            pts = tuple(time - known[0] for time in known)
    aspect = 1 / header.sample_aspect if turned else header.sample_aspect
    return Timeline(len(times), size, rate, pts, base, aspect, tuple(notes))


def plan_for(
    clip: Path, settings: RestoreSettings, boxes: Sequence[PixelBox] | None, timeline: Timeline
) -> Plan:
    """Look at frames of a clip and choose what is done to each; every step sees what those before it left.

    Raises InputError for boxes and networks that cannot be used.
    """
    width, height = timeline.size_px
    samples = list(_pictures(clip, frame_indices(timeline.frames, SAMPLES))) if settings.steps else []
    mask: Mask = np.zeros((height, width), np.bool_)
    erase: Eraser | None = None
    steps: list[dict[str, Any]] = []
    if "watermark" in settings.steps:
        reason = ""
        if boxes is None:
            found = find_watermark(samples)
            mask, reason, boxes = found.mask, found.reason, [logo.box for logo in found.logos]
        else:
            mask = mask_from_boxes(boxes, height, width)
        erase = eraser(samples, mask)
        listed = [list(box) for box in boxes]
        described = {"method": ERASING, "sha256": "", "settings": {"boxes_px": listed, "reason": reason}}
        steps.append({"step": "watermark", **described})
        samples = [erase(rgb) for rgb in samples]
    methods: list[Method] = []
    for step, method_for, model in (
        ("denoise", denoiser, settings.denoise_model),
        ("deblur", deblurrer, settings.deblur_model),
    ):
        if step in settings.steps:
            method = method_for(model, samples)
            methods.append(method)
            described = {"method": method.name, "sha256": method.sha256, "settings": dict(method.settings)}
            steps.append({"step": step, **described})
            if step == "denoise" and "deblur" in settings.steps and not settings.deblur_model:
                samples = [method(rgb) for rgb in samples[:: -(-len(samples) // BLUR_SAMPLES)]]
    return Plan(mask, erase, tuple(methods), tuple(steps))


def restore_clip(
    clip: Path,
    out: Path,
    settings: RestoreSettings,
    boxes: Sequence[PixelBox] | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Restored:
    """Write OUT/<stem>.mp4 and, in OUT/restoration/, the mask and the pictures before and after.

    `boxes` (x1, y1, x2, y2; px) are the watermarks, None: they are looked for. `tick` is called after
    every frame. Raises InputError when the clip, the boxes or a network cannot be used, OutsideError
    when a file cannot be written.
    """
    header = read_header(clip)
    timeline = read_timeline(clip, header)
    plan = plan_for(clip, settings, boxes, timeline)
    shown: list[tuple[RgbImage, RgbImage]] = []

    def frames() -> Iterator[RgbImage]:
        for index, before in enumerate(_pictures(clip)):
            after = plan.restored(before)
            if index == timeline.frames // 2:
                shown.append((before, after))
            yield after
            tick()

    written = write_h264(
        out / f"{clip.stem}.mp4",
        frames(),
        rate=timeline.rate_hz,
        size=timeline.size_px,
        crf=settings.crf,
        preset=settings.preset,
        pts=timeline.pts,
        time_base=timeline.time_base_s if timeline.pts else None,
        colour=header.colour,
        sample_aspect=timeline.sample_aspect,
    )
    if written != timeline.frames:
        raise VideoError(f"{clip}: found {timeline.frames} frames, then {written}; is it being written?")
    pictures = {f"{clip.stem}.{end}": data for end, data in before_after(*shown[0], plan.mask).items()}
    if "watermark" in settings.steps:
        pictures[f"{clip.stem}.mask.png"] = mask_png(plan.mask)
    for name, data in sorted(pictures.items()):
        write_bytes(out / FOLDER / name, data)
    return Restored(timeline, plan.steps, tuple(sorted(pictures)))


def _pictures(clip: Path, wanted: Collection[int] | None = None) -> Iterator[RgbImage]:
    """The frames of a clip, or those of the wanted numbers, as RGB."""
    reformatter = VideoReformatter()
    for index, frame in enumerate(decoded(clip)):
        if wanted is not None and index not in wanted:
            continue
        try:
            yield upright(frame, reformatter, EXACT)
        except FFmpegError as error:
            raise VideoError(
                f"{clip}: its colours cannot be converted ({error}); expected a usual format. Re-encode it."
            ) from error
