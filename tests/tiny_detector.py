"""Object detectors of the two layouts, small enough to check by hand: cells of a grid, classes are colours.

A cell is a box of 32 px of the input; its scores are its mean red, green and blue.
"""

from pathlib import Path

import numpy as np
import onnx

from pipeline.graphs import Graph

COLOURS = ("red", "green", "blue")
CELL_PX = 32


def grid_network(side_px: int = 128, *, batch: int | str = 1, names: str = "") -> bytes:
    """Layout *raw*: `images` (1, 3, side, side) to `output0` (1, 7, cells)."""
    graph, cells = Graph(), (side_px // CELL_PX) ** 2
    scores = graph.add("AveragePool", "images", kernel_shape=[CELL_PX] * 2, strides=[CELL_PX] * 2)
    scores = graph.add("Reshape", scores, graph.constant([1, 3, cells]))
    middles = np.arange(side_px // CELL_PX) * CELL_PX + CELL_PX / 2
    y, x = (axis.ravel() for axis in np.meshgrid(middles, middles, indexing="ij"))
    sizes = np.full(cells, float(CELL_PX))
    boxes = graph.constant(np.stack([x, y, sizes, sizes])[None].astype(np.float32))
    graph.add("Concat", boxes, scores, name="output0", axis=1)
    return with_names(
        graph.serialise(
            {"images": ("float32", [batch, 3, side_px, side_px])},
            {"output0": ("float32", [batch, 7, cells])},
        ),
        names,
    )


def constant_network(
    outputs: dict[str, np.ndarray],
    *,
    inputs: tuple[str, ...] = ("images",),
    shape: tuple[int, ...] = (1, 3, 64, 64),
) -> bytes:
    """A network that always gives these outputs."""
    graph = Graph()
    # Something of the input must reach the outputs, else it would not be one.
    zeros = [
        graph.add("Mul", graph.add("ReduceMean", name, keepdims=0), graph.constant(0.0)) for name in inputs
    ]
    nothing = zeros[0] if len(zeros) == 1 else graph.add("Add", *zeros)
    for name, value in outputs.items():
        kept = graph.constant(value, str(value.dtype))
        if value.dtype == np.float32:
            graph.add("Add", kept, nothing, name=name)
        else:
            graph.add("Identity", kept, name=name)
    return graph.serialise(
        {name: ("float32", list(shape)) for name in inputs},
        {name: (str(value.dtype), list(value.shape)) for name, value in outputs.items()},
    )


def suppressed_network(boxes: np.ndarray, scores: np.ndarray, labels: np.ndarray, side_px: int = 64) -> bytes:
    """Layout *suppressed*, with these answers."""
    outputs = {
        "boxes": boxes.astype(np.float32),
        "scores": scores.astype(np.float32),
        "labels": labels.astype(np.int64),
    }
    return constant_network(outputs, shape=(1, 3, side_px, side_px))


def with_names(network: bytes, names: str) -> bytes:
    """The network with `names` in its metadata, when there are any."""
    if not names:
        return network
    model = onnx.load_model_from_string(network)
    onnx.helper.set_model_props(model, {"names": names})
    return bytes(model.SerializeToString(deterministic=True))


def write_network(path: Path, network: bytes) -> Path:
    """Write it; gives the path back."""
    path.write_bytes(network)
    return path
