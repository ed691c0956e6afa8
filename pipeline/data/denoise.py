"""Taking noise and blur out of pictures: networks that the user brings, else plain methods by their names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import cv2
import numpy as np

from pipeline.data.nafnet import TiledNetwork, network_sha256
from pipeline.records import RgbImage

Settings: TypeAlias = Mapping[str, float]

QUIET_SIGMA = 2.0  # grey levels; below it taking out noise costs more texture than it is worth
# `sharpness` from which on a clip is left as it is, and up to which it gets the whole unsharp mask.
SHARP, BLURRED = 0.5, 0.4
EDGES_PERCENT = 5.0  # of the pixels, those where the coarser band is strongest


class Method(Protocol):
    """A way to make a picture better."""

    @property
    def name(self) -> str:
        """What records and tables call it."""

    @property
    def sha256(self) -> str:
        """Hash of a network, empty for a method without weights."""

    @property
    def settings(self) -> Settings:
        """The numbers it works with."""

    def __call__(self, rgb: RgbImage) -> RgbImage:
        """The better picture, of the same size."""


def noise_sigma(pictures: Sequence[RgbImage]) -> float:
    """Standard deviation of the noise of a clip's pictures (H, W, 3), in grey levels.

    Median over the pictures of the robust estimate from the finest diagonal Haar coefficients of the
    luma (Donoho and Johnstone 1994): median magnitude / 0.6745. Pictures under 2 px a side count as quiet.
    """
    found = []
    for rgb in pictures:
        luma = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
        luma = luma[: len(luma) // 2 * 2, : luma.shape[1] // 2 * 2]
        diagonal = (luma[::2, ::2] - luma[::2, 1::2] - luma[1::2, ::2] + luma[1::2, 1::2]) / 2
        if diagonal.size:
            found.append(float(np.median(np.abs(diagonal))) / 0.6745)
    return float(np.median(found)) if found else 0.0


def sharpness(pictures: Sequence[RgbImage]) -> float:
    """How sharp the edges of a clip's pictures (H, W, 3) are: about 0.2 for a blur of 1.5 px, 0.6 for none.

    Ours: median over the pictures of the energy of the luma's finest band (itself less its Gaussian blur of
    0.7 px) over that of the next (0.7 px less 1.4 px), where the next is strongest: there noise counts
    little. Noise that is left makes pictures look sharper. Pictures without edges count as sharp (1.0).
    """
    found = []
    for rgb in pictures:
        luma = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
        finer, coarser = (cv2.GaussianBlur(luma, (0, 0), sigma_px) for sigma_px in (0.7, 1.4))
        fine, next_fine = np.square(luma - finer), np.square(finer - coarser)
        edges = next_fine >= max(1e-3, float(np.percentile(next_fine, 100 - EDGES_PERCENT)))
        if edges.any():
            found.append(float(fine[edges].mean() / next_fine[edges].mean()))
    return float(np.median(found)) if found else 1.0


@dataclass(frozen=True, slots=True)
class NonLocalMeans:
    """Buades et al. 2005 as OpenCV has it, as strong as the clip's noise asks for; none for a quiet clip."""

    sigma: float
    strength: float = 1.0
    template_px: int = 5
    search_px: int = 11
    sha256: str = field(default="", init=False)

    @property
    def name(self) -> str:
        """The method, and whether it is not run."""
        return "OpenCV non-local means" if self.h else "OpenCV non-local means (not noisy: left as it is)"

    @property
    def h(self) -> float:
        """The filter's strength in grey levels, 0 where it is not run at all."""
        return 0.0 if self.sigma < QUIET_SIGMA else round(self.strength * self.sigma, 3)

    @property
    def settings(self) -> Settings:
        """The noise that was found, and the filter's strength and windows."""
        return {
            "sigma": self.sigma,
            "h": self.h,
            "template_px": self.template_px,
            "search_px": self.search_px,
        }

    def __call__(self, rgb: RgbImage) -> RgbImage:
        """The picture (H, W, 3) without its noise."""
        if not self.h:
            return rgb
        made: Any = cv2.fastNlMeansDenoisingColored(
            rgb, None, self.h, self.h, self.template_px, self.search_px
        )
        return np.asarray(made, np.uint8)


@dataclass(frozen=True, slots=True)
class UnsharpMask:
    """The luma's difference from its Gaussian blur, added again: mild, and not at all for a sharp clip."""

    sharpness: float
    most: float = 0.5
    blur_sigma_px: float = 1.5
    sha256: str = field(default="", init=False)

    @property
    def amount(self) -> float:
        """How much of the difference is added: `most` up to `BLURRED`, falling to 0 at `SHARP`."""
        share = (SHARP - self.sharpness) / (SHARP - BLURRED)
        return round(self.most * min(1.0, max(0.0, share)), 3)

    @property
    def name(self) -> str:
        """The method, and whether it is not run."""
        return "unsharp mask" if self.amount else "unsharp mask (not blurred: left as it is)"

    @property
    def settings(self) -> Settings:
        """The sharpness that was found, how much of the difference is added, and how wide the blur is."""
        return {"sharpness": self.sharpness, "amount": self.amount, "blur_sigma_px": self.blur_sigma_px}

    def __call__(self, rgb: RgbImage) -> RgbImage:
        """The sharper picture (H, W, 3)."""
        if not self.amount:
            return rgb
        luma = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
        detail = luma - cv2.GaussianBlur(luma, (0, 0), self.blur_sigma_px)
        sharper = rgb.astype(np.float32) + np.float32(self.amount) * detail[..., None]
        return np.asarray(np.rint(np.clip(sharper, 0, 255)), np.uint8)


class NetworkMethod:
    """A network that the user brought, under its file's name."""

    def __init__(self, path: Path) -> None:
        """Check, hash and open it. Raises InputError or OutsideError when it cannot be used."""
        self.name = f"ONNX network {path.name}"
        self.sha256 = network_sha256(path)
        self._network = TiledNetwork(path)
        tiling = self._network.tiling
        self.settings: Settings = {
            "tile_height_px": tiling.height_px,
            "tile_width_px": tiling.width_px,
            "overlap_px": tiling.overlap_px,
        }

    def __call__(self, rgb: RgbImage) -> RgbImage:
        """The network's picture."""
        return self._network(rgb)


def denoiser(model: Path | None, samples: Sequence[RgbImage]) -> Method:
    """The network, else non-local means as strong as the samples of the clip are noisy."""
    return NetworkMethod(model) if model else NonLocalMeans(round(noise_sigma(samples), 3))


def deblurrer(model: Path | None, samples: Sequence[RgbImage]) -> Method:
    """The network, else an unsharp mask as strong as the samples, their noise taken out, are blurred."""
    return NetworkMethod(model) if model else UnsharpMask(round(sharpness(samples), 3))
