"""Submissions and their scores: frozen, similarities in [0, 1], ranks from 1."""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.records import Prediction


@dataclass(frozen=True, slots=True)
class Submission:
    """Predictions of one system, with who sent them; `date` is ISO 8601, `url` may be empty.

    `predictions` is a tuple, or `Predictions`: columns that equal the tuple of their rows.
    """

    name: str
    authors: str
    url: str
    date: str
    source_format: str
    predictions: Sequence[Prediction]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PairScore:
    """A prediction against a truth hazard: raw cosine in [-1, 1], similarity clipped to [0, 1]."""

    video_id: str
    prediction_rank: int
    hazard_id: str
    cosine: float
    similarity: float


@dataclass(frozen=True, slots=True)
class VideoScore:
    """Scores of one video. All similarities in [0, 1]; 0 where nothing was predicted.

    `best`, `worst`, `mean` are over the predictions, each against its best-matching truth.
    """

    video_id: str
    n_predictions: int
    n_hazards: int
    n_hazards_found: int
    best: float
    worst: float
    mean: float
    besm: float
    sam: float
    detected: bool


@dataclass(frozen=True, slots=True)
class Signature:
    """Every setting that changes a number."""

    metric_version: str
    embedder: str
    embedder_sha256: str
    truth_sha256: str
    n_videos: int
    threshold: float
    no_hazard_rule: str = "empty-is-1"
    clip: str = "pair-0-1"

    def __str__(self) -> str:
        """The signature as one line."""
        return "|".join(
            [
                f"coooler:{self.metric_version}",
                f"emb:{self.embedder}@{self.embedder_sha256[:12]}",
                f"truth:{self.truth_sha256[:12]}",
                f"n:{self.n_videos}",
                f"thr:>{self.threshold:g}",
                f"nohaz:{self.no_hazard_rule}",
                f"clip:{self.clip}",
            ]
        )


@dataclass(frozen=True, slots=True)
class Scorecard:
    """A system's figures over the truth's N videos; `hazard_recall` is None without any hazard."""

    besm: float
    sam: float
    detection_rate: float
    hazard_recall: float | None
    n_videos: int
    signature: Signature


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A submission with all its scores: `videos` holds every truth video, sorted by id."""

    submission: Submission
    pairs: Sequence[PairScore]
    videos: tuple[VideoScore, ...]
    card: Scorecard
