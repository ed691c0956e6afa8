"""Hostile Parquet: cut, bent, and written by hand with figures that no writer would write.

Parquet's metadata is Thrift's compact protocol; the few parts of it that are needed are here, so that
a file of some hundred bytes can claim billions of rows, items and bytes.
"""

import io
import random
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import pyarrow as pa
import pyarrow.parquet as pq

from tests.hostile_case import MIB, Case, as_parquet

_I32, _I64, _BYTES, _LIST, _STRUCT = 5, 6, 8, 9, 12
_INT32, _INT64, _BYTE_ARRAY = 1, 2, 6
_PLAIN, _RLE, _RLE_DICTIONARY = 0, 3, 8
_REQUIRED, _OPTIONAL, _REPEATED = 0, 1, 2
_UTF8, _LIST_TYPE = 0, 3
_NONE, _GZIP, _ZSTD = 0, 2, 6


def _varint(value: int) -> bytes:
    value &= 2**64 - 1
    data = bytearray()
    while value > 127:
        data.append(value & 127 | 128)
        value >>= 7
    return bytes([*data, value])


def _number(value: int) -> bytes:
    return _varint(value << 1 if value >= 0 else (-value << 1) - 1)


def _struct(*fields: tuple[int, int, bytes]) -> bytes:
    """Fields as (id, type, value bytes) in rising order of id, and the end."""
    data, last = b"", 0
    for number, kind, value in fields:
        data += bytes([(number - last) << 4 | kind]) + value
        last = number
    return data + b"\0"


def _list(kind: int, items: Sequence[bytes]) -> bytes:
    size = bytes([len(items) << 4 | kind]) if len(items) < 15 else bytes([0xF0 | kind]) + _varint(len(items))
    return size + b"".join(items)


def _text(value: bytes) -> bytes:
    return _varint(len(value)) + value


def _run(count: int, value: int) -> bytes:
    """A run of equal values of at most 8 bits."""
    return _varint(count << 1) + bytes([value])


def _levels(*runs: tuple[int, int]) -> bytes:
    data = b"".join(_run(count, value) for count, value in runs)
    return struct.pack("<I", len(data)) + data


@dataclass(frozen=True)
class Column:
    """A column of one value repeated `count` times, and the lies that its metadata tells.

    `item_runs` says that it is a list: lengths of the runs of repetition levels 0 and 1, alternating.
    """

    name: str
    value: bytes | int
    count: int
    item_runs: tuple[int, ...] = ()
    codec: int = _NONE
    packed: bytes | None = None  # the dictionary page as it stands in the file
    unpacked_size: int | None = None
    packed_size: int | None = None
    dictionary_values: int = 1
    index: int = 0  # the place in the dictionary that every row names
    encoding: int = _RLE_DICTIONARY
    chunk_values: int | None = None
    data_offset: int | None = None
    dictionary_offset: int | None = None

    @property
    def kind(self) -> int:
        """Parquet's physical type."""
        return _BYTE_ARRAY if isinstance(self.value, bytes) else _INT64

    def schema(self) -> list[bytes]:
        """The schema elements: one, or three for a list."""
        kind = (1, _I32, _number(self.kind))
        text = [(6, _I32, _number(_UTF8))] if self.kind == _BYTE_ARRAY else []
        if not self.item_runs:
            return [
                _struct(kind, (3, _I32, _number(_REQUIRED)), (4, _BYTES, _text(self.name.encode())), *text)
            ]
        one = (5, _I32, _number(1))
        return [
            _struct(
                (3, _I32, _number(_OPTIONAL)),
                (4, _BYTES, _text(self.name.encode())),
                one,
                (6, _I32, _number(_LIST_TYPE)),
            ),
            _struct((3, _I32, _number(_REPEATED)), (4, _BYTES, _text(b"list")), one),
            _struct(kind, (3, _I32, _number(_OPTIONAL)), (4, _BYTES, _text(b"element")), *text),
        ]

    def pages(self) -> tuple[bytes, int]:
        """The dictionary page and the data page, and where the second starts."""
        plain = (
            struct.pack("<I", len(self.value)) + self.value
            if isinstance(self.value, bytes)
            else struct.pack("<q", self.value)
        )
        packed = plain if self.packed is None else self.packed
        unpacked = len(plain) if self.unpacked_size is None else self.unpacked_size
        size = len(packed) if self.packed_size is None else self.packed_size
        head = _struct((1, _I32, _number(self.dictionary_values)), (2, _I32, _number(_PLAIN)))
        dictionary = _page(2, unpacked, size, 7, head) + packed
        body = b""
        if self.item_runs:
            repeats = [(count, place % 2) for place, count in enumerate(self.item_runs)]
            body = _levels(*repeats) + _levels((self.count, 3))
        body += b"\x01" + _run(self.count, self.index)
        encodings = [_number(self.encoding), _number(_RLE), _number(_RLE)]
        counts = [_number(min(self.count, 2**31 - 1)), *encodings]
        head = _struct(*((place, _I32, value) for place, value in enumerate(counts, start=1)))
        packed = pa.compress(body, "zstd", asbytes=True) if self.codec == _ZSTD else body
        packed = pa.compress(body, "gzip", asbytes=True) if self.codec == _GZIP else packed
        return dictionary + _page(0, len(body), len(packed), 5, head) + packed, len(dictionary)


def _page(kind: int, unpacked: int, packed: int, place: int, head: bytes) -> bytes:
    sizes = [(1, _I32, _number(kind)), (2, _I32, _number(unpacked)), (3, _I32, _number(packed))]
    return _struct(*sizes, (place, _STRUCT, head))


def parquet(
    columns: Iterable[Column],
    rows: int,
    *,
    group_rows: int | None = None,
    schema: Sequence[bytes] | None = None,
    children: int | None = None,
    marks: Sequence[tuple[bytes, bytes]] = (),
    groups: int = 1,
) -> bytes:
    """A Parquet file; every argument may lie."""
    columns = list(columns)
    data, chunks = b"PAR1", []
    for column in columns:
        pages, data_place = column.pages()
        start = len(data)
        first = start + data_place if column.data_offset is None else column.data_offset
        path = [column.name.encode(), b"list", b"element"] if column.item_runs else [column.name.encode()]
        place = start if column.dictionary_offset is None else column.dictionary_offset
        meta = _struct(
            (1, _I32, _number(column.kind)),
            (2, _LIST, _list(_I32, [_number(_PLAIN), _number(_RLE), _number(column.encoding)])),
            (3, _LIST, _list(_BYTES, [_text(part) for part in path])),
            (4, _I32, _number(column.codec)),
            (5, _I64, _number(column.count if column.chunk_values is None else column.chunk_values)),
            (6, _I64, _number(len(pages))),
            (7, _I64, _number(len(pages))),
            (9, _I64, _number(first)),
            (11, _I64, _number(place)),
        )
        chunks.append(_struct((2, _I64, _number(0)), (3, _STRUCT, meta)))
        data += pages
    elements = [element for column in columns for element in column.schema()] if schema is None else schema
    top = _struct(
        (4, _BYTES, _text(b"schema")), (5, _I32, _number(len(columns) if children is None else children))
    )
    group = _struct(
        (1, _LIST, _list(_STRUCT, chunks)),
        (2, _I64, _number(len(data))),
        (3, _I64, _number(rows if group_rows is None else group_rows)),
    )
    pairs = [_struct((1, _BYTES, _text(key)), (2, _BYTES, _text(value))) for key, value in marks]
    footer = _struct(
        (1, _I32, _number(1)),
        (2, _LIST, _list(_STRUCT, [top, *elements])),
        (3, _I64, _number(rows)),
        (4, _LIST, _list(_STRUCT, [group] * groups)),
        *([(5, _LIST, _list(_STRUCT, pairs))] if pairs else []),
    )
    return data + footer + struct.pack("<I", len(footer)) + b"PAR1"


def three(rows: int, text: bytes = b"A cat.") -> list[Column]:
    """Our three columns, every row the same."""
    return [
        Column("video_id", b"v1", rows),
        Column("rank", 1, rows),
        Column("description", text, rows),
    ]


def _changed(rows: int, place: int, **lies: object) -> bytes:
    columns = three(rows)
    columns[place] = replace(columns[place], **lies)  # type: ignore[arg-type]
    return parquet(columns, rows)


# Figures that a reader may never look at; what is left is a right table.
_HARMLESS = {"offset-beyond", "offset-in-footer", "offset-of-itself", "page-claims-2-gib-plain"}
_HARMLESS |= {"rows-of-10-million-said-few", "values-claimed"}


def _lying() -> list[tuple[str, bytes]]:
    zeros = bytes(16 * MIB)
    bombs = {codec: pa.compress(zeros, codec, asbytes=True) for codec in ("zstd", "gzip")}
    lists = Column("track_ids", b"7", 2_000_000_000, item_runs=(1, 1_999_999_999))
    numbers = Column("frame_indices", 7, 2**31 - 1, item_runs=(1, 2**31 - 2))
    many = Column("track_ids", b"7", 300_000_000, item_runs=(1, 299_999_999))
    group = _struct((3, _I32, _number(_OPTIONAL)), (4, _BYTES, _text(b"g")), (5, _I32, _number(1)))
    leaf = Column("video_id", b"v1", 1).schema()
    rows_10_million = parquet(three(10_000_000), 10_000_000)
    return [
        ("rows-claimed", parquet(three(1), 2**40)),
        ("rows-claimed-in-group", parquet(three(1), 1, group_rows=2**40)),
        ("rows-negative", parquet(three(1), -1, group_rows=-1)),
        ("rows-at-the-limit", parquet(three(1), 2_000_000)),
        ("rows-of-500000-equal", parquet(three(500_000, b"A cat." * 300), 500_000)),
        ("rows-of-10-million", rows_10_million),
        ("rows-of-10-million-said-few", parquet(three(10_000_000), 1)),
        ("values-claimed", _changed(1, 2, chunk_values=2**50)),
        ("values-negative", _changed(1, 2, chunk_values=-1)),
        ("list-of-billions", parquet([*three(1), lists], 1)),
        ("list-of-billions-of-numbers", parquet([*three(1), numbers], 1)),
        ("list-of-300-million", parquet([*three(1), many], 1)),
        ("dictionary-bomb", parquet(three(500_000, b"x" * MIB), 500_000)),
        ("dictionary-index-beyond", _changed(4, 2, index=77)),
        ("dictionary-of-billions", _changed(4, 2, dictionary_values=2**31 - 1)),
        ("dictionary-negative", _changed(4, 2, dictionary_values=-5)),
        ("page-claims-2-gib", _changed(1, 2, codec=_ZSTD, unpacked_size=2**31 - 1)),
        ("page-claims-2-gib-plain", _changed(1, 2, unpacked_size=2**31 - 1)),
        ("page-negative", _changed(1, 2, unpacked_size=-1, packed_size=-1)),
        ("page-packed-2-gib", _changed(1, 2, packed_size=2**31 - 1)),
        *(
            (
                f"page-bomb-{name}",
                _changed(1, 2, codec=codec, packed=bombs[name], unpacked_size=len(zeros)),
            )
            for name, codec in (("zstd", _ZSTD), ("gzip", _GZIP))
        ),
        ("codec-unknown", _changed(1, 2, codec=99)),
        ("encoding-unknown", _changed(1, 2, encoding=77)),
        ("offset-beyond", _changed(1, 2, data_offset=2**40)),
        ("offset-negative", _changed(1, 2, data_offset=-4, dictionary_offset=-8)),
        ("offset-in-footer", _changed(1, 2, data_offset=4_000)),
        ("offset-of-itself", _changed(1, 2, dictionary_offset=4, data_offset=4)),
        ("schema-without-children", parquet(three(1), 1, children=0)),
        ("schema-with-billions-of-children", parquet(three(1), 1, children=2**31 - 1)),
        ("schema-with-negative-children", parquet(three(1), 1, children=-1)),
        ("schema-10000-deep", parquet(three(1)[:1], 1, schema=[group] * 10_000 + leaf, children=1)),
        ("schema-empty", parquet([], 5, schema=[])),
        ("row-groups-5000", parquet(three(1), 5_000, group_rows=1, groups=5_000)),
        ("columns-5000", parquet([Column(f"c{place}", 1, 1) for place in range(5_000)], 1)),
        ("columns-of-one-name", parquet(three(1) * 3, 1)),
        ("arrow-schema-garbage", parquet(three(1), 1, marks=[(b"ARROW:schema", b"A" * 4_000)])),
    ]


def _plain() -> bytes:
    """A Parquet file as pyarrow writes it, with every column and a checksum a page."""
    target = io.BytesIO()
    table = pa.table(
        {
            "video_id": ["v1", "v1", "v2"],
            "rank": [1, 2, 1],
            "description": ["A cat.", "A dog.", "A deer."],
            "track_ids": [["7"], [], ["8", "9"]],
            "frame_indices": [[1, 2], [3], []],
        }
    )
    pq.write_table(table, target)
    return target.getvalue()


def cases() -> list[Case]:
    """Every Parquet case."""
    found = [
        Case(f"parquet-{name}", "p.parquet", data, "either" if name in _HARMLESS else "refused")
        for name, data in _lying()
    ]
    plain, chance = _plain(), random.Random(4)
    size = len(plain)
    found += [
        Case(f"parquet-cut-{part:02}", "p.parquet", plain[: size * part // 24]) for part in range(1, 24)
    ]
    for count in (1, 4, 5, 8, 100):
        found.append(Case(f"parquet-head-cut-{count}", "p.parquet", plain[count:]))
        found.append(Case(f"parquet-tail-cut-{count}", "p.parquet", plain[:-count]))
    for name, length in (("none", 0), ("huge", 2**32 - 1), ("beyond", size), ("odd", 7), ("signed", 2**31)):
        data = plain[:-8] + struct.pack("<I", length) + b"PAR1"
        found.append(Case(f"parquet-footer-{name}", "p.parquet", data))
    for number in range(60):
        bent = bytearray(plain)
        for _ in range(1 + number % 3):
            bent[chance.randrange(4, size - 4)] ^= 1 << chance.randrange(8)
        found.append(Case(f"parquet-bent-{number:02}", "p.parquet", bytes(bent), "either"))
    found.append(Case("parquet-twice", "p.parquet", plain + plain, "either"))
    found.append(Case("parquet-only-its-sign", "p.parquet", b"PAR1" * 5))
    found.append(Case("parquet-encrypted-footer", "p.parquet", plain[:-4] + b"PARE"))
    wrong = {"id-number": as_parquet(video_id=1.5), "rank-nan": as_parquet(rank=float("nan"))}
    wrong |= {"text-bytes": as_parquet(text=b"\xff\xfe"), "text-null": as_parquet(text=None)}
    wrong |= {"rank-list": as_parquet(rank=[1]), "text-struct": as_parquet(text={"a": 1})}
    found += [Case(f"parquet-{name}", "p.parquet", data) for name, data in wrong.items()]
    return found
