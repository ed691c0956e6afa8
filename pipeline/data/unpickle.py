"""Plain data out of a pickle that nobody vouches for: containers, numbers, strings, numpy arrays; no more.

The bytes are walked before anything is built: every opcode must be one that plain data needs, every
length must lie inside the file, and what a short file can make large (the memo, empty containers,
whole numbers) is bounded. Only then are they loaded, with stand-ins of ours under the few names that
numpy's pickles carry: nothing that a pickle names is ever imported.
"""

import gc
import io
import pickle
import pickletools
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from pipeline.data.plain_numpy import BadArrayError, PlainArray, stand_ins
from pipeline.errors import InputError

MAX_PICKLE_BYTES = 256 << 20
# An empty container takes one byte in a file and at most 72 in memory.
MAX_CONTAINERS = 16_000_000
# Of 64 bits and a sign; longer ones could be chosen to have one hash, which makes a dict slow.
MAX_INT_BYTES, MAX_INT_CHARS = 9, 21
MAX_FLOAT_CHARS = 32

_SHOWN_CHARS = 120
_LEAVES = frozenset({bool, int, float, str, bytes, bytearray, type(None), PlainArray})

_OPCODES = frozenset(
    # Numbers, texts and bytes; containers; what was seen before, and the frame around it all; numpy's own.
    re.findall(
        r"\w+",
        """
        INT BININT BININT1 BININT2 LONG LONG1 FLOAT BINFLOAT NONE NEWTRUE NEWFALSE
        STRING BINSTRING SHORT_BINSTRING UNICODE SHORT_BINUNICODE BINUNICODE BINUNICODE8
        BINBYTES SHORT_BINBYTES BINBYTES8 BYTEARRAY8
        MARK LIST EMPTY_LIST APPEND APPENDS TUPLE EMPTY_TUPLE TUPLE1 TUPLE2 TUPLE3
        DICT EMPTY_DICT SETITEM SETITEMS
        GET BINGET LONG_BINGET PUT BINPUT LONG_BINPUT MEMOIZE PROTO FRAME STOP
        GLOBAL STACK_GLOBAL REDUCE BUILD
        """,
    )
)
_CONTAINER = rb"[\]})ldtR\x85-\x87]"  # each makes one new object


@dataclass(slots=True)
class _Walk:
    """What was found before loading: where globals are named, and the first thing that is not plain."""

    globals_at: list[int] = field(default_factory=list)
    end: int = 0
    refused: str = ""


class _Refused(Exception):  # noqa: N818  (a control signal inside this module)
    """Something that plain data has no need of; says what and where."""


def load_plain(source: Path | BinaryIO, name: str = "") -> Any:
    """The object in a pickle of any protocol, made of plain things only.

    These are dict, list, tuple, str, bytes, bytearray, int, float, bool, None, and PlainArray, an
    ndarray of numbers, truth values or texts. Numpy scalars come as Python's own. A container may hold
    itself. `name` is how errors call the file. Raises InputError when the pickle names anything else
    (with the name and its byte offset), is damaged, or is larger than the limits above.
    """
    what = name or str(source if isinstance(source, Path) else getattr(source, "name", "the pickle"))
    data = _bounded(source, what)
    walk = _walk(data)
    # What comes before the first opcode that is refused is harmless, and tells what it was to act on. The
    # rest becomes STOP, since a frame must be as long as it says.
    sound = data[: walk.end] + pickle.STOP * (len(data) - walk.end) if walk.refused else data
    try:
        with _no_collecting():
            found = _Loader(sound, walk.globals_at).load()
        if not walk.refused and walk.globals_at:
            _check_plain(found)
    except (_Refused, BadArrayError) as error:
        _refuse(what, str(error), error)
    except Exception as error:  # a damaged pickle can raise nearly anything
        if not walk.refused:
            _refuse(what, f"a pickle that is damaged or not plain ({_shown(str(error))})", error)
    if walk.refused:
        _refuse(what, walk.refused)
    return found


@contextmanager
def _no_collecting() -> Iterator[None]:
    """Without looking for garbage: among millions of new containers that are all in use, it only costs."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _refuse(what: str, found: str, cause: Exception | None = None) -> NoReturn:
    raise InputError(
        f"{what}: found {found}; expected a pickle of plain dicts, lists, tuples, numbers, texts and numpy "
        "arrays of these (allowed names: numpy's _reconstruct, scalar, dtype, ndarray, _frombuffer; "
        "_codecs.encode; bytes; OrderedDict). Nothing of it was executed. Get the file from its source "
        "again, and do not load it with plain pickle."
    ) from cause


def _shown(text: str) -> str:
    """Text of a hostile file on one line, without control or other unseen characters."""
    return ascii(text[:_SHOWN_CHARS])[1:-1]


def _bounded(source: Path | BinaryIO, what: str) -> bytes:
    try:
        if isinstance(source, Path):
            with source.open("rb") as opened:
                data = opened.read(MAX_PICKLE_BYTES + 1)
        else:
            data = source.read(MAX_PICKLE_BYTES + 1)
    except OSError as error:
        raise InputError(f"{what}: cannot be read ({error.strerror}); expected a pickle.") from error
    if len(data) > MAX_PICKLE_BYTES:
        raise InputError(
            f"{what}: found more than {MAX_PICKLE_BYTES:,} bytes; expected at most that. Split it by video."
        )
    if not data:
        raise InputError(f"{what}: the file is empty; expected a pickle. Copy it again.")
    return data


def _walk(data: bytes) -> _Walk:
    """Go over all opcodes without building anything; `end` is where STOP was, or the refused opcode."""
    walk = _Walk()
    run = _run_pattern(len(data))
    containers = 0
    while True:
        match = run.match(data, walk.end)
        assert match is not None  # it matches nothing at all, at least
        walk.end = match.end()
        containers += len(match[1])
        if containers > MAX_CONTAINERS:
            walk.refused = f"more than {MAX_CONTAINERS:,} containers at byte {walk.end:,}"
            return walk
        if match[1]:
            continue
        try:
            after = _step(data, walk)
        except _Refused as error:
            walk.refused = str(error)
            return walk
        if after == len(data) and data[walk.end] == pickle.STOP[0]:
            return walk
        walk.end = after


def _step(data: bytes, walk: _Walk) -> int:
    """Where the opcode after that at `walk.end` begins. Raises _Refused when it must not be there."""
    at = walk.end
    if at >= len(data):
        raise _Refused(f"no end of the pickle after {at:,} bytes")
    opcode = _BY_CODE.get(data[at])
    if opcode is None or opcode.name not in _OPCODES:
        shown = f"the opcode {opcode.name}" if opcode else f"the unknown opcode 0x{data[at]:02x}"
        if opcode and opcode.name == "INST":
            shown += f" of {_shown('.'.join(data[at + 1 : at + 200].decode('latin1').split(chr(10))[:2]))}"
        raise _Refused(f"{shown} at byte {at:,}")
    begin, end = _argument(data, at + 1, opcode)
    if end > len(data):
        raise _Refused(f"{opcode.name} at byte {at:,} of {end - begin:,} bytes, beyond the end of the file")
    match opcode.name:
        case "STOP" if end < len(data):
            raise _Refused(f"{len(data) - end:,} bytes after the end of the pickle at byte {at:,}")
        case "GLOBAL" | "STACK_GLOBAL":
            walk.globals_at.append(at)
        case "PUT" | "LONG_BINPUT":
            text = data[begin:end]
            index = int.from_bytes(text, "little") if opcode.name == "LONG_BINPUT" else _whole(text)
            if not 0 <= index < len(data):
                raise _Refused(f"{opcode.name} of place {_shown(str(index))} at byte {at:,}")
        case "LONG1" if end - begin > MAX_INT_BYTES:
            raise _Refused(f"a whole number of more than 64 bits at byte {at:,}")
        case "INT" | "LONG" if end - begin > MAX_INT_CHARS + 1:
            raise _Refused(f"a whole number of more than 64 bits at byte {at:,}")
        case "FLOAT" if end - begin > MAX_FLOAT_CHARS + 1:
            raise _Refused(f"a number of {end - begin:,} characters at byte {at:,}")
    return end


def _whole(text: bytes) -> int:
    return int(text) if re.fullmatch(rb"[0-9]{1,10}\n", text) else -1


def _argument(data: bytes, at: int, opcode: pickletools.OpcodeInfo) -> tuple[int, int]:
    """Where an opcode's argument begins (after its length) and ends; past the file when cut off."""
    if opcode.arg is None:
        return at, at
    size = opcode.arg.n
    if size >= 0:
        return at, at + size
    beyond = len(data) + 1
    if size == pickletools.UP_TO_NEWLINE:
        begin = at
        for _ in range(2 if opcode.name == "GLOBAL" else 1):
            at = data.find(b"\n", at) + 1
            if not at:
                return begin, beyond
        return begin, at
    width = _LENGTH_BYTES[size]
    if at + width > len(data):
        return at, beyond
    return at + width, at + width + int.from_bytes(data[at : at + width], "little")


_BY_CODE = {ord(opcode.code): opcode for opcode in pickletools.opcodes}
_LENGTH_BYTES = {
    pickletools.TAKEN_FROM_ARGUMENT1: 1,
    pickletools.TAKEN_FROM_ARGUMENT4: 4,
    pickletools.TAKEN_FROM_ARGUMENT4U: 4,
    pickletools.TAKEN_FROM_ARGUMENT8U: 8,
}


def _run_pattern(size: int) -> re.Pattern[bytes]:
    """What `_step` would let pass, as one pattern, since ten million steps in Python take ten seconds.

    It takes a run of numbers, short texts and memo entries, then (group 1) a run of new containers.
    Whatever it does not match, `_step` looks at. Memo places must be below the file's `size`.
    """
    top, second = size >> 24, size >> 16 & 0xFF
    places = [rb"..[\x00-%b]%b" % (re.escape(bytes([second - 1])), re.escape(bytes([top])))] if second else []
    if top:
        places.append(rb"...[\x00-%b]" % re.escape(bytes([top - 1])))
    digits = max(1, len(str(size)) - 1)
    leaves = [
        rb"[(Naesub\x88\x89\x94]",
        rb"[Khq].",
        rb"G.{8}",
        rb"M..",
        rb"[Jj].{4}",
        *(rb"r" + place for place in places),
        *(b"\x8c%b.{%d}" % (re.escape(bytes([n])), n) for n in range(16)),
        *(b"X%b\x00\x00\x00.{%d}" % (re.escape(bytes([n])), n) for n in range(16)),
        *(b"C%b.{%d}" % (re.escape(bytes([n])), n) for n in (1, 2, 4, 8, 16, 32)),
        *(b"\x8a%b.{%d}" % (re.escape(bytes([n])), n) for n in range(1, MAX_INT_BYTES + 1)),
        rb"[IL][^\n]{1,%d}+\n" % MAX_INT_CHARS,
        rb"F[^\n]{1,%d}+\n" % MAX_FLOAT_CHARS,
        rb"V[^\n]{0,64}+\n",
        rb"g[0-9]{1,9}+\n",
        rb"p[0-9]{1,%d}+\n" % digits,
    ]
    return re.compile(rb"(?:%b)*+(%b*+)" % (b"|".join(leaves), _CONTAINER), re.DOTALL)


class _Loader(pickle.Unpickler):
    """Loads what was walked over; knows our stand-ins and nothing else."""

    def __init__(self, data: bytes, globals_at: list[int]) -> None:
        # Python 2 wrote its texts, and the bytes of its arrays, as byte strings.
        super().__init__(io.BufferedReader(io.BytesIO(data), 1 << 17), encoding="latin1")
        self._offsets: Iterator[int] = iter(globals_at)
        # An honest file holds the bytes of each of its arrays.
        self._known = stand_ins(len(data))

    def find_class(self, module: str, name: str) -> Any:
        # Called for each global in the order of the file.
        offset = next(self._offsets)
        known = self._known.get((module, name))
        if known is None:
            raise _Refused(f"the global {_shown(f'{module}.{name}')} at byte {offset:,}")
        return known


def _check_plain(found: Any) -> None:
    """Raise BadArrayError when a stand-in itself is left in the data, in place of what it makes."""
    waiting = [found]
    seen: set[int] = set()
    while waiting:
        value = waiting.pop()
        kind = type(value)
        if kind in _LEAVES or id(value) in seen:
            continue
        if kind not in {dict, list, tuple}:
            raise BadArrayError(f"{kind.__name__.strip('_')} in place of a value")
        seen.add(id(value))
        for part in (value.keys(), value.values()) if kind is dict else (value,):
            if not _LEAVES.issuperset(map(type, part)):
                waiting.extend(item for item in part if type(item) not in _LEAVES)
