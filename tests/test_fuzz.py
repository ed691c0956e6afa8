"""Random and bent files of every format: each is read or refused with faults, and nothing else comes out.

The examples are the same in every run (see conftest.py). Parquet is read in a child, as pyarrow can abort.
"""

import gzip
import io
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError
from sitegen.fixes import fixed
from sitegen.readers import FORMATS, ReadOptions, read_predictions
from sitegen.sandbox import read_apart
from tests.fuzz_readers import hold, one_input, read_or_refuse
from tests.hostile_case import RIGHT, TRUTH, is_one_line
from tests.hostile_child import Child

TEXTS = [name for name in RIGHT if name != "parquet"]
TOKENS = [
    *(bytes([sign]) for sign in b"\"'\\,;:\n\r\t\0[]{}() #-=\xff"),
    *(b"NaN", b"Infinity", b"1e999", b"-1", b"9" * 30, b"null", b"true", b"\\u0000", b"\\ud800"),
    *(b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xe2\x80\xae", b"video_id", b"rank", b"ID", b"video_0001_0"),
    *(b"image_id", b"caption", b"[[", b"]]", b"['a']", b"__import__('os')", b"../"),
]
PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "gz": lambda data: gzip.compress(data, mtime=0),
    "zst": lambda data: bytes(pa.compress(data, "zstd", asbytes=True)),
    "zip": lambda data: _zip(data, "p"),
}
OPTIONS = st.builds(
    ReadOptions,
    source_format=st.sampled_from(["", *FORMATS]),
    caption_column=st.sampled_from(["", "Label", "Reason of Incident", "none"]),
    video_map=st.sampled_from([{}, {"1": "v1"}, {"v1": "../x"}]),
)


def _zip(data: bytes, name: str) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr(zipfile.ZipInfo(name), data)
    return target.getvalue()


@st.composite
def bent(draw: st.DrawFn, data: bytes) -> bytes:
    """The bytes, with up to six places replaced, cut out or filled in."""
    found = bytearray(data)
    for _ in range(draw(st.integers(1, 6))):
        place = draw(st.integers(0, len(found)))
        end = place + draw(st.integers(0, 12))
        found[place:end] = draw(st.one_of(st.sampled_from(TOKENS), st.binary(max_size=6)))
    return bytes(found)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


@settings(max_examples=1_000)
@given(data=st.binary(max_size=200))
def test_random_bytes(folder: Path, data: bytes) -> None:
    one_input(data, folder)


@settings(max_examples=400)
@given(text=st.text(max_size=200), way=st.integers(0, len(FORMATS) + 2))
def test_random_text(folder: Path, text: str, way: int) -> None:
    one_input(bytes([way]) + text.encode("utf-8", "surrogatepass"), folder)


@pytest.mark.parametrize("name", TEXTS)
@settings(max_examples=400)
@given(data=st.data())
def test_bent_text(folder: Path, name: str, data: st.DataObject) -> None:
    path = folder / "p"
    path.write_bytes(data.draw(bent(RIGHT[name][1])))
    read_or_refuse(path, data.draw(st.one_of(st.none(), OPTIONS)))


@pytest.mark.parametrize("name", PACKERS)
@settings(max_examples=250)
@given(data=st.data())
def test_bent_archives(folder: Path, name: str, data: st.DataObject) -> None:
    path = folder / "p"
    inside = RIGHT[data.draw(st.sampled_from(TEXTS))][1]
    path.write_bytes(data.draw(bent(PACKERS[name](inside))))
    read_or_refuse(path)


@pytest.mark.parametrize("name", TEXTS)
@settings(max_examples=150)
@given(data=st.data())
def test_fixes_of_bent_text(folder: Path, name: str, data: st.DataObject) -> None:
    path = folder / "p"
    path.write_bytes(data.draw(bent(RIGHT[name][1])))
    try:
        made = fixed(path, TRUTH, ReadOptions())
    except FaultsError as error:
        hold(error)
        return
    assert all(is_one_line(note) for note in made.notes)
    copy = folder / f"p.fixed.{made.ending}"
    copy.write_bytes(made.data)
    read_or_refuse(copy)


@pytest.fixture(scope="module")
def child(folder: Path) -> Iterator[Child]:
    found = Child(folder, dict(os.environ))
    yield found
    found.close()


@settings(max_examples=300)
@given(data=bent(RIGHT["parquet"][1]))
def test_bent_parquet(folder: Path, child: Child, data: bytes) -> None:
    path = folder / "p.parquet"
    path.write_bytes(data)
    outcome = child.ask(path)
    if outcome.verdict == "died":
        with pytest.raises(FaultsError):
            read_apart(path, TRUTH)
        return
    assert outcome.verdict in {"good", "refused"}, outcome.detail
    assert outcome.printable


def test_each_packing_of_a_right_file_is_read(folder: Path) -> None:
    for name, (_, content) in RIGHT.items():
        for pack in PACKERS.values():
            path = folder / "p"
            path.write_bytes(pack(content))
            assert read_predictions(path, TRUTH).source_format == name


def test_atheris_finds_nothing_in_seconds(tmp_path: Path) -> None:
    pytest.importorskip("atheris")
    for place, (_, content) in enumerate(RIGHT.values(), start=1):
        (tmp_path / str(place)).write_bytes(bytes([place]) + content)
    command = [sys.executable, "-m", "tests.fuzz_readers", "-max_total_time=10", str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr[-2_000:]
