"""Hostile JSON, YAML and code in strings: as JSON Lines, COCO results, and the other benchmarks' files."""

import json

from tests.hostile_case import MARKER, MIB, Case, Verdict, as_2coool, as_coco, as_coool, as_scripts, csv_bytes

_ROW = b'{"video_id": "v1", "rank": 1, "description": "A cat."}'
_TOUCH = f"__import__('pathlib').Path('{MARKER}').touch()"
_SYSTEM = f"__import__('os').system('touch {MARKER}')"

_YAML = {
    "cyclic-list": b"&a [*a]\n",
    "cyclic-map": b"&a {video_id: *a, rank: 1, description: *a}\n",
    "cyclic-block": b"- &a\n  video_id: v1\n  rank: 1\n  description: *a\n",
    "laughs": b"a: &a [x, x]\n"
    + b"".join(b"%c: &%c [*%c, *%c, *%c]\n" % (n, n, n - 1, n - 1, n - 1) for n in b"bcdefghijklmnop"),
    "python-object": f"!!python/object/apply:os.system ['touch {MARKER}']\n".encode(),
    "python-name": b"- !!python/name:os.system\n- video_id: v1\n",
    "documents": b"--- {video_id: v1}\n--- {video_id: v2}\n",
}


def _lines() -> list[Case]:
    contents: dict[str, bytes | tuple[bytes, Verdict]] = {
        "equal-keys": b'{"video_id": "v1", "rank": 1, "description": "A cat.", "description": "A dog."}\n',
        "equal-keys-of-ids": b'{"video_id": "v1", "video_id": "../x", "rank": 1, "description": "A cat."}\n',
        "equal-keys-wrong-first": b'{"rank": "x", "rank": 1, "video_id": "v1", "description": "A cat."}\n',
        "equal-keys-escaped": b'{"rank": 2, "\\u0072ank": 1, "video_id": "v1", "description": "A cat."}\n',
        "deep-lists": b"[" * 100_000 + b"]" * 100_000,
        "deep-lists-in-a-row": b'{"video_id": ' + b"[" * 100_000 + b"]" * 100_000 + b"}\n",
        "deep-objects": b'{"a":' * 100_000 + b"1" + b"}" * 100_000,
        "deep-unclosed": b'{"a":' * 100_000,
        "deep-list-in-a-cell": _ROW[:-1] + b', "track_ids": ' + b"[" * 900 + b"]" * 900 + b"}\n",
        "two-in-a-line": _ROW + _ROW + b"\n",
        "one-over-lines": json.dumps(json.loads(_ROW), indent=1).encode(),
        "commas-between": _ROW + b",\n" + _ROW + b"\n",
        "single-quotes": _ROW.replace(b'"', b"'") + b"\n",
        "comment": b"// a comment\n" + _ROW + b"\n",
        "cut": _ROW[:-9],
        "string": b'"v1"\n',
        "numbers": b"1\n2\n3\n",
        "null": b"null\n",
        "list-of-lists": b'[["v1", 1, "A cat."]]\n',
        "empty-list": b"[]\n",
        "empty-object": b"{}\n",
        "nul": _ROW.replace(b"cat", b"c\\u0000at") + b"\n",
        "raw-nul": _ROW.replace(b"cat", b"c\0at") + b"\n",
        "raw-tab": (_ROW.replace(b"cat", b"c\tat") + b"\n"),
        "prototype": (_ROW[:-1] + b', "__proto__": {"rank": 7}, "constructor": 1}\n', "good"),
        "keys-100000": b"{" + b",".join(b'"k%d": 1' % n for n in range(100_000)) + b"}\n",
        "unseen-keys": b'{"video_id\\u200b": "v1", "rank": 1, "description": "A cat."}\n',
        "items-million": _ROW[:-1] + b', "frame_indices": [' + b"1," * MIB + b"1]}\n",
        "rank-object": b'{"video_id": "v1", "rank": {"$gt": 0}, "description": "A cat."}\n',
        "lines-of-nothing": b"\n" * 3_000_000 + b"{\n",
        "lines-of-braces": b"{\n" * 300_000,
        "byte-order-only": b"\xef\xbb\xbf",
    }
    found = []
    for name, content in contents.items():
        data, verdict = content if isinstance(content, tuple) else (content, "refused")
        found.append(Case(f"json-{name}", "p.json" if name.startswith("deep") else "p.jsonl", data, verdict))
    return found


def _yaml() -> list[Case]:
    return [
        Case(f"yaml-{name}-{ending}", f"p.{ending}", data)
        for name, data in _YAML.items()
        for ending in ("csv", "json", "yaml")
    ]


def _scripts() -> list[Case]:
    answers: dict[str, object] = {
        "code": _TOUCH,
        "code-in-a-list": f"[{_TOUCH}]",
        "system": _SYSTEM,
        "lambda": f"(lambda: {_TOUCH})()",
        "comprehension": f"[x for x in [{_SYSTEM}]]",
        "power": "[9 ** 9 ** 9]",
        "product": "['x' * 10**12]",
        "number-5000-digits": "[" + "9" * 5_000 + "]",
        "signs": "-" * 200_000 + "1",
        "signs-in-a-list": "[" + "-" * 20_000 + "1]",
        "deep": "[" * 100_000 + "]" * 100_000,
        "deep-150": "[" * 150 + "'A cat'" + "]" * 150,
        "strings-100000": "[" + "'a' " * 100_000 + "]",
        "items-100000": "[" + "'A cat', " * 100_000 + "]",
        "bytes": "[b'A cat']",
        "sets": "[{1, 2}, {1: 2}, 3j, ...]",
        "nul": "['A c\\x00at']",
        "surrogate": "['A c\\ud800at']",
        "names": "['\\N{CAT FACE}" * 100 + "']",
        "number": 7,
        "null": None,
        "object": {"a": _TOUCH},
    }
    either = {"code", "code-in-a-list", "system", "lambda", "comprehension", "power", "product", "deep-150"}
    either |= {"signs-in-a-list", "bytes", "sets", "strings-100000", "names", "object", "null", "number"}
    either |= {"number-5000-digits", "signs", "deep", "items-100000"}
    found = [
        Case(f"scripts-{name}", "p.json", as_scripts(answer=value), "either" if name in either else "refused")
        for name, value in answers.items()
    ]
    twice = b'{"v1": ["", "[\'A cat\']"], "v1": ["", "[\'A dog\']"]}'
    found.append(Case("scripts-equal-keys", "p.json", twice))
    found.append(Case("scripts-one-element", "p.json", b'{"v1": ["A cat"]}', "either"))
    found.append(Case("scripts-video-deep", "p.json", b'{"v1": ' + b"[" * 50_000 + b"]" * 50_000 + b"}"))
    return found


def _coco() -> list[Case]:
    entry = '{"image_id": "v1", "caption": "A cat."}'
    contents: dict[str, tuple[str, Verdict]] = {
        "equal-keys": ('[{"image_id": "v1", "image_id": "v2", "caption": "A cat."}]', "refused"),
        "infinite": ('[{"image_id": 1e999, "caption": "A cat."}]', "refused"),
        "nan": ('[{"image_id": NaN, "caption": "A cat."}]', "refused"),
        "half": ('[{"image_id": 1.5, "caption": "A cat."}]', "refused"),
        "digits-5000": ('[{"image_id": ' + "9" * 5_000 + ', "caption": "A cat."}]', "refused"),
        "caption-list": ('[{"image_id": "v1", "caption": ["A cat."]}]', "refused"),
        "caption-null": ('[{"image_id": "v1", "caption": null}]', "refused"),
        "caption-number": ('[{"image_id": "v1", "caption": 7}]', "refused"),
        "mixed": (f"[{entry}, 7, null, []]", "refused"),
        "deep": ("[" * 100_000 + entry + "]" * 100_000, "refused"),
        "cut": (f"[{entry}, {entry}"[:-4], "refused"),
        "garbage-behind": (f"[{entry}] {entry}", "refused"),
        "nul": ('[{"image_id": "v1", "caption": "A c\\u0000at."}]', "refused"),
        "2001-characters": (as_coco(text="w" * 2_001).decode(), "refused"),
        "entries-million": ("[" + ",".join(["{}"] * 1_000_000) + "]", "refused"),
    }
    return [
        Case(f"coco-{name}", "p.json", text.encode(), verdict) for name, (text, verdict) in contents.items()
    ]


def _coool() -> list[Case]:
    head, row = as_coool().splitlines(keepends=True)
    slots = ",".join(f"Hazard_Track_{n},Hazard_Name_{n}" for n in range(2_000)).encode()
    contents: dict[str, tuple[bytes, Verdict]] = {
        "frame-huge": (as_coool(frame=10**30), "refused"),
        "frame-negative": (as_coool(frame=-1), "refused"),
        "frame-none": (as_coool(frame=""), "refused"),
        "frame-nan": (as_coool(frame="nan"), "refused"),
        "track-of-4000-characters": (as_coool(track="7" * 4_000), "refused"),
        "track-nul": (as_coool(track="7\0"), "refused"),
        "track-path": (as_coool(track="../../etc/passwd"), "either"),
        "track-script": (as_coool(track="<script>alert(4711)</script>"), "either"),
        "name-of-1-mib": (as_coool(text="w" * MIB), "refused"),
        "name-without-track": (as_coool(track=""), "either"),
        "slots-2000": (b"ID,Driver_State_Changed," + slots + b"\n" + row, "refused"),
        "slots-backwards": (b"ID,Driver_State_Changed,Hazard_Name_1,Hazard_Track_1\n" + row, "either"),
        "row-longer-than-header": (head + row.rstrip(b"\n") + b",1,2,3\n", "refused"),
        "row-twice": (head + row + row, "either"),
        "rows-100000-of-one": (head + row * 100_000, "either"),
        "no-id": (head + b",False,7,cat\n", "refused"),
        "id-without-frame": (head + b"video_0001,False,7,cat\n", "refused"),
        "only-header": (head, "either"),
        "header-numbered-huge": (head.replace(b"Track_1,", b"Track_99999999999,"), "refused"),
    }
    return [Case(f"coool-{name}", "results.csv", data, verdict) for name, (data, verdict) in contents.items()]


def _2coool() -> list[Case]:
    lines = as_2coool().splitlines(keepends=True)
    without = [line.replace(b"Caption Before Incident", b"Nothing") for line in lines]
    contents: dict[str, tuple[bytes, Verdict]] = {
        "video-nan": (as_2coool(video_id="NaN"), "refused"),
        "video-half": (as_2coool(video_id="1.5"), "refused"),
        "video-infinite": (as_2coool(video_id="1e999"), "refused"),
        "video-negative": (as_2coool(video_id="-1"), "refused"),
        "video-digits-5000": (as_2coool(video_id="9" * 5_000), "refused"),
        "video-twice": (b"".join([*lines, lines[1]]), "either"),
        "caption-of-2001": (as_2coool(text="w" * 2_001), "refused"),
        "caption-nul": (as_2coool(text="A c\0at."), "refused"),
        "caption-column-gone": (b"".join(without), "either"),
        "row-of-4": (lines[0] + b"1,2,3,4\n", "refused"),
        "formula-in-counts": (as_2coool(Label="=cmd|' /C calc'!A0"), "either"),
    }
    return [Case(f"2coool-{name}", "p.csv", data, verdict) for name, (data, verdict) in contents.items()]


def cases() -> list[Case]:
    """Every case of JSON, YAML and the other benchmarks' formats."""
    table = csv_bytes([["video_id", "rank", "description"], ["v1", 1, _TOUCH]])
    plain = Case("code-as-a-caption", "p.csv", table, "good")
    return [plain, *_lines(), *_yaml(), *_scripts(), *_coco(), *_coool(), *_2coool()]
