"""Clips to the pictures that pages show: keyframes in two sizes, a card, box crops.

What loads with a page is WebP, for its weight. The large keyframes load when asked for and are
JPEG: at the same quality a third more bytes, but encoded in a thirtieth of the time. The one large
keyframe that a page opens with is WebP.

Boxes are not burnt in: pages draw them over the pictures, so that a reader can turn them off.
"""

import json
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import VideoError
from pipeline.files import sha256_of
from pipeline.records import Box, Frame, Kind, RgbImage, TrackBox
from pipeline.video import Keyframes, read_keyframes
from sitegen.gathered import CropPicture, KeyframePicture, VideoMedia
from sitegen.language import N_


@dataclass(frozen=True, slots=True)
class MediaSettings:
    """Sizes are widths in pixels, qualities 1 to 100; pictures are never enlarged.

    The small keyframes of a video, which all load with its page, get the first of `thumb_qualities`
    with which they take at most `thumbs_bytes` together, else the last.
    """

    keyframes: int = 25
    thumb_px: int = 240
    thumb_qualities: tuple[int, ...] = (58, 42, 28)
    thumbs_bytes: int = 96 * 1024
    full_px: int = 800
    full_quality: int = 74
    cover_quality: int = 72
    card_px: int = 400
    card_quality: int = 62
    crop_px: int = 192
    crop_quality: int = 72
    crop_min_side_px: int = 12
    crops_per_hazard_track: int = 3
    traffic_tracks: int = 16


@dataclass(frozen=True, slots=True)
class MediaJob:
    """What one video's pictures are made of. `clip` is None when there is no such file."""

    video_id: str
    name: str
    clip: Path | None
    clip_sha256: str
    boxes: Sequence[TrackBox]
    show_clip: bool
    settings: MediaSettings = MediaSettings()

    @property
    def key(self) -> str:
        """Hash of everything that decides the pictures; two jobs with one key make the same."""
        parts = {
            "version": 1,
            "name": self.name,
            "clip": self.clip_sha256,
            "suffix": self.clip.suffix.lower() if self.clip else "",
            "boxes": [
                [b.frame_index, b.track_id, b.kind, b.box.x1_px, b.box.y1_px, b.box.x2_px, b.box.y2_px]
                for b in self.boxes
            ],
            "show_clip": self.show_clip,
            "settings": asdict(self.settings),
        }
        return sha256_of(json.dumps(parts, sort_keys=True).encode())


@dataclass(frozen=True, slots=True)
class MadeMedia:
    """The pictures of one video and their files as (path from the site's root, content)."""

    media: VideoMedia
    files: tuple[tuple[str, bytes], ...]


def media_to_json(media: VideoMedia) -> dict[str, Any]:
    """The record as plain JSON types, for the manifest."""
    return asdict(media)


def media_from_json(data: dict[str, Any]) -> VideoMedia:
    """The record back from `media_to_json`. Raises KeyError, TypeError or ValueError when it is not one."""
    frames = tuple(KeyframePicture(**frame) for frame in data["frames"])
    crops = tuple(CropPicture(**{**crop, "kind": Kind(crop["kind"])}) for crop in data["crops"])
    return VideoMedia(**{**data, "frames": frames, "crops": crops})


def make_media(job: MediaJob, threads: int = 1) -> MadeMedia:
    """Decode the clip once and encode its pictures, in so many threads; their bytes are the same for any.

    A clip that cannot be used is said, not raised.
    """
    if job.clip is None:
        missing = N_("There is no clip of this video.")
        return MadeMedia(VideoMedia(job.video_id, job.name, problem=missing), ())
    try:
        found = read_keyframes(job.clip, job.video_id, job.settings.keyframes)
    except VideoError as error:
        problem = str(error).replace(str(job.clip), job.clip.name)
        return MadeMedia(VideoMedia(job.video_id, job.name, problem=problem), ())
    with ThreadPoolExecutor(threads) as pool:
        return _made(job, found, pool)


def _made(job: MediaJob, found: Keyframes, pool: ThreadPoolExecutor) -> MadeMedia:
    settings, folder = job.settings, f"media/{job.name}"
    files: list[tuple[str, Future[bytes]]] = []
    frames: list[KeyframePicture] = []
    cover = _cover(found.frames, job.boxes)
    larges = list(pool.map(lambda frame: _fit(frame.rgb, settings.full_px), found.frames))
    smalls = list(pool.map(lambda large: _fit(large, settings.thumb_px), larges))
    for place, (frame, large) in enumerate(zip(found.frames, larges, strict=True)):
        thumb, full = f"{folder}/t{frame.index:06d}.webp", f"{folder}/f{frame.index:06d}.jpg"
        if place == cover:
            full = f"{folder}/cover.webp"
            card = _fit(large, settings.card_px)
            files.append((full, pool.submit(_webp, large, settings.cover_quality)))
            files.append((f"{folder}/card.webp", pool.submit(_webp, card, settings.card_quality)))
        else:
            files.append((full, pool.submit(_jpeg, large, settings.full_quality)))
        frames.append(KeyframePicture(frame.index, round(frame.time_s, 3), thumb, full))
    crops: list[CropPicture] = []
    pictures = {frame.index: frame.rgb for frame in found.frames}
    for number, chosen in enumerate(choose_crops(job.boxes, pictures, settings)):
        picture = _cut(pictures[chosen.frame_index], chosen.box)
        small = _fit(picture, settings.crop_px, max(picture.shape[:2]))
        path = f"{folder}/c{number:03d}.webp"
        files.append((path, pool.submit(_webp, small, settings.crop_quality)))
        crops.append(
            CropPicture(
                chosen.track_id,
                chosen.kind,
                chosen.frame_index,
                round(chosen.box.width_px),
                round(chosen.box.height_px),
                path,
                small.shape[1],
                small.shape[0],
            )
        )
    thumbs = zip((frame.thumb for frame in frames), _thumbs(smalls, settings, pool), strict=True)
    made = [*thumbs, *((path, encoded.result()) for path, encoded in files)]
    clip = ""
    if job.clip and job.show_clip and job.clip.suffix.lower() in {".mp4", ".m4v", ".webm"}:
        clip = f"{folder}/clip{job.clip.suffix.lower()}"
        made.append((clip, job.clip.read_bytes()))
    video = found.video
    media = VideoMedia(
        job.video_id,
        job.name,
        video.width_px,
        video.height_px,
        video.frame_count,
        round(video.fps_hz, 3),
        tuple(frames),
        tuple(crops),
        cover,
        f"{folder}/card.webp",
        clip,
        found.note,
    )
    return MadeMedia(media, tuple(made))


def _thumbs(pictures: Sequence[RgbImage], settings: MediaSettings, pool: ThreadPoolExecutor) -> list[bytes]:
    """The small keyframes as WebP, together as light as a page can afford."""
    for quality in settings.thumb_qualities:
        encoded = list(pool.map(_webp, pictures, repeat(quality)))
        if sum(map(len, encoded)) <= settings.thumbs_bytes:
            break
    return encoded


def choose_crops(
    boxes: Sequence[TrackBox], pictures: dict[int, RgbImage], settings: MediaSettings
) -> list[TrackBox]:
    """The boxes worth a crop: the largest few of each hazard track, the largest of each large traffic track.

    `pictures` maps a keyframe's index to its pixels (H, W, 3). Ordered by kind, track, frame.
    """
    tracks: dict[tuple[Kind, str], list[tuple[float, TrackBox]]] = {}
    for box in boxes:
        picture = pictures.get(box.frame_index)
        if picture is None:
            continue
        x1, y1, x2, y2 = _inside(picture, box.box)
        if min(x2 - x1, y2 - y1) >= settings.crop_min_side_px:
            area = float((x2 - x1) * (y2 - y1))
            tracks.setdefault((box.kind, box.track_id), []).append((area, box))
    chosen: list[TrackBox] = []
    traffic: list[tuple[float, TrackBox]] = []
    for (kind, _), found in tracks.items():
        found.sort(key=lambda pair: (-pair[0], pair[1].frame_index))
        if kind is Kind.CHALLENGE:
            chosen += [box for _, box in found[: settings.crops_per_hazard_track]]
        else:
            traffic.append(found[0])
    traffic.sort(key=lambda pair: (-pair[0], pair[1].track_id))
    chosen += [box for _, box in traffic[: settings.traffic_tracks]]
    return sorted(chosen, key=lambda box: (box.kind, box.track_id, box.frame_index))


def _cover(frames: Sequence[Frame], boxes: Sequence[TrackBox]) -> int:
    """Which keyframe stands for the video: the one with the largest hazard box, else the middle one."""
    areas: dict[int, float] = {}
    pictures = {frame.index: frame.rgb for frame in frames}
    for box in boxes:
        if box.kind is Kind.CHALLENGE and box.frame_index in pictures:
            x1, y1, x2, y2 = _inside(pictures[box.frame_index], box.box)
            area = float(max(0, x2 - x1) * max(0, y2 - y1))
            areas[box.frame_index] = max(area, areas.get(box.frame_index, 0.0))
    best = max(areas.values(), default=0.0)
    if best <= 0:
        return len(frames) // 2
    return next(place for place, frame in enumerate(frames) if areas.get(frame.index) == best)


def _inside(picture: NDArray[np.uint8], box: Box) -> tuple[int, int, int, int]:
    """The box in whole pixels, clipped to the picture; may be empty."""
    height, width = picture.shape[:2]
    x1, x2 = (round(min(max(value, 0.0), float(width))) for value in (box.x1_px, box.x2_px))
    y1, y2 = (round(min(max(value, 0.0), float(height))) for value in (box.y1_px, box.y2_px))
    return x1, y1, x2, y2


def _cut(picture: RgbImage, box: Box) -> RgbImage:
    x1, y1, x2, y2 = _inside(picture, box)
    return picture[y1:y2, x1:x2]


def _fit(picture: RgbImage, limit_px: int, side_px: int | None = None) -> RgbImage:
    """The picture scaled so that `side_px` (its width by default) becomes at most `limit_px`."""
    import cv2

    scale = min(1.0, limit_px / (side_px or picture.shape[1]))
    if scale == 1.0:
        return picture
    size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _webp(picture: RgbImage, quality: int) -> bytes:
    import cv2

    return _encoded(picture, ".webp", [cv2.IMWRITE_WEBP_QUALITY, quality])


def _jpeg(picture: RgbImage, quality: int) -> bytes:
    import cv2

    return _encoded(picture, ".jpg", [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1])


def _encoded(picture: RgbImage, ending: str, options: list[int]) -> bytes:
    import cv2

    done, data = cv2.imencode(ending, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), options)
    if not done:
        raise VideoError(f"A picture of {picture.shape[1]}x{picture.shape[0]} px could not be encoded.")
    return bytes(data.tobytes())
