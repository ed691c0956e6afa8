"""What runs in the process that `sandbox.read_apart` starts: read one outside file, within limits.

It writes to its standard output `MARK`, the length of a JSON document, the document, and the predictions
as a `predictions` table. Nothing here is run by the process that asked.
"""

import json
import os
import signal
import sys
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import Any

from pipeline.errors import FaultsError
from pipeline.records import TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen.readers import ReadOptions, read_given

if sys.platform != "win32":
    import resource

MARK = b"COOOLER\n"
LENGTH_BYTES = 8
MAX_RESULT_BYTES = 512 * 2**20

_MAX_OPEN_FILES = 64


def run(job: Mapping[str, Any]) -> None:
    """Do the job: `path`, `truth` (pairs of video id and whether it has a hazard, or None), `options`,
    `memory_bytes`, `seconds`."""
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no part of the result
    _limit(job["memory_bytes"], job["seconds"])
    sink.write(MARK)
    sink.flush()
    table = b""
    try:
        said, table = _read(job)
    except FaultsError as error:
        said = {"faults": [asdict(fault) for fault in error.faults]}
    except MemoryError:
        said = {"stopped": "memory"}
    except Exception as error:
        said = {"stopped": f"{type(error).__name__} {_place(error)}"}
    if len(table) > MAX_RESULT_BYTES:
        said, table = {"stopped": "size"}, b""
    document = json.dumps(said).encode()
    sink.write(len(document).to_bytes(LENGTH_BYTES, "big") + document + table)
    sink.flush()
    os._exit(0)


def _read(job: Mapping[str, Any]) -> tuple[dict[str, Any], bytes]:
    truth = None
    if job["truth"] is not None:
        # Ids are all that reading needs. What the truth says stays out of this process.
        truth = [
            TruthHazard(video_id, str(number), "", "a hazard" if has_hazard else "")
            for number, (video_id, has_hazard) in enumerate(job["truth"])
        ]
    read = read_given(Path(job["path"]), truth, ReadOptions(**job["options"]))
    said = {
        "source_format": read.source_format,
        "sha256": read.sha256,
        "warnings": list(read.warnings),
        "config_sha256": read.config_sha256,
        "ending": read.ending,
    }
    return said, PREDICTIONS.to_bytes(read.predictions)


def _place(error: Exception) -> str:
    """Where an error was raised, without paths."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"in {Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else ""


def _limit(memory_bytes: int, seconds: float) -> None:
    """Bound address space, processor time, wall time, size of output and open files; write no core."""
    if sys.platform == "win32":
        return
    whole = ceil(seconds)
    for kind, soft, hard in (
        (resource.RLIMIT_AS, memory_bytes, memory_bytes),
        (resource.RLIMIT_CPU, whole, whole + 1),
        (resource.RLIMIT_FSIZE, 2 * MAX_RESULT_BYTES, 2 * MAX_RESULT_BYTES),
        (resource.RLIMIT_NOFILE, _MAX_OPEN_FILES, _MAX_OPEN_FILES),
        (resource.RLIMIT_CORE, 0, 0),
    ):
        _, now = resource.getrlimit(kind)
        most = hard if now == resource.RLIM_INFINITY else min(hard, now)
        with suppress(ValueError, OSError):  # macOS knows no bound on addresses
            resource.setrlimit(kind, (min(soft, most), most))
    signal.alarm(whole + 2)  # should the process that asked be gone, this one ends all the same
