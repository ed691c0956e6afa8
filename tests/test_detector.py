"""Detectors that the user has: both layouts by hand, and files that are not what they say."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.data.detector import Detector, DetectorSettings, detected_boxes, letterbox, read_names
from pipeline.errors import CooolerError, InputError
from pipeline.records import Box, RgbImage
from tests.tiny_detector import (
    COLOURS,
    constant_network,
    grid_network,
    suppressed_network,
    with_names,
    write_network,
)


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COOOLER_CACHE", str(tmp_path / "cache"))


def _picture(width: int = 256, height: int = 128) -> RgbImage:
    """Black, with a red square at (64, 0) and a dim blue one at (192, 64), 64 px each."""
    rgb = np.zeros((height, width, 3), np.uint8)
    rgb[0:64, 64:128, 0] = 255
    rgb[64:128, 192:256, 2] = 128
    return rgb


@given(st.integers(1, 400), st.integers(1, 400), st.sampled_from([32, 64, 160]))
def test_a_picture_lies_whole_and_centred_in_the_input(width: int, height: int, side: int) -> None:
    pixels, fit = letterbox(np.full((height, width, 3), 255, np.uint8), side, side)
    assert pixels.shape == (1, 3, side, side) and pixels.dtype == np.float32
    white = np.argwhere(pixels[0, 0] == 1)
    (top, left), (bottom, right) = white.min(axis=0), white.max(axis=0) + 1
    assert (left, top) == (fit.left_px, fit.top_px)
    assert abs(right - left - max(1, width * fit.scale)) <= 1
    assert abs(bottom - top - max(1, height * fit.scale)) <= 1
    assert abs(left - (side - right)) <= 1 and abs(top - (side - bottom)) <= 1
    assert set(np.unique(pixels)) <= {np.float32(114) / np.float32(255), np.float32(1)}


def test_the_raw_layout_by_hand(tmp_path: Path) -> None:
    """256 x 128 px lie in 128 x 128 at half the size, 32 px down: the cells are 64 px of the picture."""
    detector = Detector(write_network(tmp_path / "grid.onnx", grid_network()), COLOURS)
    assert detector.layout == "raw"
    found = detector.find(_picture(), DetectorSettings(min_score=0.48))
    assert [(box, label) for box, _, label in found] == [
        (Box(64, 0, 128, 64), "red"),
        (Box(192, 64, 256, 128), "blue"),
    ]
    assert [score for _, score, _ in found] == pytest.approx([1.0, 128 / 255], abs=1e-3)


def test_overlaps_of_one_class_are_suppressed_and_of_two_are_not(tmp_path: Path) -> None:
    # Three boxes on one another (0.9 and 0.8 of class a, 0.7 of class b), one elsewhere, one too unsure.
    rows = [
        [20, 20, 20, 20, 0.9, 0],
        [21, 20, 20, 20, 0.8, 0],
        [20, 20, 20, 20, 0, 0.7],
        [50, 50, 8, 8, 0.6, 0],
        [10, 50, 8, 8, 0.1, 0],
    ]
    table = np.array(rows, np.float32).T[None]
    detector = Detector(write_network(tmp_path / "n.onnx", constant_network({"out": table})), ("a", "b"))
    found = detector.find(np.zeros((64, 64, 3), np.uint8), DetectorSettings())
    assert [(label, round(score, 2)) for _, score, label in found] == [("a", 0.9), ("b", 0.7), ("a", 0.6)]


@pytest.mark.parametrize("leading", [False, True], ids=["plain", "leading 1"])
def test_the_suppressed_layout_by_hand(tmp_path: Path, leading: bool) -> None:
    boxes = np.array([[8, 24, 24, 40], [-9e30, 0, 9e30, 64], [30, 30, 30, 40], [0, 0, 5, 5]])
    scores, labels = np.array([0.9, 0.5, 0.8, 0.1]), np.array([1, 0, 0, 0])
    if leading:
        boxes, scores, labels = boxes[None], scores[None], labels[None]
    network = suppressed_network(boxes, scores, labels)
    detector = Detector(write_network(tmp_path / "n.onnx", network), ("a", "b"))
    assert detector.layout == "suppressed"
    found = detector.find(np.zeros((64, 128, 3), np.uint8), DetectorSettings())  # half size, 16 px down
    assert [(box, label) for box, _, label in found] == [
        (Box(16, 16, 48, 48), "b"),
        (Box(0, 0, 128, 64), "a"),  # cut off at the picture's edges
    ]
    assert [score for _, score, _ in found] == pytest.approx([0.9, 0.5])


def test_only_every_nth_frame_is_looked_at(tmp_path: Path) -> None:
    detector = Detector(write_network(tmp_path / "grid.onnx", grid_network()), COLOURS)
    found = detected_boxes([_picture()] * 7, detector, DetectorSettings(min_score=0.9, every_frames=3))
    assert [(one.frame_index, one.label) for one in found] == [(0, "red"), (3, "red"), (6, "red")]


@pytest.mark.parametrize(
    "names",
    [
        "{0: 'red', 1: 'green', 2: 'blue'}",
        '["red", "green", "blue"]',
        '{"0": "red", "1": "green", "2": "blue"}',
    ],
)
def test_names_come_from_the_file_or_its_metadata(tmp_path: Path, names: str) -> None:
    path = write_network(tmp_path / "grid.onnx", grid_network(names=names))
    assert Detector(path).names == COLOURS
    assert Detector(path, ("a", "b", "c")).names == ("a", "b", "c")
    text = tmp_path / "names.txt"
    text.write_text("\ufeffred\ngreen \nblue\n\n", encoding="utf-8")
    assert read_names(text) == COLOURS


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"a\n\nb", b"\xff\xfe"], ids=["empty", "blank", "gap", "bytes"]
)
def test_names_that_are_none_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "names.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"names\.txt"):
        read_names(path)
    with pytest.raises(InputError):
        read_names(tmp_path)


_BOX = np.zeros((1, 6, 3), np.float32)
_HOSTILE = {
    "no onnx": (b"nothing of the kind", "no ONNX"),
    "two inputs": (constant_network({"out": _BOX}, inputs=("a", "b")), "2 inputs"),
    "two outputs": (constant_network({"out": _BOX, "more": _BOX}), "out, more"),
    "grey pictures": (constant_network({"out": _BOX}, shape=(1, 1, 64, 64)), "an input of"),
    "a batch of two": (constant_network({"out": _BOX}, shape=(2, 3, 64, 64)), "an input of"),
    "too large": (constant_network({"out": _BOX}, shape=(1, 3, 64, 4096)), "an input of"),
    "flat": (constant_network({"out": _BOX}, shape=(1, 64)), "an input of"),
    "another number of classes": (constant_network({"out": np.zeros((1, 8, 3), np.float32)}), r"\(1, 6, N\)"),
    "turned": (constant_network({"out": np.zeros((1, 3, 6), np.float32)}), r"\(1, 6, N\)"),
    "two dimensions": (constant_network({"out": np.zeros((6, 3), np.float32)}), r"\(1, 6, N\)"),
}


@pytest.mark.parametrize(("network", "said"), _HOSTILE.values(), ids=_HOSTILE)
def test_networks_of_another_layout_are_refused(tmp_path: Path, network: bytes, said: str) -> None:
    path = write_network(tmp_path / "bad.onnx", network)
    with pytest.raises(InputError, match=said) as caught:
        Detector(path, ("a", "b"))
    assert "bad.onnx" in str(caught.value)


def _raw(**changed: float) -> bytes:
    table = np.array([[[20], [20], [9], [9], [0.9], [0.1]]], np.float32)
    table[0, int(next(iter(changed))[1:]), 0] = next(iter(changed.values()))
    return constant_network({"out": table})


def _row(box: list[float], score: float, label: int) -> bytes:
    return suppressed_network(np.array([box]), np.array([score]), np.array([label]))


_ANSWERS = {
    "a side that is no number": (_raw(_0=np.nan), "not finite"),
    "an endless score": (_raw(_4=np.inf), "not finite"),
    "scores before the sigmoid": (_raw(_4=7.5), "0 to 1"),
    "an unknown label": (_row([0, 0, 9, 9], 0.9, 2), "labels from 2"),
    "a label under 0": (_row([0, 0, 9, 9], 0.9, -1), "labels from -1"),
    "boxes that are no numbers": (_row([0, 0, np.nan, 9], 0.9, 0), "not finite"),
    "fewer scores than boxes": (suppressed_network(np.zeros((2, 4)), np.zeros(1), np.zeros(1)), r"\(N, 4\)"),
    "five sides": (suppressed_network(np.zeros((1, 5)), np.zeros(1), np.zeros(1)), r"\(N, 4\)"),
    "scalars": (suppressed_network(np.zeros(()), np.zeros(()), np.zeros(())), r"\(N, 4\)"),
}


@pytest.mark.parametrize(("network", "said"), _ANSWERS.values(), ids=_ANSWERS)
def test_answers_that_are_none_are_refused(tmp_path: Path, network: bytes, said: str) -> None:
    detector = Detector(write_network(tmp_path / "bad.onnx", network), ("a", "b"))
    with pytest.raises(InputError, match=said):
        detector.find(np.zeros((64, 64, 3), np.uint8), DetectorSettings())


def test_no_row_is_no_box(tmp_path: Path) -> None:
    for network in (
        suppressed_network(np.zeros((0, 4)), np.zeros(0), np.zeros(0)),
        constant_network({"out": np.zeros((1, 6, 0), np.float32)}),
    ):
        detector = Detector(write_network(tmp_path / "empty.onnx", network), ("a", "b"))
        assert detector.find(np.zeros((64, 64, 3), np.uint8), DetectorSettings()) == []


@pytest.mark.parametrize("names", ["", "{0: 'a', 2: 'b'}", "[1, 2, 3]", "__import__('os')", "[" * 5000, "{}"])
def test_metadata_without_names_is_refused(tmp_path: Path, names: str) -> None:
    path = write_network(tmp_path / "n.onnx", with_names(grid_network(), names))
    with pytest.raises(InputError, match="names"):
        Detector(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CooolerError, match="no such file"):
        Detector(tmp_path / "none.onnx", ("a",))
