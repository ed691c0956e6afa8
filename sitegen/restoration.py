"""What was done to restored clips, read from the records beside them: `videos/restoration/`.

Records and pictures come from outside: one that is broken is told of and left out, and stops nothing.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

from pipeline.errors import InputError
from pipeline.files import sha256_of, slug
from sitegen.checks import MAX_ID_CHARS, visible

FOLDER = "restoration"
ENDING = ".restore.json"
PICTURES = ("before.webp", "after.webp", "overlay.webp")
MAX_RECORDS = 100_000
MAX_RECORD_BYTES = 2**20
MAX_PICTURE_BYTES = 512 * 1024
MAX_PICTURE_PX = 2_048

_Name = Annotated[str, Field(min_length=1, max_length=255)]
_Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_Side = Annotated[int, Field(ge=1, le=16_384)]
_At = Annotated[int, Field(ge=-65_536, le=65_536)]
_PixelBox = tuple[_At, _At, _At, _At]


class _Outside(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class StepSettings(_Outside):
    """What the page shows of a step's settings: boxes (x1, y1, x2, y2; px), or why there is none."""

    boxes_px: Annotated[list[_PixelBox], Field(max_length=64)] = []
    reason: Annotated[str, Field(max_length=500)] = ""


class Step(_Outside):
    """One thing that was done to a clip, and the method that did it, by its name in the record."""

    step: Annotated[str, Field(min_length=1, max_length=40)]
    method: Annotated[str, Field(min_length=1, max_length=200)]
    settings: StepSettings = StepSettings()


class Record(_Outside):
    """A record as it lies on disk; fields that no page shows are not looked at."""

    schema_version: Literal[1]
    video_id: Annotated[str, Field(min_length=1, max_length=MAX_ID_CHARS)]
    source: _Name
    source_sha256: _Hash
    frames: Annotated[int, Field(ge=1, lt=2**31)]
    width_px: _Side
    height_px: _Side
    steps: Annotated[list[Step], Field(max_length=16)]
    notes: Annotated[list[Annotated[str, Field(max_length=1_000)]], Field(max_length=64)] = []
    files_sha256: Annotated[dict[_Name, _Hash], Field(max_length=16)]


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture: its path from the site's root, its size, its hash, and where it lies."""

    path: str
    width_px: int
    height_px: int
    sha256: str
    source: Path = field(repr=False)

    def read(self) -> bytes:
        """Its bytes. Raises InputError when it changed since the record was read."""
        data = _bytes(self.source, MAX_PICTURE_BYTES)
        if sha256_of(data) != self.sha256:
            raise InputError(f"{self.source.name}: it was changed while it was used. Build again.")
        return data


@dataclass(frozen=True, slots=True)
class Restoration:
    """A restored clip; `name` is a safe path part, `overlay` None where nothing was masked.

    `place` counts the clips from 0, as pages show them.
    """

    place: int
    name: str
    record: Record
    before: Picture
    after: Picture
    overlay: Picture | None


@dataclass(frozen=True)
class Restorations:
    """All restored clips, by id, and what is wrong with the records that could not be used."""

    clips: tuple[Restoration, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to show."""
        return not self.clips and not self.problems

    @cached_property
    def by_video(self) -> Mapping[str, Restoration]:
        """Video id -> its restored clip."""
        return {clip.record.video_id: clip for clip in self.clips}


def read_restorations(videos: Path) -> Restorations:
    """What is known of the clips in the folder `videos`; nothing when none was restored."""
    folder = videos / FOLDER
    paths = sorted(path for path in folder.glob(f"*{ENDING}") if not path.name.startswith("."))
    clips: list[Restoration] = []
    problems = []
    if len(paths) > MAX_RECORDS:
        problems.append(f"{FOLDER}: found {len(paths):,} records; only the first {MAX_RECORDS:,} are read")
    for path in paths[:MAX_RECORDS]:
        try:
            clips.append(_restoration(path, len(clips)))
        except InputError as error:
            problems.append(visible(str(error), 400))
    return Restorations(tuple(clips), tuple(problems))


def _restoration(path: Path, place: int) -> Restoration:
    """One record with its pictures. Raises InputError when it cannot be used."""
    stem = path.name.removesuffix(ENDING)
    name = f"{slug(stem)[:40] or 'clip'}-{sha256_of(stem.encode(errors='replace'))[:10]}"
    record = _record(path)
    if record.video_id != stem:
        raise InputError(f"{path.name}: found the video id {record.video_id!r}; expected {stem!r}")
    before, after, overlay = (_picture(path.parent, stem, ending, name, record) for ending in PICTURES)
    if before is None or after is None:
        raise InputError(f"{path.name}: it names no pictures before and after. Restore the clip again.")
    sizes = {(one.width_px, one.height_px) for one in (before, after, overlay) if one}
    if len(sizes) > 1:
        raise InputError(f"{path.name}: its pictures are of different sizes. Restore the clip again.")
    return Restoration(place, name, record, before, after, overlay)


def _record(path: Path) -> Record:
    try:
        return Record.model_validate(from_json(_bytes(path, MAX_RECORD_BYTES), allow_inf_nan=False))
    except ValidationError as error:
        first: Any = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "the record"
        raise InputError(f"{path.name}: {place}: {first['msg'].lower()}. Restore the clip again.") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path.name}: not readable as JSON. Restore the clip again.") from error


def _bytes(path: Path, limit: int) -> bytes:
    """A plain file's bytes. Raises InputError when it is none, or is too large."""
    try:
        if path.is_symlink() or not path.is_file():
            raise InputError(f"{path.name}: no such file; expected a plain one. Restore the clip again.")
        with path.open("rb") as source:
            data = source.read(limit + 1)
    except OSError as error:
        raise InputError(f"{path.name}: not readable ({error.strerror}).") from error
    if len(data) > limit:
        raise InputError(f"{path.name}: found more than {limit:,} bytes; expected at most as many.")
    return data


def _picture(folder: Path, stem: str, ending: str, name: str, record: Record) -> Picture | None:
    """A picture of the record, None when it names none. Raises InputError when it is not as it was."""
    stated = record.files_sha256.get(f"{FOLDER}/{stem}.{ending}")
    if stated is None:
        return None
    path = folder / f"{stem}.{ending}"
    data = _bytes(path, MAX_PICTURE_BYTES)
    if sha256_of(data) != stated:
        raise InputError(f"{path.name}: it is not the file that the record names. Restore the clip again.")
    size = webp_size(data)
    if size is None or max(size) > MAX_PICTURE_PX:
        raise InputError(f"{path.name}: found no WebP picture of at most {MAX_PICTURE_PX} px a side.")
    return Picture(f"restored/{name}/{ending}", *size, stated, path)


def webp_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) that a WebP file states, None when it is not one (RFC 9649)."""
    if len(data) < 30 or data[:4] != b"RIFF" or data[8:12] != b"WEBP":
        return None
    kind, body = data[12:16], data[20:30]
    if kind == b"VP8 " and body[3:6] == b"\x9d\x01\x2a":
        width, height = struct.unpack("<HH", body[6:10])
        return (width & 0x3FFF, height & 0x3FFF) if width & 0x3FFF and height & 0x3FFF else None
    if kind == b"VP8L" and body[0] == 0x2F:
        bits = int.from_bytes(body[1:5], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8X":
        return int.from_bytes(body[4:7], "little") + 1, int.from_bytes(body[7:10], "little") + 1
    return None
