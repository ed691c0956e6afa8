"""Outside files read in a process of their own: what crashes, fills or stalls it ends there.

The child gets the path, the options and the ids of the truth, never the truth's texts or this process's
environment. What it hands back is checked again: it has read hostile bytes.
"""

import io
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Annotated, NoReturn

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import Fault, FaultsError, OutsideError
from pipeline.predictions import Predictions
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen import checks
from sitegen.checks import visible
from sitegen.columns import accepted, raw_columns
from sitegen.readers import PREDICTION_COLUMNS, ReadOptions, ReadPredictions
from sitegen.sandbox_child import LENGTH_BYTES, MARK, MAX_RESULT_BYTES
from sitegen.texts import MAX_ROWS

# pyarrow looks for pandas when it makes a table, which would cost most of a second and 1 GB of addresses.
_BOOT = """
import json, sys
class NoPandas:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "pandas":
            raise ModuleNotFoundError(name, name=name)
job = json.load(sys.stdin.buffer)
sys.path[:] = job["sys_path"]
sys.meta_path.insert(0, NoPandas)
from sitegen.sandbox_child import run
run(job)
"""
_KEPT_VARIABLES = ("PATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT", "TEMP", "TMPDIR", "LANG")
_ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "ARROW_IO_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
    "MALLOC_ARENA_MAX": "2",
}
_MAX_DOCUMENT_BYTES = 64 * 2**20
_MAX_UNPACKED_BYTES = 4 * 2**30
_SMALLER = "Leave out what is no prediction, or check the file on your own computer: coooler check FILE."

_Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


@dataclass(frozen=True, slots=True)
class Limits:
    """What one file may cost: bytes of address space (not on Windows), and seconds."""

    memory_bytes: int = 2 * 2**30
    seconds: float = 60.0


class _Said(BaseModel):
    """The child's document: faults, or why it stopped, or what it read."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    faults: Annotated[list[Fault], Field(max_length=2 * checks.MAX_DETAILED_FAULTS)] = []
    stopped: Annotated[str, Field(max_length=300)] = ""
    source_format: Annotated[str, Field(pattern=r"^[a-z0-9]{0,16}$")] = ""
    sha256: _Sha256 = "0" * 64
    warnings: Annotated[list[Annotated[str, Field(max_length=20_000)]], Field(max_length=1_000)] = []
    config_sha256: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")] = ""
    ending: Annotated[str, Field(pattern=r"^([a-z0-9]{1,16}(\.[a-z0-9]{1,8})?)?$")] = ""


def read_apart(
    path: Path,
    truth: Sequence[TruthHazard] | None,
    options: ReadOptions | None = None,
    limits: Limits | None = None,
) -> ReadPredictions:
    """The predictions in a file, as `read_predictions` gives them, read in a child process with limits.

    Raises FaultsError with every fault; a child that dies or runs out of memory or time is one fault of
    the whole file. Raises OutsideError when no child can be started.
    """
    limits = limits or Limits()
    options = options or ReadOptions()
    job = {
        "sys_path": [place or str(Path.cwd()) for place in sys.path],
        "path": str(path),
        "truth": None if truth is None else [[one.video_id, not one.is_no_hazard] for one in truth],
        "options": {name: getattr(options, name) for name in ("source_format", "caption_column", "name")}
        | {"video_map": dict(options.video_map)},
        "memory_bytes": limits.memory_bytes,
        "seconds": limits.seconds,
    }
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        code = _run(json.dumps(job).encode(), out, err, limits)
        out.seek(0)
        if out.read(len(MARK)) != MARK and code is not None and code >= 0:
            raise OutsideError(f"The process that reads files does not start: {_last_line(err)}")
        name = visible(options.name or str(path), 1_000)
        if code and _last_line(err) == "MemoryError":  # it had too little left to tell
            _stop(name, _too_much(limits), limits)
        return _result(name, code, out, {one.video_id for one in truth or ()} or None, limits)


def _run(job: bytes, out: IO[bytes], err: IO[bytes], limits: Limits) -> int | None:
    """Run the child in a process group of its own; its return code, None when its time was over."""
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-c", _BOOT],
            stdin=subprocess.PIPE,
            stdout=out,
            stderr=err,
            env={name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ} | _ONE_THREAD,
            start_new_session=True,
        )
    except OSError as error:
        raise OutsideError(f"The process that reads files does not start: {error.strerror}.") from error
    with process:
        try:
            process.communicate(job, timeout=limits.seconds)
        except subprocess.TimeoutExpired:
            return None
        finally:
            if process.poll() is None:
                _kill(process)
    return process.returncode


def _kill(process: "subprocess.Popen[bytes]") -> None:
    with suppress(ProcessLookupError, PermissionError):
        if sys.platform == "win32":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)


def _last_line(err: IO[bytes]) -> str:
    err.seek(max(0, err.seek(0, io.SEEK_END) - 4_096))
    lines = err.read().decode("utf-8", "replace").strip().splitlines()
    return visible(lines[-1], 300) if lines else "it says nothing"


def _result(
    name: str, code: int | None, out: IO[bytes], videos: set[str] | None, limits: Limits
) -> ReadPredictions:
    if code is None or (sys.platform != "win32" and code in (-signal.SIGXCPU, -signal.SIGALRM)):
        _stop(name, f"a file that takes more than {limits.seconds:g} seconds to read", limits)
    if code != 0:
        _stop(name, "a file that ends the process that reads it: damaged, or too large unpacked", limits)
    try:
        size = int.from_bytes(out.read(LENGTH_BYTES), "big")
        if size > _MAX_DOCUMENT_BYTES:
            raise ValueError("a document that is too long")
        said = _Said.model_validate_json(out.read(size))
        if os.fstat(out.fileno()).st_size - out.tell() > MAX_RESULT_BYTES:
            raise ValueError("a table that is too large")
        table = out.read()
        if said.faults:
            raise FaultsError(said.faults)
        if said.stopped == "memory":
            _stop(name, _too_much(limits), limits)
        if said.stopped:
            _stop(name, f"a file that cannot be read ({visible(said.stopped, 300)})", limits)
        predictions = _clean_columns(table, videos)
        if predictions is None:
            rows = _predictions(table, name)
            _check(rows, videos)
            predictions = Predictions.of(rows)
    except (ValidationError, ValueError, checks.Wrong, pa.ArrowException, OSError):
        _stop(name, "a file that confuses the process that reads it", limits)
    return ReadPredictions(
        predictions,
        said.source_format,
        said.sha256,
        tuple(said.warnings),
        said.config_sha256,
        said.ending,
    )


def _too_much(limits: Limits) -> str:
    return f"a file that takes more than {limits.memory_bytes // 2**20:,} MB of memory"


def _stop(name: str, found: str, limits: Limits) -> NoReturn:
    expected = f"a table that is read within {limits.memory_bytes // 2**20:,} MB and {limits.seconds:g} s"
    raise FaultsError([Fault(name, None, None, found, expected, _SMALLER)])


def _clean_columns(table: bytes, videos: set[str] | None) -> Predictions | None:
    """The child's table when its columns are as a reader leaves them; None when in doubt."""
    raw = raw_columns(table, "parquet", PREDICTION_COLUMNS)
    if raw is None or set(raw.names) != set(PREDICTION_COLUMNS):
        return None
    found = accepted(raw, videos, {})
    return found.predictions if found is not None and found.is_verbatim else None


def _predictions(table: bytes, name: str) -> list[Prediction]:
    """The rows of the child's table; its footer says first that they are not too many."""
    footer = pq.read_metadata(io.BytesIO(table))
    groups = [footer.row_group(number) for number in range(footer.num_row_groups)]
    if footer.num_rows > MAX_ROWS or sum(group.total_byte_size for group in groups) > _MAX_UNPACKED_BYTES:
        raise ValueError("too many rows")
    return PREDICTIONS.from_bytes(table, name)


def _check(predictions: Iterable[Prediction], videos: set[str] | None) -> None:
    """Raise ValueError or Wrong unless the rows are as a reader leaves them: clean, unique and sorted."""
    seen: set[object] = set()  # texts and ids repeat; each is checked once
    before = ("", 0)
    for one in predictions:
        if (one.video_id, one.rank) <= before:
            raise ValueError("rows that are not sorted, or not unique")
        before = (one.video_id, one.rank)
        for kind, check, value in (
            ("video", checks.safe_identifier if videos is None else checks.identifier, one.video_id),
            ("text", checks.description, one.description),
            ("label", checks.text, one.label),
            ("tracks", checks.track_ids, one.track_ids),
            ("frames", checks.frame_indices, one.frame_indices),
        ):
            if value is not None and (kind, value) not in seen:
                seen.add((kind, value))
                if check(value) != value:
                    raise ValueError(f"a {kind} that is not clean")
        if checks.whole(one.rank, 1) != one.rank or (videos is not None and one.video_id not in videos):
            raise ValueError("a row that no reader leaves")
