"""CLIP (Radford et al. 2021) on onnxruntime: pictures against labels, as the paper verifies.

The models are the user's: a folder in the layout of the public ONNX exports, two networks whose
outputs are projected into one space. Nothing in it is trusted before it was checked. A label is fed
as it is, as the paper does; a template such as "a photo of a {label}" is ours and off by default.
"""

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.clip_networks import LabelEmbedder, Network, Vectors
from pipeline.clip_preprocess import fill_batch, read_preprocessing
from pipeline.errors import InputError
from pipeline.files import sha256_of
from pipeline.graphs import remembered_sha256, require_self_contained
from pipeline.interfaces import Embedder
from pipeline.records import RgbImage
from pipeline.vector_cache import CachedEmbedder

VISION, TEXT = "vision_model.onnx", "text_model.onnx"
TOKENIZER, PREPROCESSOR = "tokenizer.json", "preprocessor_config.json"
IMAGE_BATCH = 32
MAX_NETWORK_BYTES = (1 << 31) - 1  # one protobuf holds no more
MAX_TOKENIZER_BYTES = 64 << 20
MAX_JSON_BYTES = 1 << 20
_CHECKS_VERSION = "clip 1"


class _Files(NamedTuple):
    """Where the four files of a model are."""

    vision: Path
    text: Path
    tokenizer: Path
    preprocessor: Path


def _find(folder: Path) -> _Files:
    """The files, each in the folder or its `onnx/`. Raises InputError naming all that are missing."""
    found: list[Path] = []
    wrong: list[str] = []
    for name, limit in (
        (VISION, MAX_NETWORK_BYTES),
        (TEXT, MAX_NETWORK_BYTES),
        (TOKENIZER, MAX_TOKENIZER_BYTES),
        (PREPROCESSOR, MAX_JSON_BYTES),
    ):
        path = next((p for p in (folder / name, folder / "onnx" / name) if p.is_file()), None)
        if path is None:
            wrong.append(f"found no {name}, not in onnx/ either")
        elif path.stat().st_size > limit:
            wrong.append(f"found {name} of {path.stat().st_size:,} bytes; expected at most {limit:,}")
        else:
            found.append(path)
    if wrong:
        raise InputError(
            f"{folder}: {'; '.join(wrong)}. Expected CLIP as the public ONNX exports have it: {VISION}, "
            f"{TEXT}, {TOKENIZER} and {PREPROCESSOR}. Check clip_folder."
        )
    return _Files(*found)


class ClipMatcher:
    """CLIP as an ImageTextMatcher; the networks open at the first comparison."""

    def __init__(
        self,
        folder: Path,
        embed_cache: Path | None = None,
        threads: int | None = None,
        template: str = "{label}",
    ) -> None:
        """Look at the files and hash them, remembered while they stay as they are.

        `embed_cache` is the folder of vectors that labels are kept in, None: only in memory;
        `threads` None: as many as cores; `template` must hold `{label}`. Raises InputError when a
        file is missing, too large, or not what the layout says.
        """
        if "{label}" not in template:
            raise InputError(f"template: found {template!r}; expected a text with {{label}} in it.")
        self._arguments = (folder, embed_cache, threads, template)
        self._threads = threads
        self._template = template
        self._files = _find(folder)
        where = str(self._files.preprocessor)
        try:
            config = json.loads(self._files.preprocessor.read_bytes())
        except (ValueError, RecursionError) as error:
            raise InputError(f"{where}: found no JSON; expected a JSON object.") from error
        if not isinstance(config, dict):
            raise InputError(f"{where}: found another value; expected a JSON object.")
        self._preprocessing = read_preprocessing(config, where)
        self._vision_sha256 = _network_sha256(self._files.vision)
        text_sha256 = _network_sha256(self._files.text)
        tokenizer_sha256 = sha256_of(self._files.tokenizer.read_bytes())
        labels_sha256 = sha256_of(f"{_CHECKS_VERSION} {text_sha256} {tokenizer_sha256}".encode())
        # The name stands in lines where other characters would part the fields.
        self._name = f"CLIP ({re.sub(r'[^A-Za-z0-9._-]+', '-', folder.resolve().name)[:80]})"
        text = LabelEmbedder(self._files.text, self._files.tokenizer, labels_sha256, threads)
        self._labels: Embedder = CachedEmbedder(text, embed_cache) if embed_cache else text
        self._known: dict[str, Vectors] = {}
        self._vision: Network | None = None

    def __reduce__(self) -> tuple[type["ClipMatcher"], tuple[Path, Path | None, int | None, str]]:
        """Pickles as its place: sessions stay in their process."""
        return (ClipMatcher, self._arguments)

    @property
    def name(self) -> str:
        """CLIP and its folder's name."""
        return self._name

    @property
    def sha256(self) -> str:
        """Hash of both networks, the tokenizer, the preprocessing and the template: of all that decides."""
        parts = [self._vision_sha256, self._labels.sha256, str(self._preprocessing), self._template]
        return sha256_of(json.dumps(parts).encode())

    def cosines(self, crops: Sequence[RgbImage], labels: Sequence[str]) -> NDArray[np.float32]:
        """Cosines in [-1, 1], shape (len(crops), len(labels)).

        A cell does not depend on the other crops and labels, within 1e-5. Raises InputError for a crop
        that is no picture and for a network that is not CLIP's.
        """
        if not crops or not labels:
            return np.zeros((len(crops), len(labels)), np.float32)
        texts = self._label_vectors(labels)
        pictures = self._picture_vectors(crops)
        if texts.shape[1] != pictures.shape[1]:
            raise InputError(
                f"{self._files.vision}: found vectors of {pictures.shape[1]} numbers, "
                f"and of {texts.shape[1]} from {TEXT}; expected as many. Take both from one export."
            )
        found = pictures.astype(np.float64) @ texts.astype(np.float64).T
        return np.clip(found, -1.0, 1.0).astype(np.float32)

    def _label_vectors(self, labels: Sequence[str]) -> Vectors:
        """(n, D) unit vectors of labels, each asked for once in the life of the matcher."""
        new = [label for label in dict.fromkeys(labels) if label not in self._known]
        if new:
            texts = [self._template.replace("{label}", label) for label in new]
            self._known.update(zip(new, self._labels.embed(texts), strict=True))
        return np.stack([self._known[label] for label in labels])

    def _picture_vectors(self, crops: Sequence[RgbImage]) -> Vectors:
        """(n, D) unit vectors of crops, in batches of 32 or what the graph insists on."""
        network = self._open_vision()
        batch = network.fixed_batch or IMAGE_BATCH
        pixels = np.zeros((batch, 3, *self._preprocessing.shape_px), np.float32)
        rows = []
        for start in range(0, len(crops), batch):
            part = crops[start : start + batch]
            fill_batch(part, self._preprocessing, pixels, self._threads or os.cpu_count() or 1)
            fed = pixels if network.fixed_batch else pixels[: len(part)]
            rows.append(network.run({"pixel_values": fed})[: len(part)])
        return np.concatenate(rows)

    def _open_vision(self) -> Network:
        if self._vision is None:
            network = Network(self._files.vision, "pixel_values", [], "image_embeds", self._threads)
            shape, sides = network.shape, self._preprocessing.shape_px
            takes = network.inputs["pixel_values"].type
            fits = len(shape) == 4 and all(
                type(seen) is not int or seen == side
                for seen, side in zip(shape[1:], (3, *sides), strict=True)
            )
            if not fits or takes != "tensor(float)":
                raise network.wrong(
                    f"pixel_values of {takes} {shape}", f"tensor(float) (B, 3, {sides[0]}, {sides[1]})"
                )
            self._vision = network
        return self._vision


def _network_sha256(path: Path) -> str:
    """SHA-256 of a network that holds all its tensors; checked and hashed once while it stays as it is."""

    def check_and_hash() -> str:
        data = path.read_bytes()
        require_self_contained(data, str(path))
        return sha256_of(data)

    return remembered_sha256([path], _CHECKS_VERSION, check_and_hash)
