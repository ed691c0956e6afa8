"""CLIP verification against the bare onnxruntime session, on the same crops.

The network has the size of ViT-B/32 (12 layers of 768, 12 heads) and random weights: speed does not
depend on what it has learned.
"""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.timing import Measure, interleaved
from pipeline.clip import IMAGE_BATCH, ClipMatcher
from pipeline.clip_preprocess import Preprocessing, fill_batch
from pipeline.graphs import open_session
from tests.tiny_clip import Size, noisy_pictures, write_tiny_clip

CROPS = 64
LEAST_PX = 175  # smaller ones do not pass the paper's limits
LABELS = ("cat", "deer", "pedestrian", "car", "truck", "debris on the road", "bicycle", "dog")
SIZE = Size(width=768, layers=12, heads=12, dim=512)
ROUNDS = 5


def measure() -> list[Measure]:
    """Two rows: from crops to cosines with labels known, and the preparation of the crops alone.

    The bare session gets batches that were prepared before the clock starts.
    """
    crops = noisy_pictures(CROPS, least_px=LEAST_PX)
    pixels = np.empty((CROPS, 3, SIZE.side_px, SIZE.side_px), np.float32)
    fill_batch(crops, Preprocessing(), pixels)
    scratch = np.empty_like(pixels)
    with tempfile.TemporaryDirectory() as name:
        before = os.environ.get("COOOLER_CACHE")
        os.environ["COOOLER_CACHE"] = f"{name}/cache"
        try:
            folder = write_tiny_clip(Path(name) / "clip", SIZE)
            matcher = ClipMatcher(folder)
            matcher.cosines(crops[:1], LABELS)
            session = open_session(folder / "onnx" / "vision_model.onnx")
        finally:
            if before is None:
                del os.environ["COOOLER_CACHE"]
            else:
                os.environ["COOOLER_CACHE"] = before

        def bare() -> None:
            for start in range(0, CROPS, IMAGE_BATCH):
                session.run(["image_embeds"], {"pixel_values": pixels[start : start + IMAGE_BATCH]})

        functions: dict[str, Callable[[], object]] = {
            "ours": lambda: matcher.cosines(crops, LABELS),
            "bare": bare,
            "prepare": lambda: fill_batch(crops, Preprocessing(), scratch, os.cpu_count() or 1),
        }
        times = interleaved(functions, ROUNDS)
    share = times["bare"] / times["ours"]
    return [
        Measure(
            f"{CROPS} crops x {len(LABELS)} labels, ViT-B/32-sized network with random weights",
            times["ours"],
            "bare onnxruntime session on prepared batches",
            times["bare"],
            "at most 1.11 (throughput 0.9)",
            f"throughput {share:.2f} of the bare session's; {CROPS / times['ours']:.0f} crops/s",
        ),
        Measure(
            f"preparing {CROPS} crops for it (Pillow bicubic, crop, normalise)",
            times["prepare"],
            "",
            None,
            "",
            f"{times['prepare'] / CROPS * 1e3:.2f} ms a crop",
        ),
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, one.ratio)
