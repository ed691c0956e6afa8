"""Reading by column against reading by cell, which is the definition: equal where columns are accepted."""

import csv
import io
from collections.abc import Callable
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from pipeline.records import Prediction
from pipeline.tables import PREDICTIONS
from sitegen import sheets
from sitegen.checks import Faults
from sitegen.readers import ReadOptions, by_cell, by_column

KNOWN = {"v1", "v2", "clip_07", "12"}
VIDEOS = ["v1", "v2", " v1", "clip_07", "7", "12", "v9", "", "../x", "V1"]
TEXTS = [
    "A cat",
    "a dog, running",
    'a "red" car',
    " blanks ",
    "nan",
    "",
    "  ",
    "é\u202e",
    "x" * 2_001,
    "\u2028",
]
RANKS = ["1", "2", "3", "2.0", " 4 ", "0", "-1", "1.5", "x", "", "99999999999", "+5"]
LISTS = ["", "7;9", "[1, 2]", '["7", "9"]', "[", "1 2", "-1", "x", "[null]", "[[1]]"]
COLUMNS = ["video_id", "rank", "description", "label", "track_ids", "frame_indices"]
OPTIONS = st.sampled_from(
    [ReadOptions(), ReadOptions(video_map={"7": "v2"}), ReadOptions(video_map={"a": "v1"})]
)
TRUTHS = st.sampled_from([None, KNOWN, {"clip_07"}])

pytestmark = pytest.mark.filterwarnings("error")


def outcome(read: Callable[[], Any]) -> Any:
    """What is read, or None where there are faults."""
    try:
        found = read()
    except FaultsError:
        return None
    return found and (tuple(found.predictions), found.warnings, found.ids.warnings(), found.config)


def hold(data: bytes, source_format: str, known: set[str] | None, options: ReadOptions) -> None:
    """What the columns give is what the cells give; and where cells have faults, the columns give nothing."""
    quick = outcome(lambda: by_column(data, source_format, known, options))
    event("in doubt" if quick is None else "accepted")
    if quick is not None:
        assert quick == outcome(lambda: by_cell(data, source_format, known, options, Faults("p")))


@st.composite
def rows(draw: st.DrawFn) -> list[tuple[str, ...]]:
    """Cells by `COLUMNS`; in half of the tables all are right."""
    is_hostile = draw(st.booleans())

    def cell(right: list[str], all_values: list[str]) -> str:
        return draw(st.sampled_from(all_values if is_hostile and draw(st.integers(0, 9)) == 0 else right))

    count = draw(st.integers(0, 6))
    ranks = draw(st.permutations(["1", "2", "3", "4.0", " 5 ", "+6"]))
    return [
        (
            cell(["v1", "v2", " v1"], VIDEOS),
            cell([ranks[place]], RANKS),
            cell(TEXTS[:4], TEXTS),
            cell(["car", ""], TEXTS),
            cell(LISTS[:4], LISTS),
            cell(["", "[3]", "3;4"], LISTS),
        )
        for place in range(count)
    ]


@st.composite
def csv_files(draw: st.DrawFn) -> bytes:
    """CSV as writers make it, or with bytes in it that none makes."""
    sink = io.StringIO(newline="")
    quoting = draw(st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL]))
    writer = csv.writer(
        sink, quoting=quoting, lineterminator=draw(st.sampled_from(["\n", "\n", "\r\n", "\r", "\n\n"]))
    )
    places = draw(st.permutations(range(6)))[: draw(st.sampled_from([6, 6, 6, 5]))]
    names = [COLUMNS[place] for place in places]
    if draw(st.integers(0, 9)) == 0:
        names[draw(st.integers(0, len(names) - 1))] = draw(st.sampled_from([" rank", "more", "label"]))
    writer.writerow(names)
    writer.writerows([row[place] for place in places] for row in draw(rows()))
    data = bytearray(sink.getvalue().encode())
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 2]))):
        place = draw(st.integers(0, len(data)))
        odd = [
            b'"',
            b'""',
            b",",
            b"\n",
            b"\r",
            b"\r\n",
            b"\0",
            b"\xff",
            b"\xed\xa0\x80",
            b"\xef\xbb\xbf",
            b" ",
            b" \n",
        ]
        data[place : place + draw(st.integers(0, 2))] = draw(st.sampled_from(odd))
    return draw(st.sampled_from([b"", b"", b"\xef\xbb\xbf"])) + bytes(data)


@settings(max_examples=500)
@given(data=csv_files(), known=TRUTHS, options=OPTIONS)
def test_csv(data: bytes, known: set[str] | None, options: ReadOptions) -> None:
    hold(data, "csv", known, options)


@settings(max_examples=400)
@given(cells=st.text(alphabet='a1,"\n\r ;\ufeff', max_size=40), known=TRUTHS)
def test_csv_of_any_marks(cells: str, known: set[str] | None) -> None:
    hold(b"video_id,rank,description\n" + cells.encode(), "csv", known, ReadOptions())
    hold(b"video_id,rank,description\nv1,7,x\n" + cells.encode(), "csv", known, ReadOptions())


def typed(values: list[Any], kinds: list[pa.DataType]) -> st.SearchStrategy[pa.Array]:
    """The values as one of the types that hold them all."""
    made = []
    for kind in kinds:
        try:
            made.append(pa.array(values, kind))
        except (pa.ArrowException, TypeError, ValueError, OverflowError):
            continue
    return st.sampled_from(made or [pa.array([str(value) for value in values])])


TEXT_KINDS = [pa.string(), pa.string(), pa.large_string(), pa.dictionary(pa.int8(), pa.string()), pa.binary()]
LIST_VALUES = [None, [], ["7"], ["7", " 9"], [7], [3, 4], [None], [-1], [2**40], [1.0], ["x" * 129]]


@st.composite
def parquet_files(draw: st.DrawFn) -> bytes:
    """Parquet of the types that libraries write, and of some that none does."""
    count = draw(st.integers(0, 5))
    ranks = [None, 0, 2**31, 2.0, 1.5, float("nan"), "1", True]

    is_hostile = draw(st.booleans())

    def cells(right: list[Any], all_values: list[Any]) -> list[Any]:
        some = all_values if is_hostile and draw(st.integers(0, 3)) == 0 else right
        return draw(st.lists(st.sampled_from(some), min_size=count, max_size=count))

    numbers = list(range(count, 0, -1)) if draw(st.integers(0, 3)) else cells([1, 2, 3, 4, 5], [1, *ranks])
    whole = [pa.int32(), pa.int64(), pa.uint8(), pa.uint64(), pa.float64(), pa.string(), pa.bool_()]
    lists = [pa.list_(pa.string()), pa.list_(pa.int64()), pa.large_list(pa.string()), pa.list_(pa.float64())]
    texts = cells(TEXTS[:4], [*TEXTS, None])
    columns = {
        "video_id": draw(typed(cells(["v1", "v2"], [*VIDEOS, None, 7, 12]), [pa.int64(), *TEXT_KINDS])),
        "rank": draw(typed(numbers, whole)),
        "description": draw(typed(texts, TEXT_KINDS)),
        "label": draw(typed(cells(["car", None], TEXTS), [pa.null(), *TEXT_KINDS])),
        "track_ids": draw(typed(cells(LIST_VALUES[:4], LIST_VALUES), [*lists, pa.null()])),
        "frame_indices": draw(
            typed(cells([None, [], [3, 4], [5]], LIST_VALUES), [*lists, pa.list_(pa.int32())])
        ),
        "more": pa.array([1.5] * count),
    }
    kept = draw(st.permutations(list(columns)))[: draw(st.sampled_from([7, 7, 7, 6]))]
    table = pa.table({name: columns[name] for name in kept})
    table = table.replace_schema_metadata({"config_sha256": "a" * 64} if draw(st.booleans()) else None)
    sink = io.BytesIO()
    pq.write_table(table, sink, row_group_size=draw(st.sampled_from([1, 2, 100])))
    return sink.getvalue()


@settings(max_examples=400)
@given(data=parquet_files(), known=TRUTHS, options=OPTIONS)
def test_parquet(data: bytes, known: set[str] | None, options: ReadOptions) -> None:
    hold(data, "parquet", known, options)


USUAL = (
    Prediction("v1", 1, "A cat, running", "cat", ("7", "9"), (0, 3)),
    Prediction("v1", 2, 'A "red" car'),
    Prediction("v2", 1, "A cat, running", "cat"),
)


def usual(name: str) -> bytes:
    """A file as libraries write it."""
    if name == "parquet":
        return PREDICTIONS.to_bytes(USUAL)
    sink = io.StringIO(newline="")
    writer = csv.writer(sink, lineterminator="\r\n" if name == "csv, CR LF" else "\n")
    writer.writerow(COLUMNS)
    for row in reversed(USUAL):
        lists = ";".join(row.track_ids), ";".join(map(str, row.frame_indices))
        writer.writerow((row.video_id, row.rank, row.description, row.label, *lists))
    return sink.getvalue().encode()


@pytest.mark.parametrize("name", ["parquet", "csv", "csv, CR LF"])
def test_usual_files_need_no_look_at_their_cells(name: str) -> None:
    found = by_column(usual(name), name.partition(",")[0], {"v1", "v2"}, ReadOptions())
    assert found is not None and found.predictions == USUAL


def test_lists_of_more_bytes_than_may_be_are_left_to_the_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheets, "MAX_LIST_BYTES", 1)
    assert by_column(usual("parquet"), "parquet", None, ReadOptions()) is None


CAPTIONS = ["", "A cat", "a dog, running", " A cat ", "nan", 'a "red" car', "  "]
TRACK_IDS = ["", "7", "7.0", " 7", "9", "é", "x" * 129]


@st.composite
def coool_files(draw: st.DrawFn) -> bytes:
    """COOOL results, in half of the files without a fault."""
    is_hostile = draw(st.booleans())
    first, slots = draw(st.sampled_from([0, 1])), draw(st.integers(1, 3))
    header = ["ID", "driver_state_changed"]
    for slot in range(first, first + slots):
        header += [f"Hazard_Track_{slot}", f"Hazard_Name_{slot}"]
    ids = ["v1_0", "v1_1", "v1_10", "v2_0", "v2_2", "clip_07_4", "7_1"]
    odd = ["v1_00", "v1_x", "v1", "_3", "v1_99999999999", " v2_7 ", "v1 _3", "../x_1"]
    kept = draw(st.lists(st.sampled_from(ids + (odd if is_hostile else [])), unique=True, max_size=6))
    captions, tracks = (CAPTIONS, TRACK_IDS) if is_hostile else (CAPTIONS[:4], TRACK_IDS[:5])
    sink = io.StringIO(newline="")
    writer = csv.writer(sink, lineterminator=draw(st.sampled_from(["\n", "\r\n"])))
    extra = [""] * draw(st.sampled_from([0, 0, 2]))
    writer.writerow(header + extra)
    for frame in kept:
        cells = [draw(st.sampled_from(part)) for _ in range(slots) for part in (tracks, captions)]
        short = draw(st.integers(0, 9)) == 0 if is_hostile else False
        writer.writerow([frame, "True", *cells, *extra][: -1 if short else None])
    return sink.getvalue().encode()


@settings(max_examples=400)
@given(data=coool_files(), known=TRUTHS, options=OPTIONS)
def test_coool(data: bytes, known: set[str] | None, options: ReadOptions) -> None:
    hold(data, "coool", known, options)


def test_usual_coool_results_need_no_look_at_their_rows() -> None:
    rows = ["v2_1,False,7,a dog,,", "v2_0,True,7,a dog,9,A cat", "v1_3,True,,A cat,8,", "v2_5,True,9,A cat,,"]
    header = "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1,Hazard_Track_2,Hazard_Name_2"
    found = by_column("\n".join([header, *rows]).encode(), "coool", {"v1", "v2"}, ReadOptions())
    assert found is not None and found.predictions == (
        Prediction("v1", 1, "A cat", None, (), (3,)),
        Prediction("v2", 1, "a dog", None, ("7",), (0, 1)),
        Prediction("v2", 2, "A cat", None, ("9",), (0, 5)),
    )
    assert found.warnings == ["1 track in a frame has no caption and thus no prediction."]
