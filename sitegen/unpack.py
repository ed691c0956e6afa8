"""A file's content, unpacked once when it is gz, zst, or a zip of one file. Nothing is written."""

import io
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

import pyarrow as pa

from pipeline.files import sha256_of
from sitegen import formats
from sitegen.checks import Faults, visible
from sitegen.formats import ONE_OF, UNPACK, bounded_bytes, refuse_empty

_SIGNS = {b"\x1f\x8b": "gz", b"\x28\xb5\x2f\xfd": "zst", b"PK\x03\x04": "zip", b"PK\x05\x06": "zip"}
_WORDS = {"gz": "a gzip archive", "zst": "a zstd archive", "zip": "a zip archive"}
_ENDINGS = {".gz", ".gzip", ".zst", ".zstd", ".zip"}
_CODECS = {"gz": "gzip", "zst": "zstd"}
_ENTRY = b"PK\x01\x02"  # how each entry of a zip's directory starts
_MAX_ENTRIES = 1_000
_CHUNK_BYTES = 2**20
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
_DAMAGED = (
    pa.ArrowException,
    OSError,
    EOFError,
    ValueError,
    IndexError,
    RuntimeError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


@dataclass(frozen=True, slots=True)
class Content:
    """What a file holds.

    `name` is the name that the content goes by, `packing` is `gz`, `zst`, `zip` or empty, `sha256` is
    of the file as it came.
    """

    data: bytes
    name: str
    packing: str
    sha256: str


def content_of(path: Path, faults: Faults) -> Content:
    """The content of a file of at most 512 MB, packed and unpacked.

    Raises FaultsError for what cannot be read or unpacked, and for an archive in an archive.
    """
    data = bounded_bytes(path, faults)
    sha256 = sha256_of(data)
    name = PurePath(path.name)
    if name.suffix.lower() in _ENDINGS:
        name = name.with_suffix("")
    packing = _packing_of(data)
    if not packing:
        return Content(data, str(name), "", sha256)
    try:
        if packing == "zip":
            data, inner = _unzipped(data, faults)
            name = PurePath(inner)
        else:
            data = _bounded(_chunks(data, packing), packing, faults)
    except _DAMAGED as error:
        found = f"{_WORDS[packing]} that cannot be unpacked ({visible(str(error), 200)})"
        faults.stop(found, f"{ONE_OF}, packed or not", "Pack it again, or give the file inside.")
    if within := _packing_of(data):
        faults.stop(
            f"{_WORDS[within]} in {_WORDS[packing]}",
            f"{ONE_OF}, packed once at most",
            "Unpack it once and give the file inside.",
        )
    refuse_empty(data, faults)
    return Content(data, str(name), packing, sha256)


def _packing_of(data: bytes) -> str:
    return next((packing for sign, packing in _SIGNS.items() if data.startswith(sign)), "")


def _chunks(data: bytes, packing: str) -> Iterator[bytes]:
    with pa.CompressedInputStream(pa.BufferReader(data), _CODECS[packing]) as source:
        while chunk := source.read(_CHUNK_BYTES):
            yield chunk


def _bounded(chunks: Iterator[bytes], packing: str, faults: Faults) -> bytes:
    """All chunks, until they are more than may be: a bomb is not unpacked to its end."""
    kept: list[bytes] = []
    size = 0
    for chunk in chunks:
        size += len(chunk)
        if size > formats.MAX_BYTES:
            limit = f"{formats.MAX_BYTES // 2**20} MB"
            found = f"{_WORDS[packing]} that unpacks to more than {limit}"
            faults.stop(found, f"at most {limit}, unpacked", "Leave out what is no prediction.")
        kept.append(chunk)
    return b"".join(kept)


def _unzipped(data: bytes, faults: Faults) -> tuple[bytes, str]:
    """The one file in a zip, and its name."""
    if data.count(_ENTRY) > _MAX_ENTRIES:
        _not_one(f"a zip archive of more than {_MAX_ENTRIES:,} files", faults)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = archive.infolist()
        names = [entry.filename for entry in entries]
        if "[Content_Types].xml" in names or any(name.startswith("xl/") for name in names):
            faults.stop("an Excel workbook (.xlsx)", ONE_OF, f"Export the table as {ONE_OF}.")
        files = [entry for entry in entries if not _is_aside(entry)]
        if len(files) != 1:
            shown = ", ".join(f"'{visible(entry.filename)}'" for entry in files[:5])
            more = ", ..." if len(files) > 5 else ""
            _not_one(f"a zip archive of {len(files):,} files" + (f": {shown}{more}" if files else ""), faults)
        _refuse_odd(files[0], faults)
        with archive.open(files[0]) as source:
            chunks = iter(lambda: source.read(_CHUNK_BYTES), b"")
            return _bounded(chunks, "zip", faults), PurePosixPath(files[0].filename).name


def _is_aside(entry: zipfile.ZipInfo) -> bool:
    """Whether an entry is a folder, or what macOS adds."""
    name = entry.filename
    return name.endswith("/") or name.startswith("__MACOSX/") or PurePosixPath(name).name == ".DS_Store"


def _not_one(found: str, faults: Faults) -> None:
    faults.stop(found, "a zip archive of one file", "Give one file, packed alone.")


def _refuse_odd(entry: zipfile.ZipInfo, faults: Faults) -> None:
    name = entry.filename
    shown = f"'{visible(name)}'"
    ways = (PurePosixPath(name), PureWindowsPath(name))
    if any(way.is_absolute() or way.drive or ".." in way.parts for way in ways):
        expected = "the name of a file in the archive"
        faults.stop(f"the name {shown} in a zip archive, which leads out of it", expected, UNPACK)
    if stat.S_ISLNK(entry.external_attr >> 16):
        faults.stop(f"the link {shown} in a zip archive", "a file", "Pack the file that it points to.")
    if entry.flag_bits & 1:
        faults.stop("an encrypted zip archive", "one without a password", UNPACK)
    if entry.compress_type not in _METHODS:
        found = f"a zip archive packed with method {entry.compress_type}"
        faults.stop(found, "one packed with deflate, the usual method", "Pack it again as zip or gz.")
