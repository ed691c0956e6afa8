"""The board's downloads, read back by other readers, with hostile names in them."""

import csv
import io
import json
import re
from collections.abc import Callable

import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from pipeline.config import BenchmarkSettings
from pipeline.records import TruthHazard
from pipeline.scores import Evaluation, Scorecard, Signature, Submission
from sitegen.exports import (
    FORMATS,
    SCHEMA,
    board_csv,
    board_json,
    board_latex,
    board_markdown,
    board_parquet,
    latex,
    markdown,
)
from sitegen.gathered import SiteData, System
from sitegen.uncertainty import Interval, Uncertainty
from sitegen.words import visible
from tests.site_fixtures import EVIL, FORMULA, probes

SIGNATURE = Signature("1", "words", "0" * 64, "1" * 64, 3, 0.8)
NAMES = ("Plain", FORMULA, EVIL, "100 % & {more}_of #it ~ ^ \\today $x$ | `code` **b** [l](http://e)\nnext")


def system(place: int, name: str, recall: float | None = 0.5) -> System:
    submission = Submission(name, f"{name} et al.", "https://example.org/", "2026-01-02", "csv", ())
    card = Scorecard(0.75 / place, 0.5 / place, 0.25, recall, 3, SIGNATURE)
    span = Interval(0.1, 0.9)
    sure = Uncertainty(span, span, Interval(0.0, 0.5), None if recall is None else span, 1, place, 4, 0.25)
    return System(
        1,
        place,
        f"s-{place}",
        "agents",
        False,
        Evaluation(submission, (), (), card),
        sure,
        "f" * 64,
        probes=probes(2),
        licence="MIT",
    )


@pytest.fixture(scope="module")
def data() -> SiteData:
    systems = [system(place, name) for place, name in enumerate(NAMES, start=1)]
    systems.append(system(5, "No hazard", recall=None))
    truth: dict[str, tuple[TruthHazard, ...]] = {"v1": ()}
    return SiteData(BenchmarkSettings(name="Bench & <b>"), truth, {}, {}, {}, tuple(systems))


def test_csv_reads_back(data: SiteData) -> None:
    rows = list(csv.DictReader(io.StringIO(board_csv(data).decode(), newline="")))
    assert list(rows[0]) == SCHEMA.names and len(rows) == 5
    assert [row["submission"] for row in rows[:2]] == ["Plain", "'" + FORMULA]
    assert rows[2]["submission"] == visible(EVIL)
    first = rows[0]
    assert (first["rank"], first["place"], first["rank_low"], first["rank_high"]) == ("1", "1", "1", "4")
    assert (first["besm"], first["besm_low"], first["besm_high"]) == ("0.750000", "0.100000", "0.900000")
    assert first["flags"] == "constant word-bag" and first["licence"] == "MIT"
    assert first["signature"] == str(SIGNATURE) and first["predictions_sha256"] == "f" * 64
    assert rows[4]["hazard_recall"] == rows[4]["hazard_recall_low"] == ""
    assert not any(cell[:1] in "=+-@" for row in rows for cell in row.values() if cell)


def test_json_reads_back_and_keeps_the_published_row_apart(data: SiteData) -> None:
    board = json.loads(board_json(data))
    assert [row["submission"] for row in board["rows"]] == [*NAMES, "No hazard"]  # as they were given
    assert board["rows"][0]["flags"] == ["constant", "word-bag"]
    assert board["rows"][4]["hazard_recall"] is None and list(board["rows"][0]) == SCHEMA.names
    (published,) = board["published"]
    assert published["besm"] == 0.3922 and published["note"] == "published, other data"


def test_parquet_reads_back_and_its_bytes_repeat(data: SiteData) -> None:
    content = board_parquet(data)
    table = pq.read_table(io.BytesIO(content))
    assert table.schema.equals(SCHEMA)
    assert table.to_pylist() == json.loads(board_json(data))["rows"]
    assert content == board_parquet(data)
    assert pq.ParquetFile(io.BytesIO(content)).metadata.row_group(0).column(0).compression == "ZSTD"


def test_the_published_row_is_no_row_of_the_tables(data: SiteData) -> None:
    assert b"0.3922" not in board_csv(data)
    assert 0.3922 not in pq.read_table(io.BytesIO(board_parquet(data)))["besm"].to_pylist()


def test_latex_has_a_cell_for_each_column(data: SiteData) -> None:
    text = board_latex(data).decode()
    assert text.count("\\begin{tabular}{rlrrrr}") == text.count("\\end{tabular}") == 1
    above, below = text.split("\\emph{published, other data")
    rows = [line for line in above.splitlines() if line.endswith("\\\\")]
    assert len(rows) == 1 + 5
    assert all(len(re.findall(r"(?<!\\)&", row)) == 5 for row in rows)
    assert rows[1] == (
        "1= & Plain & 0.7500 {\\scriptsize [0.1000, 0.9000]} & 0.5000 & 25.0\\,\\% & 50.0\\,\\% \\\\"
    )
    assert "0.3922" in below and "0.3922" not in above
    comments = [line for line in text.splitlines() if line.startswith("%")]
    assert len(comments) == 3  # a line break in a name would end one


SPECIAL = r"\\(?:text\w+\{\}|langle|[,#$%&_{}])|\$\\langle\$|\$\\rangle\$"


@given(st.text())
def test_latex_leaves_nothing_to_interpret(text: str) -> None:
    assert not re.search(r"[\\~^#$%&_{}<>|]", re.sub(SPECIAL, "", latex(text)))


def test_latex_by_hand() -> None:
    assert latex(r"\a_b^c~d#e$f%g&h{i}") == (
        r"\textbackslash{}a\_b\textasciicircum{}c\textasciitilde{}d\#e\$f\%g\&h\{i\}"
    )
    assert latex("a\u202eb\nc") == r"a$\langle$U+202E$\rangle$b c"


def rendered(text: str) -> str:
    return str(MarkdownIt("commonmark", {"html": True}).enable("table").render(text))


def test_markdown_has_two_tables_and_no_markup_from_outside(data: SiteData) -> None:
    html = rendered(board_markdown(data).decode())
    above, below = html.split("published, other data")
    assert above.count("<table>") == below.count("<table>") == 1
    assert above.count("<tr>") == 1 + 5 and below.count("<tr>") == 1 + 1
    assert html.count("<td") == 6 * 6
    assert "0.3922" in below and "0.3922" not in above
    assert not re.search(r"<(?:script|img|a|b|strong|em|code)\b", html)
    assert "0.7500 (0.1000–0.9000)" in above


@given(st.text(st.characters(codec="utf-8"), max_size=40))
def test_markdown_cells_say_what_they_are_given(text: str) -> None:
    html = rendered(f"| a | b |\n|---|---|\n| x{markdown(text)}x | y |\n")
    cells = re.findall(r"<td>(.*?)</td>", html, re.DOTALL)
    escaped = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"}
    assert cells == ["x" + "".join(escaped.get(char, char) for char in visible(text)) + "x", "y"]


@pytest.mark.parametrize("made", [made for _, _, made in FORMATS])
def test_every_format_of_an_empty_board(made: Callable[[SiteData], bytes]) -> None:
    empty = SiteData(BenchmarkSettings(), {"v1": ()}, {}, {}, {}, ())
    assert made(empty)
