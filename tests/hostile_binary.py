"""Hostile archives, pickles, other programs' files under a table's name, and files that are no files."""

import gzip
import io
import os
import pickle
import random
import socket
import sqlite3
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather

from tests.hostile_case import MARKER, MIB, RIGHT, Case, Verdict, as_csv

_HEAD = b"video_id,rank,description\n"
_GIB = 1024 * MIB


class _Touches:
    """Unpickled, it would make the marker file."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, str]]:
        return open, (MARKER, "w")


def _zip(*entries: tuple[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip of these names and contents, with one date."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", method) as archive:
        for name, data in entries:
            archive.writestr(zipfile.ZipInfo(name, (2026, 1, 1, 0, 0, 0)), data, method)
    return target.getvalue()


def _gzip(data: bytes) -> bytes:
    return gzip.compress(data, 1, mtime=0)


def _zstd(data: bytes) -> bytes:
    packed: bytes = pa.compress(data, "zstd", asbytes=True)
    return packed


def _deflated_zeros(mib: int) -> bytes:
    """Raw deflate of that many MiB of zeros: one flushed block, repeated."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    block = packer.compress(bytes(MIB)) + packer.flush(zlib.Z_FULL_FLUSH)
    return block * mib + packer.flush()


def _zip_bomb(mib: int, said: int | None = None) -> bytes:
    """A zip of one CSV of zeros; `said` is the size that its directory claims."""
    data, name = _deflated_zeros(mib), b"p.csv"
    size = min(mib * MIB if said is None else said, 2**32 - 1)
    common = struct.pack("<HHHHHIIIHH", 20, 0, 8, 0, 0x21, 0, len(data), size, len(name), 0)
    local = b"PK\x03\x04" + common + name + data
    central = b"PK\x01\x02\x14\x00" + common + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name
    end = b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(central), len(local), 0)
    return local + central + end


def _flag(archive: bytes, flag: int) -> bytes:
    """The archive with a flag of its first entry set, in both of its headers."""
    data = bytearray(archive)
    data[6] |= flag
    data[data.index(b"PK\x01\x02") + 8] |= flag
    return bytes(data)


def _archives() -> list[Case]:
    right, rows = as_csv(), b"v1,1,A cat.\n"
    million_rows = _gzip(rows * 100_000) * 100
    contents: dict[str, tuple[str, bytes, Verdict]] = {
        "gz-bomb": ("p.csv.gz", _gzip(_HEAD) + _gzip(bytes(16 * MIB)) * 256, "refused"),
        "gz-bomb-of-letters": ("p.csv.gz", _gzip(_HEAD + b"v1,1,") + _gzip(b"w" * 16 * MIB) * 256, "refused"),
        "gz-16-mib-line": ("p.csv.gz", _gzip(_HEAD + b"v1,1,") + _gzip(b"w" * MIB) * 16, "refused"),
        "gz-10-million-rows": ("p.csv.gz", _gzip(_HEAD) + million_rows, "refused"),
        "gz-cut": ("p.csv.gz", _gzip(right)[:-9], "refused"),
        "gz-wrong-sum": ("p.csv.gz", _gzip(right)[:-8] + bytes(8), "refused"),
        "gz-garbage-behind": ("p.csv.gz", _gzip(right) + b"garbage", "either"),
        "gz-of-gz": ("p.csv.gz", _gzip(_gzip(right)), "refused"),
        "gz-of-zip": ("p.csv.gz", _gzip(_zip(("p.csv", right))), "refused"),
        "gz-of-nothing": ("p.csv.gz", _gzip(b""), "refused"),
        "gz-of-pickle": ("p.csv.gz", _gzip(pickle.dumps(_Touches())), "refused"),
        "gz-only-its-sign": ("p.csv.gz", b"\x1f\x8b", "refused"),
        "gz-named-parquet": ("p.parquet", _gzip(right), "either"),
        "zst-bomb": ("p.csv.zst", _zstd(_HEAD) + _zstd(bytes(16 * MIB)) * 256, "refused"),
        "zst-claims-much": ("p.csv.zst", b"\x28\xb5\x2f\xfd\xe0" + b"\xff" * 8 + b"\x01\x00\x00", "refused"),
        "zst-window-of-gigabytes": ("p.csv.zst", b"\x28\xb5\x2f\xfd\x00\xff" + b"\x01\x00\x00", "refused"),
        "zst-cut": ("p.csv.zst", _zstd(right)[:-3], "refused"),
        "zst-of-zst": ("p.csv.zst", _zstd(_zstd(right)), "refused"),
        "zst-skippable": ("p.csv.zst", b"\x50\x2a\x4d\x18" + struct.pack("<I", 2**31) + b"x", "refused"),
        "zip-bomb": ("p.zip", _zip_bomb(4_096), "refused"),
        "zip-bomb-said-small": ("p.zip", _zip_bomb(4_096, said=100), "refused"),
        "zip-says-much": ("p.zip", _zip_bomb(1, said=2**32 - 1), "refused"),
        "zip-of-zip": ("p.zip", _zip(("p.zip", _zip(("p.csv", right)))), "refused"),
        "zip-of-two": ("p.zip", _zip(("a.csv", right), ("b.csv", right)), "refused"),
        "zip-of-70000": ("p.zip", _zip(*((f"{n}.csv", b"") for n in range(70_000))), "refused"),
        "zip-of-one-name-twice": ("p.zip", _twice(right), "refused"),
        "zip-of-nothing": ("p.zip", _zip(), "refused"),
        "zip-of-a-folder": ("p.zip", _zip(("folder/", b"")), "refused"),
        "zip-encrypted": ("p.zip", _flag(_zip(("p.csv", right)), 1), "refused"),
        "zip-method-unknown": (
            "p.zip",
            _zip(("p.csv", right)).replace(b"\x08\0\0\0", b"\x63\0\0\0"),
            "refused",
        ),
        "zip-path-parents": ("p.zip", _zip((f"../../../{MARKER}", right)), "either"),
        "zip-path-absolute": ("p.zip", _zip((f"/tmp/{MARKER}.csv", right)), "either"),
        "zip-path-drive": ("p.zip", _zip(("C:\\x.csv", right)), "either"),
        "zip-path-nul": ("p.zip", _zip(("p.csv", right)).replace(b"p.csv", b"p\0.cs"), "either"),
        "zip-path-bidirectional": ("p.zip", _zip(("p\u202evsc.exe", right)), "either"),
        "zip-without-a-name": ("p.zip", _zip(("", right)), "either"),
        "zip-symlink": ("p.zip", _zip_link(), "refused"),
        "zip-cut": ("p.zip", _zip(("p.csv", right))[:-30], "refused"),
        "zip-wrong-sum": ("p.zip", _zip(("p.csv", right), method=0).replace(b"A cat", b"A dog"), "refused"),
        "zip-lzma": ("p.zip", _zip(("p.csv", right), method=zipfile.ZIP_LZMA), "either"),
        "zip-bzip2": ("p.zip", _zip(("p.csv", right), method=zipfile.ZIP_BZIP2), "either"),
        "zip-of-html": ("p.zip", _zip(("p.csv", b"<html><script>1</script></html>")), "refused"),
        "zip-behind-csv": ("p.csv", right + _zip(("p.csv", right)), "refused"),
        "zip-overlapping": ("p.zip", _overlapping(), "refused"),
    }
    return [Case(f"archive-{name}", file, data, verdict) for name, (file, data, verdict) in contents.items()]


def _twice(data: bytes) -> bytes:
    both = _zip(("a.csv", data), ("b.csv", data))
    return both.replace(b"b.csv", b"a.csv")


def _zip_link() -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        link = zipfile.ZipInfo("p.csv", (2026, 1, 1, 0, 0, 0))
        link.create_system, link.external_attr = 3, 0o120777 << 16
        archive.writestr(link, "/etc/passwd")
    return target.getvalue()


def _overlapping() -> bytes:
    """A thousand entries that share one compressed body."""
    one = _zip_bomb(64)
    local = one[: one.index(b"PK\x01\x02")]
    central = one[len(local) : one.index(b"PK\x05\x06")] * 1_000
    return (
        local
        + central
        + b"PK\x05\x06"
        + struct.pack("<HHHHIIH", 0, 0, 1_000, 1_000, len(central), len(local), 0)
    )


def _sqlite() -> bytes:
    with sqlite3.connect(":memory:") as base:
        base.execute("create table p (video_id text, rank int, description text)")
        return base.serialize()


def _feather() -> bytes:
    target = io.BytesIO()
    feather.write_feather(pa.table({"video_id": ["v1"], "rank": [1], "description": ["A cat."]}), target)
    return target.getvalue()


def _npy() -> bytes:
    target = io.BytesIO()
    np.save(target, np.array([_Touches()], dtype=object), allow_pickle=True)
    return target.getvalue()


def _tar() -> bytes:
    target = io.BytesIO()
    with tarfile.open(fileobj=target, mode="w") as archive:
        entry = tarfile.TarInfo(f"../../{MARKER}")
        entry.size = len(as_csv())
        archive.addfile(entry, io.BytesIO(as_csv()))
    return target.getvalue()


def _renamed() -> list[Case]:
    found = []
    for protocol in (0, 2, 5):
        data = pickle.dumps(_Touches(), protocol)
        found += [
            Case(f"pickle-{protocol}-{ending}", f"p.{ending}", data) for ending in ("parquet", "csv", "json")
        ]
    rows = pickle.dumps([{"video_id": "v1", "rank": 1, "description": "A cat.", "more": _Touches()}])
    found.append(Case("pickle-of-rows", "p.pkl", rows))
    found.append(Case("pickle-behind-parquet-sign", "p.parquet", b"PAR1" + rows + b"PAR1"))
    svg = b'<svg xmlns="http://www.w3.org/2000/svg" onload="alert(4711)"/>'
    entity = b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'
    others = {
        "sqlite": _sqlite(),
        "feather": _feather(),
        "npy": _npy(),
        "tar": _tar(),
        "elf": b"\x7fELF\x02\x01\x01" + bytes(57),
        "exe": b"MZ\x90\x00" + bytes(60) + b"PE\0\0",
        "png": b"\x89PNG\r\n\x1a\n" + bytes(100),
        "mp4": b"\0\0\0\x18ftypmp42" + bytes(100),
        "pdf": b"%PDF-1.7\n1 0 obj <</OpenAction 2 0 R>>\n",
        "xls": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(512),
        "xlsx": _zip(("[Content_Types].xml", b"<Types/>"), ("xl/workbook.xml", b"<workbook/>")),
        "bz2": b"BZh91AY&SY" + bytes(40),
        "xz": b"\xfd7zXZ\0\0\x04" + bytes(40),
        "7z": b"7z\xbc\xaf\x27\x1c" + bytes(40),
        "rar": b"Rar!\x1a\x07\x01\x00" + bytes(40),
        "orc": b"ORC" + bytes(40) + b"ORC",
        "avro": b"Obj\x01\x04\x14avro.codec",
        "hdf5": b"\x89HDF\r\n\x1a\n" + bytes(100),
        "html": b"<!DOCTYPE html><title>404</title><script>alert(4711)</script>",
        "svg": svg,
        "xml-entity": entity,
        "shell": f"#!/bin/sh\ntouch {MARKER}\n".encode(),
        "python": f"import pathlib\npathlib.Path('{MARKER}').touch()\n".encode(),
        "zeros": bytes(MIB),
        "ones": b"\xff" * MIB,
        "random": random.Random(7).randbytes(MIB),
        "empty": b"",
        "blank": b" \t\r\n" * 1_000,
        "log": b"2026-01-01 12:00:00 ERROR nothing, to see: here\n" * 1_000,
    }
    endings = ("csv", "parquet", "json")
    for place, (name, data) in enumerate(others.items()):
        found.append(Case(f"renamed-{name}", f"p.{endings[place % 3]}", data))
    return found


def _link(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


def _unreadable(path: Path) -> None:
    path.write_bytes(b"nobody reads this")
    path.chmod(0)


def _socket(path: Path) -> None:
    before = Path.cwd()
    os.chdir(path.parent)  # a socket's path has to be short
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(path.name)
    finally:
        os.chdir(before)


def _sparse(path: Path) -> None:
    with path.open("wb") as target:
        target.truncate(20 * _GIB)


def _one_line(path: Path) -> None:
    with path.open("wb") as target:
        target.write(_HEAD + b"v1,1,")
        for _ in range(100):
            target.write(b"w" * MIB)


def _special() -> list[Case]:
    right = as_csv()
    return [
        Case("file-pipe", "p.csv", os.mkfifo),
        Case("file-socket", "p.csv", _socket),
        Case("file-folder", "p.csv", Path.mkdir),
        Case("file-link-to-zeros", "p.csv", _link("/dev/zero")),
        Case("file-link-to-random", "p.csv", _link("/dev/urandom")),
        Case("file-link-to-terminal", "p.csv", _link("/dev/tty")),
        Case("file-link-to-input", "p.csv", _link("/dev/stdin")),
        Case("file-link-to-itself", "p.csv", _link("p.csv")),
        Case("file-link-to-nothing", "p.csv", _link("nothing.csv")),
        Case("file-link-to-passwords", "p.csv", _link("/etc/passwd")),
        Case("file-link-to-memory", "p.csv", _link("/proc/self/mem")),
        Case("file-link-to-environment", "p.csv", _link("/proc/self/environ")),
        Case("file-link-to-root", "p.csv", _link("/")),
        Case("file-unreadable", "p.csv", _unreadable),
        Case("file-of-20-gib", "p.csv", _sparse),
        Case("file-of-one-line", "p.csv", _one_line),
        Case("file-name-bidirectional", "p\u202evsc.csv", b"wrong"),
        Case("file-name-of-lines", "p\n::error::x\r.csv", b"wrong"),
        Case("file-name-not-utf-8", os.fsdecode(b"p\xff\xfe.csv"), b"wrong"),
        Case("file-name-script", "<script>alert(4711)<&script>.csv", b"wrong"),
        Case("file-name-long", "p" * 250 + ".csv", b"wrong"),
        Case("file-name-option", "--truth=x.csv", right, "good"),
        Case("file-name-without-ending", "p", right, "good"),
        Case("file-name-device", "con.csv", right, "good"),
    ]


def cases() -> list[Case]:
    """Every case of archives, foreign and special files."""
    cut = [
        Case(f"cut-{name}", file, data[: len(data) // 2], "either") for name, (file, data) in RIGHT.items()
    ]
    return [*_archives(), *_renamed(), *_special(), *cut]
