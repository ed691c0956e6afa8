"""A process that reads hostile files one after the other, and what its parent sees of it.

Starting a process for each of hundreds of files would take minutes. One child reads them all; when it
dies, that is what is known of the file it was at, and the next one starts behind it.
"""

import json
import resource
import select
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

ROOT = Path(__file__).parent.parent
MEMORY = 3 * 2**30  # of address space, of which the libraries take most of one
GROWN = 2**29  # what a child may keep of one file before the next one gets a new child
SHOWN = 200

_GIVES_BACK = {"ARROW_DEFAULT_MEMORY_POOL": "system", "MALLOC_ARENA_MAX": "2"}  # memory that is not used


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one file.

    `verdict` "died" means that the process ended, was ended, or ran out of memory, `detail` says which;
    "crashed" that another exception than FaultsError came out, which `detail` names. `longest` is the
    length of the longest fault, `total` of all of them, and `printable` whether all are printable on one
    line. `seconds` are of processor time; `texts` are the captions that were read.
    """

    verdict: Literal["good", "refused", "crashed", "died"]
    detail: str = ""
    seconds: float = 0.0
    faults: int = 0
    longest: int = 0
    total: int = 0
    printable: bool = True
    texts: tuple[str, ...] = ()


class Child:
    """A child process that answers jobs; it is started when it is needed, and again when it died."""

    def __init__(self, folder: Path, environment: dict[str, str], seconds: float = 120.0) -> None:
        """It runs in `folder` with these environment variables; `seconds` bound each job, by the clock."""
        self._folder = folder
        self._environment = environment
        self._seconds = seconds
        self._process: subprocess.Popen[bytes] | None = None
        self.starts = 0

    def ask(self, path: Path, benchmark: Path | None = None) -> Outcome:
        """Read the file; with `benchmark`, a folder, submit it there instead."""
        process = self._process or self._start()
        assert process.stdin and process.stdout
        job = {"path": str(path), "benchmark": str(benchmark or "")}
        process.stdin.write(json.dumps(job).encode() + b"\n")
        process.stdin.flush()
        ready, _, _ = select.select([process.stdout], [], [], self._seconds)
        line = process.stdout.readline() if ready else b""
        if not line:
            late = f"more than {self._seconds:.0f} seconds" if not ready else ""
            code = self.close()
            return Outcome("died", late or f"exit code {code}")
        values = json.loads(line)
        if values.pop("grown"):
            self.close()
        return Outcome(**{**values, "texts": tuple(values["texts"])})

    def close(self) -> int | None:
        """End the process; give its exit code."""
        process, self._process = self._process, None
        if process is None:
            return None
        assert process.stdin and process.stdout
        try:
            process.stdin.close()
            return process.wait(1)
        except (BrokenPipeError, subprocess.TimeoutExpired):
            process.kill()
            return process.wait()
        finally:
            process.stdout.close()

    def _start(self) -> subprocess.Popen[bytes]:
        self.starts += 1
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.hostile_child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=self._folder,
            env={**self._environment, **_GIVES_BACK, "PYTHONPATH": str(ROOT)},
        )
        return self._process


def _read(path: Path, benchmark: str) -> list[str]:
    """The captions of a file that is read, or submitted to the benchmark in a folder."""
    from pipeline.benchmark import open_benchmark
    from sitegen.about import Sender
    from sitegen.board import submit_file
    from sitegen.readers import read_predictions
    from tests.hostile_case import TRUTH

    if benchmark:
        standing = submit_file(open_benchmark(Path(benchmark)), path, Sender("Hostile"), today="2026-01-02")
        return [prediction.description for prediction in standing.stored.submission.predictions]
    return [prediction.description for prediction in read_predictions(path, TRUTH).predictions]


def _answer(path: Path, benchmark: str) -> dict[str, Any]:
    from pipeline.errors import FaultsError
    from tests.hostile_case import is_one_line

    started = time.process_time()
    known: dict[str, Any] = {"verdict": "good", "detail": "", "texts": []}
    try:
        known["texts"] = _read(path, benchmark)[:SHOWN]
    except FaultsError as error:
        lines = [str(fault) for fault in error.faults]
        known |= {
            "verdict": "refused",
            "detail": lines[0][:SHOWN],
            "faults": len(lines),
            "longest": max(map(len, lines)),
            "total": sum(map(len, lines)),
            "printable": all(is_one_line(line) for line in lines),
        }
    except MemoryError:
        known |= {"verdict": "died", "detail": "out of memory"}
    except BaseException as error:
        known |= {"verdict": "crashed", "detail": f"{type(error).__name__}: {error}"[:SHOWN]}
    return known | {"seconds": time.process_time() - started}


def _size() -> int:
    """The address space of this process, in bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()


def main() -> None:
    """Answer jobs from the standard input, a line each, until it ends."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    import sitegen.board  # noqa: F401  (so that the size is that with everything imported)

    small = _size()
    for line in sys.stdin:
        job = json.loads(line)
        answer = _answer(Path(job["path"]), job["benchmark"])
        print(json.dumps({**answer, "grown": _size() > small + GROWN}), flush=True)


if __name__ == "__main__":
    main()
