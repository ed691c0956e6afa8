"""Stand-ins for the names in pickles of numpy arrays: they check all that numpy would take on trust."""

import math
import re
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

MAX_DIMENSIONS = 8
# An empty array may have a large side; as a list of lists that side would be made.
MAX_EMPTY_SIDES = 1024

_CODE = re.compile(r"[<>|=]?(?:b1|[iu][1248]|f[248]|[SU][0-9]{1,6})")

Names = dict[tuple[str, str], "_Maker | _Marker"]


class BadArrayError(Exception):
    """Something that no pickle of a plain array says."""


class PlainArray(np.ndarray[Any, Any]):
    """An array of numbers, truth values or texts, whose state was checked before it was taken."""

    __slots__ = ("left",)

    left: "_Left | None"

    def __setstate__(self, state: Any) -> None:
        """Take (version, shape, dtype, order, bytes). Raises BadArrayError when they do not fit."""
        match state:
            case (1, tuple(shape), _Dtype() as dtype, bool() | 0 | 1 as fortran, bytes() | str() as raw):
                content = raw.encode("latin1") if isinstance(raw, str) else raw
            case _:
                raise BadArrayError("an array's state of unknown form")
        left = getattr(self, "left", None)
        if left is None:
            raise BadArrayError("an array that gets its state twice")
        self.left = None
        left.take(len(content))
        _check_shape(shape, dtype.value, len(content))
        super().__setstate__((1, shape, dtype.value, bool(fortran), content))  # type: ignore[arg-type]


class _Left:
    """How many bytes arrays may still hold."""

    __slots__ = ("_bytes",)

    def __init__(self, count: int) -> None:
        self._bytes = count

    def take(self, count: int) -> None:
        self._bytes -= count
        if self._bytes < 0:
            raise BadArrayError("arrays of more bytes than the file has")


class _Marker:
    """A name that is only passed on; no attribute of it can be set by a pickle."""

    __slots__ = ()

    def __setstate__(self, state: Any) -> NoReturn:
        raise BadArrayError("a state for a name")


class _Maker(_Marker):
    """A name that is called."""

    __slots__ = ("_make",)

    def __init__(self, make: Callable[..., Any]) -> None:
        self._make = make

    def __call__(self, *arguments: Any) -> Any:
        return self._make(*arguments)


class _Dtype:
    """Stands for a numpy.dtype of numbers, truth values or texts."""

    __slots__ = ("value",)

    def __init__(self, code: str) -> None:
        self.value = np.dtype(code)

    def __setstate__(self, state: Any) -> None:
        match state:
            case (3, "<" | ">" | "|" | "=" as order, None, None, None, int(size), int(), int()) if size in {
                -1,
                self.value.itemsize,
            }:
                self.value = self.value.newbyteorder(order)
            case _:
                raise BadArrayError("a dtype of unknown form")


def _check_shape(shape: tuple[Any, ...], dtype: "np.dtype[Any]", size: int) -> None:
    """Raise BadArrayError unless `shape` of `dtype` takes just `size` bytes."""
    if len(shape) > MAX_DIMENSIONS or not all(type(n) is int and n >= 0 for n in shape):
        raise BadArrayError("an array of impossible shape")
    sides = math.prod(max(1, n) for n in shape)
    if not dtype.itemsize or math.prod(shape) * dtype.itemsize != size or sides > max(MAX_EMPTY_SIDES, size):
        raise BadArrayError(f"an array whose shape does not fit its {size:,} bytes")


def _dtype(code: Any, align: Any = False, copy: Any = True) -> _Dtype:
    if not isinstance(code, str) or not _CODE.fullmatch(code):
        raise BadArrayError(f"an array of {ascii(code)[:40]}, not of numbers or texts")
    return _Dtype(code)


def _scalar(dtype: Any, raw: Any = None) -> Any:
    content = raw.encode("latin1") if isinstance(raw, str) else raw
    if not isinstance(dtype, _Dtype) or not isinstance(content, bytes):
        raise BadArrayError("a numpy scalar of unknown form")
    if len(content) != dtype.value.itemsize:
        raise BadArrayError("a numpy scalar of another size")
    return np.frombuffer(content, dtype.value)[0].item() if content else dtype.value.type().item()


def _nothing(make: Callable[[], Any]) -> Callable[..., Any]:
    """A name that may be called without arguments only."""

    def called(*arguments: Any) -> Any:
        if arguments:
            raise BadArrayError("arguments where none are expected")
        return make()

    return called


def stand_ins(max_bytes: int) -> Names:
    """The names that a pickle may carry, and what they stand for; its arrays hold `max_bytes` at most."""
    in_arrays, in_texts = _Left(max_bytes), _Left(max_bytes)
    ndarray = _Marker()

    def reconstruct(subtype: Any, shape: Any, code: Any) -> PlainArray:
        if subtype is not ndarray or shape != (0,):
            raise BadArrayError("an array that is none of numpy's own")
        made = PlainArray(shape, np.uint8)
        made.left = in_arrays
        return made

    def frombuffer(buffer: Any, dtype: Any, shape: Any, order: Any) -> PlainArray:
        if not isinstance(buffer, bytes | bytearray) or not isinstance(dtype, _Dtype):
            raise BadArrayError("an array without its bytes")
        if not isinstance(shape, tuple) or order not in {"C", "F"}:
            raise BadArrayError("an array of unknown form")
        _check_shape(shape, dtype.value, len(buffer))
        # A view: it holds no bytes of its own.
        return PlainArray(shape, dtype.value, buffer, order=order)

    def encode(text: Any, encoding: Any) -> bytes:
        if not isinstance(text, str) or encoding not in {"latin1", "latin-1"}:
            raise BadArrayError("bytes in another encoding")
        in_texts.take(len(text))
        return text.encode("latin1")

    modules = ("numpy.core", "numpy._core")
    return {
        ("numpy", "ndarray"): ndarray,
        ("numpy", "dtype"): _Maker(_dtype),
        ("_codecs", "encode"): _Maker(encode),
        ("builtins", "bytes"): _Maker(_nothing(bytes)),
        ("__builtin__", "bytes"): _Maker(_nothing(bytes)),
        ("collections", "OrderedDict"): _Maker(_nothing(dict)),
        **{(f"{module}.multiarray", "_reconstruct"): _Maker(reconstruct) for module in modules},
        **{(f"{module}.multiarray", "scalar"): _Maker(_scalar) for module in modules},
        **{(f"{module}.numeric", "_frombuffer"): _Maker(frombuffer) for module in modules},
    }
