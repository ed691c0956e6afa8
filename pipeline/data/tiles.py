"""A function of pictures run over overlapping tiles, and the results blended so that no seam shows.

At a tile's inner edge a network has seen too little. So the outer quarter of every overlap counts for
nothing, and over the middle half one tile fades into the next. A function that looks no further than
a quarter of the overlap gives what it gives for the whole picture.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Picture: TypeAlias = NDArray[np.float32]  # (H, W, C)


@dataclass(frozen=True, slots=True)
class Tiling:
    """Tiles of `height_px` by `width_px` that share at least `overlap_px` with the next.

    Networks that halve pictures several times want sides, and places, that are multiples of `align_px`.
    """

    height_px: int = 256
    width_px: int = 256
    overlap_px: int = 64
    align_px: int = 32

    def __post_init__(self) -> None:
        """Raises ValueError for sizes that cannot be laid out."""
        sizes = (self.height_px, self.width_px, self.overlap_px)
        if self.align_px < 1 or any(size < 1 or size % self.align_px for size in sizes):
            raise ValueError(f"found sizes {sizes}; expected positive multiples of {self.align_px}")
        if self.overlap_px % 4 or self.overlap_px >= min(self.height_px, self.width_px):
            raise ValueError(f"found overlap {self.overlap_px}; expected a multiple of 4, less than a tile")


def tile_starts(length: int, tile: int, overlap: int) -> list[int]:
    """Where the tiles of one axis start: the first at 0, the last ends at `length`, which is >= `tile`."""
    step = tile - overlap
    return [*range(0, length - tile, step), length - tile]


def window(tile: int, overlap: int, first: bool, last: bool) -> NDArray[np.float32]:
    """Weights in [0, 1] of one axis of a tile; 1 up to the picture's edge where it is `first` or `last`."""
    weights = np.ones(tile, np.float64)
    fade = overlap // 2
    rise = np.sin((np.arange(fade) + 0.5) / fade * np.pi / 2) ** 2
    ramp = np.concatenate([np.zeros(overlap // 4), rise])
    if not first:
        weights[: len(ramp)] *= ramp
    if not last:
        weights[-len(ramp) :] *= ramp[::-1]
    return weights.astype(np.float32)


def in_tiles(picture: Picture, function: Callable[[Picture], Picture], tiling: Tiling) -> Picture:
    """`function` over the tiles of a picture (H, W, C) of any size; it must keep a tile's shape.

    Every tile has the tiling's size. A picture is filled up at the bottom and right by its mirror image.
    """
    height, width = picture.shape[:2]
    full_height = max(tiling.height_px, -(-height // tiling.align_px) * tiling.align_px)
    full_width = max(tiling.width_px, -(-width // tiling.align_px) * tiling.align_px)
    padding = ((0, full_height - height), (0, full_width - width), (0, 0))
    # numpy's mirror image goes on and on where a picture is smaller than what it has to fill.
    filled = np.pad(picture, padding, mode="symmetric")
    total = np.zeros_like(filled)
    weight = np.zeros((full_height, full_width, 1), np.float32)
    tops = tile_starts(full_height, tiling.height_px, tiling.overlap_px)
    lefts = tile_starts(full_width, tiling.width_px, tiling.overlap_px)
    for top in tops:
        down = window(tiling.height_px, tiling.overlap_px, top == 0, top == tops[-1])
        for left in lefts:
            across = window(tiling.width_px, tiling.overlap_px, left == 0, left == lefts[-1])
            share = np.outer(down, across)[..., None]
            at = slice(top, top + tiling.height_px), slice(left, left + tiling.width_px)
            total[at] += function(np.ascontiguousarray(filled[at])) * share
            weight[at] += share
    blended: Picture = (total / weight)[:height, :width].astype(np.float32, copy=False)
    return blended
