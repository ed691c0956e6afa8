"""Importing annotations of COOOL's size against plain `pickle.load`, which would run whatever it is told to.

`python -m bench.coool_import` prints them, and the largest memory of each in a process of its own.
"""

import pickle
import resource
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from bench.timing import Measure, interleaved
from pipeline.data.coool_import import import_coool
from pipeline.data.unpickle import load_plain
from tests.coool_case import annotations

VIDEOS, FRAMES, OBJECTS = 200, 300, 10
ROUNDS = 3  # of ten seconds each


def _import(source: Path) -> None:
    out = source.with_name("boxes.parquet")
    import_coool(source, out, None, replace=True, said=lambda *_: None)


def _plain(source: Path) -> None:
    with source.open("rb") as opened:
        pickle.load(opened)  # noqa: S301  (it is the peer, on a file of our own)


def _generate(source: Path) -> None:
    source.write_bytes(pickle.dumps(annotations(VIDEOS, FRAMES, OBJECTS, odd=False)))


def _peak_mb(run: partial[object]) -> int:
    """The largest resident memory of this process after `run`."""
    run()
    per_mb = 1 << 20 if sys.platform == "darwin" else 1 << 10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // per_mb


def _alone(run: partial[Any]) -> int:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_peak_mb, run).result()


def measure() -> list[Measure]:
    """Two rows: the whole import, and the unpickler by itself."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "annotations.pkl"
        # Elsewhere: the processes that are measured must not start from its memory.
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            pool.submit(_generate, source).result()
        peaks = [_alone(partial(run, source)) for run in (_import, load_plain, _plain)]
        times = interleaved(
            {
                "import": partial(_import, source),
                "load": partial(load_plain, source),
                "plain": partial(_plain, source),
            },
            rounds=ROUNDS,
        )
    what = f"{VIDEOS} videos x {FRAMES} frames x {OBJECTS} objects"
    peer = "plain pickle.load"
    return [
        Measure(
            f"import of {what}",
            times["import"],
            peer,
            times["plain"],
            "seconds; under 1 GB",
            f"medians of {ROUNDS}; largest memory {peaks[0]} MB, plain {peaks[2]} MB",
        ),
        Measure(
            f"unpickling {what}",
            times["load"],
            peer,
            times["plain"],
            "",
            f"medians of {ROUNDS}; largest memory {peaks[1]} MB",
        ),
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, f"ratio {one.ratio:.2f}")
