"""Our embedder against sentence-transformers on torch: the same weights, the same 400 sentences.

The other runs in a child process that stays open, and the two take turns, so that whatever else
the machine does hits both. COOOLER_BENCH_TORCH names a Python that has sentence-transformers;
without it this one is tried.
"""

import os
import random
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

from bench.timing import Measure, interleaved
from pipeline.errors import ModelMissingError
from pipeline.minilm import OnnxEmbedder, find_embedder

SENTENCES = 400

_WORDS = """a the car truck motorcycle deer pedestrian bicycle box tree van on left right ahead wet road
lane is coming closer crosses suddenly brakes has fallen near parked behind night rain with and"""

# Answers each line on stdin when it has embedded all sentences once.
_CHILD = """
import sys
from sentence_transformers import SentenceTransformer
folder, sentences = sys.argv[1], open(sys.argv[2], encoding="utf-8").read().split("\\n")
model = SentenceTransformer(folder, device="cpu")
print("ready", flush=True)
for _ in sys.stdin:
    model.encode(sentences, show_progress_bar=False)
    print("done", flush=True)
"""


def sentences(count: int = SENTENCES, seed: int = 0) -> list[str]:
    """Distinct captions of 5 to 21 words, the same every time for a seed."""
    chance = random.Random(seed)  # noqa: S311 (not for secrets)
    words = _WORDS.split()
    made: dict[str, None] = {}
    while len(made) < count:
        made[" ".join(chance.choices(words, k=chance.randint(5, 21)))] = None
    return list(made)


def measure() -> list[Measure]:
    """One row; without sentence-transformers it has no peer and says so.

    Raises ModelMissingError when the embedder is not installed as its package.
    """
    root = find_embedder()
    if root is None or root.is_dir():
        raise ModelMissingError("The benchmark needs the packaged embedder: see `coooler models`.")
    texts = sentences()
    ours = OnnxEmbedder(root)
    functions: dict[str, Callable[[], object]] = {"ours": lambda: ours.embed(texts)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with zipfile.ZipFile(root) as archive:
            archive.extractall(folder / "model")
        (folder / "sentences").write_text("\n".join(texts), encoding="utf-8")
        with subprocess.Popen(
            [
                os.environ.get("COOOLER_BENCH_TORCH", sys.executable),
                "-c",
                _CHILD,
                str(folder / "model"),
                str(folder / "sentences"),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"HF_HUB_OFFLINE": "1"},
        ) as child:
            asked, answers = child.stdin, child.stdout
            assert asked is not None and answers is not None

            def theirs() -> None:
                asked.write("\n")
                asked.flush()
                answers.readline()

            if answers.readline().strip() == "ready":
                functions["theirs"] = theirs
            times = interleaved(functions)
            asked.close()
    note = "" if "theirs" in times else "not installed: set COOOLER_BENCH_TORCH to a Python that has it"
    return [
        Measure(
            f"embed {SENTENCES} captions (all-MiniLM-L6-v2, fp32, no cache)",
            times["ours"],
            "sentence-transformers on torch",
            times.get("theirs"),
            "at most 1.0",
            note,
        )
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, one.ratio)
