"""Reading apart: the same as reading here, and whatever befalls the child is one plain fault."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import pytest

from pipeline.errors import FaultsError, OutsideError
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen import sandbox
from sitegen.readers import ReadOptions, read_predictions
from sitegen.sandbox import Limits, read_apart

SECRET = "The truth's own words"
TRUTH = [TruthHazard("v1", "1", "Cat", SECRET), TruthHazard("v2", "1", "", "")]
GOOD = 'video_id,rank,description,track_ids\nv1,2,"A cat, running",7;9\nv1,1,  A dog ,\n'
BAD = "video_id,rank,description\nv1,0,A cat\nv9,1,\n"
SAID = {"source_format": "csv", "sha256": "0" * 64, "warnings": [], "config_sha256": "", "ending": "csv"}

needs_limits = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no resource limits")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "given"
    path.write_text(GOOD)
    return path


def faults_of(path: Path, limits: Limits | None = None) -> FaultsError:
    with pytest.raises(FaultsError) as caught:
        read_apart(path, TRUTH, limits=limits)
    return caught.value


def test_it_reads_what_is_read_here(file: Path) -> None:
    assert read_apart(file, TRUTH) == read_predictions(file, TRUTH)
    options = ReadOptions("csv", "", {"v1": "v2"})
    read = read_apart(file, TRUTH, options)
    assert read == read_predictions(file, TRUTH, options)
    assert {one.video_id for one in read.predictions} == {"v2"}
    assert read_apart(file, None) == read_predictions(file)


@pytest.mark.parametrize("content", [BAD.encode(), b"", b"PAR1 no, it is not PAR1", b"\x80\x04K\x01."])
def test_faults_are_those_found_here(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "given"
    path.write_bytes(content)
    with pytest.raises(FaultsError) as here:
        read_predictions(path, TRUTH)
    assert faults_of(path).faults == here.value.faults


def test_a_missing_file_is_a_fault(tmp_path: Path) -> None:
    (fault,) = faults_of(tmp_path / "gone").faults
    assert fault.found == "no such file"


def test_a_process_without_memory_to_tell_of_it(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(_job: bytes, out: IO[bytes], err: IO[bytes], _limits: Limits) -> int:
        out.write(sandbox.MARK)
        err.write(b"Traceback\nMemoryError\n")
        return 1

    monkeypatch.setattr(sandbox, "_run", run)
    (fault,) = faults_of(file, Limits(memory_bytes=900 * 2**20, seconds=60.0)).faults
    assert "more than 900 MB" in fault.found and fault.row is None


@needs_limits
def test_memory_and_time_are_bounded(file: Path, tmp_path: Path) -> None:
    enough = Limits(memory_bytes=900 * 2**20, seconds=60.0)
    assert len(read_apart(file, TRUTH, limits=enough).predictions) == 2
    path = tmp_path / "large.csv"
    path.write_text(
        "video_id,rank,description\n" + "".join(f"v1,{n},A cat of number {n}\n" for n in range(1, 2_000_001))
    )
    (fault,) = faults_of(path, enough).faults
    assert "more than 900 MB" in fault.found and fault.row is None
    (fault,) = faults_of(path, Limits(seconds=1.0)).faults
    assert "more than 1 seconds" in fault.found


def boot(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Have the child run other code."""
    monkeypatch.setattr(sandbox, "_BOOT", code)


@needs_limits
@pytest.mark.parametrize("signal", ["SIGSEGV", "SIGABRT", "SIGKILL"])
def test_a_child_that_dies_is_a_fault(monkeypatch: pytest.MonkeyPatch, file: Path, signal: str) -> None:
    boot(monkeypatch, f"import os, signal\nos.write(1, b'COOOLER\\n')\nos.kill(os.getpid(), signal.{signal})")
    (fault,) = faults_of(file).faults
    assert "ends the process" in fault.found


def test_a_child_that_cannot_start_is_no_fault_of_the_file(
    monkeypatch: pytest.MonkeyPatch, file: Path
) -> None:
    boot(monkeypatch, "import no_such_module_anywhere")
    with pytest.raises(OutsideError, match="no_such_module_anywhere"):
        read_apart(file, TRUTH)


def says(monkeypatch: pytest.MonkeyPatch, document: object, table: bytes = b"") -> None:
    """Have the child hand back a document and a table of our choice."""
    text = json.dumps(document).encode()
    data = b"COOOLER\n" + len(text).to_bytes(8, "big") + text + table
    boot(monkeypatch, f"import os\nos.write(1, {data!r})")


def test_a_reader_that_breaks_is_told_by_place_only(monkeypatch: pytest.MonkeyPatch, file: Path) -> None:
    says(monkeypatch, {"stopped": "KeyError in readers.py, line 12"})
    (fault,) = faults_of(file).faults
    assert "KeyError in readers.py, line 12" in fault.found


@pytest.mark.parametrize(
    "rows",
    [
        [Prediction("v9", 1, "A cat")],  # no video of the truth
        [Prediction("v1", 1, "A\0cat")],
        [Prediction("v1", 1, " A cat")],
        [Prediction("v1", 0, "A cat")],
        [Prediction("v1", 1, "A cat"), Prediction("v1", 1, "A dog")],
        [Prediction("v1", 1, "A cat", track_ids=("",))],
        [Prediction("v1", 1, "A cat", frame_indices=(-1,))],
        [Prediction("v1", 1, "w" * 2_001)],
    ],
)
def test_rows_that_no_reader_leaves_are_refused(
    monkeypatch: pytest.MonkeyPatch, file: Path, rows: Sequence[Prediction]
) -> None:
    says(monkeypatch, SAID, PREDICTIONS.to_bytes(rows))
    (fault,) = faults_of(file).faults
    assert "confuses" in fault.found


@pytest.mark.parametrize(
    ("document", "table"),
    [
        (SAID, b"no table"),
        (SAID, b""),
        ([], b""),
        ({**SAID, "more": 1}, PREDICTIONS.to_bytes([])),
        ({**SAID, "ending": "../../x"}, PREDICTIONS.to_bytes([])),
        ({**SAID, "sha256": "x"}, PREDICTIONS.to_bytes([])),
        ({"faults": [{"file": "x"}]}, b""),
    ],
)
def test_a_document_of_another_shape_is_refused(
    monkeypatch: pytest.MonkeyPatch, file: Path, document: object, table: bytes
) -> None:
    says(monkeypatch, document, table)
    (fault,) = faults_of(file).faults
    assert "confuses" in fault.found


def test_clean_rows_pass(monkeypatch: pytest.MonkeyPatch, file: Path) -> None:
    rows = (Prediction("v1", 1, "A cat", "cat", ("7",), (0, 3)), Prediction("v1", 2, "A cat"))
    says(monkeypatch, SAID, PREDICTIONS.to_bytes(rows))
    assert read_apart(file, TRUTH).predictions == rows


def test_the_child_knows_neither_the_truth_nor_our_environment(
    monkeypatch: pytest.MonkeyPatch, file: Path
) -> None:
    monkeypatch.setenv("COOOLER_TOKEN", "hush")
    code = (
        "import json, os, sys\n"
        "known = sys.stdin.read() + repr(dict(os.environ))\n"
        f"found = [word for word in ({SECRET!r}, 'hush', 'v1') if word in known]\n"
        "text = json.dumps({'stopped': repr(found)}).encode()\n"
        "os.write(1, b'COOOLER\\n' + len(text).to_bytes(8, 'big') + text)\n"
    )
    boot(monkeypatch, code)
    (fault,) = faults_of(file).faults
    assert "['v1']" in fault.found
