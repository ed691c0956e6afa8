"""Our embedder against sentence-transformers on torch: the same weights, the same 400 sentences.

The other runs in a child process that stays open, and the two take turns, so that whatever else
the machine does hits both. COOOLER_BENCH_TORCH names a Python that has sentence-transformers;
without it this one is tried.
"""

import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

from pipeline.errors import ModelMissingError
from pipeline.minilm import OnnxEmbedder, find_embedder

ROUNDS = 5
SENTENCES = 400

# Answers each line on stdin with the seconds that one embedding of all sentences took.
_CHILD = """
import sys, time
from sentence_transformers import SentenceTransformer
folder, sentences = sys.argv[1], open(sys.argv[2], encoding="utf-8").read().split("\\n")
model = SentenceTransformer(folder, device="cpu")
model.encode(sentences, show_progress_bar=False)
print("ready", flush=True)
for _ in sys.stdin:
    start = time.perf_counter()
    model.encode(sentences, show_progress_bar=False)
    print(time.perf_counter() - start, flush=True)
"""


def sentences() -> list[str]:
    """400 distinct captions of 5 to 21 words, the same every time."""
    chance = random.Random(0)  # noqa: S311 (not for secrets)
    words = [
        "a",
        "the",
        "car",
        "truck",
        "motorcycle",
        "deer",
        "pedestrian",
        "bicycle",
        "box",
        "tree",
        "van",
        "on",
        "left",
        "right",
        "ahead",
        "wet",
        "road",
        "lane",
        "is",
        "coming",
        "closer",
        "crosses",
        "suddenly",
        "brakes",
        "has",
        "fallen",
        "near",
        "parked",
        "behind",
        "night",
        "rain",
        "with",
        "and",
    ]
    made: dict[str, None] = {}
    while len(made) < SENTENCES:
        made[" ".join(chance.choices(words, k=chance.randint(5, 21)))] = None
    return list(made)


def measure() -> list[tuple[str, float, float | None, str]]:
    """Rows (what, our seconds, the peer's seconds or None, note); medians of 5 interleaved rounds.

    Raises ModelMissingError when the embedder is not installed as its package.
    """
    root = find_embedder()
    if root is None or root.is_dir():
        raise ModelMissingError("The benchmark needs the packaged embedder: see `coooler models`.")
    texts = sentences()
    ours = OnnxEmbedder(root)
    ours.embed(texts)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with zipfile.ZipFile(root) as archive:
            archive.extractall(folder / "model")
        (folder / "sentences").write_text("\n".join(texts), encoding="utf-8")
        python = os.environ.get("COOOLER_BENCH_TORCH", sys.executable)
        child = subprocess.Popen(
            [python, "-c", _CHILD, str(folder / "model"), str(folder / "sentences")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"HF_HUB_OFFLINE": "1"},
        )
        assert child.stdin is not None and child.stdout is not None
        with child:
            has_peer = child.stdout.readline().strip() == "ready"
            our_s: list[float] = []
            peer_s: list[float] = []
            for _ in range(ROUNDS):
                start = time.perf_counter()
                ours.embed(texts)
                our_s.append(time.perf_counter() - start)
                if has_peer:
                    child.stdin.write("\n")
                    child.stdin.flush()
                    peer_s.append(float(child.stdout.readline()))
            child.stdin.close()
    what = f"embed {SENTENCES} sentences (all-MiniLM-L6-v2, fp32, no cache)"
    if not peer_s:
        note = "sentence-transformers is not installed here: set COOOLER_BENCH_TORCH to a Python that has it"
        return [(what, statistics.median(our_s), None, note)]
    ratio = statistics.median(mine / other for mine, other in zip(our_s, peer_s, strict=True))
    note = f"against sentence-transformers on torch; median ratio {ratio:.2f}"
    return [(what, statistics.median(our_s), statistics.median(peer_s), note)]


if __name__ == "__main__":
    for row in measure():
        print(*row, sep="\t")
