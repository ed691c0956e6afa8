"""Workflow commands as GitHub documents them: what is escaped, and what is left out."""

import re
from urllib.parse import unquote

from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import Fault
from sitegen.annotations import error_lines, warning_lines

COMMAND = re.compile(r"::(error|warning) ((?:\w+=[^,:\r\n]*)(?:,\w+=[^,:\r\n]*)*)::([^\r\n]*)")


def test_a_fault_with_all_its_places() -> None:
    fault = Fault("runs/p.csv", 1234, "rank", "'0'", "a whole number from 1", "Count from 1.", 1240)
    assert error_lines([fault]) == [
        "::error file=runs/p.csv,line=1240,title=Row 1234%2C column rank"
        "::found '0'; expected a whole number from 1. Count from 1."
    ]


def test_what_is_not_known_is_left_out() -> None:
    whole = Fault("p.parquet", None, None, "no rows", "rows", "Add some.")
    column = Fault("p.csv", None, "rank", "no such column", "a column `rank`", "Add it.")
    row = Fault("p.parquet", 3, None, "x", "y", "z")
    assert [line.split("::")[1] for line in error_lines([whole, column, row], "sub/p.csv")] == [
        "error file=sub/p.csv,title=The file",
        "error file=sub/p.csv,title=Column rank",
        "error file=sub/p.csv,title=Row 3",
    ]


def test_signs_that_would_end_a_command_are_escaped() -> None:
    fault = Fault("a,b:c%.csv", 1, "x::y", "50 %\r\n::error::z", "b", "c", 2)
    assert error_lines([fault]) == [
        "::error file=a%2Cb%3Ac%25.csv,line=2,title=Row 1%2C column x%3A%3Ay"
        "::found 50 %25%0D%0A::error::z; expected b. c"
    ]
    assert warning_lines("p.csv", ["one, 100 %", "two\n"]) == [
        "::warning file=p.csv,title=Predictions::one, 100 %25",
        "::warning file=p.csv,title=Predictions::two%0A",
    ]


@given(st.text(min_size=1), st.text(min_size=1), st.text())
def test_each_is_one_line_and_loses_nothing(file: str, column: str, found: str) -> None:
    (line,) = error_lines([Fault(file, 7, column, found, "b", "c", 9)])
    match = COMMAND.fullmatch(line)
    assert match
    parts = dict(part.split("=", 1) for part in match[2].split(","))
    assert parts.keys() == {"file", "line", "title"}
    escapes = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
    assert match[3] == f"found {found}; expected b. c".translate(escapes)
    if file.isascii():
        assert unquote(parts["file"]) == file
