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
    """What a track is annotated as (COOOL); `proposed` (ours) is one that nobody annotated."""

    CHALLENGE = "challenge"
    TRAFFIC = "traffic"
    PROPOSED = "proposed"


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
class VideoFile:
    """What is known of a benchmark's video without looking at its frames; `file` lies in its folder."""

    video_id: str
    file: str
    frame_count: int
    fps_hz: float
    width_px: int
    height_px: int
    sha256: str


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
class Reaction:
    """When the driver of a video reacts: the first such frame, None for never.

    `score` in [0, 1] is the share of the motion ahead that is lost there (0 without a reaction);
    `signal_hz` is that motion, one number a frame.
    """

    video_id: str
    frame_index: int | None
    score: float
    signal_hz: tuple[float, ...] = ()


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
class UsageRow:
    """What one role's questions about one video cost; None where it was not counted.

    `seconds` are summed over calls, which may have run side by side; `cost` is in the currency of
    the configuration.
    """

    video_id: str
    role: str
    model: str
    calls: int
    input_tokens: int | None
    output_tokens: int | None
    seconds: float | None
    cost: float | None
