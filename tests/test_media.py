"""The pictures of a video: what loads with its page is light, whatever the clip shows."""

from pathlib import Path

import numpy as np

from pipeline.records import Box, Kind, TrackBox
from sitegen.media import MediaJob, MediaSettings, make_media
from tests.clips import write_clip


def _thumbs(clip: Path, settings: MediaSettings) -> int:
    made = make_media(MediaJob("v", "v", clip, "", (), False, settings))
    return sum(len(data) for path, data in made.files if path.startswith("media/v/t"))


def test_small_keyframes_of_a_busy_clip_get_a_lower_quality(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    pictures = [random.integers(0, 256, (96, 160, 3), dtype=np.uint8) for _ in range(6)]
    clip = write_clip(tmp_path / "v.mp4", 6, (160, 96), pictures=pictures)
    good, less, least = (_thumbs(clip, MediaSettings(thumb_qualities=(quality,))) for quality in (58, 42, 28))
    assert good > less > least
    for limit, expected in ((good, good), (good - 1, less), (less, less), (less - 1, least), (0, least)):
        assert _thumbs(clip, MediaSettings(thumbs_bytes=limit)) == expected


def test_threads_make_the_same_bytes(tmp_path: Path) -> None:
    write_clip(tmp_path / "v.mp4", 40, (320, 180))
    boxes = tuple(TrackBox("v", at, "t", Kind.CHALLENGE, Box(10, 10, 90, 80)) for at in range(40))
    job = MediaJob("v", "v", tmp_path / "v.mp4", "", boxes, True)
    assert make_media(job, threads=3) == make_media(job)
