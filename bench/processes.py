"""Whole commands in processes of their own, against a Python that does nothing, or only imports."""

import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

from bench.embedding import sentences
from bench.timing import Measure, interleaved
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS, TRUTH

VIDEOS = 200
IMPORTS = "import numpy, onnxruntime, pyarrow.parquet, tokenizers, typer"


def _run(*command: str) -> None:
    # As users run it: what was compiled once is not compiled again.
    given = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=given)


def measure() -> list[Measure]:
    """Three rows: `--help`, and `score`, whose captions are embedded before the clock starts."""
    coooler = str(Path(sys.executable).with_name("coooler"))
    with tempfile.TemporaryDirectory() as name:
        truth, predictions = Path(name) / "truth.parquet", Path(name) / "predictions.parquet"
        texts = sentences(2 * VIDEOS)
        ids = [f"v{number:03}" for number in range(VIDEOS)]
        TRUTH.write(truth, [TruthHazard(one, "1", "car", texts[at]) for at, one in enumerate(ids)])
        PREDICTIONS.write(predictions, [Prediction(one, 1, texts[VIDEOS + at]) for at, one in enumerate(ids)])
        times = interleaved(
            {
                "help": partial(_run, coooler, "--help"),
                "pass": partial(_run, sys.executable, "-c", "pass"),
                "typer": partial(_run, sys.executable, "-c", "import typer"),
                "score": partial(_run, coooler, "score", str(predictions), "--truth", str(truth)),
                "imports": partial(_run, sys.executable, "-c", IMPORTS),
            },
            rounds=9,
        )
    return [
        Measure("coooler --help", times["help"], "python -c pass", times["pass"], "at most 8"),
        Measure("coooler --help", times["help"], "python -c 'import typer'", times["typer"], ""),
        Measure(
            f"coooler score, {VIDEOS} videos, vectors cached",
            times["score"],
            f"python -c '{IMPORTS}'",
            times["imports"],
            "",
        ),
    ]
