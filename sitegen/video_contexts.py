"""What the template of a video's page is given; texts come ready to print, paths are from the site's root."""

from dataclasses import dataclass

from sitegen.contexts import Fact, Link, Shell
from sitegen.figure2 import Figure2
from sitegen.numerals import Score
from sitegen.words import Diff


@dataclass(frozen=True, slots=True)
class OverlayBox:
    """A box in viewBox units (the video's pixels); texts are numbers for attributes.

    `track` names its track, `label` is that name, cut to fit on the picture.
    """

    x: str
    y: str
    width: str
    height: str
    text_y: str
    track: str
    label: str
    hazard: bool
    proposed: bool = False


@dataclass(frozen=True, slots=True)
class TrackChip:
    """A track on the keyframes that can be switched; `title` is the truth's label, or empty."""

    track: str
    label: str
    title: str
    hazard: bool
    proposed: bool = False


@dataclass(frozen=True, slots=True)
class FilmFrame:
    """A keyframe in the strip."""

    number: int
    index: int
    time: str
    thumb: str
    full: str
    alt: str
    boxes: tuple[OverlayBox, ...]
    is_cover: bool


@dataclass(frozen=True, slots=True)
class CropView:
    """A crop with what was said about its track."""

    picture: str
    width: int
    height: int
    alt: str
    track: str
    label: str
    hazard: bool
    frame: int
    size: str
    seen_as: tuple[str, ...]
    proposed: bool = False


@dataclass(frozen=True, slots=True)
class TruthView:
    """A truth hazard."""

    hazard_id: str
    label: str
    description: str
    where: str


@dataclass(frozen=True, slots=True)
class CaptionView:
    """A prediction, against the truth hazard it matches best.

    `fault` names what is wrong with it as a caption (an extra hazard, a wrong object), `fault_text` says why.
    """

    rank: int
    label: str
    text: str
    tracks: str
    hazard_id: str
    score: Score | None
    note: str
    fault: str
    fault_text: str
    diff: Diff


@dataclass(frozen=True, slots=True)
class Result:
    """How a system did on the video."""

    besm: Score
    sam: Score
    verdict: str
    verdict_text: str


@dataclass(frozen=True, slots=True)
class FailureView:
    """What became of a truth hazard under a system.

    `similarity` is its best, as text, and empty when there is none. `name` is empty when the hazard is found,
    else how it failed, and `evidence` a sentence on that; `place` is the id on the page of what it speaks of,
    and `place_name` its name; both may be empty.
    """

    hazard: str
    found: bool
    similarity: str
    name: str
    evidence: str
    place: str
    place_name: str


@dataclass(frozen=True, slots=True)
class SystemView:
    """All that one system said about the video; `result` is None when the truth is hidden.

    `fates` says what became of each truth hazard; it is empty where that was not looked into.
    """

    slug: str
    name: str
    agents: str
    is_baseline: bool
    result: Result | None
    captions: tuple[CaptionView, ...]
    empty_text: str
    fates: tuple[FailureView, ...]


@dataclass(frozen=True, slots=True)
class MatrixRow:
    """A prediction's cosine with every truth hazard; `chosen` numbers the match."""

    system: str
    first_of_system: bool
    span: int
    rank: int
    text: str
    cells: tuple[Score, ...]
    chosen: int


@dataclass(frozen=True, slots=True)
class Saying:
    """One thing that a stage said; `times` counts equal answers in a row, as text or empty."""

    where: str
    times: str
    items: tuple[tuple[str, str], ...]
    reply: str
    parse: str


@dataclass(frozen=True, slots=True)
class StageView:
    """A stage of one system on one video."""

    code: str
    name: str
    meaning: str
    agent: str
    prompt_id: str
    calls: str
    sayings: tuple[Saying, ...]


@dataclass(frozen=True, slots=True)
class TrackCheck:
    """The verification of one track: how many snippets counted, why others did not, what matched."""

    track: str
    hazard: bool
    snippets: str
    excluded: str
    best_label: str
    best: Score | None
    detected: str
    in_aos: str
    proposed: bool = False


@dataclass(frozen=True, slots=True)
class Transcript:
    """What every stage of one system said about the video."""

    slug: str
    name: str
    summary: str
    stages: tuple[StageView, ...]
    tracks: tuple[TrackCheck, ...]
    tracks_summary: str
    error: str
    figure: Figure2 | None


@dataclass(frozen=True, slots=True)
class VideoPage:
    """videos/<name>.html; `proposed` says that nobody annotated the tracks, empty where somebody did."""

    shell: Shell
    video_id: str
    hidden: bool
    heading: str
    facts: tuple[Fact, ...]
    truth: tuple[TruthView, ...]
    problem: str
    note: str
    width: int
    height: int
    frames: tuple[FilmFrame, ...]
    cover: FilmFrame | None
    clip: str
    restored: str
    tracks: tuple[TrackChip, ...]
    tracks_text: str
    crops: tuple[CropView, ...]
    systems: tuple[SystemView, ...]
    matrix_columns: tuple[TruthView, ...]
    matrix: tuple[MatrixRow, ...]
    transcripts: tuple[Transcript, ...]
    unrecorded: str
    threshold: str
    threshold_share: int
    label_px: str
    previous: Link | None
    following: Link | None
    place: str
    proposed: str = ""
