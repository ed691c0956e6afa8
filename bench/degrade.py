"""Clean pictures made worse in known ways, and how far others are from them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.records import RgbImage

KINDS = ("blur", "noise", "logo")
BLUR_SIGMA_PX = 1.0
NOISE_SIGMA = 10.0  # grey levels
LOGO_ALPHA = 0.5


def degraded(rgb: RgbImage, kinds: tuple[str, ...], seed: int) -> RgbImage:
    """A picture (H, W, 3) as a camera and a publisher spoil it: first blur, then noise, then a white logo.

    The logo is text, half see-through, a sixth of the height from the top left corner.
    """
    spoilt = rgb.astype(np.float32)
    if "blur" in kinds:
        spoilt = cv2.GaussianBlur(spoilt, (0, 0), BLUR_SIGMA_PX).astype(np.float32)
    if "noise" in kinds:
        spoilt += np.random.default_rng(seed).normal(0, NOISE_SIGMA, rgb.shape).astype(np.float32)
    if "logo" in kinds:
        share = logo(rgb.shape[0], rgb.shape[1])[..., None] * LOGO_ALPHA
        spoilt = spoilt * (1 - share) + 255 * share
    return np.asarray(np.rint(np.clip(spoilt, 0, 255)), np.uint8)


def logo(height: int, width: int) -> NDArray[np.float32]:
    """How much of each pixel (height, width) the logo covers, in [0, 1]."""
    drawn = np.zeros((height, width), np.uint8)
    scale = height / 220
    place = (width // 20, height // 6)
    cv2.putText(
        drawn, "DASHCAM", place, cv2.FONT_HERSHEY_DUPLEX, scale, 255, max(1, round(scale)), cv2.LINE_AA
    )
    return drawn.astype(np.float32) / np.float32(255)


def psnr(found: RgbImage, clean: RgbImage) -> float:
    """Peak signal-to-noise ratio in dB over all pixels and channels; infinite for equal pictures."""
    error = float(np.mean((found.astype(np.float64) - clean) ** 2))
    return float("inf") if error == 0 else float(10 * np.log10(255**2 / error))


def ssim(found: RgbImage, clean: RgbImage) -> float:
    """Structural similarity of the lumas (Wang et al. 2004): 11x11 Gaussian of 1.5 px, borders left out."""
    x, y = (cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float64) for rgb in (found, clean))

    def local(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(cv2.GaussianBlur(values, (11, 11), 1.5)[5:-5, 5:-5], np.float64)

    mean_x, mean_y = local(x), local(y)
    variance_x, variance_y = local(x * x) - mean_x**2, local(y * y) - mean_y**2
    covariance = local(x * y) - mean_x * mean_y
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    above = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    return float(np.mean(above / ((mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2))))
