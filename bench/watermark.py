"""How well watermarks are found and taken off: `python -m bench.watermark [CLIP ...]`, a table of cases.

Overlays are drawn on the demo's clips, which have none, and the result goes through H.264 and back.
Recall and precision are of pixels; the root mean square error and PSNR are inside the found mask.
"""

import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from pipeline.data.watermark import RADIUS_PX, eraser
from pipeline.data.watermark_find import Mask, find_watermark
from pipeline.records import RgbImage
from pipeline.video import read_keyframes
from tests.clips import write_clip
from tests.overlays import OVERLAYS, drawn_on, laid_over

VIDEOS = Path(__file__).parent.parent / "demo" / "videos"
ALPHAS = (0.35, 0.6, 1.0)
FRAMES = 60


def psnr(found: Sequence[RgbImage], true: Sequence[RgbImage], mask: Mask) -> float:
    """In dB, over the masked pixels of all frames."""
    squares = [np.square(a[mask].astype(float) - b[mask]).mean() for a, b in zip(found, true, strict=True)]
    return float(10 * np.log10(255**2 / max(1e-9, float(np.mean(squares)))))


def through_h264(frames: list[RgbImage], folder: Path) -> list[RgbImage]:
    """The frames as a decoder gives them."""
    height, width = frames[0].shape[:2]
    path = write_clip(folder / "clip.mp4", len(frames), (width, height), pictures=frames)
    return [frame.rgb for frame in read_keyframes(path, "clip", len(frames)).frames]


def inpainted(rgb: RgbImage, mask: Mask) -> RgbImage:
    """The usual remedy, for comparison: all that is masked, filled from around (Telea 2004)."""
    return np.asarray(cv2.inpaint(rgb, mask.astype(np.uint8), RADIUS_PX, cv2.INPAINT_TELEA), np.uint8)


def main() -> None:
    """Print the table, and the means of every overlay."""
    wanted = set(sys.argv[1:])
    print("| clip | overlay | alpha | recall | precision | before | inpainted | un-blended |")
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    rows: dict[str, list[tuple[float, ...]]] = defaultdict(list)
    alarms, cases, missed = [], 0, []
    with tempfile.TemporaryDirectory() as name:
        for path in sorted(VIDEOS.glob("*.mp4")):
            if wanted and path.stem not in wanted:
                continue
            clean = [frame.rgb for frame in read_keyframes(path, path.stem, FRAMES).frames]
            if find_watermark(clean).logos:
                alarms.append(path.stem)
            for overlay in OVERLAYS:
                truth = drawn_on(clean, overlay)
                for alpha in ALPHAS:
                    cases += 1
                    marked = through_h264(laid_over(clean, overlay, alpha), Path(name))
                    mask = find_watermark(marked).mask
                    if not mask.any():
                        missed.append(f"{path.stem}, {overlay.name}, {alpha}")
                        continue
                    erase, some = eraser(marked, mask), slice(0, FRAMES, 6)
                    row = (
                        float((mask & truth).sum() / truth.sum()),
                        float((mask & truth).sum() / mask.sum()),
                        psnr(marked[some], clean[some], mask),
                        psnr([inpainted(frame, mask) for frame in marked[some]], clean[some], mask),
                        psnr([erase(frame) for frame in marked[some]], clean[some], mask),
                    )
                    rows[overlay.name].append(row)
                    print(f"| {path.stem} | {overlay.name} | {alpha} | {_cells(row)} |", flush=True)
    for overlay_name, found in rows.items():
        means = tuple(float(value) for value in np.mean(found, axis=0))
        print(f"| mean | {overlay_name} | | {_cells(means)} |")
    print(f"\n{len(missed)} of {cases} not found: {'; '.join(missed) or 'none'}")
    print(f"False alarms on clean clips: {', '.join(alarms) or 'none'}")


def _cells(row: Sequence[float]) -> str:
    return " | ".join([*(f"{value:.2f}" for value in row[:2]), *(f"{value:.1f}" for value in row[2:])])


if __name__ == "__main__":
    main()
