"""A file's bytes, and which of the accepted formats they are, told by content, not by the ending."""

import re
import stat
from pathlib import Path

from sitegen.checks import Faults

MAX_BYTES = 512 * 2**20

_HEAD_BYTES = 8_192
_ENDINGS = {
    ".csv": "csv",
    ".json": "jsonl",
    ".jsonl": "jsonl",
    ".ndjson": "jsonl",
    ".parquet": "parquet",
    ".pq": "parquet",
}
_NAMES = {"csv": "a CSV file", "jsonl": "a JSON Lines file", "parquet": "a Parquet file"}
_SIGNS: tuple[tuple[bytes, str], ...] = (
    (b"PAR1", "parquet"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook (.xls)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    (b"7z\xbc\xaf", "a 7-Zip archive"),
    (b"ARROW1", "an Arrow IPC (Feather) file"),
    (b"%PDF", "a PDF file"),
    (b"\x89PNG", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"\x93NUMPY", "a NumPy file"),
    (b"SQLite format 3", "an SQLite database"),
    (b"\xff\xfe", "text in UTF-16"),
    (b"\xfe\xff", "text in UTF-16"),
)
_TEXT_STARTS = {b"{": "jsonl", b"[": "a JSON list", b"<": "an HTML or XML file"}
_PICKLE = re.compile(rb"\x80[\x02-\x05]")
_ONE_OF = "a Parquet, CSV or JSON Lines file"


def bounded_bytes(path: Path, faults: Faults) -> bytes:
    """The content of a regular file of at most 512 MB; raises FaultsError for anything else."""
    expected = f"{_ONE_OF} of at most {MAX_BYTES // 2**20} MB"
    data = b""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            faults.stop("a folder", expected, "Give the path of the file in it.")
        if not stat.S_ISREG(status.st_mode):
            faults.stop("something that is not a regular file", expected, "Save it to a file first.")
        if status.st_size <= MAX_BYTES:
            with path.open("rb") as source:
                data = source.read(MAX_BYTES + 1)
        if max(status.st_size, len(data)) > MAX_BYTES:
            found = f"{status.st_size / 2**20:,.0f} MB"
            faults.stop(found, expected, "Leave out what is no prediction, or use Parquet.")
    except FileNotFoundError:
        faults.stop("no such file", expected, "Check the path.")
    except (OSError, ValueError) as error:
        faults.stop(f"a path that cannot be read ({error})", expected, "Check path and permissions.")
    if not data.strip():
        faults.stop("an empty file", _ONE_OF, "Write the table again.")
    return data


def format_of(data: bytes, path: Path, faults: Faults) -> str:
    """`csv`, `jsonl` or `parquet`.

    Raises FaultsError when the content is another format, or not the one that the ending names.
    """
    ending = _ENDINGS.get(path.suffix.lower())
    expected = _NAMES[ending] if ending else _ONE_OF
    looks_like = _looks_like(data)
    if looks_like not in _NAMES:
        unpack = "archive" in looks_like
        mend = "Unpack it first and give the file inside." if unpack else f"Export the table as {expected}."
        faults.stop(looks_like, expected, mend)
    if ending and ending != looks_like:
        mend = "Give the file the ending of its format, or the format of its ending."
        faults.stop(f"what looks like {_NAMES[looks_like]}", f"{expected}, as its ending says", mend)
    return looks_like


def _looks_like(data: bytes) -> str:
    """One of the format names, or in words what else it looks like."""
    head = data[:_HEAD_BYTES]
    for sign, name in _SIGNS:
        if head.startswith(sign):
            return name
    if head.startswith(b"PK\x03\x04"):
        workbook = b"[Content_Types].xml" in head or b"xl/" in head
        return "an Excel workbook (.xlsx)" if workbook else "a zip archive"
    if _PICKLE.match(head):
        return "a Python pickle"
    if sum(byte < 32 and byte not in b"\t\n\r\f" for byte in head) > len(head) * 0.1:
        return "binary data"
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1]
    return _TEXT_STARTS.get(start, "csv")
