"""Small picture-to-picture networks with random weights: a NAFNet of two levels, and plain convolutions."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.graphs import Graph

Values = Mapping[str, tuple[str, Sequence[int | str]]]


def tiny_weights(width: int = 4, seed: int = 0) -> dict[str, NDArray[np.float32]]:
    """The weights of a NAFNet, named as official checkpoints do: blocks 1, 2, then 1, then 1, 1."""
    chance = np.random.default_rng(seed)
    made: dict[str, NDArray[np.float32]] = {}

    def add(name: str, *shape: int) -> None:
        spread = 1 / np.sqrt(max(1, int(np.prod(shape[1:]))))
        made[name] = (spread * chance.normal(size=shape)).astype(np.float32)

    def layer(name: str, out: int, into: int, side: int, bias: bool = True) -> None:
        add(f"{name}.weight", out, into, side, side)
        if bias:
            made[f"{name}.bias"] = (0.1 * chance.normal(size=out)).astype(np.float32)

    def block(name: str, c: int) -> None:
        layer(f"{name}.conv1", 2 * c, c, 1)
        layer(f"{name}.conv2", 2 * c, 1, 3)
        layer(f"{name}.sca.1", c, c, 1)
        layer(f"{name}.conv3", c, c, 1)
        layer(f"{name}.conv4", 2 * c, c, 1)
        layer(f"{name}.conv5", c, c, 1)
        for norm in ("norm1", "norm2"):
            made[f"{name}.{norm}.weight"] = (1 + 0.2 * chance.normal(size=c)).astype(np.float32)
            made[f"{name}.{norm}.bias"] = (0.1 * chance.normal(size=c)).astype(np.float32)
        for part in ("beta", "gamma"):
            add(f"{name}.{part}", 1, c, 1, 1)

    layer("intro", width, 3, 3)
    block("encoders.0.0", width)
    layer("downs.0", 2 * width, width, 2)
    block("encoders.1.0", 2 * width)
    block("encoders.1.1", 2 * width)
    layer("downs.1", 4 * width, 2 * width, 2)
    block("middle_blks.0", 4 * width)
    layer("ups.0.0", 8 * width, 4 * width, 1, bias=False)
    block("decoders.0.0", 2 * width)
    layer("ups.1.0", 4 * width, 2 * width, 1, bias=False)
    block("decoders.1.0", width)
    layer("ending", 3, width, 3)
    return made


def convolutional(
    layers: int,
    stride: int = 1,
    channels: int = 3,
    scale: float = 0.2,
    size: tuple[int, int] | None = None,
) -> bytes:
    """`layers` 3x3 convolutions and a residual, as ONNX; looks `layers` px around every pixel."""
    chance = np.random.default_rng(7)
    graph = Graph()
    value = "image"
    for _ in range(layers):
        weight = graph.constant((scale * chance.normal(size=(3, channels, 3, 3))).astype(np.float32))
        value = graph.add("Conv", value, weight, pads=[1, 1, 1, 1], strides=[stride, stride])
    graph.add(*(("Add", "image", value) if stride == 1 else ("Identity", value)), name="out")
    shape = [1, 3, *(size or ("h", "w"))]
    return graph.serialise({"image": ("float32", shape)}, {"out": ("float32", [1, 3, "oh", "ow"])})


def graph_bytes(inputs: Values, outputs: Values) -> bytes:
    """A graph that gives its first input back, under whatever types and shapes it claims."""
    graph = Graph()
    graph.add("Identity", next(iter(inputs)), name="out")
    return graph.serialise(inputs, outputs)
