"""ONNX graphs that we build ourselves: a small builder, the cache of built graphs, sessions.

onnx and onnxruntime are imported where they are used: a run whose answers are all cached never
loads them.
"""

import contextlib
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, OutsideError
from pipeline.files import sha256_file, sha256_of, write_bytes

# onnxruntime 1.20 runs opsets up to 21; 17 brought LayerNormalization and is enough.
OPSET = 17
IR_VERSION = 8


def cache_folder() -> Path:
    """Where built graphs and vectors are kept: COOOLER_CACHE, else the user's cache folder."""
    chosen = os.environ.get("COOOLER_CACHE")
    if chosen:
        return Path(chosen)
    from platformdirs import user_cache_path

    return user_cache_path("coooler", appauthor=False)


class Graph:
    """Collects nodes and constants; `add` gives back the name of a node's output."""

    def __init__(self) -> None:
        """An empty graph."""
        self._nodes: list[Any] = []
        self._constants: list[Any] = []
        self._names: dict[bytes, str] = {}

    def constant(self, value: NDArray[Any] | Sequence[int] | float, dtype: str = "") -> str:
        """A constant's name; equal constants are stored once. Plain ints are int64, floats float32."""
        from onnx import numpy_helper

        array = np.asarray(value)
        if not dtype:
            dtype = "int64" if array.dtype.kind in "iu" else "float32"
        array = np.ascontiguousarray(array, dtype=dtype).reshape(array.shape)
        key = f"{array.dtype}{array.shape}".encode() + bytes.fromhex(sha256_of(array.tobytes()))
        if key not in self._names:
            self._names[key] = f"c{len(self._names)}"
            self._constants.append(numpy_helper.from_array(array, self._names[key]))
        return self._names[key]

    def add(self, kind: str, *inputs: str, name: str = "", domain: str = "", **attributes: Any) -> str:
        """Add a node with one output and return the output's name."""
        from onnx import helper

        output = name or f"v{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, list(inputs), [output], domain=domain, **attributes))
        return output

    def serialise(
        self,
        inputs: Mapping[str, tuple[str, Sequence[int | str]]],
        outputs: Mapping[str, tuple[str, Sequence[int | str]]],
    ) -> bytes:
        """The checked model as bytes, the same for the same calls; values are (dtype, shape)."""
        import onnx

        def values(described: Mapping[str, tuple[str, Sequence[int | str]]]) -> list[Any]:
            types = {
                "float32": onnx.TensorProto.FLOAT,
                "int64": onnx.TensorProto.INT64,
                "uint8": onnx.TensorProto.UINT8,
            }
            return [onnx.helper.make_tensor_value_info(n, types[d], s) for n, (d, s) in described.items()]

        graph = onnx.helper.make_graph(
            self._nodes, "coooler", values(inputs), values(outputs), self._constants
        )
        domains = [onnx.helper.make_opsetid("", OPSET)]
        if any(node.domain for node in self._nodes):
            domains.append(onnx.helper.make_opsetid("com.microsoft", 1))
        model = onnx.helper.make_model(graph, opset_imports=domains, producer_name="coooler")
        model.ir_version = IR_VERSION
        onnx.checker.check_model(model)
        return bytes(model.SerializeToString(deterministic=True))


def built(name: str, key: str, build: Callable[[], bytes]) -> Path:
    """The cached graph `name` for `key` (a hex hash of all that it is built from); built when absent.

    The file's name carries the hash of its content, so a damaged file is seen and built again.
    Raises OutsideError when the cache folder cannot be written.
    """
    folder = cache_folder() / "graphs"
    for path in sorted(folder.glob(f"{name}-{key[:16]}-*.onnx")):
        stated = re.fullmatch(r".*-([0-9a-f]{64})\.onnx", path.name)
        try:
            if stated and sha256_file(path) == stated[1]:
                return path
            path.unlink()
        except OSError:
            continue
    data = build()
    path = folder / f"{name}-{key[:16]}-{sha256_of(data)}.onnx"
    try:
        write_bytes(path, data)
    except OSError as error:
        raise OutsideError(
            f"{folder}: cannot be written ({error.strerror}); expected a folder for built models. "
            "Set COOOLER_CACHE to a folder that can be written."
        ) from error
    return path


def require_self_contained(model: bytes, what: str) -> None:
    """Raise InputError when a model is no ONNX or keeps tensors in other files, which its hash misses."""
    import onnx

    def tensors(nodes: Any) -> Iterator[Any]:
        for attribute in (attribute for node in nodes for attribute in node.attribute):
            yield from (attribute.t, *attribute.tensors)
            for graph in (attribute.g, *attribute.graphs):
                yield from of_graph(graph)

    def of_graph(graph: Any) -> Iterator[Any]:
        yield from graph.initializer
        for sparse in graph.sparse_initializer:
            yield from (sparse.values, sparse.indices)
        if len(graph.node):
            yield from tensors(graph.node)

    try:
        loaded = onnx.load_model_from_string(model)
    except Exception as error:  # protobuf's DecodeError, whichever backend
        raise InputError(f"{what}: found no ONNX model ({str(error)[:100]}); expected one.") from error
    in_functions = (tensor for function in loaded.functions for tensor in tensors(function.node))
    if any(t.data_location == onnx.TensorProto.EXTERNAL for t in (*of_graph(loaded.graph), *in_functions)):
        raise InputError(
            f"{what}: found tensors kept in another file; expected all of them inside. "
            "Save the model again as one file."
        )


def remembered_sha256(files: Sequence[Path], salt: str, compute: Callable[[], str]) -> str:
    """`compute()`, remembered while the files' paths, sizes, inodes and times stay as they are.

    Hashing 90 MB out of a zip takes most of a second, at every start of every command. A change
    time cannot be set by hand, so a changed file is hashed again.
    """
    stats = [
        (str(p.resolve()), s.st_size, s.st_ino, s.st_mtime_ns, s.st_ctime_ns)
        for p in files
        for s in [p.stat()]
    ]
    memo = cache_folder() / "hashes" / sha256_of(f"{salt} {stats}".encode())
    with contextlib.suppress(OSError, UnicodeDecodeError):
        known = memo.read_text("ascii")
        if re.fullmatch(r"[0-9a-f]{64}", known):
            return known
    value = compute()
    with contextlib.suppress(OSError):  # a memory that cannot be written is only slower
        write_bytes(memo, value.encode())
    return value


def open_session(model: Path | bytes, threads: int | None = None) -> Any:
    """An onnxruntime session on the CPU; `threads` None leaves the choice to onnxruntime.

    Raises OutsideError when onnxruntime refuses the model.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.inter_op_num_threads = 1
    if threads is not None:
        options.intra_op_num_threads = threads
    source = str(model) if isinstance(model, Path) else model
    try:
        return onnxruntime.InferenceSession(source, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # its exceptions share no base but Exception
        shown = source if isinstance(source, str) else "the given model"
        raise OutsideError(f"onnxruntime cannot load {shown}: {str(error)[:300]}") from error
