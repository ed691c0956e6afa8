"""Pictures as CLIP's vision network takes them, by the model's own preprocessor_config.json.

The steps and their defaults are those of Hugging Face's CLIPImageProcessor, which repeats OpenAI's:
shortest side to 224 px with Pillow's bicubic, centre crop, mean and deviation of each channel. The
filter is Pillow's own because OpenCV's bicubic (a = -0.75) does not smooth where a picture shrinks.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.records import RgbImage

# The published constants of CLIP (Radford et al. 2021; openai/CLIP, clip.py).
CLIP_MEAN = (0.48145466, 0.4578275, 0.40821073)
CLIP_STD = (0.26862954, 0.26130258, 0.27577711)
CLIP_SIDE_PX = 224
BICUBIC = 3  # Pillow's number, as in the configuration
MAX_SIDE_PX = 1024

# Whole up to this ratio of the sides, as everyone does it; beyond, only what the crop keeps.
_LONGEST_WHOLE = 4

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Preprocessing:
    """How a picture becomes the network's input.

    `shortest_px` resizes by the shorter side, else the picture is resized to `resize_px`; `crop_px`
    is cut from its centre. Sizes in tuples are (height, width). A value v in 0 to 255 of channel c
    becomes (v * scale - mean[c]) / std[c]. `resample` is Pillow's number of the filter.
    """

    shortest_px: int | None = CLIP_SIDE_PX
    resize_px: tuple[int, int] | None = None
    crop_px: tuple[int, int] | None = (CLIP_SIDE_PX, CLIP_SIDE_PX)
    resample: int = BICUBIC
    scale: float = 1 / 255
    mean: Triple = CLIP_MEAN
    std: Triple = CLIP_STD

    @property
    def shape_px(self) -> tuple[int, int]:
        """(height, width) of every picture that comes out."""
        shape = self.crop_px or self.resize_px
        assert shape is not None
        return shape

    @property
    def levels(self) -> NDArray[np.float32]:
        """What each grey level becomes, shape (3, 256)."""
        values = np.arange(256, dtype=np.float64) * self.scale
        mean, std = (np.array(triple)[:, None] for triple in (self.mean, self.std))
        table: NDArray[np.float32] = ((values - mean) / std).astype(np.float32)
        return table


class _Reader:
    """Reads a configuration and collects what is wrong with it."""

    def __init__(self, config: Mapping[str, Any]) -> None:
        self.faults: list[str] = []
        self._config = config

    def fault(self, key: str, expected: str) -> None:
        self.faults.append(f"{key}: found {str(self._config.get(key))[:80]}; expected {expected}.")

    def flag(self, key: str, *, must: bool = False) -> bool:
        value = self._config.get(key, True)
        if type(value) is not bool or (must and not value):
            self.fault(key, "true" if must else "true or false")
            return True
        return value

    def size(self, key: str, shortest: bool) -> tuple[int | None, tuple[int, int]]:
        """(shortest side or None, (height, width)) of `size` or `crop_size`."""
        value = self._config.get(key, CLIP_SIDE_PX)
        if type(value) is int and _is_side(value):
            return (value if shortest else None), (value, value)
        if isinstance(value, dict):
            if set(value) == {"height", "width"} and all(map(_is_side, value.values())):
                return None, (value["height"], value["width"])
            if shortest and set(value) == {"shortest_edge"} and _is_side(value["shortest_edge"]):
                return value["shortest_edge"], (value["shortest_edge"],) * 2
        named = "shortest_edge, or height and width," if shortest else "height and width"
        self.fault(key, f"a side, or {named} of 1 to {MAX_SIDE_PX} px")
        return None, (CLIP_SIDE_PX, CLIP_SIDE_PX)

    def filter(self) -> int:
        value = self._config.get("resample", BICUBIC)
        if type(value) is not int or value not in range(6):
            self.fault("resample", "Pillow's number of a filter, 0 to 5")
            return BICUBIC
        return value

    def number(self, key: str, default: float) -> float:
        value = self._config.get(key, default)
        if not _is_number(value) or not 0 < value <= 1:
            self.fault(key, "a number over 0, at most 1")
            return default
        return float(value)

    def triple(self, key: str, default: Triple, *, positive: bool = False) -> Triple:
        value = self._config.get(key, default)
        good = isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value))
        if not good or (positive and min(value) < 1e-6):
            self.fault(key, f"3 {'positive ' if positive else ''}numbers, at most 1000")
            return default
        return (float(value[0]), float(value[1]), float(value[2]))


def _is_side(value: Any) -> bool:
    return type(value) is int and 1 <= value <= MAX_SIDE_PX


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= 1000  # NaN is not


def read_preprocessing(config: Mapping[str, Any], where: str) -> Preprocessing:
    """What a preprocessor_config.json says; what it leaves out is CLIP's. `where` names the file.

    Raises InputError with every setting that is wrong or not supported.
    """
    read = _Reader(config)
    read.flag("do_resize", must=True)  # crops come in all sizes, the network takes one
    read.flag("do_convert_rgb")  # our crops are RGB already
    shortest_px, resize_px = read.size("size", shortest=True)
    crop_px = read.size("crop_size", shortest=False)[1] if read.flag("do_center_crop") else None
    if crop_px is None and shortest_px is not None:
        read.fault("size", "height and width where do_center_crop is false")
    if crop_px is not None and (crop_px[0] > resize_px[0] or crop_px[1] > resize_px[1]):
        read.fault("crop_size", f"at most the {resize_px[0]} x {resize_px[1]} px of size")
    scale = read.number("rescale_factor", 1 / 255) if read.flag("do_rescale") else 1.0
    mean, std = read.triple("image_mean", CLIP_MEAN), read.triple("image_std", CLIP_STD, positive=True)
    if not read.flag("do_normalize"):
        mean, std = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    resample = read.filter()
    if read.faults:
        raise InputError("\n".join([f"{where}: {len(read.faults)} wrong setting(s).", *read.faults]))
    return Preprocessing(shortest_px, None if shortest_px else resize_px, crop_px, resample, scale, mean, std)


def resized(picture: RgbImage, settings: Preprocessing) -> RgbImage:
    """A picture (H, W, 3) of any size from 1 x 1, resized and cropped: (h, w, 3), h x w = `shape_px`.

    As CLIPImageProcessor does it, to the last grey level. Of a picture whose sides differ more than
    4 times only the part that the crop keeps is computed, so that a sliver costs no memory: within
    one level of the whole. Raises InputError when it is no picture.
    """
    from PIL import Image

    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or picture.size == 0:
        raise InputError(
            f"crop: found {picture.dtype}{picture.shape}; expected uint8 (H, W, 3) of 1 x 1 or more."
        )
    height, width = picture.shape[:2]
    if settings.shortest_px is None:
        assert settings.resize_px is not None
        tall, wide = settings.resize_px
    else:
        tall, wide = (settings.shortest_px * side // min(height, width) for side in (height, width))
    whole = Image.fromarray(np.ascontiguousarray(picture))
    resample = Image.Resampling(settings.resample)
    rows, columns = settings.shape_px
    left, top = (wide - columns) // 2, (tall - rows) // 2
    if max(tall, wide) <= _LONGEST_WHOLE * min(tall, wide):
        made = whole.resize((wide, tall), resample)
        if (rows, columns) != (tall, wide):
            made = made.crop((left, top, left + columns, top + rows))
    else:
        # Across first, then down, each rounded to whole levels: as Pillow resizes a whole picture.
        across, down = width / wide, height / tall
        made = whole.resize(
            (columns, height), resample, box=(left * across, 0, (left + columns) * across, height)
        )
        made = made.resize((columns, rows), resample, box=(0, top * down, columns, (top + rows) * down))
    return np.asarray(made, np.uint8)


def fill_batch(
    pictures: Sequence[RgbImage], settings: Preprocessing, into: NDArray[np.float32], threads: int = 1
) -> None:
    """Write the network's input for each picture: `into` is (B, 3, h, w), B at least len(pictures).

    Raises what `resized` raises.
    """
    levels = settings.levels

    def fill(place: int) -> None:
        small = resized(pictures[place], settings)
        for channel in range(3):
            # "clip" only because the checked mode goes through a buffer; a grey level is always inside.
            np.take(levels[channel], small[:, :, channel], out=into[place, channel], mode="clip")

    if threads > 1 and len(pictures) > 1:
        with ThreadPoolExecutor(threads) as pool:  # Pillow and NumPy let go of the interpreter's lock
            list(pool.map(fill, range(len(pictures))))
    else:
        for place in range(len(pictures)):
            fill(place)
