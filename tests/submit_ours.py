"""Files with our columns for the corpus of the submit page: CSV and JSON Lines, right and wrong."""

import json
from collections.abc import Iterator

from tests.submit_case import FULL, HEAD, Case, csv_case, record


def ours() -> Iterator[Case]:
    """All of them."""
    yield from _csv_rows()
    yield from _csv_shapes()
    yield from _json_lines()
    yield from _json_text()


def _csv_rows() -> Iterator[Case]:
    """One cell or row that is odd, in a CSV with the three columns that are needed."""
    for body in (
        "",
        "v1,1,A cat\n",
        "v9,1,x\n",
        "v1,1,x\nv1,1,y\n",
        "v1,1,x\nv1, 1 ,y\nv1,1.0,z\nv2,1,a\n",
        "v1,0,x\n",
        "v1,-1,x\nv1,+2,x\n",
        "v1,1.5,x\nv1,2.,x\nv1,3.000,y\n",
        "v1,one,x\nv1,,x\nv1,1e3,x\n",
        "v1,2147483647,x\nv1,2147483648,x\n",
        f"v1,{'9' * 19},x\nv1,{'9' * 5000},x\n",
        "v1,١,x\nv1,1\u00a0,x\nv1,\x1c2\x85,y\nv1,\ufeff3,y\n",
        "v1,1,\nv1,2,   \nv1,3,\u200b \u2060\nv1,4,\u3000\n",
        "v1,1,nan\nv1,2,NaN\nv1,3,NAN \nv1,4,nano\n",
        "v1,1," + "x" * 2000 + "\n",
        "v1,1," + "x" * 2001 + "\n",
        "v1,1," + "🐈" * 2000 + "\nv1,2," + "🐈" * 2001 + "\n",
        "v1,1," + " " * 3000 + "x" + "\u2003" * 3000 + "\n",
        "v1,1,a\0b\n\0v1,2,x\n",
        "v1,1\nv1,1,x,y\n\nv1\n",
        "v1,1,\u202eevil\0\nv1,2,\u202eevil\n\u2066v1,3,x\n",
        "v1,1,\u00ad\nv1,2,\ue000\nv1,3,\U000e0001\nv1,4,\U0010ffff\n",
        "v1,1,\x7f\nv1,2,\x1b[31mred\nv1,3,a\tb\n",
        'v1,1,"two\nlines"\n\nv1,0,x\nv9,1,\nv2,1\nv1,1,z\n',
        "V1,1,x\nv 1,1,x\n../v1,1,x\n,1,x\n",
        f"{'v' * 128},1,x\n{'v' * 129},1,x\n",
        "video_001,1,x\nvideo_00001,1,x\nvideo-0001,1,x\nvdieo_0001,1,x\nvideo_0013,1,x\n",
        "".join(f"video_{number},1,x\n" for number in range(100, 160)),
        "".join(f"{'long' * 29}{number},1,x\n" for number in range(12)),
        "a.b-c_e,1,x\nA.b-c_d,1,x\na.b.c.d,1,x\nab-c_d,1,x\n🐈.b-c_d,1,x\n",
        "1,1,x\n2,1,y\n0003,1,z\n",
        "1,1,x\n01,2,y\n1,2,z\n",
        "7,1,x\n8,1,y\n99,1,z\n",
        "v1,1,x\n2,1,y\n",
        "1,1,x\nv1,1,y\nvideo_0001,2,z\n",
        " v1 ,1,x\nv1,2,y\n1_,1,x\n",
        "".join(f"video_{number:04d},1,x\n" for number in range(1, 13)) + "v1,1,x\nv2,1,x\n",
        "v1,0,\n" * 1500,
        "v1,0,x\n" * 999 + "v1,1\n" * 1200,
        "".join(f"v1,{number},x\n" for number in range(1, 30)) * 2,
        "=HYPERLINK(1),1,x\nv1,1,=1+1\nv2,1,<script>alert(1)</script>\n",
    ):
        yield csv_case(HEAD + body)
    yield csv_case(
        FULL
        + 'v1,1,x,cat,7;9,0 1 2\nv1,2,x,,"[7, ""9""]","[0, 12]"\nv1,3,x, ,,\nv1,4,x,nan,"7, 8","[1 2]"\n'
        + "v1,5,x,a,['7' '8'],[ ]\nv1,6,x,a,[],;;\n"
    )
    long_list = " ".join("1" for _ in range(10_001))
    for cells in (
        'x,cat,"[null]",0',
        'x,cat,"[7.5]",0',
        'x,cat,"[[7]]",[true]',
        'x,cat,"{""a"": 1}",x',
        f"x,cat,{long_list},{long_list}",
        f"x,cat,{'t' * 129},-1",
        "x,\u200b,7,1.5",
        "x,a\0b,[7,8",
        'x,cat,"[7","[1, 2"',
        'x,cat,"[""\\ud800""]","[1] 2"',
        'x,cat,"[""\\ud83d\\ude00""]",[]',
        'x,cat,"[NaN]","[Infinity]"',
        f"x,cat,[{'9' * 19}],[{'9' * 5000}]",
        "x,cat,[-0],[-0]",
        "x,cat,[1e2],[1e2]",
        f"x,{'l' * 2001},{'[' * 300},\u0661",
        "x,cat,'7',\"'7'\"",
    ):
        yield csv_case(f"{FULL}v1,1,{cells}\n")


def _csv_shapes() -> Iterator[Case]:
    """Headers, quotes and line ends."""
    for text in (
        "video_id\n",
        "video_id,rank\nv1,1\n",
        "Video ID,Rank,description \nv1,1,x\n",
        "VIDEO-ID,RANK,DESCRIPTION\nv1,1,x\n",
        "video,rank,caption\nv1,1,x\n",
        "video_id,rank,description,rank\nv1,1,x,2\n",
        "video_id,rank,description,rank,label,label,label\nv1,1,x,2,a,b,c\n",
        "video_id;rank;description\nv1;1;x\n",
        "video_id\trank\tdescription\nv1\t1\tx\n",
        "video_id|rank|description\nv1|1|x\n",
        "description,video_id,rank,extra,\u202eevil\nx,v1,1,a,b\n",
        ",".join(f"c{number}" for number in range(30)) + "\n" + ",".join("x" * 30) + "\n",
        HEAD.strip() + "," + ",".join(f"c{number}" for number in range(30)) + "\nv1,1,x" + "," * 30 + "\n",
        "\n\n" + HEAD + "\n\nv1,1,x\n\n\nv1,0,y\n",
        HEAD.replace("\n", "\r\n") + 'v1,1,"a\r\nb"\r\n\r\nv1,0,c\r\n',
        HEAD.replace("\n", "\r") + "v1,1,x\rv1,0,y\r",
        HEAD + "v1,1,x\rv1,2,y\r\nv1,0,z\n\r",
        HEAD + "v1,1,x",
        HEAD + 'v1,1,"x"',
        HEAD + 'v1,1,"""x"" said ""y"", ok"\n',
        HEAD + 'v1,1,""\n"v1","2","x"\n',
        HEAD + 'v1,1,a "quoted" word\nv1,2,x"\n',
        HEAD + 'v1,1,ok\nv1,2,"never closed\nv2,1,x\n',
        HEAD + 'v1,1,ok\nv1,2,"bad" quote\nv2,1,x\n',
        HEAD + 'v1,0,ok\nv1,2\n\nv1,2,"bad"" quote\n\nv2,1,x\n',
        'video_id,rank,"description\nv1,1,x\n',
        '"video_id","rank" ,"description"\nv1,1,x\n',
        '"video_id,rank,description"\nv1,1,x\n',
        ',rank,"a"b\n1,2,3\n',
        HEAD + 'v1,1, "spaced"\n',
        HEAD + "v1,1,x," + "\n" + ",,\n" + "   \n",
        HEAD + "\u2028\nv1,1,a\u2028b\x85c\x0bd\n",
        "one column only\nx\n",
        "é,ü\n1,2\n",
        "\x0c" + HEAD + "v1,1,x\n",
    ):
        yield csv_case(text)


def _json_lines() -> Iterator[Case]:
    """Values of every type in every column."""
    values = (
        "null", "true", "1", "1.0", "1.5", "-0", "-0.0", "1e999", "-1e999", "NaN", "Infinity", "-Infinity",
        "1e16", "1e15", "123456789012345680.0", "1.5e-7", "0.0001", "0.00001", "9007199254740993",
        "1000000000000000000", "1000000000000000001", "-" + "9" * 50, "1" * 4300, "1" * 4301, '""', '" v1 "',
        '"v1"', '"2"', "[]", "[1]", '["7", 8]', "[[1]]", "{}", '{"a": 1}', '"\\ud800"', '"\\ud83d\\ude00"',
        '"it\'s"', '"a\\"b\'c"', '["it\'s", "say \\"x\\"", "\\\\", "\\n\\u202e"]', "[1,2,3,4,5,6,7,8]",
        '{"b":1,"a":2,"d":3,"c":4,"e":5}', '{"x": [[[[[[[1]]]]]]]}', "[null, true, false, 1.0, 2.5e300]",
        '["' + "long " * 20 + '"]', '["🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈🐈"]',
    )  # fmt: skip
    columns = ("video_id", "rank", "description", "label", "track_ids", "frame_indices")
    for value in values:
        lines = [
            record(rank=place + 1, **{}).replace("}", f', "{column}": {value}}}')
            if column not in ("video_id", "rank", "description")
            else "{"
            + ", ".join(
                f'"{name}": {value if name == column else json.dumps(default)}'
                for name, default in (("video_id", "v1"), ("rank", place + 1), ("description", "x"))
            )
            + "}"
            for place, column in enumerate(columns)
        ]
        yield Case("p.jsonl", "\n".join(lines).encode())
    for text in (
        '{"video_id": 7, "rank": 1, "description": "x"}',
        '{"video_id": 1, "rank": 1, "description": "x"}\n{"video_id": "1", "rank": 2, "description": "x"}',
        "{}\n",
        "{}\n[]\n",
        "{}\n" + record(),
        record() + "\n" + '{"video_id": "v1", "rank": 2}',
        record() + "\n\n \t\n\r\n" + record(rank=2) + "\r\n\n",
        record() + "\n" + record(),
        record(extra=1, other=[2]) + "\n" + record(rank=2, third=None),
        record() + "\n" + '{"video_id": "v1", "rank": 2, "rank": 3, "description": "x"}',
        '{"": 1, "": 2}\n{"\\u202e": 1, "\\u202e": 1}',
        '[1]\n"text"\n1\n1.5\ntrue\nnull\nNaN\n' + record(),
        record(track_ids=None, frame_indices=None, label=None),
        record(track_ids="7;8", frame_indices="1, 2"),
        record(description=" " * 50 + "x" * 2001),
    ):
        if text.startswith(("[", '"')):
            yield Case("p.jsonl", f"{record()}\n{text}".encode())
        yield Case("p.jsonl", text.encode())
    deep = '{"video_id": "v1", "rank": 1, "description": ' + "[" * 50_000
    yield Case("p.jsonl", deep.encode(), close=True)
    yield Case("p.jsonl", ('{"x": ' + "[" * 2_000 + "]" * 2_000 + "}\n").encode(), close=True)


def _json_text() -> Iterator[Case]:
    """Lines that are no JSON, each in a different way."""
    bodies = (
        "{oops}", "{", '{"a"', '{"a":', '{"a": ', '{"a": 1', '{"a": 1 "b": 2}', '{"a": 1} x', '{"a": 1}}',
        '{"a" 1}', "{1: 2}", "{'a': 1}", '{"a": "', '{"a": "x\\', '{"a": "\\x"}', '{"a": "\\u12"}',
        '{"a": "\\u12G4"}', '{"a": "\\ud83d\\u12"}', '{"a": "\\ud83d\\uZZZZ"}', '{"a": "\t"}',
        '{"a": "x\x01y"}',
        '{"a": .5}', '{"a": 5.}', '{"a": 1e}', '{"a": +1}', '{"a": -}', '{"a": 01}', '{"a": nul}',
        '{"a": Nan}', '{"a": Inf}', '{"a": -Inf}', '{"a": tru', '{"a": [1 2]}', '{"a": [', '{"a": [1',
        '{"a": [1,', '{"a": {', "{}{}", "{} {}", '{"a": 1}\x0b', '\u00a0{"a": 1}', '{"🐈🐈": 🐈}',
        '{"' + "🐈" * 100 + '": x}', '{"a": "\\ud83d', '{"a": "\\ud83d\\ude0"}', "\ufeff{}", '{"a":1}\x00',
        '{"a": 1e5x}', "{\u2028}", '{"a": "\u2028"} \u2028',
    )  # fmt: skip
    for body in bodies:
        yield Case("p.jsonl", f"{record()}\n{body}\n{record(rank=0)}".encode())
    for body in ('{"a": 1,}', '{"a": [1,]}', '{"a": [,1]}', "{,}"):  # Python 3.13 says it in other words
        yield Case("p.jsonl", f"{record()}\n{body}".encode(), close=True)
