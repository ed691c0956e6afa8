"""Tiles against whole pictures: equal where a function looks no further than a quarter of the overlap."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.data.tiles import Picture, Tiling, in_tiles, tile_starts, window

SMALL = Tiling(height_px=32, width_px=48, overlap_px=16, align_px=4)
sides = st.integers(1, 150)


def picture(height: int, width: int, seed: int) -> Picture:
    return np.random.default_rng(seed).random((height, width, 3), np.float32)


def blurred(radius: int, tile: Picture) -> Picture:
    """Sees `radius` px around; beyond the tile it sees zeros, as a padded convolution does."""
    side = 2 * radius + 1
    made = cv2.boxFilter(tile.astype(np.float64), -1, (side, side), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(made, np.float32)


def blocks(tile: Picture) -> Picture:
    """Halves the picture twice and enlarges it again, as a U-shaped network does."""
    height, width = tile.shape[:2]
    means = tile.reshape(height // 4, 4, width // 4, 4, 3).mean((1, 3))
    return np.repeat(np.repeat(means, 4, 0), 4, 1)


def test_tile_starts_by_hand() -> None:
    assert tile_starts(32, 32, 16) == [0]
    assert tile_starts(36, 32, 16) == [0, 4]
    assert tile_starts(64, 32, 16) == [0, 16, 32]
    assert tile_starts(68, 32, 16) == [0, 16, 32, 36]


def test_window_by_hand() -> None:
    """Overlap 8: two pixels of nothing, four that rise, two of one; the next tile's window is the rest."""
    rise = np.sin(np.array([0.5, 1.5, 2.5, 3.5]) / 4 * np.pi / 2) ** 2
    left, right = window(16, 8, True, False), window(16, 8, False, True)
    np.testing.assert_allclose(right[:8], [0, 0, *rise, 1, 1], atol=1e-6)
    np.testing.assert_allclose(left[8:] + right[:8], np.ones(8), atol=1e-6)
    assert (left[:8] == 1).all() and (right[8:] == 1).all()


@given(sides, sides, st.integers(0, 4), st.integers(0, 9))
@settings(max_examples=60, deadline=None)
def test_equals_the_whole_picture_for_a_function_that_looks_a_quarter_of_the_overlap_far(
    height: int, width: int, radius: int, seed: int
) -> None:
    # Of a size that needs no filling up, so that both see the same at the borders.
    whole = picture(max(32, height // 4 * 4), max(48, width // 4 * 4), seed)
    found = in_tiles(whole, lambda tile: blurred(radius, tile), SMALL)
    np.testing.assert_allclose(found, blurred(radius, whole), atol=2e-6)


def test_a_function_that_looks_further_is_not_equal() -> None:
    """The margin is what makes it equal: without enough of it the test above would fail."""
    whole = picture(64, 96, 1)
    found = in_tiles(whole, lambda tile: blurred(7, tile), SMALL)
    assert np.abs(found - blurred(7, whole)).max() > 1e-3


@given(sides, sides)
@settings(max_examples=40, deadline=None)
def test_tiles_lie_where_a_network_that_halves_pictures_wants_them(height: int, width: int) -> None:
    whole = picture(max(32, height // 4 * 4), max(48, width // 4 * 4), 3)
    np.testing.assert_allclose(in_tiles(whole, blocks, SMALL), blocks(whole), atol=1e-6)


@given(sides, sides)
@settings(max_examples=40, deadline=None)
def test_any_size_keeps_its_shape_and_every_tile_has_the_same(height: int, width: int) -> None:
    seen: set[tuple[int, ...]] = set()

    def same(tile: Picture) -> Picture:
        seen.add(tile.shape)
        return tile

    whole = picture(height, width, 5)
    np.testing.assert_allclose(in_tiles(whole, same, SMALL), whole, atol=1e-6)
    assert seen == {(32, 48, 3)}


def test_no_seam_where_tiles_differ() -> None:
    """Tiles of different brightness fade into each other: no step is larger than the fade's steepest."""
    shades = iter(range(1000))
    found = in_tiles(picture(32, 200, 0), lambda tile: np.full_like(tile, next(shades)), SMALL)
    steepest = np.diff(window(48, 16, False, True)).max()
    assert np.abs(np.diff(found, axis=1)).max() <= steepest + 1e-5


@pytest.mark.parametrize(
    "sizes", [(30, 48, 16, 4), (32, 48, 0, 4), (32, 48, 32, 4), (32, 48, 6, 2), (32, 48, 16, 0)]
)
def test_tilings_that_cannot_be_laid_out(sizes: tuple[int, int, int, int]) -> None:
    with pytest.raises(ValueError, match="expected"):
        Tiling(*sizes)
