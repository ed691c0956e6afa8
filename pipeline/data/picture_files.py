"""The manifest of picture files: a row for each frame or crop, and how its file is called."""

from collections.abc import Iterable
from dataclasses import dataclass

import pyarrow as pa

from pipeline.files import sha256_of, slug
from pipeline.table import Row, Table


@dataclass(frozen=True, slots=True)
class PictureFile:
    """One row of the manifest: a picture, the frame it shows, and the box (of the clip, in px) of a crop."""

    video_id: str
    frame_index: int
    time_s: float
    file: str
    width_px: int
    height_px: int
    track_id: str | None = None
    kind: str | None = None
    x1_px: float | None = None
    y1_px: float | None = None
    x2_px: float | None = None
    y2_px: float | None = None


def _row(record: PictureFile) -> Row:
    return {name: getattr(record, name) for name in PictureFile.__slots__}


_FIELDS: dict[str, pa.DataType] = {
    "video_id": pa.string(),
    "frame_index": pa.int32(),
    "time_s": pa.float64(),
    "file": pa.string(),
    "width_px": pa.int32(),
    "height_px": pa.int32(),
    "track_id": pa.string(),
    "kind": pa.string(),
    "x1_px": pa.float64(),
    "y1_px": pa.float64(),
    "x2_px": pa.float64(),
    "y2_px": pa.float64(),
}
_OPTIONAL = {"track_id", "kind", "x1_px", "y1_px", "x2_px", "y2_px"}

PICTURES: Table[PictureFile] = Table(
    "frames",
    pa.schema([pa.field(name, kind, nullable=name in _OPTIONAL) for name, kind in _FIELDS.items()]),
    lambda record: (record.video_id, record.frame_index, record.file),
    _row,
    lambda row: PictureFile(**row),
)


def safe_names(track_ids: Iterable[str]) -> dict[str, str]:
    """A file name part for each track id, all different also where case does not count.

    An id that is safe stays; any other is made safe and gets the start of its hash.
    """
    ids = sorted(set(track_ids))
    names = {track: track for track in ids if track and slug(track) == track}
    taken = set(names.values())
    for track in (track for track in ids if track not in names):
        digest = sha256_of(track.encode("utf-8", "surrogatepass"))
        stem = slug(track)[:32].strip("-") or "track"
        name = next(n for length in (8, 64) if (n := f"{stem}-{digest[:length]}") not in taken)
        names[track] = name
        taken.add(name)
    return names
