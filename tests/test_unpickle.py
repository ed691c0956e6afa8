"""The unpickler for plain data: what goes in comes out, and what is more than plain is refused unexecuted."""

import builtins
import io
import os
import pickle
import pickletools
import re
import struct
import tracemalloc
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.data import unpickle
from pipeline.data.unpickle import load_plain
from pipeline.errors import InputError
from tests.hostile_pickles import ARRAYS, BOMBS, DTYPE, EMPTY, NAME, NAMED, OPCODES, STATE


def _load(data: bytes) -> Any:
    return load_plain(io.BytesIO(data), "a.pkl")


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64)
    | st.floats(allow_nan=False)
    | st.text()
    | st.binary(),
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.dictionaries(st.text() | st.integers(-(2**63), 2**63) | st.tuples(st.integers(0, 9)), inner)
    ),
)


@given(PLAIN, st.integers(0, pickle.HIGHEST_PROTOCOL))
def test_plain_data_comes_back(value: Any, protocol: int) -> None:
    found = _load(pickle.dumps(value, protocol))
    assert found == value and type(found) is type(value)


DTYPES = (
    hnp.boolean_dtypes()
    | hnp.integer_dtypes()
    | hnp.unsigned_integer_dtypes()
    | hnp.floating_dtypes(sizes=(16, 32, 64))
)
TEXTS = hnp.unicode_string_dtypes(min_len=1, max_len=8) | hnp.byte_string_dtypes(min_len=1, max_len=8)


@given(
    hnp.arrays(DTYPES | TEXTS, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0)),
    st.booleans(),
    st.integers(0, pickle.HIGHEST_PROTOCOL),
    st.booleans(),
)
def test_arrays_come_back(array: Any, fortran: bool, protocol: int, old: bool) -> None:
    sent = np.asfortranarray(array) if fortran else array
    data = pickle.dumps({"a": sent, "b": [sent]}, protocol)
    if old and protocol < 4:  # as numpy before 2.0 wrote it; later ones frame and count the names
        data = data.replace(b"numpy._core.", b"numpy.core.")
    found = _load(data)
    assert found["a"] is found["b"][0] and _native(found["a"]) == _native(array)
    np.testing.assert_array_equal(found["a"], array)


def _native(array: Any) -> Any:
    return array.dtype.newbyteorder("=")


@given(DTYPES | TEXTS, st.data(), st.integers(0, pickle.HIGHEST_PROTOCOL))
def test_numpy_scalars_come_as_pythons(dtype: Any, data: st.DataObject, protocol: int) -> None:
    scalar = data.draw(hnp.arrays(dtype, 1))[0]
    found = _load(pickle.dumps((scalar, [scalar]), protocol))
    assert type(found[0]) is type(scalar.item())
    np.testing.assert_equal(found, (scalar.item(), [scalar.item()]))


def test_the_names_of_both_layouts_of_numpy_are_known() -> None:
    array = np.array([1.5, 2.5], ">f4")
    for protocol, names in ((4, (b"\x8c\x16numpy._core.multiarray", b"\x8c\x15numpy.core.multiarray")),):
        data = pickle.dumps([array, array[0]], protocol)
        assert names[0] in data
        start = data.index(b"\x95") + 1
        shorter = data.replace(*names)
        size = struct.unpack("<Q", data[start : start + 8])[0] - (len(data) - len(shorter))
        found = _load(shorter[:start] + struct.pack("<Q", size) + shorter[start + 8 :])
        assert found[0].tolist() == [1.5, 2.5] and found[1] == 1.5


def test_what_python_2_wrote_is_read() -> None:
    # pickle.dumps({"track_id": 5L, "bbox": numpy.array([1.0])}, 2) of Python 2.7
    array = (
        b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R(K\x01K\x01\x85"
        b"cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
        b"\x89U\x08\x00\x00\x00\x00\x00\x00\xf0?tb"
    )
    found = _load(b"\x80\x02}(U\x08track_id\x8a\x01\x05U\x04bbox" + array + b"u.")
    assert found["track_id"] == 5 and found["bbox"].tolist() == [1.0]


def test_shared_and_own_containers_stay_so() -> None:
    shared: list[Any] = [1]
    ring: list[Any] = [shared, shared, OrderedDict(a=np.int8(3))]
    ring.append(ring)
    found = _load(pickle.dumps(ring))
    assert found[0] is found[1] and found[3] is found and found[2] == {"a": 3}


@pytest.mark.parametrize(
    ("data", "named"),
    [
        pytest.param(*case, id=name)
        for table in (NAMED, OPCODES, BOMBS, ARRAYS)
        for name, case in table.items()
    ],
)
def test_hostile_pickles_are_refused_unexecuted(
    data: bytes, named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    called: list[Any] = []
    monkeypatch.setattr(os, "system", called.append)
    monkeypatch.setattr(builtins, "__import__", _no_import(builtins.__import__, called))
    tracemalloc.start()
    try:
        with pytest.raises(
            InputError, match=rf"a\.pkl: found .*(?:{named}).*; expected a pickle of plain dicts"
        ):
            _load(data)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert not called and not list(tmp_path.iterdir())
    assert peak < 20 << 20


def _no_import(real: Any, called: list[Any]) -> Any:
    def imported(name: str, *rest: Any, **more: Any) -> Any:
        if name in {"posix", "os", "nt"}:
            called.append(name)
        return real(name, *rest, **more)

    return imported


def test_the_same_pickle_does_execute_with_plain_pickle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table above proves something only if its first entry is a real attack."""
    monkeypatch.chdir(tmp_path)
    pickle.loads(NAMED["system by REDUCE"][0])
    assert (tmp_path / "pwned").exists()


PIECES = [
    *(ord(op.code).to_bytes(1) for op in pickletools.opcodes if op.name in unpickle._OPCODES and not op.arg),
    *(b"K\x01", b"h\x00", b"q\x00", b"\x8c\x01b", b"C\x01x", b"G?\xf0\x00\x00\x00\x00\x00\x00"),
    *(DTYPE, STATE, EMPTY, NAME + b"scalar\n", b"cnumpy\nndarray\n", b"ccollections\nOrderedDict\n"),
]


@given(st.binary(max_size=300) | st.lists(st.sampled_from(PIECES)).map(b"".join))
def test_any_bytes_give_plain_data_or_an_error(data: bytes) -> None:
    try:
        unpickle._check_plain(_load(data + b"."))
    except InputError as error:
        assert "a.pkl" in str(error)


@given(st.lists(st.sampled_from(range(6))), st.integers(0, 10_000), st.integers(0, 255))
def test_a_damaged_pickle_gives_plain_data_or_an_error(path: list[int], at: int, byte: int) -> None:
    value = {"video_0001": {np.int64(1): [np.arange(4.0), np.float32(1), "x" * 300, path, 2**40]}}
    data = bytearray(pickle.dumps(value, len(path) % 6))
    data[at % len(data)] = byte
    try:
        unpickle._check_plain(_load(bytes(data)))
    except InputError as error:
        assert "a.pkl" in str(error)


def test_the_fast_walk_agrees_with_the_slow_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pattern only skips what the steps would let pass."""
    value = {"v": [{"a": [1.5, 70_000, 300, -1, "s" * n, np.arange(3), 2**n]} for n in range(40)]}
    for protocol in range(6):
        data = pickle.dumps(value, protocol)
        fast = unpickle._walk(data)
        with monkeypatch.context() as patch:
            patch.setattr(unpickle, "_run_pattern", lambda size: re.compile(rb"()"))
            slow = unpickle._walk(data)
        assert (fast.end, fast.globals_at, fast.refused) == (slow.end, slow.globals_at, "")


def test_containers_and_sizes_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpickle, "MAX_CONTAINERS", 100)
    assert _load(b"(" + b"]" * 99 + b"t.") == ([],) * 99
    with pytest.raises(InputError, match="more than 100 containers"):
        _load(b"(" + b"]" * 101 + b"t.")
    path = tmp_path / "big.pkl"
    path.write_bytes(pickle.dumps("x" * 2000))
    monkeypatch.setattr(unpickle, "MAX_PICKLE_BYTES", 1000)
    with pytest.raises(InputError, match=r"big\.pkl: found more than 1,000 bytes"):
        load_plain(path)


def test_a_deep_pickle_takes_no_stack() -> None:
    depth = 200_000
    found = _load(b"]" * depth + b"a" * (depth - 1) + b".")
    for _ in range(depth - 1):
        (found,) = found
    assert found == []


def test_files_that_are_no_pickle(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_plain(tmp_path / "none.pkl")
    (tmp_path / "empty.pkl").touch()
    with pytest.raises(InputError, match="is empty"):
        load_plain(tmp_path / "empty.pkl")
    (tmp_path / "page.pkl").write_text("<!doctype html><title>Not found</title>")
    with pytest.raises(InputError, match="found the unknown opcode 0x3c at byte 0"):
        load_plain(tmp_path / "page.pkl")
