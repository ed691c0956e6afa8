"""What an annotator looks at: clips, the keyframes of their film strips, and the tracks of their boxes."""

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, VideoError

if TYPE_CHECKING:
    from pipeline.records import RgbImage

PLAYABLE = frozenset({".mp4", ".m4v", ".webm"})

_WIDTH_PX = 480
_QUALITY = 75
_REMEMBERED = 64


@dataclass(frozen=True, slots=True)
class _Strip:
    """A clip's facts, and (index, time in s) of the keyframes whose pictures are in the temporary folder."""

    frame_count: int = 0
    fps_hz: float = 0.0
    width_px: int = 0
    height_px: int = 0
    keyframes: tuple[tuple[int, float], ...] = ()
    problem: str = ""


class Clips:
    """The clips of a folder and the tracks of a `boxes` table; pictures are made when first looked at."""

    def __init__(self, videos: Path, boxes: Path | None) -> None:
        """`boxes` None: there are no tracks.

        Raises InputError for a folder without clips or with names that cannot be ids, and for a file
        that is no `boxes` table.
        """
        from pipeline.places import Place
        from pipeline.run import find_videos, video_id_of

        self._paths = {video_id_of(place): Path(str(place)) for place in find_videos(Place(str(videos)))}
        self._boxes = boxes
        if boxes is not None:
            _check_boxes(boxes)
        self._temporary = tempfile.TemporaryDirectory(prefix="coooler-annotate-")
        self._folder = Path(self._temporary.name)
        self._decoding = {video_id: Lock() for video_id in self._paths}
        self._strips: dict[str, _Strip] = {}
        self._tracks = lru_cache(_REMEMBERED)(self._read_tracks)

    @property
    def ids(self) -> tuple[str, ...]:
        """The videos with a clip, sorted."""
        return tuple(sorted(self._paths))

    def path(self, video_id: str) -> Path | None:
        """The clip's file, None when there is none."""
        return self._paths.get(video_id)

    def facts(self, video_id: str) -> dict[str, Any]:
        """What a page shows of a video, for JSON; `problem` says why there are no pictures, or is empty."""
        strip = self._strip(video_id)
        path = self._paths.get(video_id)
        return {
            "video_id": video_id,
            "frame_count": strip.frame_count,
            "fps_hz": strip.fps_hz,
            "width_px": strip.width_px,
            "height_px": strip.height_px,
            "clip": f"/clip/{video_id}" if path and path.suffix.lower() in PLAYABLE else "",
            "keyframes": [
                {"index": index, "time_s": time_s, "src": f"/keyframe/{video_id}/{index}.webp"}
                for index, time_s in strip.keyframes
            ],
            "tracks": self._tracks(video_id),
            "problem": strip.problem,
        }

    def keyframe(self, video_id: str, index: int) -> Path | None:
        """A keyframe's picture (WebP, at most 480 px wide), None when there is no such keyframe."""
        if all(index != known for known, _ in self._strip(video_id).keyframes):
            return None
        return self._picture(video_id, index)

    def close(self) -> None:
        """Remove the pictures."""
        self._temporary.cleanup()

    def _picture(self, video_id: str, index: int) -> Path:
        return self._folder / video_id / f"{index:06d}.webp"

    def _strip(self, video_id: str) -> _Strip:
        path = self._paths.get(video_id)
        if path is None:
            return _Strip(problem="There is no clip of this video.")
        with self._decoding[video_id]:
            if video_id not in self._strips:
                self._strips[video_id] = self._decode(video_id, path)
            return self._strips[video_id]

    def _decode(self, video_id: str, path: Path) -> _Strip:
        from pipeline.video import read_keyframes

        try:
            found = read_keyframes(path, video_id)
        except VideoError as error:
            return _Strip(problem=str(error).replace(str(path), path.name))
        (self._folder / video_id).mkdir(exist_ok=True)
        for frame in found.frames:
            self._picture(video_id, frame.index).write_bytes(_webp(frame.rgb))
        video = found.video
        keyframes = tuple((frame.index, round(frame.time_s, 3)) for frame in found.frames)
        return _Strip(
            video.frame_count, round(video.fps_hz, 3), video.width_px, video.height_px, keyframes, found.note
        )

    def _read_tracks(self, video_id: str) -> list[dict[str, Any]]:
        """The tracks of a video, sorted by their first frame, each with its boxes by frame."""
        import pyarrow.parquet as pq

        if self._boxes is None:
            return []
        rows = pq.read_table(self._boxes, filters=[("video_id", "==", video_id)]).to_pylist()
        return _tracks_of(rows)


def _tracks_of(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    by_track: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        by_track.setdefault(row["track_id"], []).append(row)
    tracks = []
    for track_id, found in by_track.items():
        found.sort(key=lambda row: row["frame_index"])
        sides = ("x1_px", "y1_px", "x2_px", "y2_px")
        boxes = [[row["frame_index"], *(round(row[side], 1) for side in sides)] for row in found]
        first, last = found[0]["frame_index"], found[-1]["frame_index"]
        kind = found[0]["kind"]
        tracks.append(
            {"track_id": track_id, "kind": kind, "first_frame": first, "last_frame": last, "boxes": boxes}
        )
    return sorted(tracks, key=lambda track: (track["first_frame"], _numbered(track["track_id"])))


def _numbered(track_id: str) -> tuple[int, str]:
    return (int(track_id) if track_id.isdecimal() and len(track_id) < 19 else -1, track_id)


def _check_boxes(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from pipeline.tables import BOXES

    try:
        found = pq.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path}: not readable as Parquet ({error}); expected a boxes table.") from error
    missing = [field.name for field in BOXES.schema if field.name not in found.names]
    if missing:
        raise InputError(f"{path}: found no column {', '.join(missing)}; expected a boxes table (--boxes).")


def _webp(rgb: "RgbImage") -> bytes:
    import cv2
    import numpy as np

    height_px, width_px = rgb.shape[:2]
    if width_px > _WIDTH_PX:
        size = (_WIDTH_PX, max(1, round(height_px * _WIDTH_PX / width_px)))
        rgb = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
    done, data = cv2.imencode(".webp", rgb[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    if not done:
        raise VideoError("A keyframe could not be written as WebP.")
    return bytes(data)
