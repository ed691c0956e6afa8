"""Logos and time stamps: where they are on a clip, given or found, and pictures without them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.watermark_find import Floats, Mask, PixelBox
from pipeline.errors import Fault, FaultsError, InputError
from pipeline.records import RgbImage

RADIUS_PX = 3  # how far around a pixel to be filled inpainting looks
MAX_OPACITY = 0.75  # above, too little of the scene shows to give it back
SLACK = 0.12  # of opacity: how wrong the spread may be


def mask_from_boxes(boxes: Sequence[PixelBox], height: int, width: int) -> Mask:
    """The mask (height, width) of boxes (x1, y1, x2, y2; px, end excluded), cut off at the frame's edges.

    Raises FaultsError with every box that is empty or lies outside the frame.
    """
    mask = np.zeros((height, width), np.bool_)
    faults = []
    for number, (x1, y1, x2, y2) in enumerate(boxes, start=1):
        if x1 >= x2 or y1 >= y2 or x1 >= width or y1 >= height or x2 <= 0 or y2 <= 0:
            expected = f"x1 < x2, y1 < y2 and some of it inside the frame of {width}x{height} px"
            found = f"{x1},{y1},{x2},{y2}"
            faults.append(Fault("boxes", number, None, found, expected, "Give the box as x1,y1,x2,y2."))
        else:
            mask[max(0, y1) : y2, max(0, x1) : x2] = True
    if faults:
        raise FaultsError(faults)
    return mask


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A region around a mask's part: what undoes the overlay there, and what only inpainting fills.

    `top_px`, `left_px` place it in the frame; `gain` and `offset` (h, w, 3) turn a colour into that
    below the overlay; `holes` (h, w) is where nothing of it shows.
    """

    top_px: int
    left_px: int
    gain: Floats
    offset: Floats
    holes: Mask


@dataclass(frozen=True, slots=True, eq=False)
class Eraser:
    """Takes the watermark off the frames of one clip, whose (height, width) is `size`."""

    size: tuple[int, int]
    patches: tuple[Patch, ...]

    def __call__(self, rgb: RgbImage) -> RgbImage:
        """The picture (H, W, 3) without it; outside the mask nothing changes.

        Raises InputError when the picture is of another size.
        """
        _require_size(rgb, self.size)
        clean = rgb.copy()
        for patch in self.patches:
            height, width = patch.holes.shape
            at = slice(patch.top_px, patch.top_px + height), slice(patch.left_px, patch.left_px + width)
            below = np.rint(np.clip(rgb[at] * patch.gain + patch.offset, 0, 255)).astype(np.uint8)
            clean[at] = _inpainted(below, patch.holes)
        return clean


def eraser(frames: Sequence[RgbImage] | NDArray[np.uint8], mask: Mask) -> Eraser:
    """What takes the masked overlay (H, W) off, learnt from frames (H, W, 3) spread over the clip.

    Ours. A half-transparent overlay W of opacity a shows (1 - a) I + a W of the scene I, so over time
    the spread shrinks by 1 - a and the mean shifts. Spread and mean of I are those of the pixels around,
    inpainted; equal spread and mean give I back. Where an overlay is opaque, or changes as digits do
    (the mean shifts further than any colour of that opacity can shift it), the picture is inpainted.
    Raises InputError for no frames or sizes that differ.
    """
    if not len(frames):
        raise InputError("found no frames; expected some of the clip.")
    for frame in frames:
        _require_size(frame, mask.shape)
    patches = []
    for top, left, part in _parts(mask):
        height, width = part.shape
        at = slice(top, top + height), slice(left, left + width)
        seen = np.stack([frame[at] for frame in frames]).astype(np.float32)
        patches.append(_patch(top, left, part, seen.mean(axis=0), seen.std(axis=0)))
    return Eraser((mask.shape[0], mask.shape[1]), tuple(patches))


def _patch(top_px: int, left_px: int, part: Mask, mean: Floats, spread: Floats) -> Patch:
    """What undoes the overlay on `part` (h, w), by mean and spread over time (h, w, 3)."""
    mean_below, spread_below = (_inpainted_floats(values, part) for values in (mean, spread))
    opacity = 1 - spread / np.maximum(spread_below, 0.5)
    shift = mean - mean_below
    room = np.where(shift > 0, 255 - mean_below, mean_below)
    impossible = np.abs(shift) > (np.maximum(opacity, 0) + SLACK) * room
    holes = part & ((opacity > MAX_OPACITY) | impossible).any(axis=-1)
    gain = np.where(part[..., None], 1 / (1 - np.clip(opacity, 0, MAX_OPACITY)), 1).astype(np.float32)
    offset = np.where(part[..., None], mean_below - gain * mean, 0).astype(np.float32)
    return Patch(top_px, left_px, gain, offset, holes)


def _parts(mask: Mask) -> Iterator[tuple[int, int, Mask]]:
    """Top, left and mask (h, w) of each part of a mask, with all around it that inpainting looks at."""
    reach = 2 * (2 * RADIUS_PX + 2) + 1
    wide = cv2.dilate(mask.astype(np.uint8), np.ones((reach, reach), np.uint8))
    count, _, stats, _ = cv2.connectedComponentsWithStats(wide)
    for x, y, width, height in stats[1:count, :4].tolist():
        yield y, x, mask[y : y + height, x : x + width]


def _inpainted(rgb: RgbImage, holes: Mask) -> RgbImage:
    if not holes.any():
        return rgb
    filled = cv2.inpaint(np.ascontiguousarray(rgb), holes.astype(np.uint8), RADIUS_PX, cv2.INPAINT_TELEA)
    return np.asarray(filled, np.uint8)


def _inpainted_floats(values: Floats, holes: Mask) -> Floats:
    """`_inpainted` for (h, w, 3) of any range."""
    planes = [np.ascontiguousarray(values[..., channel]) for channel in range(3)]
    patch = holes.astype(np.uint8)
    return np.stack([cv2.inpaint(one, patch, RADIUS_PX, cv2.INPAINT_TELEA) for one in planes], axis=-1)


def _require_size(rgb: RgbImage, size: tuple[int, ...]) -> None:
    if rgb.shape[:2] != size:
        raise InputError(
            f"found a picture of {rgb.shape[1]}x{rgb.shape[0]} px and a mask of {size[1]}x{size[0]} px; "
            "expected one size. Make the mask for this clip."
        )


def mask_png(mask: Mask) -> bytes:
    """The mask as PNG: 255 where something is removed, else 0."""
    return bytes(cv2.imencode(".png", mask.astype(np.uint8) * 255)[1].tobytes())
