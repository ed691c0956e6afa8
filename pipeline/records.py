"""The data that passes between the steps: frozen, with units in the names.

Indices are 0-based, ranks are 1-based, boxes are in pixels of the video.
`Prediction` is the only record an outside submission must provide.
"""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

RgbImage: TypeAlias = NDArray[np.uint8]  # (H, W, 3), RGB


class Kind(StrEnum):
    """What a track is annotated as (COOOL)."""

    CHALLENGE = "challenge"
    TRAFFIC = "traffic"


class Stage(StrEnum):
    """The steps of the pipeline that say something (paper, sections on Track 1 and 2)."""

    SCENE = "scene"
    RHS = "rhs"
    ANSWER = "answer"
    CHUNKS = "chunks"
    AES = "aes"
    COS = "cos"
    AOS = "aos"


class Parse(StrEnum):
    """How an answer was turned into items."""

    JSON = "json"
    LITERAL = "literal"
    LINES = "lines"
    COMMAS = "commas"
    PROSE = "prose"
    EMPTY = "empty"
    FAILED = "failed"


class Exclusion(StrEnum):
    """Why a snippet was ignored in the verification (paper: size limits; ours: outside)."""

    TOO_NARROW = "too narrow"
    TOO_LOW = "too low"
    AREA_TOO_SMALL = "area too small"
    OUTSIDE_FRAME = "outside the frame"


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-aligned box in pixels; may lie partly outside the frame."""

    x1_px: float
    y1_px: float
    x2_px: float
    y2_px: float

    @property
    def width_px(self) -> float:
        """Width, in pixels."""
        return self.x2_px - self.x1_px

    @property
    def height_px(self) -> float:
        """Height, in pixels."""
        return self.y2_px - self.y1_px

    @property
    def area_px2(self) -> float:
        """Area, in square pixels."""
        return self.width_px * self.height_px


@dataclass(frozen=True, slots=True)
class TrackBox:
    """One box of one track in one frame."""

    video_id: str
    frame_index: int
    track_id: str
    kind: Kind
    box: Box


@dataclass(frozen=True, slots=True)
class Video:
    """A video file as decoding found it, not as its header claims."""

    video_id: str
    path: Path
    frame_count: int
    fps_hz: float
    width_px: int
    height_px: int


@dataclass(frozen=True, slots=True)
class Frame:
    """A decoded frame. The paper's models see `rgb` only; `boxes` serve the embedded agents."""

    video_id: str
    index: int
    time_s: float
    rgb: RgbImage
    boxes: tuple[TrackBox, ...] = ()


@dataclass(frozen=True, slots=True)
class Item:
    """One element of a ranked list; `rank` counts from 1."""

    rank: int
    label: str
    description: str


@dataclass(frozen=True, slots=True)
class Reply:
    """What an agent answered. `latency_s` and the token counts are None where not measured."""

    text: str
    model: str
    latency_s: float | None = None
    input_tokens: int | None = None
    output_tokens: int | None = None


@dataclass(frozen=True, slots=True)
class StageOutput:
    """One call of one stage; `call` counts the calls of that stage in the video from 0.

    `frame_index` is the frame a scene description is of, else None.
    """

    video_id: str
    stage: Stage
    call: int
    prompt_id: str
    request_sha256: str
    reply: Reply
    items: tuple[Item, ...]
    parse: Parse
    frame_index: int | None = None


@dataclass(frozen=True, slots=True)
class Snippet:
    """A box crop considered in the verification, or the reason why it was not."""

    track_box: TrackBox
    excluded: Exclusion | None


@dataclass(frozen=True, slots=True)
class Match:
    """One cell of the verification matrix: a snippet against a COS label.

    `cosine` is in [-1, 1]; `detected` says that it lies in the top 10th percentile of its row.
    """

    video_id: str
    frame_index: int
    track_id: str
    label: str
    cosine: float
    detected: bool
    in_aos: bool


@dataclass(frozen=True, slots=True)
class Prediction:
    """One predicted hazard of a video; ranks start at 1 and are unique in a video."""

    video_id: str
    rank: int
    description: str
    label: str | None = None
    track_ids: tuple[str, ...] = ()
    frame_indices: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class TruthHazard:
    """One human-described hazard. Empty label and description: the video has no hazard."""

    video_id: str
    hazard_id: str
    label: str
    description: str
    track_id: str | None = None
    first_frame: int | None = None
    last_frame: int | None = None

    @property
    def is_no_hazard(self) -> bool:
        """Whether this row says that the video has no hazard."""
        return not self.description


@dataclass(frozen=True, slots=True)
class VideoOutcome:
    """How the pipeline fared on one video file: `error` is empty when all went well.

    `note` says what was odd but did not stop it (a header that counts frames that are not there).
    """

    video_id: str
    file: str
    frame_count: int
    fps_hz: float
    width_px: int
    height_px: int
    error: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Submission:
    """Predictions of one system, with who sent them; `date` is ISO 8601, `url` may be empty."""

    name: str
    authors: str
    url: str
    date: str
    source_format: str
    predictions: tuple[Prediction, ...]
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
    pairs: tuple[PairScore, ...]
    videos: tuple[VideoScore, ...]
    card: Scorecard
