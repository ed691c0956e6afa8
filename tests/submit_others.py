"""Other files for the corpus of the submit page: other encodings, kinds, archives, other challenges."""

import gzip
import io
import json
import zipfile
from collections.abc import Iterator

from tests.submit_case import HEAD, Case, csv_case, record


def others() -> Iterator[Case]:
    """All of them."""
    yield from _encodings()
    yield from _kinds()
    yield from _packed()
    yield from _coool()
    yield from _two_coool()
    yield from _coco()


def _encodings() -> Iterator[Case]:
    head = HEAD.encode()
    line = record().encode()
    for bad in (b"\xff", b"caf\xe9", b"\xe2\x82", b"\xc0\xaf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80",
                b"\x80\x80ab\xfe", b"\xf0\x9f\x90", b"\xe2\x28\xa1", b"\xf0\x9f\x90\x88\x88", b"a\xc3",
                b"\xf8\x88\x80\x80\x80"):  # fmt: skip
        yield Case("p.csv", head + b"v1,1,ok\nv1,2," + bad + b"\n" + bad + b",3,x\n")
        yield Case("p.jsonl", line + b"\n" + line.replace(b"x", bad) + b"\n" + line)
    yield Case("p.csv", b"\xef\xbb\xbf" + head + b"v1,1,x\n")
    yield Case("p.csv", b"\xef\xbb\xbf\xef\xbb\xbf" + head + b"v1,1,x\n")
    yield Case("p.csv", b"video_id,rank,description,caf\xe9\nv1,1,x,y\n")
    yield Case("p.jsonl", b"\xef\xbb\xbf" + line + b"\n\xef\xbb\xbf" + line)
    yield Case("p.csv", HEAD.encode("utf-16"))
    yield Case("p.csv", (HEAD + "v1,1,x\n").encode("utf-16-le"))
    yield Case("p.csv", (HEAD + "v1,1,caf\u00e9\n").encode("latin-1"))


def _zip(name: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, HEAD)
    return buffer.getvalue()


def _kinds() -> Iterator[Case]:
    """Files that are something else, or not what their name says."""
    good = (HEAD + "v1,1,x\n").encode()
    line = record().encode()
    for name in (
        "p",
        "p.txt",
        "p.CSV",
        "p.jsonl",
        "p.JSON",
        "p.parquet",
        "p.pq",
        "a.b.csv",
        ".csv",
        "p.csv.",
    ):
        yield Case(name, good)
        yield Case(name, line)
    signs = (
        b"\xd0\xcf\x11\xe0x",
        b"BZh9",
        b"7z\xbc\xaf",
        b"ARROW1",
        b"%PDF-1.7",
        b"\x89PNG",
        b"\xff\xd8\xff\xe0",
    )
    more_signs = (b"\x93NUMPY", b"SQLite format 3\0", b"\xfd7zXZ", b"\x80\x04x", b"PAR1", b"\x1f\x8b")
    texts = (b"", b" \n\n\t", b"\xef\xbb\xbf", b"<html></html>", b" [1]", b"[" + line + b"]", b"[]x", b"{}")
    tar = b"x" * 257 + b"ustar\x0000" + b"x" * 200
    for content in (*signs, *more_signs, *texts, tar, b"\0", bytes(range(32)) * 10):
        for name in ("p", "p.csv", "p.jsonl"):
            closed = content == b"PAR1" and name == "p"
            yield Case(name, content, close=content == b"\x1f\x8b", closed=closed)
    yield Case("p.xlsx", _zip("xl/workbook.xml"))
    yield Case("p.zip", _zip("p.csv"), closed=True)
    yield Case("p.csv.zst", b"\x28\xb5\x2f\xfdx", closed=True)
    yield Case("p.json", json.dumps({"video_0001": ["COS", '["A cat"]']}).encode(), closed=True)
    yield Case("p.jsonl", json.dumps({"video_0001": ["COS", '["A cat"]']}).encode())


def _packed() -> Iterator[Case]:
    good = (HEAD + "v1,1,x\nv1,0,y\n").encode()
    packed = gzip.compress(good, mtime=0)
    for name in ("p.csv.gz", "p.gz", "p.csv", "p.jsonl.gz", "p.csv.GZIP", "p.parquet.gz"):
        yield Case(name, packed)
    yield Case("p.jsonl.gz", gzip.compress(record().encode(), mtime=0))
    yield Case("p.csv.gz", gzip.compress(b" \n", mtime=0))
    yield Case("p.csv.gz", gzip.compress(packed, mtime=0))
    yield Case("p.csv.gz", gzip.compress(_zip("p.csv"), mtime=0))
    yield Case("p.csv.gz", packed[:-9], close=True)
    yield Case("p.csv.gz", packed[:12] + b"\xff" * 10 + packed[22:], close=True)


def _coool() -> Iterator[Case]:
    """COOOL results in the shapes that are about, and broken ones."""
    names = [f"Hazard_{kind}_{slot}" for slot in range(1, 23) for kind in ("Track", "Name")]
    full = ",".join(["ID", "Driver_State_Changed", *names]) + "\n"
    zero = [f"Hazard_{kind}_{slot}" for slot in range(23) for kind in ("Track", "Name")]
    sample = ", ".join(["ID", "Driver_State_Changed", *zero]) + "\n"
    two = "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1,Hazard_Track_2,Hazard_Name_2\n"
    for text in (
        full + "video_0001_0,False" + ",7,cat" + ", , " * 21 + "\n",
        sample + "video_0001_0, False, 7, a cat\nvideo_0001_1, True, 7, a cat\nvideo_0002_0, False, , \n",
        sample + "video_0001_0, False\nvideo_0001_1\n\nvideo_0001_2, False, 7\n",
        two + "video_0001_0,F,7,cat,8,dog\nvideo_0001_0,F,7,cat\nvideo_0001_00,F\n",
        two + "video_0001_0,F,7,cat,8,dog,extra\nvideo_0001_1,F,7,cat,8,dog, ,\n",
        two + "v1_0,F,7,,8,\nv1_1,F,,cat,,\nv2_0,F,7.0,cat,7,cat\nv3_1,F,7,nan,,\n",
        two + 'v1_0,F,7,"a cat, running", 8 , "a ""dog"""\n',
        two + "v9_0,F,7,cat\nv9_1,F,7,cat\nvideo_001_5,F,7,cat\n",
        two + "v1,F,7,cat\nv1_,F,7,cat\n_3,F,7,cat\nv1_x,F\nv1_2147483648,F\nv1_99999999999,F\n",
        two + "1_0,F,7,cat\n2_0,F,7,cat\n",
        two + "7_0,F,7,cat\n",
        two + f"v1_0,F,{'t' * 129},{'x' * 2001}\nv1_1,F,\u200b,\u200b\n",
        two + "v1_0,F,7,,8,cat\nv1_1,F,7,,,\n",
        two + f"v1_0,F,{'t' * 129},,8,cat\n",
        two + 'v1_0,F,7,"cat\nv1_1,F,8,dog\n',
        two + 'v1_0,F,7,"cat"x\n',
        two.replace("Name_2", "Name_3") + "v1_0,F,7,cat\n",
        two.lower() + "v1_0,F,7,cat\n",
        two.replace("\n", ",,\n") + "v1_0,F,7,cat,8,dog,,\n",
        "ID,Hazard_Track_1,Hazard_Name_1\nv1_0,7,cat\n",
        "ID,Driver_State_Changed,Hazard_Track_1\nv1_0,F,7\n",
        "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1,Hazard_Track_2\nv1_0,F,7,cat,8\n",
        ",".join(
            ["ID", "Driver_State_Changed", *(f"Hazard_{k}_{n}" for n in range(24) for k in ("Track", "Name"))]
        )
        + "\nv1_0,F\n",
        two,
        two + "".join(f"v1_{frame},F,7,cat,8,dog\n" for frame in range(10_001)),
        two + "v1_0,F,caf\udce9,cat\n",
    ):
        yield Case("results.csv", text.encode("utf-8", "surrogateescape"))


def _two_coool() -> Iterator[Case]:
    head = "video,Incident window start frame,Incident Detection,Caption Before Incident,Reason of Incident\n"
    for text in (
        head + "1,0,1,A cat crosses,The cat\n2,0,1,A dog,The dog\n",
        head + "1.0,0,1,A cat,x\n2.000,0,1,,x\n3,0,1, ,x\n",
        head + "1,0,1,A cat,x\n1,0,1,A dog,x\n1.0,0,1,A cow,x\n",
        head + "1,0,1,A cat\n2,0,1,A cat,x,y\n,0,1,A cat,x\n",
        head + "7,0,1,A cat,x\n99,0,1,A cat,x\n1,0,1,nan,x\n",
        head + '1,0,1, "A cat, running" , x\n',
        head.replace("Caption Before", "caption before") + "1,0,1,A cat,x\n",
        head.replace("Reason of Incident", "caption before incident") + "1,0,1,A cat,x\n",
        head.replace("Reason of Incident", "Caption Before Incident") + "1,0,1,A cat,x\n",
        head.replace("Caption Before Incident", "Caption") + "1,0,1,A cat,x\n",
        head.replace("video", "Video") + "1,0,1,A cat,x\n",
        head.replace("video", "Video,video") + "1,1,0,1,A cat,x\n",
        head,
        head + "".join(f"{number},0,1,A cat,x\n" for number in range(1, 700)),
    ):
        yield csv_case(text)


def _coco() -> Iterator[Case]:
    for text in (
        '[{"image_id": "v1", "caption": "A cat"}, {"image_id": "v1", "caption": "A dog"}]',
        '[{"image_id": 1, "caption": "A cat"},\n {"image_id": "2", "caption": "A dog"}]',
        '[\n{"image_id": 7, "caption": "x"},\n{"image_id": "v9",\n"caption": null},\n{"caption": "x"}\n]',
        '[{"image_id": "v1", "caption": "x", "id": 3, "score": [1], "\\u202e": 0}]',
        '[{"image_id": "v1", "caption": "x", "id": NaN}]',
        '[{"image_id": "v1", "caption": "x", "id": NaN}, {"image_id": "v1", "caption": -Infinity}]',
        '[{"image_id": "v1", "caption": "x", "id": Infinity, "b": [NaN, -Infinity]}]',
        '[{"image_id": "v1", "image_id": "v2", "caption": "x"}]',
        '[{"image_id": 1.0, "caption": "x"}, {"image_id": true, "caption": 5}, {"image_id": []}]',
        '[1, "x", null, [], {"image_id": "v1", "caption": "x"}, true, 1.5, {}]',
        '[{"image_id": "v1", "caption": "x"}',
        '[{"image_id": "v1", "caption": "x"}]]',
        '[{"image_id": "v1",\n\n "caption": "🐈" x}]',
        '[{"image_id": "v1", "caption": "x"} {"image_id": "v1", "caption": "y"}]',
        '[{"image_id": "v1", "caption": "a\nb"}]',
        "[]",
        " [ ] \n",
        '\ufeff[{"image_id": "v1", "caption": "x"}]',
        '[{"image_id": "' + "v" * 129 + '", "caption": "' + "x" * 2001 + '"}]',
        "[" + ",\n".join(f'{{"image_id": "video_{n:04d}", "caption": ""}}' for n in range(1, 1500)) + "]",
        '[{"image_id": "v1", "caption": ' + "9" * 4301 + "}]",
        '{"image_id": "v1", "caption": "x"}',
        '\x0b[{"image_id": "v1", "caption": "x"}]',
    ):
        for name in ("captions.json", "p.csv") if text.startswith("[]") else ("captions.json",):
            yield Case(name, text.encode())
    yield Case("captions.json", b'[{"image_id": "v1",\n"caption": "caf\xe9"}]')
    yield Case("captions.json", ('[{"image_id": "v1", "x": ' + "[" * 2_000).encode(), close=True)
