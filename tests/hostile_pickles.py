"""Pickles that want more than plain data, are bombs, or lie about arrays; each with what its refusal says."""

import copyreg
import os
import pickle
from typing import Any

import numpy as np


class _Reduced:
    def __init__(self, *call: Any) -> None:
        self.call = call

    def __reduce__(self) -> Any:
        return self.call


class _Own:
    def __init__(self) -> None:
        self.x = 1


class _NewEx:
    def __reduce_ex__(self, protocol: Any) -> Any:
        return copyreg.__newobj_ex__, (_Own, (), {"a": 1})  # type: ignore[attr-defined]


class _Subarray(np.ndarray[Any, Any]):
    pass


TOUCH = "touch pwned"
NAME = b"cnumpy._core.multiarray\n"
DTYPE = b"cnumpy\ndtype\n(S'f8'\nI00\nI01\ntR"
STATE = b"(I3\nS'<'\nNNNI-1\nI-1\nI0\ntb"
EMPTY = NAME + b"_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR"


def _deflected() -> bytes:
    """os.system by STACK_GLOBAL, its module and name out of the memo."""
    return (
        b"\x80\x04\x8c\x05posix\x94\x8c\x06system\x94\x8c\x01x\x8c\x01y00h\x00h\x01\x93\x8c\x0b%b\x85R."
        % (TOUCH.encode())
    )


NAMED = {
    "system by REDUCE": (pickle.dumps(_Reduced(os.system, (TOUCH,)), 0), r"posix\.system at byte 0"),
    "system in protocol 4": (pickle.dumps([1, _Reduced(os.system, (TOUCH,))]), r"posix\.system at byte \d+"),
    "eval": (pickle.dumps(_Reduced(eval, ("1",)), 2), r"__builtin__\.eval at byte 2"),
    "exec": (pickle.dumps(_Reduced(exec, ("1",))), r"builtins\.exec"),
    "getattr": (pickle.dumps(_Reduced(getattr, ("", "upper"))), r"builtins\.getattr"),
    "dotted": (b"\x80\x04\x8c\x05numpy\x8c\x0edtype.__init__\x93.", r"numpy\.dtype\.__init__"),
    "copyreg": (pickle.dumps(_Reduced(copyreg._reconstructor, (_Own, object, None))), r"copyreg\._recon"),
    "old instance": (pickle.dumps(_Own(), 0), r"(copyreg|copy_reg)\._reconstructor"),
    "NEWOBJ": (pickle.dumps(_Own()), r"tests\.hostile_pickles\._Own"),
    "NEWOBJ_EX": (pickle.dumps(_NewEx(), 4), r"tests\.hostile_pickles\._Own"),
    "type": (pickle.dumps(int), r"builtins\.int"),
    "set": (pickle.dumps({1}, 2), r"__builtin__\.set"),
    "subclass": (pickle.dumps(np.zeros(2).view(_Subarray)), r"hostile_pickles\._Subarray"),
    "complex": (pickle.dumps(1j), r"builtins\.complex"),
    "control characters": (b"cos\x1b[31m\nsystem\n.", r"os\\x1b\[31m\.system"),
    "numpy's loader": (b"cnumpy\nload\n(S'x'\ntR.", r"numpy\.load"),
    "INST": (b"(S'touch pwned'\niposix\nsystem\n.", r"opcode INST of posix\.system at byte 16"),
    "OBJ": (b"(cposix\nsystem\nS'touch pwned'\no.", r"posix\.system at byte 1"),
    "memo": (_deflected().replace(b"00h", b"h"), r"posix\.system"),
}
OPCODES = {
    "POP": (_deflected(), "opcode POP at byte"),
    "persistent id": (b"P1\n.", "opcode PERSID at byte 0"),
    "binary persistent id": (b"K\x01Q.", "opcode BINPERSID at byte 2"),
    "EXT1": (b"\x80\x02\x82\x01.", "opcode EXT1 at byte 2"),
    "EXT4": (b"\x80\x02\x84\x01\x00\x00\x00.", "opcode EXT4"),
    "out of band": (b"\x80\x05\x97.", "opcode NEXT_BUFFER"),
    "read-only buffer": (b"\x80\x05K\x01\x98.", "opcode READONLY_BUFFER"),
    "set opcodes": (pickle.dumps({1}), "opcode EMPTY_SET"),
    "unknown": (b"\xff.", "unknown opcode 0xff at byte 0"),
    "nothing after": (b"K\x01.K\x02.", "3 bytes after the end of the pickle at byte 2"),
    "cut off": (pickle.dumps(list(range(1000)))[:-1], "no end of the pickle"),
    "half a number": (b"J\x01", "beyond the end"),
    "half a length": (b"\x8e\x01\x02", "beyond the end"),
    "no line end": (b"I12", "beyond the end"),
}
BOMBS = {
    "memo": (b"\x80\x02K\x01r\xff\xff\xff\x7f.", "LONG_BINPUT of place 2147483647 at byte 4"),
    "memo as text": (b"I1\np2147483647\n.", "PUT of place 2147483647"),
    "memo of -1": (b"I1\np-1\n.", "PUT of place -1"),
    "LONG4": (b"\x80\x02\x8b\xff\xff\xff\x7f.", "opcode LONG4"),
    "long integer": (pickle.dumps(1 << 90), "more than 64 bits"),
    "long text integer": (b"L" + b"9" * 5000 + b"L\n.", "more than 64 bits"),
    "BINBYTES8": (b"\x80\x04\x8e" + b"\xff" * 7 + b"\x0f.", "BINBYTES8 at byte 2 of .* beyond the end"),
    "BYTEARRAY8": (b"\x80\x05\x96" + b"\xff" * 7 + b"\x0f.", "BYTEARRAY8 at byte 2 of .* beyond the end"),
    "BINUNICODE8": (b"\x80\x04\x8d" + b"\x00" * 7 + b"\x01.", "BINUNICODE8 .* beyond the end"),
    "BINSTRING": (b"T\xff\xff\xff\xff.", "BINSTRING .* beyond the end"),
    "shape": (
        EMPTY + b"(I1\n(I1000000000\nI1000000000\nt" + DTYPE + STATE + b"I00\nS''\ntb.",
        "does not fit",
    ),
    "empty sides": (EMPTY + b"(I1\n(I1000000000\nI0\nt" + DTYPE + STATE + b"I00\nS''\ntb.", "does not fit"),
    "wide text": (b"cnumpy\ndtype\n(S'U999999999'\nI00\nI01\ntR.", "not of numbers"),
    "no width": (
        EMPTY + b"(I1\n(I1000000000\ntcnumpy\ndtype\n(S'U0'\nI00\nI01\ntRI00\nS''\ntb.",
        "does not fit",
    ),
    "bytes copied": (
        b"(c_codecs\nencode\np0\n(V%b\np1\nVlatin1\ntR" % (b"x" * 300) + b"g0\n(g1\nVlatin1\ntR" * 99 + b"t.",
        "more bytes than the file",
    ),
    "arrays copied": (
        b"("
        + DTYPE
        + STATE
        + b"p7\nS'%b'\np8\n" % (b"x" * 8000)
        + 9 * (EMPTY + b"(I1\n(I1000\ntg7\nI00\ng8\ntb")
        + b"t.",
        "more bytes than the file",
    ),
}
ARRAYS = {
    "object dtype": (pickle.dumps(np.array([_Own()])), "not of numbers or texts|hostile_pickles"),
    "object scalar": (NAME + b"scalar\n(cnumpy\ndtype\n(S'O8'\nI00\nI01\ntRS'x'\ntR.", "not of numbers"),
    "record dtype": (pickle.dumps(np.zeros(1, "i4,i4")), "not of numbers"),
    "date": (pickle.dumps(np.datetime64("2024-01-01")), "not of numbers"),
    "dtype of a dtype": (b"cnumpy\ndtype\n(cnumpy\nndarray\nI00\nI01\ntR.", "not of numbers"),
    "dtype with fields": (DTYPE + b"(I3\nS'|'\nNS'a'\nNI-1\nI-1\nI0\ntb.", "dtype of unknown form"),
    "dtype of another size": (DTYPE + b"(I3\nS'|'\nNNNI1\nI-1\nI0\ntb.", "dtype of unknown form"),
    "dtype left over": (DTYPE + b".", "in place of a value"),
    "name left over": (b"(lcnumpy\nndarray\na.", "in place of a value"),
    "name as a key": (b"(dcnumpy\ndtype\nI1\ns.", "in place of a value"),
    "scalar too short": (NAME + b"scalar\n(" + DTYPE + b"S'1234'\ntR.", "another size"),
    "no dtype": (NAME + b"scalar\n(S'f8'\nS'12345678'\ntR.", "unknown form"),
    "another subtype": (NAME + b"_reconstruct\n(S'ndarray'\n(I0\ntS'b'\ntR.", "none of numpy's own"),
    "large at once": (
        NAME + b"_reconstruct\n(cnumpy\nndarray\n(I1000000000\ntS'b'\ntR.",
        "none of numpy's own",
    ),
    "state of a list": (EMPTY + b"(I1\n(I1\nt" + DTYPE + STATE + b"I00\n(lI1\natb.", "state of unknown form"),
    "state of a dict": (EMPTY + b"(dS'x'\nI1\nsb.", "state of unknown form"),
    "state twice": (
        EMPTY + 2 * (b"(I1\n(I1\nt" + DTYPE + STATE + b"I00\nS'12345678'\ntb") + b".",
        "its state twice",
    ),
    "negative side": (EMPTY + b"(I1\n(I-1\nt" + DTYPE + STATE + b"I00\nS''\ntb.", "impossible shape"),
    "state of a name": (b"cnumpy\ndtype\n(dS'x'\nI1\nsb.", "a state for a name"),
    "slot of a name": (b"cnumpy\ndtype\n(N(dS'_make'\nI1\nstb.", "a state for a name"),
    "bytes of something": (b"cbuiltins\nbytes\n(I1000000000\ntR.", "arguments where none"),
    "dict of something": (b"ccollections\nOrderedDict\n((lltR.", "arguments where none|not plain"),
    "another codec": (b"c_codecs\nencode\n(Vx\nVhex\ntR.", "another encoding"),
    "calls a marker": (b"cnumpy\nndarray\n(I1\ntR.", "not callable"),
    "list as a key": (b"(d(lI1\ns.", "unhashable"),
    "empty stack": (b".", "damaged"),
    "no such memo": (b"h\x05.", "damaged"),
    "protocol 99": (b"\x80\x63K\x01.", "damaged"),
}
