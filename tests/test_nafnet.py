"""NAFNet's graph against the paper's formulas in numpy, and networks that must be refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.data.export_nafnet import main as export
from pipeline.data.nafnet import TiledNetwork, network_sha256
from pipeline.data.nafnet_graph import nafnet_onnx
from pipeline.data.tiles import Tiling, in_tiles
from pipeline.errors import CooolerError, InputError
from pipeline.graphs import open_session
from tests.tiny_nafnet import convolutional, graph_bytes, tiny_weights

Floats = NDArray[np.float64]


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COOOLER_CACHE", str(tmp_path / "cache"))


def conv(x: Floats, weight: Floats, bias: Floats | None, pad: int = 0, stride: int = 1) -> Floats:
    """x (C, H, W) by weight (O, C, k, k); depthwise where the weight has one input channel for many."""
    size = weight.shape[-1]
    x = np.pad(x, ((0, 0), (pad, pad), (pad, pad)))
    seen = np.lib.stride_tricks.sliding_window_view(x, (size, size), (1, 2))[:, ::stride, ::stride]
    if weight.shape[1] == 1 and len(x) > 1:
        made = np.einsum("chwij,cij->chw", seen, weight[:, 0])
    else:
        made = np.einsum("chwij,ocij->ohw", seen, weight)
    return made if bias is None else made + bias[:, None, None]


def reference(weights: dict[str, NDArray[np.float32]], x: Floats) -> Floats:
    """NAFNet as the paper draws it (Chen et al. 2022, figures 2 to 4), two levels."""
    w = {name: value.astype(np.float64) for name, value in weights.items()}

    def layer_norm(v: Floats, name: str) -> Floats:
        scaled = (v - v.mean(0)) / np.sqrt(v.var(0) + 1e-6)
        return scaled * w[f"{name}.weight"][:, None, None] + w[f"{name}.bias"][:, None, None]

    def gate(v: Floats) -> Floats:
        return v[: len(v) // 2] * v[len(v) // 2 :]

    def block(v: Floats, name: str) -> Floats:
        def layer(u: Floats, part: str, pad: int = 0) -> Floats:
            return conv(u, w[f"{name}.{part}.weight"], w[f"{name}.{part}.bias"], pad)

        u = gate(layer(layer(layer_norm(v, f"{name}.norm1"), "conv1"), "conv2", 1))
        u = layer(u * layer(u.mean((1, 2), keepdims=True), "sca.1"), "conv3")
        y = v + u * w[f"{name}.beta"][0]
        u = layer(gate(layer(layer_norm(y, f"{name}.norm2"), "conv4")), "conv5")
        return y + u * w[f"{name}.gamma"][0]

    def shuffled(v: Floats) -> Floats:
        channels, height, width = v.shape
        parts = v.reshape(channels // 4, 2, 2, height, width).transpose(0, 3, 1, 4, 2)
        return parts.reshape(channels // 4, height * 2, width * 2)

    v = conv(x, w["intro.weight"], w["intro.bias"], 1)
    first = block(v, "encoders.0.0")
    second = block(
        block(conv(first, w["downs.0.weight"], w["downs.0.bias"], stride=2), "encoders.1.0"), "encoders.1.1"
    )
    v = block(conv(second, w["downs.1.weight"], w["downs.1.bias"], stride=2), "middle_blks.0")
    v = block(shuffled(conv(v, w["ups.0.0.weight"], None)) + second, "decoders.0.0")
    v = block(shuffled(conv(v, w["ups.1.0.weight"], None)) + first, "decoders.1.0")
    return x + conv(v, w["ending.weight"], w["ending.bias"], 1)


def test_the_graph_is_the_papers_network() -> None:
    weights = tiny_weights()
    x = np.random.default_rng(1).random((1, 3, 8, 12), np.float32)
    found = open_session(nafnet_onnx(weights), 1).run(None, {"image": x})[0][0]
    expected = reference(weights, x[0].astype(np.float64))
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert np.abs(expected - x[0]).max() > 0.1  # it does something


def test_a_nafnet_runs_in_tiles_on_any_size(tmp_path: Path) -> None:
    path = tmp_path / "tiny.onnx"
    path.write_bytes(nafnet_onnx(tiny_weights()))
    network = TiledNetwork(path, Tiling(64, 64, 32, 32))
    for height, width in ((1, 1), (70, 45), (64, 200)):
        rgb = np.random.default_rng(2).integers(0, 256, (height, width, 3), np.uint8)
        made = network(rgb)
        assert made.shape == rgb.shape and made.dtype == np.uint8
        np.testing.assert_array_equal(made, network(rgb))


def test_tiles_equal_the_whole_for_a_network_that_looks_near(tmp_path: Path) -> None:
    """Three 3x3 convolutions with a residual look 3 px far; the margin is 16 px."""
    path = tmp_path / "near.onnx"
    path.write_bytes(convolutional(layers=3))
    rgb = np.random.default_rng(3).integers(0, 256, (384, 544, 3), np.uint8)
    fed = np.ascontiguousarray(rgb.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    session = open_session(path, 1)
    whole = session.run(None, {"image": fed})[0][0].transpose(1, 2, 0)

    def one(tile: NDArray[np.float32]) -> NDArray[np.float32]:
        made = session.run(None, {"image": np.ascontiguousarray(tile.transpose(2, 0, 1)[None])})[0]
        return np.asarray(made[0].transpose(1, 2, 0), np.float32)

    tiled = in_tiles(rgb.astype(np.float32) / np.float32(255), one, Tiling())
    np.testing.assert_allclose(tiled, whole, atol=1e-5)
    expected = np.rint(np.clip(whole, 0, 1) * 255)
    assert np.abs(TiledNetwork(path)(rgb) - expected).max() <= 1  # a half may round either way


@pytest.mark.parametrize(
    ("name", "value"),
    [("ending.weight", None), ("extra.weight", (3,)), ("encoders.0.7.conv1.weight", (8, 4, 1, 1))],
)
def test_weights_of_another_network_are_refused(name: str, value: tuple[int, ...] | None) -> None:
    weights = tiny_weights()
    if value is None:
        del weights[name]
    else:
        weights[name] = np.zeros(value, np.float32)
    with pytest.raises(InputError, match="found"):
        nafnet_onnx(weights)


FLOAT = "float32"
ANY = [1, 3, "h", "w"]
HOSTILE: dict[str, tuple[Callable[[], bytes], str]] = {
    "text": (lambda: b"not a network", "no ONNX model"),
    "empty": (lambda: b"", "0 bytes"),
    "uint8": (lambda: graph_bytes({"image": ("uint8", ANY)}, {"out": ("uint8", ANY)}), r"tensor\(uint8\)"),
    "grey": (lambda: graph_bytes({"image": (FLOAT, [1, 1, "h", "w"])}, {"out": (FLOAT, ANY)}), r"1, 1, 'h'"),
    "rank": (lambda: graph_bytes({"image": (FLOAT, [3, "h", "w"])}, {"out": (FLOAT, ANY)}), r"3, 'h', 'w'"),
    "batch": (lambda: graph_bytes({"image": (FLOAT, [4, 3, "h", "w"])}, {"out": (FLOAT, ANY)}), r"4, 3"),
    "odd": (lambda: graph_bytes({"image": (FLOAT, [1, 3, 100, 100])}, {"out": (FLOAT, ANY)}), "100x100 px"),
    "huge": (lambda: graph_bytes({"image": (FLOAT, [1, 3, 4096, 4096])}, {"out": (FLOAT, ANY)}), "4096x4096"),
    "two": (
        lambda: graph_bytes({"image": (FLOAT, ANY), "more": (FLOAT, ANY)}, {"out": (FLOAT, ANY)}),
        "2 inputs",
    ),
    "smaller": (lambda: convolutional(layers=1, stride=2), r"shape \(1, 3, 128, 128\)"),
    "nan": (lambda: convolutional(layers=1, scale=float("nan")), "not finite"),
    "fails": (lambda: convolutional(layers=1, channels=5), "cannot be run|cannot load"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_networks_that_are_none_from_pictures_to_pictures(tmp_path: Path, kind: str) -> None:
    make, message = HOSTILE[kind]
    path = tmp_path / "hostile.onnx"
    path.write_bytes(make())
    with pytest.raises(CooolerError, match=message):
        network_sha256(path)
        TiledNetwork(path)


def test_a_network_of_fixed_size_gets_tiles_of_that_size(tmp_path: Path) -> None:
    path = tmp_path / "fixed.onnx"
    path.write_bytes(convolutional(layers=2, size=(96, 128)))
    network = TiledNetwork(path)
    assert (network.tiling.height_px, network.tiling.width_px) == (96, 128)
    assert network(np.zeros((150, 210, 3), np.uint8)).shape == (150, 210, 3)


def test_the_export_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export([]) == 2
    code = export([str(tmp_path / "no.pth"), str(tmp_path / "out.onnx")])
    said = capsys.readouterr().err
    assert (code, "expected" in said) in {(3, True), (1, True)}  # without PyTorch, and with it
    assert not (tmp_path / "out.onnx").exists()
