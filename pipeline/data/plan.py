"""The plan of a benchmark's clips: which part of which raw video each is, and where the boxes come from."""

from collections import Counter
from decimal import Decimal
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from pipeline.config import Settings, read_toml
from pipeline.errors import InputError
from pipeline.files import sha256_file

FILE_NAME = "plan.toml"
MAX_FRAMES = 1_000_000

# Names become paths: one folder's files, none hidden.
_Id = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-][A-Za-z0-9._-]{0,127}$")]
_Side = Annotated[int, Field(ge=2, le=16_384, multiple_of=2)]


class SourcePlan(Settings):
    """A raw video: its file in the folder of sources, and the SHA-256 of its bytes."""

    file: _Id
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class ClipPlan(Settings):
    """One clip: `frames` frames from `start_s` of the source `source`, at the quality `crf` (0 to 51)."""

    video_id: _Id
    source: _Id
    start_s: Decimal = Field(ge=0, le=1_000_000)
    frames: int = Field(ge=1, le=MAX_FRAMES)
    crf: int = Field(default=23, ge=0, le=51)

    @property
    def file(self) -> str:
        """The clip's file name."""
        return f"{self.video_id}.mp4"

    @property
    def start(self) -> Fraction:
        """`start_s`, exact."""
        return Fraction(self.start_s)


class Plan(Settings):
    """A plan: sizes and rate of all clips, the raw videos, the clips. Paths are relative to the plan.

    `package` is a Python package that carries the raw videos, `folder` where they lie in it.
    """

    fps_hz: Decimal = Field(gt=0, le=1_000)
    width_px: _Side
    height_px: _Side
    preset: str = Field(
        default="medium", pattern=r"^(ultra|super|very)?fast(er)?$|^medium$|^(very)?slow(er)?$"
    )
    package: str = Field(default="", pattern=r"^([A-Za-z_][A-Za-z0-9_]*)?$")
    folder: str = Field(default="", pattern=r"^([A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*)?$")
    videos: _Id = "videos"
    key_boxes: _Id | None = None
    boxes: _Id = "boxes.parquet"
    sources: tuple[SourcePlan, ...] = Field(min_length=1)
    clips: tuple[ClipPlan, ...] = Field(min_length=1, max_length=100_000)

    @model_validator(mode="after")
    def _names_fit(self) -> Self:
        known = {source.file for source in self.sources}
        wrong = [
            f"{clip.video_id}: no source {clip.source}" for clip in self.clips if clip.source not in known
        ]
        for what, names in (
            ("clip", (clip.video_id.casefold() for clip in self.clips)),
            ("source", (source.file for source in self.sources)),
        ):
            wrong += [f"{name}: the {what} {n} times" for name, n in Counter(names).items() if n > 1]
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of every clip."""
        return self.width_px, self.height_px

    @property
    def rate(self) -> Fraction:
        """Frames a second, exact."""
        return Fraction(self.fps_hz)


def read_plan(path: Path) -> Plan:
    """The plan in a TOML file. Raises ConfigError with every fault."""
    return read_toml(path, Plan, Decimal)


def find_sources(plan: Plan, folder: Path | None) -> dict[str, Path]:
    """The raw videos of a plan by name, each checked by its hash.

    They lie in `folder`, else in the plan's installed package. Raises InputError that lists every file
    that is missing or another one.
    """
    place = folder or _packaged(plan)
    faults: list[str] = []
    found: dict[str, Path] = {}
    for source in plan.sources:
        path = place / source.file
        if not path.is_file():
            faults.append(f"{path}: no such file; expected a raw video of the plan.")
        elif (sha256 := sha256_file(path)) != source.sha256:
            faults.append(f"{path}: found SHA-256 {sha256}; expected {source.sha256}. It is another file.")
        else:
            found[source.file] = path
    if faults:
        raise InputError(
            "\n  ".join([f"{len(faults)} of {len(plan.sources)} raw videos cannot be used.", *faults])
        )
    return found


def _packaged(plan: Plan) -> Path:
    spec = find_spec(plan.package) if plan.package else None
    places = spec.submodule_search_locations if spec else None
    if not places:
        wanted = f", or the package {plan.package} installed (with --no-deps)" if plan.package else ""
        raise InputError(f"found no raw videos; expected their folder (--sources){wanted}.")
    return Path(places[0]) / plan.folder
