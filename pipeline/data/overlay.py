"""Boxes and track ids drawn into a clip: hazards thick and orange on top, the rest thin and white."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from av.video.reformatter import VideoReformatter

from pipeline.data.decode import ClipHeader, decoded, read_header, size_of
from pipeline.data.encode import EXACT, write_h264
from pipeline.errors import CooolerError
from pipeline.records import Box, Kind, RgbImage, TrackBox
from pipeline.video import upright

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

# The site's colours of boxes and of their words.
HAZARD, OTHER, HAZARD_WORDS = (255, 122, 46), (255, 255, 255), (255, 176, 131)
EDGE = (0, 0, 0)
LONGEST_LABEL = 40
_SPAN_PX = 10  # how far beyond the frame a side may still be drawn


@dataclass(frozen=True, slots=True)
class OverlayJob:
    """A clip, its boxes, and what they are called: `labels` maps a track id to words beside it.

    `names` turns the words on.
    """

    video_id: str
    clip: Path
    target: Path
    boxes: tuple[TrackBox, ...]
    labels: Mapping[str, str] = field(default_factory=dict)
    names: bool = True
    crf: int = 20


@dataclass(frozen=True, slots=True)
class Overlaid:
    """What became of a clip; `error` is empty when it was written."""

    video_id: str
    frames: int
    boxes: int
    error: str = ""


def overlay_clip(job: OverlayJob) -> Overlaid:
    """Write a clip with its boxes drawn in: same frames, times and size. Faults are said, not raised."""
    try:
        header = read_header(job.clip)
        size = size_of(job.clip)
        times: list[int] = []  # filled as the frames come, each before it is asked for
        count = write_h264(
            job.target,
            _drawn(job, header, times),
            rate=header.rate_hz,
            size=size,
            crf=job.crf,
            pts=times if header.times else None,
            time_base=header.time_base_s if header.times else None,
            colour=header.colour,
            sample_aspect=header.sample_aspect,
        )
    except CooolerError as error:
        return Overlaid(job.video_id, 0, 0, str(error))
    drawn = sum(box.frame_index < count for box in job.boxes)
    return Overlaid(job.video_id, count, drawn)


def _drawn(job: OverlayJob, header: ClipHeader, times: list[int]) -> Iterator[RgbImage]:
    by_frame: dict[int, list[TrackBox]] = defaultdict(list)
    for box in job.boxes:
        by_frame[box.frame_index].append(box)
    reformatter = VideoReformatter()
    for index, frame in enumerate(decoded(job.clip)):
        if header.times and frame.pts is not None:
            times.append(frame.pts - header.times[0])
        rgb = upright(frame, reformatter, EXACT)
        yield draw_boxes(rgb, by_frame[index], job.labels, names=job.names) if index in by_frame else rgb


def draw_boxes(
    rgb: RgbImage, boxes: Sequence[TrackBox], labels: Mapping[str, str], *, names: bool = True
) -> RgbImage:
    """A frame (H, W, 3) with boxes drawn in, hazards last; each line has a dark edge, words a dark ground.

    Words are the track's id and its label, "proposed" for a proposal without one, in one line of at most
    40 characters. A box that is no box (not finite) is not drawn.
    """
    from PIL import Image, ImageDraw

    height_px, width_px = rgb.shape[:2]
    image = Image.fromarray(rgb)
    draw = ImageDraw.Draw(image)
    order = sorted(boxes, key=lambda box: (box.kind is Kind.CHALLENGE, box.track_id, repr(box.box)))
    shown = [(box, corners) for box in order if (corners := _corners(box.box, width_px, height_px))]
    thin = max(1, round(height_px / 360))
    for box, (x1, y1, x2, y2) in shown:
        hazard = box.kind is Kind.CHALLENGE
        line = 3 * thin if hazard else thin
        draw.rectangle((x1 - thin, y1 - thin, x2 + thin, y2 + thin), outline=EDGE, width=line + 2 * thin)
        draw.rectangle((x1, y1, x2, y2), outline=HAZARD if hazard else OTHER, width=line)
    if names:
        font = _font(max(11, round(height_px / 28)))
        for box, (x1, y1, _, _) in shown:
            label = labels.get(box.track_id, "proposed" if box.kind is Kind.PROPOSED else "")
            _write(draw, (x1, y1), _words(box.track_id, label), font, box.kind, (width_px, height_px))
    return np.asarray(image, np.uint8)


def _corners(box: Box, width_px: int, height_px: int) -> tuple[int, int, int, int] | None:
    """Whole pixels, just beyond the frame at most; None when nothing of the box is in the frame."""
    if not all(isfinite(side) for side in (box.x1_px, box.y1_px, box.x2_px, box.y2_px)):
        return None
    if min(box.x2_px, box.y2_px) <= 0 or box.x1_px >= width_px or box.y1_px >= height_px:
        return None
    if box.x1_px > box.x2_px or box.y1_px > box.y2_px:
        return None
    x1, x2 = (round(min(max(x, -_SPAN_PX), width_px - 1 + _SPAN_PX)) for x in (box.x1_px, box.x2_px))
    y1, y2 = (round(min(max(y, -_SPAN_PX), height_px - 1 + _SPAN_PX)) for y in (box.y1_px, box.y2_px))
    return x1, y1, x2, y2


def _words(track_id: str, label: str) -> str:
    """Id and label as one short line of characters that the font has."""
    text = f"{track_id} {label}".strip().encode("ascii", "backslashreplace").decode()
    plain = "".join(sign if sign.isprintable() else "?" for sign in text)
    return plain if len(plain) <= LONGEST_LABEL else f"{plain[: LONGEST_LABEL - 3]}..."


def _write(
    draw: Any,
    corner: tuple[int, int],
    text: str,
    font: "FreeTypeFont",
    kind: Kind,
    size_px: tuple[int, int],
) -> None:
    """Words above a box's upper left corner, moved into the frame."""
    left, top, right, bottom = draw.textbbox((0, 0), text, font=font)
    wide, high, pad = round(right - left), round(bottom - top), 2
    x = max(0, min(corner[0], size_px[0] - wide - 2 * pad))
    y = max(0, min(corner[1] - high - 3 * pad, size_px[1] - high - 2 * pad))
    draw.rectangle((x, y, x + wide + 2 * pad, y + high + 2 * pad), fill=EDGE)
    fill = HAZARD_WORDS if kind is Kind.CHALLENGE else OTHER
    draw.text((x + pad - left, y + pad - top), text, font=font, fill=fill)


@cache
def _font(size_px: int) -> "FreeTypeFont":
    from PIL import ImageFont

    return ImageFont.load_default(size_px)  # type: ignore[return-value]
