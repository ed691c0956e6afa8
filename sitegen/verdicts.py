"""How a system did on a video, in a word, and the match that each caption is judged by."""

from collections.abc import Sequence

from pipeline.records import TruthHazard
from pipeline.scores import PairScore, VideoScore
from sitegen.gathered import System
from sitegen.numerals import Score, score
from sitegen.score import TOLERANCE
from sitegen.words import shorten

NO_HAZARD = "No hazard"


def title_of(truth: Sequence[TruthHazard]) -> str:
    """The labels of a video's hazards, or that there is none."""
    labels = [hazard.label or shorten(hazard.description, 40) for hazard in truth if not hazard.is_no_hazard]
    return ", ".join(labels) or NO_HAZARD


def verdict(video: VideoScore) -> tuple[str, str]:
    """How a system did on a video: `pass`, `fail` or `silent`, and the same in words."""
    if video.n_hazards == 0:
        return ("pass", "Rightly silent") if video.n_predictions == 0 else ("fail", "False alarm")
    if video.detected:
        if video.n_hazards_found < video.n_hazards:
            return "pass", f"Detected {video.n_hazards_found} of {video.n_hazards}"
        return "pass", "Detected"
    return ("silent", "Said nothing") if video.n_predictions == 0 else ("fail", "Not detected")


def best_pairs(system: System, video_id: str) -> dict[int, PairScore]:
    """Prediction rank -> its pair with the highest cosine; the first truth hazard wins ties."""
    best: dict[int, PairScore] = {}
    for pair in system.pairs.get(video_id, ()):
        held = best.get(pair.prediction_rank)
        if held is None or pair.cosine > held.cosine:
            best[pair.prediction_rank] = pair
    return best


def cosine_score(pair: PairScore, threshold: float) -> Score:
    """A pair's cosine, with the verdict that its similarity earns."""
    return score(pair.cosine, pair.similarity > threshold + TOLERANCE)
