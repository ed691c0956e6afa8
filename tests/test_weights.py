"""Reading weights: what the formats allow, and files that are broken or hostile."""

import collections
import io
import json
import os
import pickle
import sys
import tracemalloc
import types
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.weights import has_model_file, read_model_file, read_safetensors, read_torch_legacy


def _safetensors(header: Any, body: bytes = b"", length: int | None = None) -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return (len(text) if length is None else length).to_bytes(8, "little") + text + body


def test_safetensors_are_read() -> None:
    matrix, numbers = np.arange(6, dtype="<f4").reshape(2, 3), np.array([7, -8], "<i8")
    header = {
        "__metadata__": {"format": "pt"},
        "m": {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]},
        "n": {"dtype": "I64", "shape": [2], "data_offsets": [24, 40]},
        "scalar": {"dtype": "F32", "shape": [], "data_offsets": [0, 4]},
    }
    read = read_safetensors(_safetensors(header, matrix.tobytes() + numbers.tobytes()), "x")
    assert sorted(read) == ["m", "n", "scalar"]
    assert (read["m"] == matrix).all() and (read["n"] == numbers).all() and read["scalar"].shape == ()


def _one(**changes: Any) -> dict[str, Any]:
    return {"t": {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]} | changes}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"short",
        _safetensors({}, length=2**63),
        _safetensors({}, length=100),
        _safetensors(b"\xff\xfe"),
        _safetensors(b"[" * 100_000),
        _safetensors([1]),
        _safetensors({"t": 1}),
        _safetensors({"t": {}}),
        _safetensors(_one(dtype="BF99"), bytes(8)),
        _safetensors(_one(shape=[3]), bytes(8)),
        _safetensors(_one(shape=[-2]), bytes(8)),
        _safetensors(_one(shape=[True, 2]), bytes(8)),
        _safetensors(_one(shape=["2"]), bytes(8)),
        _safetensors(_one(shape=[1] * 99), bytes(8)),
        _safetensors(_one(shape=[2**40, 2**40]), bytes(8)),
        _safetensors(_one(data_offsets=[-8, 0]), bytes(8)),
        _safetensors(_one(data_offsets=[8, 16]), bytes(8)),
        _safetensors(_one(data_offsets=[8, 0]), bytes(8)),
        _safetensors(_one(data_offsets=[0, 8, 8]), bytes(8)),
        _safetensors(_one(), bytes(7)),
        _safetensors({f"t{i}": 1 for i in range(10_001)}),
    ],
)
def test_hostile_safetensors_are_refused(data: bytes) -> None:
    with pytest.raises(InputError, match=r"model\.zip: found .*; expected "):
        read_safetensors(data, "model.zip")


def test_files_of_folders_and_zips_are_bounded(tmp_path: Path) -> None:
    folder, archive = tmp_path / "folder", tmp_path / "a.zip"
    folder.mkdir()
    (folder / "w").write_bytes(bytes(1000))
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as written:
        written.writestr("w", bytes(1000))
    for root in (folder, archive):
        assert read_model_file(root, "w", 1000) == bytes(1000)
        assert not has_model_file(root, "v")
        with pytest.raises(InputError, match="found no v"):
            read_model_file(root, "v", 1000)
        with pytest.raises(InputError, match="found 1,000 bytes; expected at most 999"):
            read_model_file(root, "w", 999)


def test_broken_zips_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    path.write_bytes(b"no zip at all")
    with pytest.raises(InputError, match="sound zip"):
        has_model_file(path, "w")
    with zipfile.ZipFile(path, "w") as written:
        written.writestr("w", b"x" * 1000)
    path.write_bytes(path.read_bytes().replace(b"x" * 10, b"y" * 10, 1))
    with pytest.raises(InputError, match="sound zip"):
        read_model_file(path, "w", 1000)


class _Reduced:
    """Pickles as a call of `function` with `arguments`."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> Any:
        return self.call


class _Stored:
    def __init__(self, pid: Any) -> None:
        self.pid = pid


class _Pickler(pickle.Pickler):
    def persistent_id(self, item: Any) -> Any:
        return item.pid if isinstance(item, _Stored) else None


def _legacy(state: Any, storages: dict[str, bytes], magic: int = 0x1950A86A20F9469CFC6C) -> bytes:
    stream = io.BytesIO()
    for part in (magic, 1001, {"little_endian": True}, state, list(storages)):
        _Pickler(stream, 2).dump(part)
    for data in storages.values():
        stream.write((len(data) // 4).to_bytes(8, "little") + data)
    return stream.getvalue()


@pytest.fixture
def torch(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A stand-in for torch with just the names that its legacy pickles carry."""
    fake, inner = types.ModuleType("torch"), types.ModuleType("torch._utils")

    def rebuild(*_: Any) -> None: ...

    rebuild.__module__, rebuild.__qualname__ = "torch._utils", "_rebuild_tensor_v2"
    inner._rebuild_tensor_v2 = rebuild  # type: ignore[attr-defined]
    fake.FloatStorage = type("FloatStorage", (), {"__module__": "torch"})  # type: ignore[attr-defined]
    fake._utils = inner  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "torch", fake)
    monkeypatch.setitem(sys.modules, "torch._utils", inner)
    return fake


def _tensor(torch: Any, shape: Any, strides: Any, offset: int = 0, count: Any = 6) -> _Reduced:
    storage = _Stored(("storage", torch.FloatStorage, "a", "cpu", count, None))
    function = torch._utils._rebuild_tensor_v2
    return _Reduced(function, storage, offset, shape, strides, False, collections.OrderedDict())


SIX = np.arange(6, dtype="<f4").tobytes()


def test_legacy_torch_files_are_read_with_their_strides(torch: Any) -> None:
    state = collections.OrderedDict(
        plain=_tensor(torch, (2, 3), (3, 1)),
        turned=_tensor(torch, (3, 2), (1, 3)),
        part=_tensor(torch, (2,), (1,), 4),
    )
    read = read_torch_legacy(_legacy(state, {"a": SIX}), "w.pth")
    plain = np.arange(6).reshape(2, 3)
    assert (read["plain"] == plain).all() and (read["turned"] == plain.T).all()
    assert read["part"].tolist() == [4, 5] and not read["plain"].flags.writeable


@pytest.mark.parametrize(
    ("shape", "strides", "offset"),
    [
        ((7,), (1,), 0),
        ((2, 3), (3, 2), 0),
        ((6,), (1,), 1),
        ((2,), (2**29,), 0),
        ((-1,), (1,), 0),
        ((2,), (1, 1), 0),
    ],
)
def test_legacy_tensors_outside_their_storage_are_refused(
    torch: Any, shape: Any, strides: Any, offset: int
) -> None:
    with pytest.raises(InputError, match=r"w\.pth: found a tensor"):
        read_torch_legacy(_legacy({"t": _tensor(torch, shape, strides, offset)}, {"a": SIX}), "w.pth")


def test_legacy_files_of_other_forms_are_refused(torch: Any) -> None:
    good = _tensor(torch, (6,), (1,))
    whole = _legacy({"t": good}, {"a": SIX})
    hostile = [
        b"",
        b"PK\x03\x04",
        whole[:40],
        whole[:-1],
        _legacy({"t": good}, {"a": SIX}, magic=1),
        _legacy([good], {"a": SIX}),
        _legacy({"t": 1}, {"a": SIX}),
        _legacy({1: good}, {"a": SIX}),
        _legacy({"t": good}, {"b": SIX}),
        _legacy({"t": good}, {}),
        _legacy({"t": _tensor(torch, (6,), (1,), count=7)}, {"a": SIX}),
        _legacy({"t": _tensor(torch, (6,), (1,), count=-1)}, {"a": SIX}),
        _legacy({"t": _Stored(("storage", "FloatStorage", "a", "cpu", 6, None))}, {"a": SIX}),
        _legacy({"t": _Stored("a")}, {"a": SIX}),
    ]
    for data in hostile:
        with pytest.raises(InputError, match=r"w\.pth: found "):
            read_torch_legacy(data, "w.pth")


def test_a_short_pickle_takes_no_large_memory() -> None:
    place = pickle.LONG_BINPUT + (2**24).to_bytes(4, "little")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="place 16,777,216 in the memo"):
            read_torch_legacy(pickle.PROTO + b"\x02" + pickle.NONE + place + pickle.STOP, "w.pth")
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("function", "arguments", "named"),
    [
        (os.system, ("touch pwned",), "posix.system"),
        (eval, ("1",), "__builtin__.eval"),
        (getattr, ("x", "upper"), "__builtin__.getattr"),
    ],
)
def test_a_pickle_that_calls_something_is_refused_by_name(
    function: Any, arguments: Any, named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=f"asks for {named}"):
        read_torch_legacy(_legacy({"t": _Reduced(function, *arguments)}, {}), "w.pth")
    assert not (tmp_path / "pwned").exists()
