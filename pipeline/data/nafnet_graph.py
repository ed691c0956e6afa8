"""NAFNet (Chen et al. 2022, "Simple Baselines for Image Restoration") as an ONNX graph.

Built from the weights of a checkpoint: width and numbers of blocks are read from their names and shapes.
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.graphs import Graph

EPSILON = 1e-6  # of the layer norms

Weights = Mapping[str, NDArray[np.float32]]


class _Network:
    """The graph under construction, and which weights were used."""

    def __init__(self, weights: Weights, what: str) -> None:
        self.graph = Graph()
        self.used: set[str] = set()
        self._weights = weights
        self._what = what

    def weight(self, name: str) -> NDArray[np.float32]:
        if name not in self._weights:
            raise InputError(
                f"{self._what}: found no weight {name}; expected a checkpoint of NAFNet. Another network's?"
            )
        self.used.add(name)
        return np.asarray(self._weights[name], np.float32)

    def convolution(self, value: str, name: str, bias: bool = True, **attributes: Any) -> str:
        inputs = [value, self.graph.constant(self.weight(f"{name}.weight"))]
        if bias:
            inputs.append(self.graph.constant(self.weight(f"{name}.bias")))
        return self.graph.add("Conv", *inputs, **attributes)

    def scaled(self, value: str, name: str) -> str:
        """A value times a weight a channel, shape (1, C, 1, 1)."""
        return self.graph.add("Mul", value, self.graph.constant(self.weight(name).reshape(1, -1, 1, 1)))

    def normalised(self, value: str, name: str) -> str:
        """Layer norm over the channels of every pixel."""
        graph = self.graph
        centred = graph.add("Sub", value, graph.add("ReduceMean", value, axes=[1]))
        variance = graph.add("ReduceMean", graph.add("Mul", centred, centred), axes=[1])
        deviation = graph.add("Sqrt", graph.add("Add", variance, graph.constant(EPSILON)))
        scaled = self.scaled(graph.add("Div", centred, deviation), f"{name}.weight")
        return graph.add("Add", scaled, graph.constant(self.weight(f"{name}.bias").reshape(1, -1, 1, 1)))

    def half(self, value: str, name: str, second: bool, depthwise: bool = False) -> str:
        """A convolution that makes one half of the channels of `name`'s, so that none need be cut apart."""
        weight, bias = self.weight(f"{name}.weight"), self.weight(f"{name}.bias")
        channels = len(weight) // 2
        part = slice(channels, None) if second else slice(channels)
        how: dict[str, Any] = {"group": channels, "pads": [1, 1, 1, 1]} if depthwise else {}
        return self.graph.add(
            "Conv", value, self.graph.constant(weight[part]), self.graph.constant(bias[part]), **how
        )

    def block(self, value: str, name: str) -> str:
        """One NAFBlock: a gated depthwise part with channel attention, then a gated pointwise part.

        SimpleGate multiplies the first half of the channels with the second.
        """
        graph = self.graph
        inner = self.normalised(value, f"{name}.norm1")
        halves = []
        for second in (False, True):
            wide = self.half(inner, f"{name}.conv1", second)
            halves.append(self.half(wide, f"{name}.conv2", second, depthwise=True))
        inner = graph.add("Mul", *halves)
        attention = self.convolution(graph.add("GlobalAveragePool", inner), f"{name}.sca.1")
        inner = self.convolution(graph.add("Mul", inner, attention), f"{name}.conv3")
        value = graph.add("Add", value, self.scaled(inner, f"{name}.beta"))
        inner = self.normalised(value, f"{name}.norm2")
        inner = graph.add("Mul", *(self.half(inner, f"{name}.conv4", second) for second in (False, True)))
        inner = self.convolution(inner, f"{name}.conv5")
        return graph.add("Add", value, self.scaled(inner, f"{name}.gamma"))

    def blocks(self, value: str, name: str) -> str:
        """All the blocks `name.0`, `name.1`, …"""
        for index in range(_count(self._weights, name)):
            value = self.block(value, f"{name}.{index}")
        return value


def _count(weights: Weights, name: str) -> int:
    """How many numbered parts a name has."""
    pattern = re.compile(rf"{re.escape(name)}\.([0-9]{{1,4}})\.")
    found = {int(match[1]) for key in weights if (match := pattern.match(key))}
    return max(found) + 1 if found else 0


def nafnet_onnx(weights: Weights, what: str = "the checkpoint") -> bytes:
    """The network from `image` to `restored`, both float32 (1, 3, H, W), RGB in [0, 1], any H and W
    that are multiples of 2 ** levels. Raises InputError when the weights are not a NAFNet's.
    """
    network = _Network(weights, what)
    graph = network.graph
    value = network.convolution("image", "intro", pads=[1, 1, 1, 1])
    skips = []
    for level in range(_count(weights, "downs")):
        value = network.blocks(value, f"encoders.{level}")
        skips.append(value)
        value = network.convolution(value, f"downs.{level}", strides=[2, 2])
    value = network.blocks(value, "middle_blks")
    for level, skip in enumerate(reversed(skips)):
        wide = network.convolution(value, f"ups.{level}.0", bias=False)
        value = graph.add("DepthToSpace", wide, blocksize=2, mode="CRD")
        value = network.blocks(graph.add("Add", value, skip), f"decoders.{level}")
    change = network.convolution(value, "ending", pads=[1, 1, 1, 1])
    graph.add("Add", "image", change, name="restored")
    unused = sorted(set(weights) - network.used)
    if unused:
        raise InputError(
            f"{what}: found {len(unused)} weights that NAFNet does not have ({', '.join(unused[:3])}); "
            "expected those of NAFNet alone. Another network's?"
        )
    shape = (1, 3, "height", "width")
    try:
        return graph.serialise({"image": ("float32", shape)}, {"restored": ("float32", shape)})
    except ValueError as error:
        raise InputError(f"{what}: its weights do not fit together ({str(error)[:200]}).") from error
