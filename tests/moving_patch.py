"""Clips of a patch that moves over a background which the camera pans across, and where the patch is."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from pipeline.data.linking import iou
from pipeline.records import Box, RgbImage, TrackBox
from tests.clips import write_clip

SIZE_PX = (320, 192)


def texture(width_px: int, height_px: int, seed: int) -> RgbImage:
    """Soft random blobs in colour, (H, W, 3): corners everywhere, and it survives compression."""
    coarse = np.random.default_rng(seed).integers(0, 256, (height_px // 6, width_px // 6, 3))
    return cv2.resize(coarse.astype(np.uint8), (width_px, height_px), interpolation=cv2.INTER_CUBIC)


def panned(
    frames: int = 30, *, patch: bool = True, step_px: float = 4.0, growth_px: float = 0.0, seed: int = 1
) -> tuple[list[RgbImage], list[Box]]:
    """The pictures and the patch's box in each; the camera pans 2 px a frame, the patch moves `step_px`.

    The patch is 60 x 44 px at first and grows by `growth_px` a frame on every side.
    """
    width, height = SIZE_PX
    wide = texture(width + 2 * frames, height, seed)
    thing = texture(240, 180, seed + 100)
    pictures, boxes = [], []
    for index in range(frames):
        picture = wide[:, 2 * index : 2 * index + width].copy()
        grown = round(growth_px * index)
        high, across = 44 + 2 * grown, 60 + 2 * grown
        left, top = round(30 + step_px * index) - grown, 80 - grown
        if patch:
            picture[top : top + high, left : left + across] = cv2.resize(thing, (across, high))
        pictures.append(picture)
        boxes.append(Box(float(left), float(top), float(left + across), float(top + high)))
    return pictures, boxes


def write_panned(path: Path, seed: int = 1, frames: int = 30) -> list[Box]:
    """Such a clip as H.264; gives the patch's box in every frame."""
    pictures, boxes = panned(frames, seed=seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_clip(path, frames, SIZE_PX, pictures=pictures)
    return boxes


def share_found(truth: Sequence[Box], rows: Sequence[TrackBox], first: int) -> float:
    """In how many of the frames from `first` on some box overlaps the patch by more than 0.3 (IoU)."""
    hits = [
        any(iou(box, row.box) > 0.3 for row in rows if row.frame_index == index)
        for index, box in enumerate(truth)
        if index >= first
    ]
    return sum(hits) / len(hits)
