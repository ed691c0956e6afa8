"""Our embedder against a bare onnxruntime loop and sentence-transformers: the same weights and sentences.

The bare loop gets token ids that were made before the clock starts, sorted by length, in batches of
16 padded to their longest. sentence-transformers, on torch, runs in a child process that stays open,
and all take turns, so that whatever else the machine does hits each. COOOLER_BENCH_TORCH names a
Python that has it; without it this one is tried. To make one: `python -m venv torch`, then
`torch/bin/pip install torch sentence-transformers`, and COOOLER_BENCH_TORCH=torch/bin/python.
"""

import os
import random
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.timing import Measure, interleaved
from pipeline.errors import ModelMissingError
from pipeline.minilm import BATCH, OnnxEmbedder, find_embedder
from pipeline.vector_cache import CachedEmbedder

SENTENCES = 400

_WORDS = """a the car truck motorcycle deer pedestrian bicycle box tree van on left right ahead wet road
lane is coming closer crosses suddenly brakes has fallen near parked behind night rain with and"""

# Keeps its vectors in a file, and answers each line on stdin when it has embedded all sentences once more.
_CHILD = """
import sys
import numpy as np
from sentence_transformers import SentenceTransformer
folder, sentences = sys.argv[1], open(sys.argv[2], encoding="utf-8").read().split("\\n")
model = SentenceTransformer(folder, device="cpu")
np.save(sys.argv[3], model.encode(sentences, show_progress_bar=False))
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


def bare_loop(ours: OnnxEmbedder, texts: list[str]) -> Callable[[], object]:
    """A loop over the same session with nothing around it; the embedder has run once before."""
    ids = sorted((coded.ids for coded in ours._tokenizer.encode_batch(texts)), key=len)
    batches = []
    for start in range(0, len(ids), BATCH):
        part = ids[start : start + BATCH]
        tokens = np.zeros((len(part), len(part[-1])), np.int64)
        mask = np.zeros_like(tokens)
        for row, one in enumerate(part):
            tokens[row, : len(one)], mask[row, : len(one)] = one, 1
        feeds = {"input_ids": tokens, "attention_mask": mask, "token_type_ids": np.zeros_like(tokens)}
        batches.append({name: value for name, value in feeds.items() if name in ours._inputs})
    return lambda: [ours._session.run([ours._output], feeds) for feeds in batches]


def measure() -> list[Measure]:
    """Three rows; without sentence-transformers the second has no peer and says so.

    Raises ModelMissingError when the embedder is not installed as its package.
    """
    root = find_embedder()
    if root is None or root.is_dir():
        raise ModelMissingError("The benchmark needs the packaged embedder: see `coooler models`.")
    texts = sentences()
    ours = OnnxEmbedder(root)
    ours.embed(texts[:1])
    functions: dict[str, Callable[[], object]] = {
        "ours": lambda: ours.embed(texts),
        "bare": bare_loop(ours, texts),
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        CachedEmbedder(ours, folder / "vectors").embed(texts)
        # A new one each time, as each command opens one: the vectors are on disk, not in memory.
        functions["cached"] = lambda: CachedEmbedder(ours, folder / "vectors").embed(texts)
        with zipfile.ZipFile(root) as archive:
            archive.extractall(folder / "model")
        (folder / "sentences").write_text("\n".join(texts), encoding="utf-8")
        note = "not installed: set COOOLER_BENCH_TORCH to a Python that has it"
        with subprocess.Popen(
            [
                os.environ.get("COOOLER_BENCH_TORCH", sys.executable),
                "-c",
                _CHILD,
                str(folder / "model"),
                str(folder / "sentences"),
                str(folder / "theirs.npy"),
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
                apart = np.abs(ours.embed(texts) - np.load(folder / "theirs.npy")).max()
                note = f"the same vectors: the largest difference of a component is {apart:.1e}"
            times = interleaved(functions)
            asked.close()
    what = f"embed {SENTENCES} captions (all-MiniLM-L6-v2, fp32)"
    return [
        Measure(
            f"{what}, no cache",
            times["ours"],
            f"bare onnxruntime loop over sorted batches of {BATCH}",
            times["bare"],
            "at most 1.1",
            "tokens made before the clock starts; ours tokenises",
        ),
        Measure(
            f"{what}, no cache",
            times["ours"],
            "sentence-transformers on torch",
            times.get("theirs"),
            "at most 1.0",
            note,
        ),
        Measure(f"{what}, the second time", times["cached"], "the first time", times["ours"], "at most 0.1"),
    ]


if __name__ == "__main__":
    for one in measure():
        print(one, one.ratio)
