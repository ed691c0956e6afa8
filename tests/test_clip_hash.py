"""Near-copies of real clips: changed copies are found, other clips of the same road are not."""

import shutil
from collections.abc import Sequence
from functools import cache
from itertools import combinations
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.data.clip_facts import CACHE, clip_files, known_clips, look, survey
from pipeline.data.clip_hash import (
    MIRROR,
    THRESHOLD_BITS,
    Groups,
    distance,
    frame_hash,
    near_copies,
)
from tests.clips import write_clip

DEMO = Path(__file__).parent.parent / "demo" / "videos"
HASH = st.integers(1, 2**64 - 1)
Pictures = Sequence[NDArray[np.uint8]]


def pictures_of(path: Path, size: tuple[int, int] = (320, 180), count: int = 75) -> list[NDArray[np.uint8]]:
    found = []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            found.append(cv2.resize(frame.to_ndarray(format="rgb24"), size, interpolation=cv2.INTER_AREA))
            if len(found) == count:
                break
    return found


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, ...]]:
    cache_file = tmp_path_factory.mktemp("cache") / CACHE
    return {clip.video_id: clip.hashes for clip in survey(clip_files(DEMO), cache_file, workers=2)}


@cache
def source() -> Pictures:
    return tuple(pictures_of(DEMO / "demo_0004.mp4"))


def changed(rgb: NDArray[np.uint8], contrast: float = 1.0, levels: float = 0.0) -> NDArray[np.uint8]:
    return np.clip(rgb.astype(np.float32) * contrast + levels, 0, 255).astype(np.uint8)


def small(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return cv2.resize(rgb, (160, 96), interpolation=cv2.INTER_AREA)


def with_logo(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    marked = rgb.copy()
    marked[5:20, 5:55] = 255
    return marked


# How a copy is made of the pictures, and its size in pixels.
COPIES = {
    "re-encoded": (lambda frames: frames, (320, 180)),
    "160x96": (lambda frames: [small(rgb) for rgb in frames], (160, 96)),
    "brighter": (lambda frames: [changed(rgb, levels=40) for rgb in frames], (320, 180)),
    "flatter": (lambda frames: [changed(rgb, contrast=0.6) for rgb in frames], (320, 180)),
    "7 frames off": (lambda frames: frames[7:], (320, 180)),
    "13 frames off, 10 off the end": (lambda frames: frames[13:-10], (320, 180)),
    "cut by 8 px": (lambda frames: [rgb[8:-8, 8:-8] for rgb in frames], (304, 164)),
    "logo": (lambda frames: [with_logo(rgb) for rgb in frames], (320, 180)),
    "mirrored": (lambda frames: [np.ascontiguousarray(rgb[:, ::-1]) for rgb in frames], (320, 180)),
}


def test_clips_of_one_drive_are_not_copies(demo: dict[str, tuple[int, ...]]) -> None:
    assert len(demo) == 14 and all(len(hashes) >= 25 for hashes in demo.values())
    assert near_copies(demo) == []
    pairs = combinations((np.array(hashes, np.uint64) for hashes in demo.values()), 2)
    assert min(distance(first, second)[0] for first, second in pairs) > THRESHOLD_BITS + 2


@pytest.mark.parametrize("name", COPIES)
def test_a_changed_copy_is_found_among_the_demo(
    name: str, demo: dict[str, tuple[int, ...]], tmp_path: Path
) -> None:
    change, size = COPIES[name]
    frames = change(source())
    clip = write_clip(tmp_path / "copy.mp4", len(frames), size, pictures=frames)
    (found,) = near_copies({**demo, "zz": look(clip).hashes})
    assert (found.first, found.second, found.mirrored) == ("demo_0004", "zz", name == "mirrored")
    assert found.distance_bits < THRESHOLD_BITS - 2


def test_copies_of_copies_are_one_group(demo: dict[str, tuple[int, ...]]) -> None:
    hashes = demo["demo_0001"]
    turned = [value ^ int(MIRROR) for value in hashes]
    found = near_copies({"a": hashes, "b": turned, "c": hashes[5:], "d": demo["demo_0002"]})
    assert len(found) == 2 and all(pair.distance_bits == 0 for pair in found)
    assert sum(pair.mirrored for pair in found) >= 1
    groups = Groups("abcd")
    for pair in found:
        groups.join(pair.first, pair.second)
    assert groups.sets() == [("a", "b", "c")]


def test_brightness_and_contrast_do_not_matter_and_a_mirror_flips_known_bits() -> None:
    noise = np.random.default_rng(0).integers(60, 160, (90, 160)).astype(np.uint8)
    grey = cv2.GaussianBlur(noise, (0, 0), 6)
    grey = cv2.normalize(grey, None, 60, 160, cv2.NORM_MINMAX)
    value = frame_hash(grey)
    assert int(np.bitwise_count(np.uint64(value ^ frame_hash(grey + np.uint8(50))))) == 0
    flipped = frame_hash(np.ascontiguousarray(grey[:, ::-1]))
    assert int(np.bitwise_count(np.uint64(value ^ flipped ^ int(MIRROR)))) <= 1
    assert int(np.bitwise_count(np.uint64(MIRROR))) == 32


def test_flat_frames_say_nothing() -> None:
    assert frame_hash(np.full((48, 64), 90, np.uint8)) == 0
    assert near_copies({"a": [0] * 20, "b": [0] * 20}) == []
    assert near_copies({}) == []
    assert near_copies({"a": [5, 6], "b": [5, 6]}) == []  # too short to say


@given(st.lists(HASH, min_size=8, max_size=30), st.integers(0, 4))
def test_the_shift_is_found(hashes: list[int], shift: int) -> None:
    whole, part = np.array(hashes, np.uint64), np.array(hashes[shift:], np.uint64)
    bits, found = distance(whole, part)
    assert bits == 0
    assert np.array_equal(whole[found : found + len(part)], part[: len(whole) - found])
    assert distance(part, whole)[0] == 0


def test_distance_by_hand() -> None:
    first = np.array([1, 2, 4, 8, 16, 0], np.uint64)
    second = np.array([1, 2, 4, 9, 16, 7], np.uint64)
    assert distance(first, second) == (1 / 5, 0)  # the flat frame is left out
    assert distance(first[:2], second[:2]) == (64.0, 0)


def test_facts_of_clips(tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "a.mp4", 20, (64, 48))
    facts = look(clip)
    assert (facts.frame_count, facts.claimed_frames, facts.codec) == (20, 20, "h264")
    assert (facts.width_px, facts.height_px, facts.fps_hz, facts.duration_s) == (64, 48, 25.0, 0.8)
    assert not (facts.problem or facts.damage or facts.has_audio or facts.is_variable_rate)
    quick = look(clip, decode=False)
    assert (quick.frame_count, quick.hashes, quick.is_decoded) == (20, (), False)
    for name, content in (
        ("empty.mp4", b""),
        ("text.mp4", b"no video"),
        ("cut.mp4", clip.read_bytes()[:300]),
    ):
        (tmp_path / name).write_bytes(content)
        assert look(tmp_path / name).problem


def test_what_is_known_is_not_looked_at_again(tmp_path: Path) -> None:
    folder, cache_file = tmp_path / "clips", tmp_path / CACHE
    folder.mkdir()
    for name in "ab":
        write_clip(folder / f"{name}.mp4", 12, (64, 48))
    first = survey(clip_files(folder), cache_file)
    assert known_clips(cache_file) == first == survey(clip_files(folder), cache_file, workers=2)
    shutil.copy(folder / "a.mp4", folder / "c.mp4")
    (folder / "b.mp4").unlink()
    seen = survey(clip_files(folder), cache_file)
    assert [clip.video_id for clip in seen] == ["a", "c"] and seen[0] == first[0]
    assert seen[0].sha256 == seen[1].sha256
    cache_file.write_bytes(b"damaged")
    assert survey(clip_files(folder), cache_file) == seen
