"""CLIP-shaped networks of any size with random weights, and a byte-level BPE tokenizer like CLIP's.

The vision network is a ViT (patches, class token, pre-norm blocks, projection), the text network a
causal transformer read at its first end token (Radford et al. 2021). They know nothing about
pictures and words, but they have the shapes, the operators and the files of the public exports.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.graphs import Graph

START, END = "<|startoftext|>", "<|endoftext|>"
MERGES = [("c", "a"), ("ca", "t</w>"), ("d", "e"), ("e", "r</w>"), ("de", "er</w>"), ("o", "n</w>")]

# As published with CLIP ViT-B/32.
PREPROCESSOR = {
    "crop_size": {"height": 224, "width": 224},
    "do_center_crop": True,
    "do_convert_rgb": True,
    "do_normalize": True,
    "do_rescale": True,
    "do_resize": True,
    "image_mean": [0.48145466, 0.4578275, 0.40821073],
    "image_processor_type": "CLIPImageProcessor",
    "image_std": [0.26862954, 0.26130258, 0.27577711],
    "resample": 3,
    "rescale_factor": 0.00392156862745098,
    "size": {"shortest_edge": 224},
}


@dataclass(frozen=True, slots=True)
class Size:
    """How large a pair of networks is; ViT-B/32 is 768 wide with 12 layers and 12 heads, patches of 32 px."""

    width: int = 16
    layers: int = 1
    heads: int = 2
    dim: int = 8
    side_px: int = 224
    patch_px: int = 32


class _Transformer:
    """The parts that both networks share, with weights from one seeded generator."""

    def __init__(self, size: Size, seed: int) -> None:
        self.graph = Graph()
        self.size = size
        self._chance = np.random.default_rng(seed)

    def weights(self, *shape: int) -> str:
        n_in = shape[0] if len(shape) == 2 else int(np.prod(shape[1:]))
        values = self._chance.normal(size=shape) / np.sqrt(max(n_in, 1))
        return self.graph.constant(values.astype(np.float32))

    def norm(self, x: str) -> str:
        ones = np.ones(self.size.width, np.float32)
        scale, bias = self.graph.constant(ones), self.graph.constant(ones * 0.1)
        return self.graph.add("LayerNormalization", x, scale, bias, axis=-1, epsilon=1e-5)

    def block(self, x: str, mask: str | None) -> str:
        """One pre-norm block; `mask` is added to the attention's logits."""
        graph, width, heads = self.graph, self.size.width, self.size.heads
        split = graph.constant([0, 0, heads, width // heads])
        y = self.norm(x)
        query, key, value = (
            graph.add("Reshape", graph.add("MatMul", y, self.weights(width, width)), split) for _ in range(3)
        )
        query, value = (graph.add("Transpose", part, perm=[0, 2, 1, 3]) for part in (query, value))
        key = graph.add("Transpose", key, perm=[0, 2, 3, 1])
        logits = graph.add("Mul", graph.add("MatMul", query, key), graph.constant((width / heads) ** -0.5))
        if mask is not None:
            logits = graph.add("Add", logits, mask)
        seen = graph.add("MatMul", graph.add("Softmax", logits, axis=-1), value)
        merged = graph.add(
            "Reshape", graph.add("Transpose", seen, perm=[0, 2, 1, 3]), graph.constant([0, 0, width])
        )
        x = graph.add("Add", x, graph.add("MatMul", merged, self.weights(width, width)))
        raised = graph.add("MatMul", self.norm(x), self.weights(width, 4 * width))
        gate = graph.add("Sigmoid", graph.add("Mul", raised, graph.constant(1.702)))  # CLIP's QuickGELU
        lowered = graph.add("MatMul", graph.add("Mul", raised, gate), self.weights(4 * width, width))
        return graph.add("Add", x, lowered)


def vision_network(size: Size, batch: int | str = "batch", output: str = "image_embeds") -> bytes:
    """`pixel_values` (B, 3, side, side) to `image_embeds` (B, dim)."""
    made = _Transformer(size, 1)
    graph, width, patches = made.graph, size.width, (size.side_px // size.patch_px) ** 2
    x = graph.add(
        "Conv",
        "pixel_values",
        made.weights(width, 3, size.patch_px, size.patch_px),
        kernel_shape=[size.patch_px] * 2,
        strides=[size.patch_px] * 2,
    )
    x = graph.add("Reshape", x, graph.constant([0, width, patches]))
    x = graph.add("Transpose", x, perm=[0, 2, 1])
    rows = graph.add("Shape", "pixel_values", start=0, end=1)
    token = graph.add("Concat", rows, graph.constant([1, width]), axis=0)
    token = graph.add("Expand", made.weights(1, 1, width), token)
    x = graph.add("Add", graph.add("Concat", token, x, axis=1), made.weights(1, patches + 1, width))
    x = made.norm(x)
    for _ in range(size.layers):
        x = made.block(x, None)
    first = graph.add("Gather", x, graph.constant(np.array(0)), axis=1)
    graph.add("MatMul", made.norm(first), made.weights(width, size.dim), name=output)
    sides = [size.side_px, size.side_px]
    return graph.serialise(
        {"pixel_values": ("float32", [batch, 3, *sides])}, {output: ("float32", [batch, size.dim])}
    )


def text_network(
    size: Size,
    vocabulary: int,
    batch: int | str = "batch",
    tokens: int | str = "tokens",
    mask: bool = False,
    output: str = "text_embeds",
) -> bytes:
    """`input_ids` (B, T) (and `attention_mask`) to `text_embeds` (B, dim); the end token has the last id."""
    made = _Transformer(size, 2)
    graph, width = made.graph, size.width
    length = graph.add("Shape", "input_ids", start=1, end=2)
    zero = graph.constant([0])
    places = graph.add("Slice", made.weights(77, width), zero, length, zero)
    x = graph.add("Add", graph.add("Gather", made.weights(vocabulary, width), "input_ids"), places)
    square = graph.add("Concat", length, length, axis=0)
    ahead = graph.add("Expand", graph.constant(-1e9), square)
    ahead = graph.add("Trilu", ahead, graph.constant(np.array(1)), upper=1)
    if mask:
        absent = graph.add("Sub", graph.constant(1.0), graph.add("Cast", "attention_mask", to=1))
        absent = graph.add("Unsqueeze", absent, graph.constant([1, 2]))
        ahead = graph.add("Add", ahead, graph.add("Mul", absent, graph.constant(-1e9)))
    for _ in range(size.layers):
        x = made.block(x, ahead)
    ends = graph.add("Equal", "input_ids", graph.constant(np.array(vocabulary - 1)))
    at = graph.add("ArgMax", graph.add("Cast", ends, to=6), axis=1, keepdims=1)
    pooled = graph.add("GatherND", x, at, batch_dims=1)
    graph.add("MatMul", made.norm(pooled), made.weights(width, size.dim), name=output)
    inputs = {"input_ids": ("int64", [batch, tokens])}
    if mask:
        inputs["attention_mask"] = ("int64", [batch, tokens])
    return graph.serialise(inputs, {output: ("float32", [batch, size.dim])})


def tokenizer_json() -> tuple[str, int]:
    """A tokenizer.json built like CLIP's, with few merges, and the size of its vocabulary."""
    import tokenizers
    from tokenizers import decoders, models, normalizers, pre_tokenizers, processors

    letters = sorted(pre_tokenizers.ByteLevel.alphabet())
    words = [*letters, *(f"{letter}</w>" for letter in letters), *("".join(pair) for pair in MERGES)]
    vocabulary = {word: at for at, word in enumerate([*words, START, END])}
    made = tokenizers.Tokenizer(
        models.BPE(vocabulary, MERGES, unk_token=END, end_of_word_suffix="</w>", fuse_unk=False)
    )
    made.normalizer = normalizers.Sequence([normalizers.NFC(), normalizers.Lowercase()])
    pattern = tokenizers.Regex(r"'s|'t|'re|'ve|'m|'ll|'d|[\p{L}]+|[\p{N}]|[^\s\p{L}\p{N}]+")
    made.pre_tokenizer = pre_tokenizers.Sequence(
        [
            pre_tokenizers.Split(pattern, behavior="removed", invert=True),
            pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False),
        ]
    )
    made.post_processor = processors.RobertaProcessing(
        (END, vocabulary[END]), (START, vocabulary[START]), trim_offsets=False, add_prefix_space=False
    )
    made.decoder = decoders.ByteLevel()
    made.add_special_tokens([START, END])
    return made.to_str(), len(vocabulary)


def write_tiny_clip(folder: Path, size: Size | None = None, below: str = "onnx", mask: bool = False) -> Path:
    """Write the four files of a model; the networks go into the subfolder `below`. Gives the folder back."""
    size = size or Size()
    tokenizer, vocabulary = tokenizer_json()
    networks = folder / below
    networks.mkdir(parents=True, exist_ok=True)
    (networks / "vision_model.onnx").write_bytes(vision_network(size))
    (networks / "text_model.onnx").write_bytes(text_network(size, vocabulary, mask=mask))
    (folder / "tokenizer.json").write_text(tokenizer, encoding="utf-8")
    (folder / "preprocessor_config.json").write_text(json.dumps(PREPROCESSOR), encoding="utf-8")
    return folder


def noisy_pictures(count: int, seed: int = 0, least_px: int = 30) -> list[NDArray[np.uint8]]:
    """Pictures (H, W, 3) of `least_px` to 400 px a side: random blocks, so that they differ, and noise."""
    chance = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        height, width = (int(side) for side in chance.integers(least_px, 400, 2))
        coarse = chance.integers(0, 224, (6, 6, 3))
        rows, columns = np.arange(height) * 6 // height, np.arange(width) * 6 // width
        picture = coarse[rows][:, columns] + chance.integers(0, 32, (height, width, 3))
        made.append(picture.astype(np.uint8))
    return made
