"""CLIP's cosines against the bare networks, and folders that it must refuse."""

import json
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.clip import ClipMatcher
from pipeline.clip_preprocess import Preprocessing, fill_batch
from pipeline.errors import InputError
from pipeline.graphs import Graph, open_session
from pipeline.records import RgbImage
from tests.tiny_clip import (
    Size,
    noisy_pictures,
    text_network,
    tokenizer_json,
    vision_network,
    write_tiny_clip,
)

LABELS = ["cat", "a deer on the road", "", "Cat", "debris"]


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COOOLER_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_clip(tmp_path_factory.mktemp("models") / "tiny")


@pytest.fixture(scope="module")
def matcher(folder: Path) -> ClipMatcher:
    return ClipMatcher(folder)


@pytest.mark.parametrize(
    "crop",
    [
        np.zeros((4, 4), np.uint8),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros((4, 4, 3), np.float32),
    ],
)
def test_a_crop_that_is_no_picture_is_refused(matcher: ClipMatcher, crop: RgbImage) -> None:
    with pytest.raises(InputError, match=r"crop: found .* expected uint8 \(H, W, 3\)"):
        matcher.cosines([crop], ["cat"])


def _prepared(picture: RgbImage, how: Preprocessing) -> NDArray[np.float32]:
    made = np.empty((1, 3, *how.shape_px), np.float32)
    fill_batch([picture], how, made)
    return made[0]


def _bare(folder: Path, crops: list[RgbImage], labels: list[str]) -> NDArray[np.float64]:
    """Cosines by the plain sessions, one picture and one text at a time."""
    import tokenizers

    tokenizer = tokenizers.Tokenizer.from_file(str(folder / "tokenizer.json"))
    vision = open_session(folder / "onnx" / "vision_model.onnx")
    text = open_session(folder / "onnx" / "text_model.onnx")
    masked = "attention_mask" in {value.name for value in text.get_inputs()}
    pictures, words = [], []
    for crop in crops:
        pixels = _prepared(crop, Preprocessing())[None]
        pictures.append(vision.run(["image_embeds"], {"pixel_values": pixels})[0][0])
    for label in labels:
        ids = np.array([tokenizer.encode(label).ids], np.int64)  # not padded at all
        feeds = {"input_ids": ids} | ({"attention_mask": np.ones_like(ids)} if masked else {})
        words.append(text.run(["text_embeds"], feeds)[0][0])
    a, b = np.array(pictures, np.float64), np.array(words, np.float64)
    cosines: NDArray[np.float64] = (a @ b.T) / np.outer(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
    return cosines


@pytest.mark.parametrize("mask", [False, True])
def test_cosines_are_those_of_the_bare_networks(tmp_path: Path, mask: bool) -> None:
    """Padding to 77 tokens changes nothing: the text network looks only backwards."""
    folder = write_tiny_clip(tmp_path / "m", mask=mask)
    crops = noisy_pictures(5)
    found = ClipMatcher(folder).cosines(crops, LABELS)
    assert found.dtype == np.float32 and found.shape == (5, len(LABELS))
    assert np.abs(found - _bare(folder, crops, LABELS)).max() < 1e-5
    assert np.array_equal(found[:, 0], found[:, 3])  # lower-cased
    assert np.ptp(found, axis=1).min() > 1e-3 and np.ptp(found, axis=0).min() > 1e-3


def test_a_cell_does_not_depend_on_its_batch_mates(matcher: ClipMatcher) -> None:
    crops = noisy_pictures(37)  # one whole batch and five more
    together = matcher.cosines(crops, LABELS)
    assert np.array_equal(matcher.cosines(crops, LABELS), together)
    assert np.abs(matcher.cosines(crops[::-1], LABELS[::-1])[::-1, ::-1] - together).max() <= 1e-5
    for place in (0, 31, 36):
        assert np.abs(matcher.cosines([crops[place]], [LABELS[1]])[0, 0] - together[place, 1]) <= 1e-5
    assert np.abs(together).max() <= 1.0


def test_repeats_and_nothing(matcher: ClipMatcher) -> None:
    crops = noisy_pictures(2)
    found = matcher.cosines([crops[0], crops[1], crops[0]], ["cat", "deer", "cat"])
    assert np.array_equal(found[0], found[2]) and np.array_equal(found[:, 0], found[:, 2])
    assert matcher.cosines([], ["cat"]).shape == (0, 1)
    assert matcher.cosines(crops, []).shape == (2, 0)


def test_labels_of_any_kind(matcher: ClipMatcher) -> None:
    labels = ["x" * 100_000, "\ud800 half", "\0\u202eback", "猫", "🦌" * 300, "<|endoftext|>"]
    found = matcher.cosines(noisy_pictures(1), labels)
    assert np.isfinite(found).all()
    long = matcher.cosines(
        noisy_pictures(1), ["cat " * 75 + "deer", "cat " * 75 + "on", "cat " * 74 + "deer"]
    )[0]
    assert long[0] == long[1] != long[2]  # 77 tokens hold a start, 75 words and an end


def test_label_vectors_are_kept_on_disk_by_the_text_networks_hash(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    crops, cache = noisy_pictures(3), tmp_path / "vectors"
    wanted = ClipMatcher(folder, cache).cosines(crops, LABELS)
    again = ClipMatcher(folder, cache)

    def fail(*_: Any) -> None:
        raise AssertionError("the text network was asked again")

    monkeypatch.setattr("pipeline.clip_networks.LabelEmbedder.embed", fail)
    assert np.array_equal(again.cosines(crops, LABELS), wanted)
    assert np.array_equal(again.cosines(crops, LABELS), wanted)
    with pytest.raises(AssertionError):
        again.cosines(crops, ["new"])


def test_matchers_go_to_other_processes(matcher: ClipMatcher) -> None:
    copy = pickle.loads(pickle.dumps(matcher))
    assert (copy.name, copy.sha256) == (matcher.name, matcher.sha256) == ("CLIP (tiny)", matcher.sha256)
    crops = noisy_pictures(2)
    assert np.array_equal(copy.cosines(crops, LABELS), matcher.cosines(crops, LABELS))


def test_a_template_is_filled_and_part_of_the_hash(folder: Path, matcher: ClipMatcher) -> None:
    photo = ClipMatcher(folder, template="a photo of a {label}")
    crops = noisy_pictures(2)
    assert np.array_equal(photo.cosines(crops, ["cat"]), matcher.cosines(crops, ["a photo of a cat"]))
    assert photo.sha256 != matcher.sha256
    with pytest.raises(InputError, match="template"):
        ClipMatcher(folder, template="a photo")


def test_every_file_decides_the_hash(tmp_path: Path) -> None:
    folder = write_tiny_clip(tmp_path / "m")
    before = ClipMatcher(folder).sha256
    seen = {before}
    changes: list[tuple[str, Callable[[bytes], bytes]]] = [
        ("onnx/vision_model.onnx", lambda data: vision_network(Size(layers=2))),
        ("onnx/text_model.onnx", lambda data: text_network(Size(layers=2), tokenizer_json()[1])),
        ("tokenizer.json", lambda data: data + b"\n"),
        ("preprocessor_config.json", lambda data: data.replace(b'"resample": 3', b'"resample": 2')),
    ]
    for name, change in changes:
        kept = (folder / name).read_bytes()
        (folder / name).write_bytes(change(kept))
        seen.add(ClipMatcher(folder).sha256)
        (folder / name).write_bytes(kept)
    assert len(seen) == 5 and ClipMatcher(folder).sha256 == before


def test_networks_that_insist_on_their_shapes(folder: Path, matcher: ClipMatcher, tmp_path: Path) -> None:
    fixed = write_tiny_clip(tmp_path / "m", below=".")  # the networks beside the other files
    (fixed / "vision_model.onnx").write_bytes(vision_network(Size(), batch=4))
    (fixed / "text_model.onnx").write_bytes(text_network(Size(), tokenizer_json()[1], batch=2, tokens=77))
    crops = noisy_pictures(6)
    found = ClipMatcher(fixed).cosines(crops, LABELS)
    assert np.abs(found - matcher.cosines(crops, LABELS)).max() <= 1e-5


def test_all_missing_files_are_listed(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(InputError) as caught:
        ClipMatcher(tmp_path / "nowhere")
    for name in ("vision_model.onnx", "text_model.onnx", "tokenizer.json", "preprocessor_config.json"):
        assert f"found no {name}" in str(caught.value)
    whole = write_tiny_clip(tmp_path / "m")
    (whole / "tokenizer.json").unlink()
    with (whole / "preprocessor_config.json").open("r+b") as file:
        file.truncate((1 << 20) + 1)
    with pytest.raises(InputError, match=r"no tokenizer\.json.*preprocessor_config\.json of 1,048,577 bytes"):
        ClipMatcher(whole)


def _one_node(
    kind: str, source: tuple[str, str, list[Any]], made: tuple[str, str, list[Any]], **how: Any
) -> bytes:
    """A network of one operator; source and result are (name, type, shape)."""
    graph = Graph()
    graph.add(kind, source[0], name=made[0], **how)
    return graph.serialise({source[0]: source[1:]}, {made[0]: made[1:]})


def _without_ends() -> bytes:
    made = json.loads(tokenizer_json()[0])
    return json.dumps(made | {"post_processor": None}).encode()


PIXELS = ("pixel_values", "float32", ["b", 3, 224, 224])
WRONG: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "no projection": (
        "vision_model.onnx",
        lambda: vision_network(Size(), output="pooler_output"),
        "from pixel_values to pooler_output; expected from pixel_values to image_embeds",
    ),
    "no text projection": (
        "text_model.onnx",
        lambda: text_network(Size(), tokenizer_json()[1], output="last_hidden_state"),
        r"from input_ids to last_hidden_state; expected from input_ids \(and attention_mask\) to text_embeds",
    ),
    "another side": (
        "vision_model.onnx",
        lambda: vision_network(Size(side_px=96)),
        r"96, 96.*\(B, 3, 224, 224\)",
    ),
    "another width": (
        "vision_model.onnx",
        lambda: vision_network(Size(dim=9)),
        "vectors of 9 numbers, and of 8",
    ),
    "swapped": (
        "vision_model.onnx",
        lambda: text_network(Size(), tokenizer_json()[1]),
        "expected from pixel_values",
    ),
    "no ONNX": ("vision_model.onnx", lambda: b"\xff" * 100, "found no ONNX model"),
    "a huge batch": ("vision_model.onnx", lambda: vision_network(Size(), batch=10_000), "batches of 10000"),
    "a small vocabulary": ("text_model.onnx", lambda: text_network(Size(), 9), "cannot be run"),
    "infinite": (
        "vision_model.onnx",
        lambda: _one_node(
            "ReduceLogSum", PIXELS, ("image_embeds", "float32", ["b", 3]), axes=[2, 3], keepdims=0
        ),
        "not finite",
    ),
    "maps, not vectors": (
        "vision_model.onnx",
        lambda: _one_node("GlobalAveragePool", PIXELS, ("image_embeds", "float32", ["b", 3, 1, 1])),
        r"of shape \(1, 3, 1, 1\)",
    ),
    "bytes": (
        "vision_model.onnx",
        lambda: _one_node(
            "Identity", ("pixel_values", "uint8", PIXELS[2]), ("image_embeds", "uint8", PIXELS[2])
        ),
        r"tensor\(uint8\)",
    ),
    "an endless context": (
        "text_model.onnx",
        lambda: _one_node(
            "Cast", ("input_ids", "int64", ["b", 1 << 20]), ("text_embeds", "float32", ["b", 1 << 20]), to=1
        ),
        "a context of 1048576 tokens",
    ),
    "words for a tokenizer": ("tokenizer.json", lambda: b"{}", r"tokenizer\.json: not usable"),
    "no text at all": ("tokenizer.json", lambda: b"\xff\xfe", r"tokenizer\.json: not usable"),
    "no start and end": ("tokenizer.json", _without_ends, "found 0 tokens for an empty text"),
    "no JSON": ("preprocessor_config.json", lambda: b"[" * 100_000, "found no JSON"),
    "no object": ("preprocessor_config.json", lambda: b"[]", "expected a JSON object"),
}


@pytest.mark.parametrize("what", WRONG)
def test_folders_of_other_kinds_are_refused(tmp_path: Path, what: str) -> None:
    name, content, message = WRONG[what]
    folder = write_tiny_clip(tmp_path / "m", below=".")
    (folder / name).write_bytes(content())
    with pytest.raises(InputError, match=message):
        ClipMatcher(folder).cosines([np.zeros((40, 40, 3), np.uint8)], ["cat"])


def test_tensors_in_other_files_are_refused(tmp_path: Path) -> None:
    import onnx

    folder = write_tiny_clip(tmp_path / "m", below=".")
    path = folder / "vision_model.onnx"
    model = onnx.load_model_from_string(path.read_bytes())
    onnx.save_model(model, path, save_as_external_data=True, location="tensors.bin", size_threshold=0)
    with pytest.raises(InputError, match="kept in another file"):
        ClipMatcher(folder)
