"""The pictures by which a person sees what restoring a clip did: one frame before, after, and the mask."""

import cv2
import numpy as np

from pipeline.data.watermark_find import Mask
from pipeline.errors import VideoError
from pipeline.records import RgbImage

WIDTH_PX = 640  # at most; pictures are never enlarged
QUALITY = 76
MASK_QUALITY = 60
TINT_RGBA = (255, 90, 30, 150)


def before_after(before: RgbImage, after: RgbImage, mask: Mask) -> dict[str, bytes]:
    """Ending of the file -> WebP: `before.webp`, `after.webp`, and `overlay.webp` when something is masked.

    Both pictures are (H, W, 3), the mask is (H, W); the overlay is see-through but for the mask. All are at
    most 640 px wide. Raises VideoError when a picture cannot be encoded.
    """
    pictures = {
        "before.webp": _webp(_fit(before)[..., ::-1], QUALITY),
        "after.webp": _webp(_fit(after)[..., ::-1], QUALITY),
    }
    if mask.any():
        small = _fit(mask.astype(np.uint8) * 255)
        overlay = np.zeros((*small.shape, 4), np.uint8)
        overlay[small > 0] = (*TINT_RGBA[2::-1], TINT_RGBA[3])
        pictures["overlay.webp"] = _webp(overlay, MASK_QUALITY)
    return pictures


def _fit(picture: RgbImage) -> RgbImage:
    height, width = picture.shape[:2]
    scale = min(1.0, WIDTH_PX / width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    fitted = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if scale < 1 else picture
    return np.asarray(fitted, np.uint8)


def _webp(picture: RgbImage, quality: int) -> bytes:
    done, data = cv2.imencode(".webp", np.ascontiguousarray(picture), [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise VideoError(f"A picture of {picture.shape[1]}x{picture.shape[0]} px could not be encoded.")
    return bytes(data.tobytes())
