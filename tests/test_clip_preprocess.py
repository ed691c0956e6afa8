"""CLIP's preprocessing against the published one, and settings that it must refuse."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from pipeline.clip_preprocess import (
    CLIP_MEAN,
    CLIP_STD,
    Preprocessing,
    fill_batch,
    read_preprocessing,
    resized,
)
from pipeline.errors import InputError
from pipeline.records import RgbImage
from tests.tiny_clip import PREPROCESSOR


def _picture(height: int, width: int) -> RgbImage:
    """A picture that is a formula, with edges and ramps."""
    y, x = np.mgrid[:height, :width]
    channels = [(x * 7 + y * 3) % 256, x * y // 5 % 256, 255 * x // max(width - 1, 1)]
    return np.stack(channels, axis=-1).astype(np.uint8)


def _prepared(picture: RgbImage, how: Preprocessing) -> NDArray[np.float32]:
    made = np.empty((1, 3, *how.shape_px), np.float32)
    fill_batch([picture], how, made)
    return made[0]


# pixel_values at (channel, row, column) of (0, 0, 0), (1, 111, 50), (2, 223, 223), (0, 100, 200), as
# transformers 5.24's CLIPImageProcessor (Pillow backend, Pillow 13.0) gave them with its defaults.
PUBLISHED = {
    (300, 200): [0.3975, -1.0017, 2.1459, 0.1347],
    (61, 180): [0.5143, 0.9193, 0.9372, -0.2156],
    (37, 41): [-1.6317, -1.2268, 2.0037, -1.2959],
    (224, 224): [-1.7923, -0.4614, 2.1459, 0.6019],
    (500, 731): [-1.2667, 0.8743, 1.5629, 0.9668],
}


@pytest.mark.parametrize("shape", PUBLISHED)
def test_pixels_agree_with_the_published_preprocessing(shape: tuple[int, int]) -> None:
    found = _prepared(_picture(*shape), read_preprocessing(PREPROCESSOR, "here"))
    values = [float(found[place]) for place in ((0, 0, 0), (1, 111, 50), (2, 223, 223), (0, 100, 200))]
    # Other versions of Pillow may round a level (1 / 255 / 0.26) otherwise.
    assert np.abs(np.array(values) - PUBLISHED[shape]).max() < 0.0155


def test_an_empty_configuration_is_clips_own() -> None:
    how = read_preprocessing({}, "here")
    assert how == Preprocessing() == read_preprocessing(PREPROCESSOR, "here")
    assert (how.mean, how.std) == (CLIP_MEAN, CLIP_STD)
    assert (how.shortest_px, how.crop_px, how.resample) == (224, (224, 224), 3)
    assert how.levels[0, 0] == pytest.approx(-0.48145466 / 0.26862954, abs=1e-6)
    assert how.levels[2, 255] == pytest.approx((1 - 0.40821073) / 0.27577711, abs=1e-6)
    old = {"size": 224, "crop_size": 224, "feature_extractor_type": "CLIPFeatureExtractor", "resample": 3}
    assert read_preprocessing(old, "here") == how


def _keys(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keys' cubic with a = -0.5."""
    x = np.abs(distance)
    near, far = (1.5 * x - 2.5) * x * x + 1, ((-0.5 * x + 2.5) * x - 4) * x + 2
    return np.where(x < 1, near, np.where(x < 2, far, 0.0))


def _along(picture: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """(H, W, 3) resized to (size, W, 3) by the antialiased cubic, weights that sum to 1."""
    scale = picture.shape[0] / size
    wide = max(scale, 1.0)
    centres = (np.arange(size) + 0.5) * scale
    weights = _keys((np.arange(picture.shape[0]) + 0.5 - centres[:, None]) / wide)
    return np.einsum("ts,swc->twc", weights / weights.sum(axis=1, keepdims=True), picture)


@pytest.mark.parametrize(("height", "width"), [(300, 224), (224, 500), (97, 120), (640, 480)])
def test_the_filter_is_the_antialiased_cubic(height: int, width: int) -> None:
    y, x = np.mgrid[:height, :width]
    waves = [120 + 60 * np.sin(x / 9), 120 + 60 * np.cos(y / 7), 100 + 50 * np.sin((x + y) / 5)]
    picture = np.stack(waves, -1).astype(np.uint8)
    short = min(height, width)
    tall, wide = 224 * height // short, 224 * width // short
    expected = _along(picture.astype(np.float64), tall)
    expected = _along(expected.transpose(1, 0, 2), wide).transpose(1, 0, 2)
    top, left = (tall - 224) // 2, (wide - 224) // 2
    expected = expected[top : top + 224, left : left + 224]
    assert np.abs(resized(picture, Preprocessing()) - expected).max() < 1.6


def test_of_a_sliver_only_what_the_crop_keeps_is_computed() -> None:
    x = np.arange(6000)
    row = np.stack([100 + 80 * np.sin(x / 40), x // 30, 255 - x // 30], -1).astype(np.uint8)
    sliver = np.repeat(row[None], 2, axis=0)
    made = resized(sliver, Preprocessing())
    # 2 x 6000 becomes 224 x 672,000; the middle 224 columns are the middle 2 of the source.
    assert made.shape == (224, 224, 3)
    assert np.abs(made.astype(int) - row[2999:3001].astype(int).mean(axis=0)).max() <= 3
    upright = resized(np.ascontiguousarray(sliver.transpose(1, 0, 2)), Preprocessing())
    assert np.abs(upright.transpose(1, 0, 2).astype(int) - made).max() <= 1


@pytest.mark.parametrize(("height", "width"), [(61, 300), (400, 77), (1500, 120)])
def test_a_cut_sliver_is_as_if_it_were_resized_whole(height: int, width: int) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
    short = min(height, width)
    wide, tall = 224 * width // short, 224 * height // short
    left, top = (wide - 224) // 2, (tall - 224) // 2
    whole = Image.fromarray(noise).resize((wide, tall), Image.Resampling.BICUBIC)
    expected = np.asarray(whole.crop((left, top, left + 224, top + 224)), int)
    different = np.abs(resized(noise, Preprocessing()) - expected)
    assert different.max() <= 1 and (different > 0).mean() < 0.01


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 700), st.integers(1, 700))
def test_pictures_of_every_size_come_out_in_one(height: int, width: int) -> None:
    found = resized(np.full((height, width, 3), 77, np.uint8), Preprocessing())
    assert found.shape == (224, 224, 3) and set(np.unique(found)) == {77}


def test_sizes_without_a_crop_and_other_settings() -> None:
    config = {
        "size": {"height": 32, "width": 48},
        "do_center_crop": False,
        "do_normalize": False,
        "resample": 2,
        "image_std": [1, 1, 1],
    }
    how = read_preprocessing(config, "here")
    found = _prepared(np.full((10, 99, 3), 51, np.uint8), how)
    assert found.shape == (3, 32, 48) and np.allclose(found, 0.2)
    raw = read_preprocessing(config | {"do_rescale": False}, "here")
    assert np.allclose(_prepared(np.full((10, 99, 3), 51, np.uint8), raw), 51)


@pytest.mark.parametrize(
    ("config", "key"),
    [
        ({"size": {"longest_edge": 224}}, "size"),
        ({"size": 0}, "size"),
        ({"size": True}, "size"),
        ({"size": 100_000}, "size"),
        ({"size": {"shortest_edge": "224"}}, "size"),
        ({"size": {"height": 224, "width": [1]}}, "size"),
        ({"crop_size": {"height": 224, "width": 300}}, "crop_size"),
        ({"crop_size": None}, "crop_size"),
        ({"do_center_crop": False}, "size"),
        ({"do_resize": False}, "do_resize"),
        ({"do_normalize": "yes"}, "do_normalize"),
        ({"resample": 9}, "resample"),
        ({"resample": "bicubic"}, "resample"),
        ({"rescale_factor": 0}, "rescale_factor"),
        ({"rescale_factor": float("nan")}, "rescale_factor"),
        ({"rescale_factor": 10**400}, "rescale_factor"),
        ({"image_mean": [0.5, 0.5]}, "image_mean"),
        ({"image_mean": "abc"}, "image_mean"),
        ({"image_std": [0.2, 0, 0.2]}, "image_std"),
        ({"image_std": [0.2, float("inf"), 0.2]}, "image_std"),
    ],
)
def test_settings_that_cannot_be_are_named(config: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match=f"here: 1 wrong setting.*\n{key}: found .*; expected "):
        read_preprocessing(config, "here")


def test_all_wrong_settings_come_together() -> None:
    with pytest.raises(InputError, match="3 wrong") as caught:
        read_preprocessing({"size": "x" * 10_000, "resample": -1, "image_std": None}, "here")
    assert len(str(caught.value)) < 500
