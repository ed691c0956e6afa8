"""Finds logos and time stamps that lie still on a moving picture.

Ours, after the observation of Dekel et al. (2017) that the temporal median of an image's gradients keeps
those of its watermark: what moves cancels out, what lies still stays. Bonnets, horizons, lane marks and
black bars lie still too, but their edges run in one direction and do not close; those of letters and
logos run in every direction and close (the gradients of a closed shape add up to nothing).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.records import RgbImage

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
PixelBox = tuple[int, int, int, int]

WORK_PX = 640  # pictures are searched at this width at most; every length below is at that size
SAMPLES = 60  # more frames than this are thinned out
MIN_SAMPLES = 12
MOVED = 2.0  # mean difference in grey levels to the frame before, below which nothing moved
MIN_EDGE = 4.0  # grey levels a pixel
MAX_WOBBLE = 0.5  # median distance from the median gradient, as a share of it
MAX_STILL = 0.35  # share of still pixels among those with an edge, above which the camera stands still
LINE_PX = 32
MAX_LINE = 0.9  # coherence of a line's edges
MAX_COHERENCE = 0.5  # 0 when edges run in every direction alike, 1 when in one
MAX_IMBALANCE = 0.3  # 0 when the gradients add up to nothing, 1 when all point one way
WEAK = 0.4  # of the strength of a logo's clear edges: what is weaker is cloud or bonnet behind it
MIN_SCORE = 0.1
BAND = 0.32  # logos are looked for in this much of the height, at the top and at the bottom
MAX_WIDTH = 0.6
MAX_HEIGHT = 0.3

STANDS_STILL = "the camera does not move enough: a logo cannot be told from the scene; give boxes"
NOTHING = "nothing found that lies still and is shaped like a logo or text"


@dataclass(frozen=True, slots=True)
class Logo:
    """One logo: its box (x1, y1, x2, y2; px of the video, end excluded), how clear it is, and why.

    `score` is from 0.1 (just passes) to 1.
    """

    box: PixelBox
    score: float
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Watermark:
    """What lies still on a clip: `mask` (H, W), true where it is; without any logo `reason` says why."""

    mask: Mask
    logos: tuple[Logo, ...]
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """Per pixel (h, w), at working size: the gradient that stays, and how far single frames are from it.

    `gx`, `gy` are in grey levels a pixel, of the colour channel where they stay best; `edge` is the mean
    length of the gradients of single frames; `still` says where the gradient is strong and stays;
    `hint` is its length where it stays at least in part, else 0.
    """

    gx: Floats
    gy: Floats
    wobble: Floats
    edge: Floats
    still: Mask
    hint: Floats


def find_watermark(frames: Iterable[RgbImage]) -> Watermark:
    """The logos on frames (H, W, 3) of one size, spread over a clip, 12 that differ or more.

    A clip whose camera stands still gives none, with the reason. Raises InputError for no frame, or for
    frames of different sizes.
    """
    small, size = _small(frames)
    moved = _that_moved(small)
    height, width = size
    none = np.zeros(size, np.bool_)
    if len(moved) < MIN_SAMPLES:
        return Watermark(none, (), f"{STANDS_STILL} ({len(moved)} frames differ; {MIN_SAMPLES} are needed)")
    still = stay(moved)
    edges = still.edge > MIN_EDGE
    share = float((still.still & edges).sum() / max(1, edges.sum()))
    if share > MAX_STILL:
        return Watermark(none, (), f"{STANDS_STILL} ({share:.0%} of all edges stay where they are)")
    logos, mask = [], np.zeros_like(still.still)
    scale = (width / mask.shape[1], height / mask.shape[0])
    for logo, part in _logos(still):
        mask |= part
        logos.append(_enlarged(logo, scale, size))
    if not logos:
        return Watermark(none, (), NOTHING)
    large = cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    return Watermark(large, tuple(logos), "")


def _small(frames: Iterable[RgbImage]) -> tuple[list[RgbImage], tuple[int, int]]:
    """At most `SAMPLES` of the frames at working size, and the (height, width) they had."""
    found = list(frames)
    sizes: list[tuple[int, int]] = sorted({(frame.shape[0], frame.shape[1]) for frame in found})
    if len(sizes) != 1:
        raise InputError(f"found frames of the sizes {sizes}; expected one size. Take frames of one clip.")
    height, width = sizes[0]
    if len(found) > SAMPLES:
        found = [found[round(place * (len(found) - 1) / (SAMPLES - 1))] for place in range(SAMPLES)]
    scale = min(1.0, WORK_PX / width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    shrunk = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) if scale < 1 else one for one in found]
    return [np.asarray(one, np.uint8) for one in shrunk], (height, width)


def _that_moved(frames: list[RgbImage]) -> list[RgbImage]:
    """The frames that differ from the one kept before: a clip that waits at a light counts once."""
    kept = frames[:1]
    for frame in frames[1:]:
        if float(cv2.absdiff(frame, kept[-1]).mean()) > MOVED:
            kept.append(frame)
    return kept


def stay(frames: list[RgbImage]) -> Still:
    """Where gradients stay over the frames (h, w, 3), each pixel in the colour channel that shows it best."""
    shape = frames[0].shape[:2]
    zero = np.zeros(shape, np.float32)
    best = Still(zero.copy(), zero.copy(), zero.copy(), zero.copy(), zero > 0, zero.copy())
    for channel in range(3):
        gradients = [_gradient(frame[..., channel]) for frame in frames]
        mean_x = np.mean([gx for gx, _ in gradients], axis=0)
        mean_y = np.mean([gy for _, gy in gradients], axis=0)
        edge = np.mean([cv2.magnitude(gx, gy) for gx, gy in gradients], axis=0)
        length = np.hypot(mean_x, mean_y)
        best.edge[...] = np.maximum(best.edge, edge)
        best.hint[...] = np.maximum(best.hint, np.where(length > 0.4 * edge, length, 0))
        # A median is dear: it is taken only where the mean says that it may be long.
        rows, columns = np.nonzero((length > MIN_EDGE / 2) & (length > 0.4 * edge))
        if not len(rows):
            continue
        xs = np.stack([gx[rows, columns] for gx, _ in gradients], axis=-1)
        ys = np.stack([gy[rows, columns] for _, gy in gradients], axis=-1)
        gx, gy = np.median(xs, axis=-1), np.median(ys, axis=-1)
        wobble = np.median(np.hypot(xs - gx[:, None], ys - gy[:, None]), axis=-1)
        fits = (np.hypot(gx, gy) > MIN_EDGE) & (wobble < MAX_WOBBLE * np.hypot(gx, gy))
        better = fits & (np.hypot(gx, gy) > np.hypot(best.gx, best.gy)[rows, columns])
        at = rows[better], columns[better]
        best.gx[at], best.gy[at], best.wobble[at] = gx[better], gy[better], wobble[better]
        best.still[at] = True
    return best


def _gradient(channel: NDArray[np.uint8]) -> tuple[Floats, Floats]:
    """The horizontal and vertical gradient, in grey levels a pixel."""
    gx = cv2.Sobel(channel, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
    gy = cv2.Sobel(channel, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
    return np.asarray(gx, np.float32), np.asarray(gy, np.float32)


def _logos(still: Still) -> Iterator[tuple[Logo, Mask]]:
    """Each logo with its mask (h, w), at working size."""
    shapes = still.still & ~_lines(still)
    strength = np.hypot(still.gx, still.gy)
    near = cv2.getStructuringElement(cv2.MORPH_RECT, (19, 9))
    for box, group in _components(cv2.dilate(shapes.astype(np.uint8), near) > 0):
        x1, y1, x2, y2 = box
        part = np.zeros_like(shapes)
        part[y1:y2, x1:x2] = group & shapes[y1:y2, x1:x2]
        part &= strength > WEAK * _usual(strength, part)
        logo = _judged(still, part)
        if logo:
            yield logo, _covered(still, part, logo.box)


def _usual(strength: Floats, part: Mask) -> float:
    """How strong the clear edges of a group are, in grey levels a pixel."""
    return float(np.percentile(strength[part], 75)) if part.any() else 0.0


def _components(mask: Mask) -> Iterator[tuple[PixelBox, Mask]]:
    """Each connected part: its box, and its pixels inside the box."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    for number in range(1, count):
        x, y, width, height = (int(value) for value in stats[number, :4])
        yield (x, y, x + width, y + height), labels[y : y + height, x : x + width] == number


def _lines(still: Still) -> Mask:
    """What is no logo by itself: long edges of one direction (horizon, lane marks, black bars), and what
    runs out of the frame, as a bonnet does.
    """
    height, width = still.still.shape
    found = np.zeros_like(still.still)
    for (x1, y1, x2, y2), part in _components(still.still):
        at = slice(y1, y2), slice(x1, x2)
        long = max(x2 - x1, y2 - y1) >= LINE_PX
        cut_off = min(x1, y1) < 1 or x2 >= width or y2 >= height
        if cut_off or (long and coherence(still.gx[at][part], still.gy[at][part]) > MAX_LINE):
            found[at] |= part
    return found


def coherence(gx: Floats, gy: Floats) -> float:
    """How much gradients (K,) run along one direction: 0 not at all, 1 all do (structure tensor)."""
    xx, yy, xy = float((gx * gx).sum()), float((gy * gy).sum()), float((gx * gy).sum())
    return float(np.hypot(xx - yy, 2 * xy) / (xx + yy))


def imbalance(gx: Floats, gy: Floats) -> float:
    """How far gradients (K,) are from adding up to nothing, as those of a closed shape do: 0 to 1."""
    return float(np.hypot(gx.sum(), gy.sum()) / np.hypot(gx, gy).sum())


def _judged(still: Still, part: Mask) -> Logo | None:
    """The logo that a group of still pixels is, or None."""
    height, width = part.shape
    rows, columns = np.nonzero(part)
    if len(rows) < max(24, round(0.1 * min(width, WORK_PX))):
        return None
    x1, x2, y1, y2 = int(columns.min()), int(columns.max()) + 1, int(rows.min()), int(rows.max()) + 1
    in_band = y2 <= BAND * height or y1 >= (1 - BAND) * height
    if not in_band or x2 - x1 > MAX_WIDTH * width or y2 - y1 > MAX_HEIGHT * height:
        return None
    gx, gy = still.gx[part], still.gy[part]
    directed, open_ends = coherence(gx, gy), imbalance(gx, gy)
    if directed > MAX_COHERENCE or open_ends > MAX_IMBALANCE:
        return None
    length = np.hypot(gx, gy)
    wobble = float(np.median(still.wobble[part] / length))
    score = 1 - max(directed / MAX_COHERENCE, open_ends / MAX_IMBALANCE, wobble / MAX_WOBBLE)
    if score < MIN_SCORE:
        return None
    why = (
        f"{len(rows)} edge pixels of {float(np.median(length)):.0f} grey levels stay within {wobble:.0%}, "
        f"run in all directions (coherence {directed:.2f}) and close (imbalance {open_ends:.2f})"
    )
    return Logo((x1, y1, x2, y2), round(score, 3), why)


def _covered(still: Still, part: Mask, box: PixelBox) -> Mask:
    """All of a logo: its edges, weaker ones among them, and what they enclose."""
    x1, y1, x2, y2 = box
    around = np.zeros_like(part)
    beside = y2 - y1
    around[max(0, y1 - 2) : y2 + 2, max(0, x1 - beside) : x2 + beside] = True
    weak = max(MIN_EDGE / 2, WEAK * _usual(np.hypot(still.gx, still.gy), part))
    edges = (part | ((still.hint > weak) & around)).astype(np.uint8)
    wide = cv2.dilate(edges, np.ones((3, 3), np.uint8))
    outlines, _ = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(wide), outlines, -1, 1, cv2.FILLED)
    return np.asarray(cv2.dilate(filled, np.ones((3, 3), np.uint8)) > 0)


def _enlarged(logo: Logo, scale: tuple[float, float], size: tuple[int, int]) -> Logo:
    """The logo at the video's own size (height, width)."""
    (x_scale, y_scale), (height, width) = scale, size
    x1, y1, x2, y2 = logo.box
    box = (
        int(x1 * x_scale),
        int(y1 * y_scale),
        min(width, int(np.ceil(x2 * x_scale))),
        min(height, int(np.ceil(y2 * y_scale))),
    )
    return Logo(box, logo.score, logo.why)
