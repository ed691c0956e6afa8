"""Model weights without torch: bounded reading, safetensors, and torch's legacy (not zip) format.

Whoever offers a weights file is not trusted: sizes are bounded before anything is read, a
safetensors header is checked field by field, and a pickle may name four harmless things only.
"""

import importlib.util
import io
import json
import math
import pickle
import pickletools
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from pipeline.errors import InputError

MAX_WEIGHTS_BYTES = 1 << 30
MAX_TENSORS = 10_000
MAX_HEADER_BYTES = 8 << 20

Tensors = dict[str, NDArray[Any]]

_SAFETENSORS_TYPES = {"F32": "<f4", "F16": "<f2", "F64": "<f8", "I64": "<i8", "I32": "<i4", "U8": "u1"}
_STORAGE_TYPES = {"FloatStorage": "<f4", "DoubleStorage": "<f8", "HalfStorage": "<f2", "LongStorage": "<i8"}
_LEGACY_MAGIC = 0x1950A86A20F9469CFC6C
_LEGACY_PROTOCOL = 1001


def _too_large(what: str, size: int, limit: int) -> InputError:
    return InputError(f"{what}: found {size:,} bytes; expected at most {limit:,}. Use a smaller model.")


def package_folder(module: str) -> Path | None:
    """The folder of an installed top-level package, or None; it is not imported: it may import torch."""
    try:
        found = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    if found is None or not found.submodule_search_locations:
        return None
    return Path(next(iter(found.submodule_search_locations)))


def has_model_file(root: Path, name: str) -> bool:
    """Whether a model folder or zip has the file. Raises InputError when `root` is neither."""
    if root.is_dir():
        return (root / name).is_file()
    with _archive(root, name) as archive:
        return name in archive.NameToInfo


def read_model_file(root: Path, name: str, limit_bytes: int) -> bytes:
    """The bytes of file `name` (a fixed name of ours) in a model folder or zip.

    Nothing is extracted. Raises InputError when it is not there, larger than `limit_bytes`, or
    cannot be unpacked.
    """
    if not has_model_file(root, name):
        raise InputError(f"{root}: found no {name}; expected it there. Install the model again.")
    if root.is_dir():
        path = root / name
        if path.stat().st_size > limit_bytes:
            raise _too_large(str(path), path.stat().st_size, limit_bytes)
        return path.read_bytes()
    with _archive(root, name) as archive:
        size = archive.getinfo(name).file_size
        if size > limit_bytes:
            raise _too_large(f"{root}, member {name}", size, limit_bytes)
        # zipfile reads no more than the size that the directory declares, and checks the CRC.
        return archive.read(name)


@contextmanager
def _archive(root: Path, name: str) -> Iterator[zipfile.ZipFile]:
    """An open zip whose faults come out as InputError."""
    try:
        with zipfile.ZipFile(root) as archive:
            yield archive
    except (zipfile.BadZipFile, NotImplementedError, EOFError, RuntimeError, zlib.error, OSError) as error:
        raise InputError(
            f"{root}, member {name}: cannot be unpacked ({error}); expected a folder or a sound zip. "
            "Install the model again."
        ) from error


def read_safetensors(data: bytes, what: str) -> Tensors:
    """Every tensor of a safetensors file, as read-only views into `data`.

    `what` names the file in errors. Raises InputError when the header is not what the format
    (huggingface/safetensors, "Format") allows: bounds, types, shapes and offsets are all checked.
    """

    def wrong(found: str, expected: str) -> InputError:
        return InputError(f"{what}: found {found}; expected {expected}. Install the model again.")

    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or length > min(MAX_HEADER_BYTES, len(data) - 8):
        raise wrong(f"a header of {length:,} bytes in a file of {len(data):,}", "a header inside the file")
    try:
        header = json.loads(data[8 : 8 + length])
    except (ValueError, RecursionError) as error:
        raise wrong("a header that is not JSON", "a safetensors header") from error
    if not isinstance(header, dict) or len(header) > MAX_TENSORS:
        raise wrong("a header of another form", f"a JSON object with at most {MAX_TENSORS:,} tensors")
    body = 8 + length
    tensors: Tensors = {}
    for name, entry in header.items():
        if name == "__metadata__":
            continue
        match entry:
            case {"dtype": str(kind), "shape": [*shape], "data_offsets": [int(start), int(end)]} if (
                kind in _SAFETENSORS_TYPES
            ):
                dtype = np.dtype(_SAFETENSORS_TYPES[kind])
            case _:
                raise wrong(
                    f"tensor {name!r} as {str(entry)[:80]}", f"dtype of {sorted(_SAFETENSORS_TYPES)}, shape"
                )
        if len(shape) > 8 or not all(type(n) is int and 0 <= n <= MAX_WEIGHTS_BYTES for n in shape):
            raise wrong(f"tensor {name!r} of shape {str(shape)[:80]}", "at most 8 sizes of 0 or more")
        count = math.prod(shape)
        if not 0 <= start <= end <= len(data) - body or end - start != count * dtype.itemsize:
            raise wrong(
                f"tensor {name!r} at {start}..{end}", f"{count * dtype.itemsize} bytes inside the file"
            )
        tensors[name] = np.frombuffer(data, dtype, count, body + start).reshape(shape)
    return tensors


class _Storage(NamedTuple):
    """A storage that a legacy file speaks of before its bytes come."""

    key: str
    dtype: str
    elements: int


class _Lazy(NamedTuple):
    """A tensor whose storage has not been read yet; sizes and strides are in elements."""

    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]


class _StorageType(NamedTuple):
    """Stands for torch.FloatStorage and its kin."""

    dtype: str


def _rebuild_tensor(storage: Any, offset: Any, shape: Any, strides: Any, *_: Any) -> _Lazy:
    """Stands for torch._utils._rebuild_tensor_v2."""
    if not isinstance(storage, _Storage):
        raise pickle.UnpicklingError("a tensor without a storage")
    numbers = (offset, *shape, *strides)
    if not all(type(n) is int and 0 <= n <= MAX_WEIGHTS_BYTES for n in numbers) or len(shape) != len(strides):
        raise pickle.UnpicklingError("a tensor with impossible sizes")
    return _Lazy(storage, offset, tuple(shape), tuple(strides))


class _RestrictedUnpickler(pickle.Unpickler):
    """Unpickles tensors and plain containers; every other name is refused."""

    def find_class(self, module: str, name: str) -> Any:
        allowed: dict[tuple[str, str], Callable[..., Any] | _StorageType] = {
            ("collections", "OrderedDict"): OrderedDict,
            ("torch._utils", "_rebuild_tensor_v2"): _rebuild_tensor,
            **{("torch", kind): _StorageType(dtype) for kind, dtype in _STORAGE_TYPES.items()},
        }
        if (module, name) not in allowed:
            raise pickle.UnpicklingError(f"the pickle asks for {module}.{name}, which is refused")
        return allowed[module, name]

    def persistent_load(self, pid: Any) -> _Storage:
        match pid:
            case ("storage", _StorageType(dtype), str(key), str(_), int(count), None) if (
                0 <= count <= MAX_WEIGHTS_BYTES
            ):
                return _Storage(key, dtype, count)
        raise pickle.UnpicklingError("a storage of unknown form")


def _load_restricted(stream: io.BytesIO) -> Any:
    """The next pickle of a stream. One that names a place in the memo beyond its own bytes is refused:
    the unpickler would make room for all places before it.
    """
    start, size = stream.tell(), len(stream.getbuffer())
    for opcode, argument, _ in pickletools.genops(stream):
        if opcode.name in {"PUT", "BINPUT", "LONG_BINPUT"} and not 0 <= (argument or 0) < size:
            raise pickle.UnpicklingError(f"place {argument:,} in the memo of {size:,} bytes")
    stream.seek(start)
    return _RestrictedUnpickler(stream).load()


def read_torch_legacy(data: bytes, what: str) -> Tensors:
    """Every tensor of a state dict that torch saved in its legacy format (before torch 1.6).

    The file is five pickles (magic, protocol, system, state dict, storage keys) and then each
    storage as a 64-bit count and its elements (torch/serialization.py, `_legacy_load`). Raises
    InputError when it is anything else, and names what a pickle asked for and did not get.
    """

    def wrong(found: str) -> InputError:
        return InputError(
            f"{what}: found {found}; expected a state dict of tensors in torch's legacy format. "
            "Install the model again."
        )

    stream = io.BytesIO(data)
    try:
        parts = [_load_restricted(stream) for _ in range(5)]
    except Exception as error:  # a hostile pickle can raise nearly anything
        raise wrong(str(error)[:200]) from error
    magic, protocol, _, state, keys = parts
    if magic != _LEGACY_MAGIC or protocol != _LEGACY_PROTOCOL:
        raise wrong("another magic number or protocol")
    if not isinstance(state, dict) or not isinstance(keys, list) or len(state) > MAX_TENSORS:
        raise wrong("something else")
    if not all(isinstance(name, str) and isinstance(lazy, _Lazy) for name, lazy in state.items()):
        raise wrong("entries that are not named tensors")
    storages = {lazy.storage.key: lazy.storage for lazy in state.values()}
    arrays: dict[str, NDArray[Any]] = {}
    at = stream.tell()
    for key in keys:
        storage = storages.get(key) if isinstance(key, str) else None
        if storage is None:
            raise wrong("a storage that no tensor uses")
        dtype = np.dtype(storage.dtype)
        count = int.from_bytes(data[at : at + 8], "little")
        if count != storage.elements or at + 8 + count * dtype.itemsize > len(data):
            raise wrong(f"storage {key[:40]!r} with {count:,} elements in place of {storage.elements:,}")
        arrays[key] = np.frombuffer(data, dtype, count, at + 8)
        at += 8 + count * dtype.itemsize
    return {name: _tensor(lazy, arrays, wrong) for name, lazy in state.items()}


def _tensor(lazy: _Lazy, arrays: dict[str, NDArray[Any]], wrong: Callable[[str], InputError]) -> NDArray[Any]:
    """A read-only view of a storage, with the strides that torch saved (weights come transposed)."""
    array = arrays.get(lazy.storage.key)
    steps = sum((size - 1) * stride for size, stride in zip(lazy.shape, lazy.strides, strict=True))
    empty = 0 in lazy.shape
    if array is None or len(lazy.shape) > 8 or (not empty and lazy.offset + steps >= len(array)):
        raise wrong("a tensor that does not lie in its storage")
    if empty:
        return np.empty(lazy.shape, array.dtype)
    # as_strided does not check bounds; the line above did. Strides are not negative.
    bytes_apart = tuple(stride * array.itemsize for stride in lazy.strides)
    return as_strided(array[lazy.offset :], lazy.shape, bytes_apart, writeable=False)
