"""A file's bytes, and which of the accepted formats they are, told by content, not by the ending."""

import csv
import re
import stat
from pathlib import Path, PurePath

from sitegen.checks import Faults

MAX_BYTES = 512 * 2**20
ONE_OF = "a Parquet, CSV or JSON Lines file"
UNPACK = "Unpack it first and give the file inside."

NAMES = {
    "csv": "a CSV file",
    "jsonl": "a JSON Lines file",
    "parquet": "a Parquet file",
    "coool": "COOOL results (CSV)",
    "2coool": "2COOOL results (CSV)",
    "scripts": "results of the paper's scripts (JSON)",
    "coco": "COCO caption results (JSON)",
}
"""What each format is called, in words."""
KINDS = {
    "csv": ("csv", "coool", "2coool"),
    "json": ("jsonl", "scripts", "coco"),
    "parquet": ("parquet",),
}
"""The formats that are one kind of file."""
TABLES = ("csv", "jsonl", "parquet")
"""The formats with our columns, one row for every caption."""
CAPTION_2COOOL = "Caption Before Incident"

_HEAD_BYTES = 8_192
_ENDINGS = {
    ".csv": KINDS["csv"],
    ".json": KINDS["json"],
    ".jsonl": ("jsonl",),
    ".ndjson": ("jsonl",),
    ".parquet": KINDS["parquet"],
    ".pq": KINDS["parquet"],
}
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
_JSON_LIST = "a JSON list"
_TEXT_STARTS = {b"{": "jsonl", b"[": _JSON_LIST, b"<": "an HTML or XML file"}
_PICKLE = re.compile(rb"\x80[\x02-\x05]")
_COCO = re.compile(rb'"(?:image_id|caption)"\s*:|\A\s*\[\s*\]\s*\Z')
_SCRIPTS = re.compile(rb'\{\s*"(?!(?:track_ids|frame_indices)")(?:[^"\\]|\\.)*"\s*:\s*\[')
_OUR_KEY = re.compile(rb'"video_id"\s*:')
_2COOOL = {CAPTION_2COOOL.lower(), "reason of incident", "incident detection", "incident window start frame"}


def bounded_bytes(path: Path, faults: Faults, what: str = ONE_OF) -> bytes:
    """The content of a regular file of at most 512 MB; raises FaultsError for anything else.

    `what` is what the file should be, in words.
    """
    expected = f"{what} of at most {MAX_BYTES // 2**20} MB"
    data = b""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            faults.stop("a folder", expected, "Give the path of the file in it.")
        if not stat.S_ISREG(status.st_mode):
            faults.stop("something that is not a regular file", expected, "Save it to a file first.")
        if status.st_size <= MAX_BYTES:
            with path.open("rb") as source:
                data = source.read(status.st_size + 1)  # a larger number would be set aside whole
        if max(status.st_size, len(data)) > MAX_BYTES:
            found = f"{status.st_size / 2**20:,.0f} MB"
            faults.stop(found, expected, "Leave out what is no prediction, or use Parquet.")
    except FileNotFoundError:
        faults.stop("no such file", expected, "Check the path.")
    except (OSError, ValueError) as error:
        faults.stop(f"a path that cannot be read ({error})", expected, "Check path and permissions.")
    refuse_empty(data, faults, what)
    return data


def refuse_empty(data: bytes, faults: Faults, what: str = ONE_OF) -> None:
    """Raise FaultsError when there is nothing but blanks."""
    if not data[:_HEAD_BYTES].strip() and not data.strip():
        faults.stop("an empty file", what, "Write the table again.")


def ending_of(source_format: str) -> str:
    """What the name of a file of this format ends in."""
    if source_format == "jsonl":
        return "jsonl"
    return next(kind for kind, formats in KINDS.items() if source_format in formats)


def format_of(data: bytes, name: str, faults: Faults) -> str:
    """`csv`, `jsonl` or `parquet`; `name` is the file's, without the ending of an archive.

    Raises FaultsError when the content is another format, or not the one that the ending names.
    """
    return _as_named(_looks_like(data), name, faults)


def prediction_format_of(data: bytes, name: str, faults: Faults, caption_column: str = "") -> str:
    """One of the formats in `NAMES`; `name` is the file's, without the ending of an archive.

    A CSV with a column `video` and the column `caption_column` is a 2COOOL file. Raises as `format_of`.
    """
    looks_like = _looks_like(data)
    if looks_like == "csv":
        looks_like = _csv_format(data, caption_column)
    elif looks_like == _JSON_LIST and _COCO.search(_text_head(data)):
        looks_like = "coco"
    elif looks_like == "jsonl":
        head = _text_head(data)
        looks_like = "scripts" if _SCRIPTS.match(head) and not _OUR_KEY.search(head) else "jsonl"
    return _as_named(looks_like, name, faults)


def refuse_other_kind(data: bytes, asked: str, faults: Faults) -> None:
    """Raise FaultsError when the content is not even the kind of file that the format `asked` for is."""
    looks_like = _looks_like(data)
    if looks_like == _JSON_LIST and asked in {"scripts", "coco"}:
        return
    if looks_like not in NAMES:
        faults.stop(looks_like, NAMES[asked], _mend(looks_like, NAMES[asked]))
    if not any(looks_like in formats and asked in formats for formats in KINDS.values()):
        mend = "Ask for the format that the file has, or for none."
        faults.stop(f"what looks like {NAMES[looks_like]}", f"{NAMES[asked]}, as was asked for", mend)


def _as_named(looks_like: str, name: str, faults: Faults) -> str:
    formats = _ENDINGS.get(PurePath(name).suffix.lower(), ())
    expected = NAMES[formats[0]] if formats else ONE_OF
    if looks_like not in NAMES:
        faults.stop(looks_like, expected, _mend(looks_like, expected))
    if formats and looks_like not in formats:
        mend = "Give the file the ending of its format, or the format of its ending."
        faults.stop(f"what looks like {NAMES[looks_like]}", f"{expected}, as its ending says", mend)
    return looks_like


def _mend(looks_like: str, expected: str) -> str:
    return UNPACK if "archive" in looks_like else f"Export the table as {expected}."


def _looks_like(data: bytes) -> str:
    """`csv`, `jsonl`, `parquet`, or in words what else it looks like."""
    head = data[:_HEAD_BYTES]
    for sign, name in _SIGNS:
        if head.startswith(sign):
            return name
    if head.startswith(b"PK\x03\x04"):
        workbook = b"[Content_Types].xml" in head or b"xl/" in head
        return "an Excel workbook (.xlsx)" if workbook else "a zip archive"
    if head[257:262] == b"ustar":
        return "a tar archive"
    if _PICKLE.match(head):
        return "a Python pickle"
    if sum(byte < 32 and byte not in b"\t\n\r\f" for byte in head) > len(head) * 0.1:
        return "binary data"
    return _TEXT_STARTS.get(_text_head(data)[:1], "csv")


def _text_head(data: bytes) -> bytes:
    return data[:_HEAD_BYTES].removeprefix(b"\xef\xbb\xbf").lstrip()


def _csv_format(data: bytes, caption_column: str) -> str:
    """Which CSV it is, by its header."""
    line = _text_head(data).decode("utf-8", "replace").splitlines()[:1]
    try:
        names = [name.strip().lower() for name in next(csv.reader(line, skipinitialspace=True), [])]
    except csv.Error:
        return "csv"
    if names[:1] == ["id"] and any(name.startswith("hazard_track_") for name in names):
        return "coool"
    marks = _2COOOL | ({caption_column.strip().lower()} - {""})
    if "video" in names and "video_id" not in names and marks & set(names):
        return "2coool"
    return "csv"
