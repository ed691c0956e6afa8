"""Hostile text: ids, captions, numbers, quotes, encodings, JSON and YAML, in every text format."""

from tests.hostile_case import (
    ALERT,
    MARKER,
    MIB,
    Case,
    Verdict,
    as_2coool,
    as_coco,
    as_coool,
    as_csv,
    as_jsonl,
    as_parquet,
    as_scripts,
    csv_bytes,
)

HEAD = b"video_id,rank,description\n"
TOUCH = f"__import__('pathlib').Path('{MARKER}').touch()"

IDS: dict[str, str] = {
    "parents": "../../etc/passwd",
    "parent": "..",
    "dot": ".",
    "absolute": "/etc/passwd",
    "drive": "C:\\x",
    "share": "\\\\host\\share",
    "slash": "a/b",
    "backslash": "a\\b",
    "device": "con",
    "device-with-ending": "nul.txt",
    "file-url": "file:///etc/passwd",
    "percent": "%2e%2e%2fpasswd",
    "home": "~root",
    "variable": "$HOME",
    "backtick": "`id`",
    "option": "--help",
    "hidden": ".htaccess",
    "4000-characters": "x" * 4_000,
    "line-end": "v1\nv2",
    "tab": "v1\tx",
    "nul": "v1\0.html",
    "script": f"<script>{ALERT}</script>",
    "attribute": f'v1" onmouseover="{ALERT}',
    "sql": "v1' OR '1'='1",
    "template": "{{ 7*7 }}",
    "formula": "=1+1",
    "bidirectional": "v1\u202e",
    "zero-width": "v\u200b1",
    "bom": "\ufeffv1",
    "fullwidth": "ｖ１",
    "case": "V1",
    "stream": "v1::$DATA",
    "trailing-dot": "v1.",
    "prototype": "__proto__",
}
_SOME_IDS = ("parents", "absolute", "drive", "device", "4000-characters", "script", "bidirectional", "nul")

GOOD_TEXTS: dict[str, str] = {
    "script": f"A cat <script>{ALERT}</script> crosses.",
    "image": f'A cat <img src=x onerror="{ALERT}"> crosses.',
    "script-end": f"</script><script>{ALERT}//",
    "svg": f"<svg onload={ALERT}><style>*{{display:none}}</style>",
    "link": f"[A cat](javascript:{ALERT}) crosses.",
    "comment": f"<!-- --!><script>{ALERT}</script> A cat.",
    "template": "A cat {{ 7*7 }} {% raw %} ${7*7} #{7*7}",
    "entity": "A cat &lt;b&gt; &#x3c;script&#x3e; crosses.",
    "formula": '=HYPERLINK("http://evil.example/","x")',
    "formula-plus": "+cmd|' /C calc'!A0",
    "formula-at": "@SUM(1+1)",
    "bidirectional": "A cat \u202eesrever\u202c crosses.",
    "isolates": "A \u2067cat\u2069 \u200f crosses.",
    "zero-width": "A c\u200ba\u2060t crosses.",
    "line-separators": "A cat\u2028crosses\u2029.",
    "combining": "A c" + "\u0336\u0489" * 400 + "at.",
    "longest": "w" * 2_000,
    "quotes": 'A "cat" \'crosses\' ``here``, ""now"".',
    "terminal": "A cat \x1b[31mcrosses\x1b]0;owned\x07.",
    "line-end": "A cat\ncrosses\r\nthe road.",
    "emoji": "A 🐈\u200d⬛ crosses.",
    "annotation": "::error file=a::A cat ::set-output name=x::y",
    "latex": "A cat \\input{/etc/passwd} & $x_1$ \\write18{id} %",
    "markdown": "| A | ```cat``` | <!-- @everyone #1 --> |",
}
BAD_TEXTS: dict[str, str] = {
    "nul": "A cat\0crosses.",
    "empty": "",
    "blank": " \t ",
    "unseen": "\u200b\u200d\ufeff",
    "control": "\x01\x02",
    "2001-characters": "w" * 2_001,
    "1-mib": "w" * MIB,
    "nan": "NaN",
}
RANKS: tuple[str, ...] = (
    "0", "-1", "1.5", "NaN", "nan", "Infinity", "-Infinity", "1e999", "-1e999", "1e400", "9" * 30,
    "9" * 5_000, "0x10", "1_000", "2147483648", "true", "null", "", "١", "1;2", "[1]", "1+1", TOUCH,
)  # fmt: skip
_LITERALS = ("NaN", "Infinity", "-Infinity", "1e999", "9" * 5_000, "true", "null", "[1]", '"x"', '{"a": 1}')


def _named(value: str, place: int) -> str:
    kept = "".join(char if char.isascii() and char.isalnum() else "-" for char in value[:12].lower())
    return f"{place:02}-{kept.strip('-') or 'sign'}"


def _ids() -> list[Case]:
    found = []
    for name, value in IDS.items():
        found.append(Case(f"id-csv-{name}", "p.csv", as_csv(value)))
        found.append(Case(f"id-jsonl-{name}", "p.jsonl", as_jsonl(value)))
        if name in _SOME_IDS:
            found.append(Case(f"id-parquet-{name}", "p.parquet", as_parquet(value)))
            found.append(Case(f"id-coool-{name}", "results.csv", as_coool(value)))
            found.append(Case(f"id-2coool-{name}", "p.csv", as_2coool(value)))
            found.append(Case(f"id-scripts-{name}", "p.json", as_scripts(value)))
            found.append(Case(f"id-coco-{name}", "p.json", as_coco(value)))
    surrogate = b'{"video_id": "v1\\ud800", "rank": 1, "description": "A cat."}\n'
    found.append(Case("id-jsonl-surrogate", "p.jsonl", surrogate))
    odd: dict[str, object] = {"number": 10**400, "none": None, "list": ["v1"], "object": {}, "true": True}
    found += [Case(f"id-jsonl-of-{name}", "p.jsonl", as_jsonl(value)) for name, value in odd.items()]
    found += [Case(f"id-coco-of-{name}", "p.json", as_coco(value)) for name, value in odd.items()]
    return found


def _texts() -> list[Case]:
    found = []
    for name, value in GOOD_TEXTS.items():
        found.append(Case(f"text-csv-{name}", "p.csv", as_csv(text=value), "good"))
        found.append(Case(f"text-jsonl-{name}", "p.jsonl", as_jsonl(text=value), "good"))
    for name in ("script", "bidirectional", "formula"):
        value = GOOD_TEXTS[name]
        found.append(Case(f"text-parquet-{name}", "p.parquet", as_parquet(text=value), "good"))
        found.append(Case(f"text-2coool-{name}", "p.csv", as_2coool(text=value), "good"))
        found.append(Case(f"text-coco-{name}", "p.json", as_coco(text=value), "good"))
        found.append(Case(f"text-scripts-{name}", "p.json", as_scripts(answer=repr([value])), "good"))
    for name, value in BAD_TEXTS.items():
        found.append(Case(f"text-csv-{name}", "p.csv", as_csv(text=value)))
        found.append(Case(f"text-jsonl-{name}", "p.jsonl", as_jsonl(text=value)))
    found.append(Case("text-jsonl-surrogate", "p.jsonl", as_jsonl(text="A \ud800cat.")))
    found.append(Case("label-csv-nul", "p.csv", HEAD[:-1] + b",label\nv1,1,A cat.,a\0b\n"))
    return found


def _numbers() -> list[Case]:
    found = []
    for place, value in enumerate(RANKS):
        found.append(Case(f"rank-csv-{_named(value, place)}", "p.csv", as_csv(rank=value)))
    for place, value in enumerate(_LITERALS):
        line = f'{{"video_id": "v1", "description": "A cat.", "rank": {value}}}\n'
        found.append(Case(f"rank-jsonl-{_named(value, place)}", "p.jsonl", line.encode()))
        line = line.replace('"rank": ', '"rank": 1, "frame_indices": [').replace("}\n", "]}\n")
        found.append(Case(f"frame-jsonl-{_named(value, place)}", "p.jsonl", line.encode()))
    lists = {
        "deep": "[" * 100_000,
        "long": "1;" * 200_000,
        "negative": "[-1]",
        "infinite": "[Infinity]",
        "huge": "[" + "9" * 5_000 + "]",
        "code": TOUCH,
        "nested": "[[1], [2]]",
    }
    head = [*HEAD[:-1].decode().split(","), "frame_indices"]
    for name, value in lists.items():
        rows = csv_bytes([head, ["v1", 1, "A cat.", value]])
        found.append(Case(f"frames-csv-{name}", "p.csv", rows))
    return found


def _quotes() -> list[Case]:
    row = b"v1,1,A cat.\n"
    right = HEAD + row
    contents: dict[str, bytes | tuple[bytes, Verdict]] = {
        "unclosed": HEAD + b'v1,1,"A cat.\nv2,1,A dog.\n',
        "unclosed-at-the-end": right + b'v2,1,"',
        "nested": HEAD + b'v1,1,"A "cat" crosses."\n',
        "nested-deep": HEAD + b"v1,1," + b'"' * 99_999 + b"\n",
        "in-the-middle": (HEAD + b'v1,1,A "cat, dog" crosses.\n'),
        "in-the-header": b'"video_id,rank,description\n' + row,
        "only-quotes": b'"' * 100_000,
        "only-commas": b"," * 100_000,
        "only-line-ends": (b"\n" * 100_000),
        "cell-of-lines": HEAD + b'v1,1,"' + b"A cat.\n" * 200_000 + b'"\n',
        "nul-bytes": HEAD + b"v1,1,A\0cat.\n\0\0\0\n",
        "nul-in-the-header": b"video_id\0,rank,description\n" + row,
        "carriage-returns": (right.replace(b"\n", b"\r"), "either"),
        "line-ends-mixed": (HEAD.replace(b"\n", b"\r\n") + row + b"\r\rv2,1,A dog.\r\n", "either"),
        "columns-of-one-name": b"video_id,rank,description,rank\nv1,1,A cat.,2\n",
        "columns-5000": b"video_id,rank,description,"
        + b",".join(b"c%d" % n for n in range(5_000))
        + b"\n"
        + row,
        "columns-million": b"," * 1_000_000 + b"\n" + row,
        "ragged": HEAD + b"".join(b"v1,%d%s\n" % (n, b",x" * (n % 9)) for n in range(1, 3_000) if n % 9 != 1),
        "header-only-of-another": b"image_id,caption\n",
        "header-of-5000-characters": b"video_id,rank,description," + b"h" * 5_000 + b"\nv1,1,A cat.\n",
        "twice": right + HEAD + row,
        "equal-rows": HEAD + row * 50_000,
        "semicolons": right.replace(b",", b";"),
        "tabs": right.replace(b",", b"\t"),
        "bars": right.replace(b",", b"|"),
        "blanks-between": b"video_id rank description\nv1 1 cat\n",
        "form-feeds": right.replace(b"\n", b"\x0c"),
        "many-faults": HEAD + b"\x1b,\x1b,\x1b\n" * 100_000,
    }
    found = []
    for name, content in contents.items():
        data, verdict = content if isinstance(content, tuple) else (content, "refused")
        found.append(Case(f"csv-{name}", "p.csv", data, verdict))
    return found


def _encodings() -> list[Case]:
    text = HEAD.decode() + "v1,1,A naïve cat – “here”.\n"
    jsonl = '{"video_id": "v1", "rank": 1, "description": "A naïve cat."}\n'
    found = []
    for name in ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be", "cp1252", "cp037"):
        found.append(Case(f"encoding-csv-{name}", "p.csv", text.encode(name, "replace")))
        found.append(Case(f"encoding-jsonl-{name}", "p.jsonl", jsonl.encode(name, "replace")))
    odd = {
        "latin-1": "A naïve cat.".encode("latin-1"),
        "shift-jis": "猫が道を渡る".encode("shift-jis"),
        "gb18030": "一只猫穿过马路".encode("gb18030"),
        "overlong": b"A \xc0\xafcat \xe0\x80\xaf.",
        "surrogates": b"A \xed\xa0\xbd\xed\xb0\x88 cat.",
        "beyond-unicode": b"A \xf4\x90\x80\x80 cat.",
        "cut-character": b"A cat \xf0\x9f\x90",
        "stray-bytes": b"A \x80\xbf\xfe\xff cat.",
    }
    for name, data in odd.items():
        found.append(Case(f"encoding-csv-{name}", "p.csv", HEAD + b"v1,1," + data + b"\n"))
        line = b'{"video_id": "v1", "rank": 1, "description": "' + data + b'"}\n'
        found.append(Case(f"encoding-jsonl-{name}", "p.jsonl", line))
    bom = b"\xef\xbb\xbf"
    found.append(Case("encoding-csv-bom", "p.csv", bom + as_csv(), "good"))
    found.append(Case("encoding-csv-bom-in-the-middle", "p.csv", as_csv() + bom + b"v2,1,A dog.\n"))
    found.append(Case("encoding-csv-bom-twice", "p.csv", bom + bom + as_csv()))
    found.append(Case("encoding-jsonl-bom-in-the-middle", "p.jsonl", as_jsonl() + bom + as_jsonl("v2")))
    found.append(Case("encoding-csv-utf-7", "p.csv", HEAD + b"+AHYAMQ-,1,A cat.\n"))
    return found


def cases() -> list[Case]:
    """Every case of plain text and tables of text."""
    return [*_ids(), *_texts(), *_numbers(), *_quotes(), *_encodings()]
