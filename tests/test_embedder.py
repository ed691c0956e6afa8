"""The embedder against sentence-transformers on torch, and models that it must refuse."""

import json
import os
import pickle
import platform
import random
import subprocess
import sys
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.bert import bert_graph
from pipeline.errors import InputError
from pipeline.graphs import Graph
from pipeline.minilm import MINILM, MINILM_SHA256, OnnxEmbedder, find_embedder, open_embedder

ROOT = Path(__file__).parent.parent
REFERENCE = json.loads((Path(__file__).parent / "reference" / "minilm_reference.json").read_text("utf-8"))

# Where onnxruntime's kernels for x86 run, a vector is a function of its text alone, to the last bit.
TOLERANCE = 0.0 if platform.machine().lower() in {"x86_64", "amd64"} else 1e-6


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COOOLER_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.delenv("COOOLER_EMBEDDER", raising=False)
        yield


@pytest.fixture(scope="module")
def minilm() -> OnnxEmbedder:
    path = find_embedder()
    assert path is not None
    return OnnxEmbedder(path)


def test_vectors_agree_with_sentence_transformers_on_torch(minilm: OnnxEmbedder) -> None:
    """Reference: tests/reference/make_minilm_reference.py (empty, emoji, CJK, 300 words and more)."""
    vectors = minilm.embed(REFERENCE["texts"])
    assert vectors.shape == (len(REFERENCE["texts"]), 384) and vectors.dtype == np.float32
    assert np.abs(vectors[:, :8] - np.array(REFERENCE["first_8"])).max() < 1e-5
    cosines = vectors.astype(np.float64) @ vectors.astype(np.float64).T
    assert np.abs(cosines - np.array(REFERENCE["cosines"])).max() < 1e-5
    assert np.abs(np.linalg.norm(vectors, axis=1) - 1).max() < 1e-6
    assert (minilm.name, minilm.sha256) == (MINILM, MINILM_SHA256)


def test_a_vector_is_the_same_whatever_goes_with_it(minilm: OnnxEmbedder) -> None:
    rng = random.Random(3)
    words = ["a", "deer", "crosses", "the", "wet", "road", "ahead", "while", "cars", "brake,", "suddenly"]
    texts = [" ".join(rng.choices(words, k=rng.randrange(1, 40))) for _ in range(40)] + REFERENCE["texts"]
    together = minilm.embed(texts)
    path = find_embedder()
    assert path is not None
    others = [
        minilm.embed(texts[::-1])[::-1],
        np.concatenate([minilm.embed([text]) for text in texts]),
        OnnxEmbedder(path, threads=1).embed(texts),
    ]
    for vectors in others:
        assert np.abs(vectors - together).max() <= TOLERANCE


def test_order_and_repeats_are_kept(minilm: OnnxEmbedder) -> None:
    one, two = minilm.embed(["a long road ahead of us", "deer"])
    assert np.array_equal(minilm.embed(["deer", "a long road ahead of us", "deer"]), [two, one, two])
    assert minilm.embed([]).shape == (0, 384)


def test_text_beyond_256_tokens_is_cut(minilm: OnnxEmbedder) -> None:
    whole = minilm.embed([" ".join(["deer"] * 254)])
    assert np.array_equal(minilm.embed([" ".join(["deer"] * 254 + ["banana"] * 50)]), whole)
    assert not np.array_equal(minilm.embed([" ".join(["deer"] * 253 + ["banana"])]), whole)


def test_text_that_is_not_text_does_not_stop_it(minilm: OnnxEmbedder) -> None:
    vectors = minilm.embed(["\ud800 half a character", "\0\x1b[31m", "\u202eback", "x" * 100_000])
    assert np.isfinite(vectors).all()


def test_embedders_go_to_other_processes(minilm: OnnxEmbedder) -> None:
    copy = pickle.loads(pickle.dumps(minilm))
    assert np.array_equal(copy.embed(["deer"]), minilm.embed(["deer"]))
    cached = pickle.loads(pickle.dumps(open_embedder()))
    assert np.array_equal(cached.embed(["deer"]), minilm.embed(["deer"]))


def _tiny(rng: np.random.Generator) -> tuple[dict[str, Any], dict[str, NDArray[np.float32]]]:
    config = {
        "hidden_size": 8, "num_attention_heads": 2, "num_hidden_layers": 1, "intermediate_size": 16,
        "max_position_embeddings": 16, "vocab_size": 11, "type_vocab_size": 2, "model_type": "bert",
    }  # fmt: skip
    shapes = {
        "embeddings.word_embeddings.weight": (11, 8),
        "embeddings.position_embeddings.weight": (16, 8),
        "embeddings.token_type_embeddings.weight": (2, 8),
        "embeddings.LayerNorm.weight": (8,),
        "embeddings.LayerNorm.bias": (8,),
    }
    for name, n_out, n_in in [
        *[(f"attention.self.{part}", 8, 8) for part in ("query", "key", "value")],
        ("attention.output.dense", 8, 8),
        ("intermediate.dense", 16, 8),
        ("output.dense", 8, 16),
    ]:
        shapes |= {f"encoder.layer.0.{name}.weight": (n_out, n_in), f"encoder.layer.0.{name}.bias": (n_out,)}
    for name in ("attention.output", "output"):
        shapes |= {f"encoder.layer.0.{name}.LayerNorm.{part}": (8,) for part in ("weight", "bias")}
    return config, {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def test_building_a_graph_repeats_to_the_byte_and_checks_its_tensors() -> None:
    config, tensors = _tiny(np.random.default_rng(0))
    assert bert_graph(tensors, config, "m") == bert_graph(dict(reversed(tensors.items())), config, "m")
    for name, tensor in tensors.items():
        with pytest.raises(InputError, match=f"tensor {name}: found nothing"):
            bert_graph({k: v for k, v in tensors.items() if k != name}, config, "m")
        with pytest.raises(InputError, match=f"tensor {name}: found float32"):
            bert_graph(tensors | {name: tensor[:-1]}, config, "m")
    for key, value in {
        "hidden_act": "relu",
        "model_type": "t5",
        "num_attention_heads": 3,
        "hidden_size": "8",
    }.items():
        with pytest.raises(InputError, match=r"^m"):
            bert_graph(tensors, config | {key: value}, "m")


def _onnx_folder(
    folder: Path, inputs: Sequence[str] = ("input_ids", "attention_mask", "token_type_ids")
) -> Path:
    """A folder in the ONNX layout whose 'BERT' looks its token vectors up in a table of 3 columns."""
    path = find_embedder()
    assert path is not None
    (folder / "onnx").mkdir(parents=True)
    with zipfile.ZipFile(path) as archive:
        (folder / "tokenizer.json").write_bytes(archive.read("tokenizer.json"))
    graph = Graph()
    table = np.random.default_rng(1).normal(size=(30522, 3)).astype(np.float32)
    graph.add("Gather", graph.constant(table), inputs[0], name="last_hidden_state")
    tokens = {name: ("int64", ["b", "t"]) for name in inputs}
    (folder / "onnx" / "model.onnx").write_bytes(
        graph.serialise(tokens, {"last_hidden_state": ("float32", ["b", "t", 3])})
    )
    return folder


def test_the_onnx_layout_is_pooled_and_normalised_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = _onnx_folder(tmp_path / "my model|x")
    monkeypatch.setenv("COOOLER_EMBEDDER", str(folder))
    embedder = open_embedder()
    assert embedder.name == "my-model-x" and embedder.sha256 != MINILM_SHA256
    import tokenizers

    texts = ["deer", "a deer on the road", "the road is wet and", ""]
    vectors = embedder.embed(texts)
    tokenizer = tokenizers.Tokenizer.from_file(str(folder / "tokenizer.json"))
    tokenizer.no_padding()
    table = np.random.default_rng(1).normal(size=(30522, 3)).astype(np.float32)
    for text, vector in zip(texts, vectors, strict=True):
        mean = table[tokenizer.encode(text).ids].mean(axis=0)
        assert np.abs(vector - mean / np.linalg.norm(mean)).max() < 1e-6
    fresh = OnnxEmbedder(folder)
    assert np.array_equal(np.concatenate([fresh.embed([text]) for text in texts]), vectors)


def test_embedders_of_other_kinds_are_refused(tmp_path: Path) -> None:
    folder = _onnx_folder(tmp_path / "m")
    whole = OnnxEmbedder(folder).sha256
    (folder / "1_Pooling").mkdir()
    pooling, modules, sentence = (
        folder / name for name in ("1_Pooling/config.json", "modules.json", "sentence_bert_config.json")
    )
    for path, texts, found in [
        (pooling, ['{"pooling_mode_cls_token": true}', '{"pooling_mode": "cls"}'], "found"),
        (pooling, ["{", "[]", '"' + "x" * (1 << 20) + '"'], "expected"),
        (modules, ['[{"type": "a.Transformer"}, {"type": "b.Dense"}]'], "Transformer, Dense"),
        (sentence, ['{"max_seq_length": 0}', '{"max_seq_length": "256"}'], "max_seq_length"),
    ]:
        for text in texts:
            path.write_text(text)
            with pytest.raises(InputError, match=found):
                OnnxEmbedder(folder)
        path.unlink()
    sentence.write_text('{"max_seq_length": 8}')
    assert OnnxEmbedder(folder).sha256 != whole  # cut elsewhere, long texts get other vectors
    sentence.unlink()
    (folder / "tokenizer.json").write_text("{}")
    with pytest.raises(InputError, match=r"tokenizer\.json: not usable"):
        OnnxEmbedder(folder).embed(["x"])
    with pytest.raises(InputError, match="expected input_ids"):
        OnnxEmbedder(_onnx_folder(tmp_path / "n", ["words"])).embed(["x"])


def test_with_everything_cached_no_model_is_loaded(minilm: OnnxEmbedder) -> None:
    wanted = open_embedder().embed(["deer", "road"])
    code = (
        "import sys; from pipeline.minilm import open_embedder\n"
        "e = open_embedder(); v = e.embed(['deer', 'road'])\n"
        "print(e.embedded_count, {'onnx', 'onnxruntime', 'tokenizers'} & set(sys.modules), v[:, 0].tolist())"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=dict(os.environ),
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == f"0 set() {wanted[:, 0].tolist()}"
    assert np.array_equal(minilm.embed(["deer", "road"]), wanted)
