"""CLIP's two networks and its tokenizer on onnxruntime, every claim of the files checked."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.graphs import open_session

CONTEXT_TOKENS = 77  # the length that CLIP was trained with
TEXT_BATCH = 16
MAX_WIDTH = 8192
MAX_FIXED_BATCH = 256

Vectors = NDArray[np.float32]


class Network:
    """One of the two networks: what it takes, and its one output, (B, D) vectors."""

    def __init__(self, path: Path, takes: str, also: Sequence[str], gives: str, threads: int | None) -> None:
        """Open the session. Raises InputError when the network has other inputs or outputs."""
        self._path, self._takes, self._gives = path, takes, gives
        self._session = open_session(path, threads)
        inputs = {value.name: value for value in self._session.get_inputs()}
        outputs = {value.name: value for value in self._session.get_outputs()}
        if takes not in inputs or not set(inputs) <= {takes, *also} or gives not in outputs:
            optional = f" (and {', '.join(also)})" if also else ""
            raise InputError(
                f"{path}: found a network from {', '.join(inputs)} to {', '.join(outputs)}; expected from "
                f"{takes}{optional} to {gives}, the projected vectors. Export CLIP with its projections."
            )
        self.inputs = inputs
        self.shape: list[Any] = list(inputs[takes].shape)
        # How many rows the graph insists on; None: any number.
        self.fixed_batch = self.shape[0] if self.shape and type(self.shape[0]) is int else None
        if self.fixed_batch is not None and not 1 <= self.fixed_batch <= MAX_FIXED_BATCH:
            raise self.wrong(f"batches of {self.fixed_batch}", f"any, or 1 to {MAX_FIXED_BATCH}")

    def wrong(self, found: str, expected: str) -> InputError:
        """An error that names the file."""
        return InputError(f"{self._path}: found {found}; expected {expected}. Export the model again.")

    def run(self, feeds: dict[str, NDArray[Any]]) -> Vectors:
        """Unit vectors, shape (B, D). Raises InputError when the network cannot be run or gives nonsense."""
        rows = len(feeds[self._takes])
        try:
            made: Any = self._session.run([self._gives], feeds)[0]
        except Exception as error:  # onnxruntime's exceptions share no base but Exception
            raise self.wrong(f"that it cannot be run ({str(error)[:200]})", "a CLIP network") from error
        shape: Any = getattr(made, "shape", ())
        if len(shape) != 2 or shape[0] != rows or not 1 <= shape[1] <= MAX_WIDTH or made.dtype.kind != "f":
            raise self.wrong(f"{self._gives} of shape {shape}", f"({rows}, D) floats, D at most {MAX_WIDTH}")
        vectors = made.astype(np.float64)
        if not np.isfinite(vectors).all():
            raise self.wrong(f"{self._gives} that are not finite", "finite numbers")
        lengths = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
        unit: Vectors = (vectors / lengths).astype(np.float32)
        return unit


class LabelEmbedder:
    """The text network with its tokenizer, as an Embedder, so that label vectors can be cached."""

    def __init__(self, text: Path, tokenizer: Path, sha256: str, threads: int | None) -> None:
        """The files are opened at the first `embed`; `sha256` is the hash of both."""
        self._text_path, self._tokenizer_path = text, tokenizer
        self._sha256 = sha256
        self._threads = threads
        self._network: Network | None = None
        self._tokenizer: Any = None

    @property
    def name(self) -> str:
        """What the network is."""
        return "CLIP text network"

    @property
    def sha256(self) -> str:
        """The hash that was given."""
        return self._sha256

    def embed(self, texts: Sequence[str]) -> Vectors:
        """Unit vectors, shape (len(texts), D); every text is padded to the same length."""
        if not texts:
            return np.empty((0, 0), np.float32)
        network = self._open()
        # A lone surrogate, which JSON can carry, has no UTF-8 that the tokenizer could read.
        readable = [text.encode("utf-8", "replace").decode() for text in texts]
        coded = self._tokenizer.encode_batch(readable)
        kinds = {"tensor(int64)": np.int64, "tensor(int32)": np.int32}
        columns: dict[str, list[list[int]]] = {
            "input_ids": [one.ids for one in coded],
            "attention_mask": [one.attention_mask for one in coded],
        }
        feeds = {name: np.array(columns[name], kinds[value.type]) for name, value in network.inputs.items()}
        batch = network.fixed_batch or TEXT_BATCH
        rows = []
        for start in range(0, len(texts), batch):
            part = {name: value[start : start + batch] for name, value in feeds.items()}
            if network.fixed_batch and len(part["input_ids"]) < batch:
                part = {name: np.resize(value, (batch, value.shape[1])) for name, value in part.items()}
            rows.append(network.run(part)[: len(texts) - start])
        return np.concatenate(rows)

    def _open(self) -> Network:
        if self._network is not None:
            return self._network
        network = Network(self._text_path, "input_ids", ["attention_mask"], "text_embeds", self._threads)
        kinds = {value.type for value in network.inputs.values()}
        if not kinds <= {"tensor(int64)", "tensor(int32)"} or len(network.shape) != 2:
            raise network.wrong(f"inputs of {', '.join(sorted(kinds))} {network.shape}", "(B, T) integers")
        fixed = network.shape[1]
        if type(fixed) is int and not 3 <= fixed <= 1024:
            raise network.wrong(f"a context of {fixed} tokens", "3 to 1024")
        self._tokenizer = clip_tokenizer(
            self._tokenizer_path, fixed if type(fixed) is int else CONTEXT_TOKENS
        )
        self._network = network
        return network


def clip_tokenizer(path: Path, context: int) -> Any:
    """The tokenizer, cutting and padding every text to `context` tokens.

    Padded with the end token, as OpenAI's configuration has it: the network reads its vector at
    the first end token and looks only backwards, so what comes after is never seen.
    """
    import tokenizers

    try:
        tokenizer = tokenizers.Tokenizer.from_str(path.read_bytes().decode())
        tokenizer.no_padding()
        tokenizer.enable_truncation(context)
        ends = tokenizer.encode("").ids
    except Exception as error:  # tokenizers raises plain Exception
        raise InputError(f"{path}: not usable ({str(error)[:200]}); expected CLIP's tokenizer.") from error
    if len(ends) != 2:
        raise InputError(
            f"{path}: found {len(ends)} tokens for an empty text; expected a start and an end token. "
            "Save the tokenizer again with its post-processor."
        )
    tokenizer.enable_padding(length=context, pad_id=ends[1], pad_token=tokenizer.id_to_token(ends[1]))
    return tokenizer
