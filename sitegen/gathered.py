"""Everything a site is made of, read and scored, before any page exists."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

from pipeline.config import BenchmarkSettings
from pipeline.files import sha256_of, slug
from pipeline.records import (
    Kind,
    Match,
    Prediction,
    Snippet,
    StageOutput,
    TrackBox,
    TruthHazard,
    UsageRow,
    VideoOutcome,
)
from pipeline.scores import Evaluation, PairScore, VideoScore
from sitegen.data_findings import StoredCheck
from sitegen.failures import Blame
from sitegen.judgements import Votes
from sitegen.language import N_
from sitegen.ledger import Entry
from sitegen.probes import Probe
from sitegen.restoration import Restorations
from sitegen.uncertainty import Uncertainty

V = TypeVar("V", PairScore, Prediction)

_SAFE_NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9._-]{0,78}[A-Za-z0-9_-])?")


@dataclass(frozen=True, slots=True)
class Published:
    """A result that was printed on other data, which no rank here can hold."""

    system: str
    besm: float
    sam: float
    n_videos: int
    threshold: float
    source: str


# Paper, table 1.
PUBLISHED = Published(
    N_("COOOLER, the paper's pipeline with its own models"), 0.3922, 0.3922, 200, 0.80, "Shriram et al. 2025"
)


@dataclass(frozen=True, slots=True)
class KeyframePicture:
    """One keyframe on disk: paths from the site's root, `/`-separated."""

    index: int
    time_s: float
    thumb: str
    full: str


@dataclass(frozen=True, slots=True)
class CropPicture:
    """One box cut out of a keyframe; the box is `width_px` x `height_px` in the video's pixels."""

    track_id: str
    kind: Kind
    frame_index: int
    width_px: int
    height_px: int
    path: str
    picture_width_px: int
    picture_height_px: int


@dataclass(frozen=True, slots=True)
class VideoMedia:
    """The pictures of one video. Without any, `problem` says why; `note` what was odd.

    `clip` is the path of the playable clip, empty when it is not shown; `card` is a small
    picture of the keyframe number `cover` (an index into `frames`).
    """

    video_id: str
    name: str
    width_px: int = 0
    height_px: int = 0
    frame_count: int = 0
    fps_hz: float = 0.0
    frames: tuple[KeyframePicture, ...] = ()
    crops: tuple[CropPicture, ...] = ()
    cover: int = 0
    card: str = ""
    clip: str = ""
    note: str = ""
    problem: str = ""

    @property
    def paths(self) -> tuple[str, ...]:
        """All its files, from the site's root."""
        pictures = (path for frame in self.frames for path in (frame.thumb, frame.full))
        others = (*(crop.path for crop in self.crops), self.card, self.clip)
        return tuple(path for path in (*pictures, *others) if path)


@dataclass(frozen=True, slots=True)
class Records:
    """What a pipeline run wrote about one video beside its predictions; each part may be empty."""

    stages: Sequence[StageOutput] = ()
    snippets: Sequence[Snippet] = ()
    matches: Sequence[Match] = ()
    outcome: VideoOutcome | None = None

    def read(self) -> "Records":
        """The same with every part as a tuple, where it may have to be read from a file before."""
        return Records(tuple(self.stages), tuple(self.snippets), tuple(self.matches), self.outcome)


@dataclass(frozen=True, eq=False)
class System:
    """A submission with its scores and everything recorded about how it came about.

    `rank` counts from 1 and is shared by all that cannot be told apart; `place` is where its score
    alone puts it; `agents` says plainly who produced it; `facts` are provenance lines (name, value);
    `records` maps a video id to its records; `history` is what the ledger holds of it, oldest first;
    `rehearsed` marks a preview, which is not on the board; `blame` says where hazards were lost, when it
    was worked out.
    """

    rank: int
    place: int
    slug: str
    agents: str
    is_baseline: bool
    evaluation: Evaluation
    uncertainty: Uncertainty
    predictions_sha256: str
    facts: tuple[tuple[str, str], ...] = ()
    records: Mapping[str, Records] = field(default_factory=dict)
    probes: tuple[Probe, ...] = ()
    history: tuple[Entry, ...] = ()
    usage: tuple[UsageRow, ...] = ()
    licence: str = ""
    notes: str = ""
    rehearsed: bool = False
    blame: Blame | None = None

    @property
    def name(self) -> str:
        """The name of the submission, as it was given."""
        return self.evaluation.submission.name

    @cached_property
    def scores(self) -> dict[str, VideoScore]:
        """Video id -> score."""
        return {score.video_id: score for score in self.evaluation.videos}

    @cached_property
    def pairs(self) -> dict[str, list[PairScore]]:
        """Video id -> its pairs."""
        return _by_video(self.evaluation.pairs)

    @cached_property
    def predictions(self) -> dict[str, list[Prediction]]:
        """Video id -> its predictions, by rank."""
        rows = sorted(self.evaluation.submission.predictions, key=lambda row: row.rank)
        return _by_video(rows)


@dataclass(frozen=True, slots=True)
class SiteData:
    """All inputs of the pages. `systems` come best first; mappings are keyed by video id.

    `boxes` holds the boxes on the keyframes only; `names` maps a video id to its path part;
    `ledger_file` is the ledger as it lies on disk, `votes` are people's on pairs of captions;
    `check` is what the last `coooler data check` found, None when it was not kept or is hidden;
    `restored` is what was done to the clips before they came here; `proposed_by` names what proposed
    the boxes that nobody annotated, as "motion" or "detector,motion". With
    `hidden` nothing here tells of the truth: every video has no rows, and no system has scores of
    pairs or single videos.
    """

    settings: BenchmarkSettings
    truth: Mapping[str, tuple[TruthHazard, ...]]
    boxes: Mapping[str, tuple[TrackBox, ...]]
    media: Mapping[str, VideoMedia]
    names: Mapping[str, str]
    systems: tuple[System, ...]
    attribution: str = ""
    ledger: tuple[Entry, ...] = ()
    ledger_file: bytes = b""
    votes: Votes = field(default_factory=Votes)
    check: StoredCheck | None = None
    restored: Restorations = field(default_factory=Restorations)
    proposed_by: str = ""

    @property
    def hidden(self) -> bool:
        """Whether the organiser keeps the truth back."""
        return self.settings.hide_truth

    @property
    def is_rehearsal(self) -> bool:
        """Whether this is a preview with a system that is not on the board."""
        return any(system.rehearsed for system in self.systems)

    @property
    def video_ids(self) -> tuple[str, ...]:
        """The videos of the truth, sorted."""
        return tuple(sorted(self.truth))


def _by_video(rows: Iterable[V]) -> dict[str, list[V]]:
    groups: dict[str, list[V]] = {}
    for row in rows:
        groups.setdefault(row.video_id, []).append(row)
    return groups


def path_names(video_ids: Iterable[str]) -> dict[str, str]:
    """Video id -> a path part that is safe on every file system and unique whatever its case.

    Ids made of letters, digits, `.`, `_` and `-` are kept; others become a slug and a short hash.
    """
    names: dict[str, str] = {}
    taken: set[str] = set()
    for video_id in sorted(set(video_ids)):
        name = video_id
        if not _SAFE_NAME.fullmatch(name) or name.casefold() in taken:
            name = f"{slug(video_id)[:40] or 'video'}-{sha256_of(video_id.encode(errors='replace'))[:10]}"
        taken.add(name.casefold())
        names[video_id] = name
    return names
