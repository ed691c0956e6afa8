"""One video of COOOL's annotations as columns of boxes; every fault and oddity in it is collected.

The form (AlShami et al. 2024) is `{frame_index: {"challenge_object": [{"track_id": ..., "bbox": [x1, y1,
x2, y2]}, ...], "traffic_scene": [...]}}`. What cannot be understood is a fault; what can, but is odd, is a
finding, and says what was done about it (ours).
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.records import Kind

MAX_FRAME = 2**31 - 1
MAX_ID_CHARS = 128
# Farther out than any frame: not a place in pixels.
MAX_COORDINATE_PX = 1_000_000.0

# In this order: a track that one frame has in both lists is the challenge's.
LISTS = {"challenge_object": Kind.CHALLENGE, "traffic_scene": Kind.TRAFFIC}

_NUMBERS = frozenset({int, float})
_DIGITS = re.compile(r"[0-9]{1,10}", re.ASCII)


class Oddity(StrEnum):
    """What can be odd about annotations that can be read."""

    NOT_FINITE = "box without finite coordinates, dropped"
    DEGENERATE = "box without width or height, dropped"
    REPEATED = "track again in the same frame, dropped"
    REORDERED = "corners in the wrong order, put right"
    MIXED_IDS = "track id as a number and as text, taken as one track"
    IGNORED_KEY = "unknown key, ignored"
    JUMP = "track jumps"
    RESIZE = "track changes its size at once"
    GAP = "track is away and comes back"
    PARTLY_OUTSIDE = "box partly outside the frame"
    OUTSIDE = "box wholly outside the frame"
    BEYOND_END = "annotated frame beyond the end of the video"
    NOT_ANNOTATED = "frames without an annotation"


@dataclass(frozen=True, slots=True)
class Finding:
    """One oddity; `frame_index` and `track_id` are None where it is of the whole video or frame."""

    oddity: Oddity
    video_id: str
    frame_index: int | None
    track_id: str | None
    detail: str


@dataclass(frozen=True, slots=True)
class Wrong:
    """One fault of the form; `place` is the video, frame and entry, as the keys are written."""

    place: str
    found: str
    expected: str


@dataclass(slots=True)
class VideoBoxes:
    """The boxes of one video, sorted by frame and track; the columns have one length.

    `frames` are all annotated frames, with or without boxes, ascending. `boxes_px` is (n, 4).
    """

    video_id: str
    frames: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    track_ids: list[str]
    is_challenge: NDArray[np.bool_]
    boxes_px: NDArray[np.float64]
    findings: list[Finding] = field(default_factory=list)
    wrong: list[Wrong] = field(default_factory=list)


def read_video(video_id: str, frames: Any) -> VideoBoxes:
    """The boxes of one video. Where `wrong` is not empty, the rest is not to be used."""
    reading = _Reading(video_id)
    reading.read(frames)
    return reading.columns()


def shown(value: Any) -> str:
    """A value of a pickle as a fault quotes it: bounded, on one line."""
    if isinstance(value, dict | list | tuple):
        return f"a {type(value).__name__} of {len(value):,}"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, str | bytes | bytearray):
        return ascii(value[:40])
    return ascii(value)[:40]


class _Reading:
    """Collects the boxes of one video as they come."""

    def __init__(self, video_id: str) -> None:
        self.video_id = video_id
        self.frames: set[int] = set()
        self.frame_index: list[int] = []
        self.track_ids: list[str] = []
        self.challenge: list[bool] = []
        self.coordinates: list[float] = []
        self.wrong: list[Wrong] = []
        self.ignored: Counter[str] = Counter()
        self.as_number: Counter[str] = Counter()
        self.as_text: Counter[str] = Counter()

    def read(self, frames: Any) -> None:
        if frames is None:
            return
        if not isinstance(frames, dict):
            self._add("", "", shown(frames), "a dict of frames")
            return
        for key, content in frames.items():
            index = _frame_index(key)
            if index is None:
                self._add(shown(key), "", "this key", "a frame index of 0 or more")
            elif index in self.frames:
                self._add(shown(key), "", f"frame {index} a second time", "each frame once")
            else:
                self.frames.add(index)
                self._read_frame(index, content)

    def _read_frame(self, index: int, content: Any) -> None:
        if content is None:
            return
        if not isinstance(content, dict):
            self._add(str(index), "", shown(content), f"a dict with {' and '.join(LISTS)}")
            return
        for name, kind in LISTS.items():
            entries = content.get(name)
            if isinstance(entries, list | tuple):
                for place, entry in enumerate(entries):
                    self._read_entry(index, name, place, kind is Kind.CHALLENGE, entry)
            elif entries is not None:
                self._add(str(index), name, shown(entries), "a list of objects")
        if len(content) > len(LISTS) or not content.keys() <= LISTS.keys():
            for key in (key for key in content if key not in LISTS):
                if isinstance(content[key], list | tuple | dict) and content[key]:
                    self._add(str(index), shown(key), shown(content[key]), " or ".join(LISTS))
                else:
                    self.ignored[shown(key)] += 1

    def _read_entry(self, index: int, name: str, place: int, challenge: bool, entry: Any) -> None:
        if not isinstance(entry, dict) or "track_id" not in entry or "bbox" not in entry:
            found = (
                f"the keys {', '.join(map(shown, [*entry][:5]))}" if isinstance(entry, dict) else shown(entry)
            )
            self._add(str(index), f"{name}[{place}]", found, "a dict with track_id and bbox")
            return
        raw = entry["track_id"]
        track_id = _track_id(raw)
        box = _box(entry["bbox"])
        if track_id is None:
            self._add(
                str(index), f"{name}[{place}]", f"track_id {shown(raw)}", "a whole number or a short text"
            )
        if box is None:
            found = f"bbox {shown(entry['bbox'])}"
            self._add(str(index), f"{name}[{place}]", found, "four numbers x1, y1, x2, y2")
        if track_id is None or box is None:
            return
        if len(entry) > 2:
            self.ignored.update(shown(key) for key in entry if key not in {"track_id", "bbox"})
        (self.as_text if isinstance(raw, str) else self.as_number)[track_id] += 1
        self.frame_index.append(index)
        self.track_ids.append(track_id)
        self.challenge.append(challenge)
        self.coordinates += box

    def _add(self, frame: str, entry: str, found: str, expected: str) -> None:
        parts = (f"video {self.video_id}", frame and f"frame {frame}", entry)
        self.wrong.append(Wrong(", ".join(filter(None, parts)), found, expected))

    def columns(self) -> VideoBoxes:
        """The columns, put in order."""
        frames = np.array(sorted(self.frames), np.int64)
        index = np.array(self.frame_index, np.int64)
        tracks = np.array(self.track_ids, np.str_)
        boxes = np.array(self.coordinates, np.float64).reshape(-1, 4)
        challenge = np.array(self.challenge, np.bool_)
        findings = list(self._of_the_video())
        # Python's order of strings is numpy's: by code point. Stable, so that the first of equals is first.
        order = np.lexsort((~challenge, tracks, index))

        def note(oddity: Oddity, rows: NDArray[np.bool_]) -> None:
            for row in order[rows[order]]:
                corners = ", ".join(f"{number:.6g}" for number in boxes[row])
                findings.append(Finding(oddity, self.video_id, int(index[row]), str(tracks[row]), corners))

        # NaN compares as False.
        finite = (np.abs(boxes) <= MAX_COORDINATE_PX).all(axis=1)
        note(Oddity.NOT_FINITE, np.logical_not(finite))
        low, high = np.minimum(boxes[:, :2], boxes[:, 2:]), np.maximum(boxes[:, :2], boxes[:, 2:])
        flat = finite & (low == high).any(axis=1)
        note(Oddity.DEGENERATE, flat)
        swapped = np.any(low != boxes[:, :2], axis=1)
        note(Oddity.REORDERED, finite & ~flat & swapped)
        order = order[(finite & ~flat)[order]]
        again = (np.diff(index[order], prepend=-1) == 0) & (tracks[order] == np.roll(tracks[order], 1))
        repeated = np.zeros(len(index), np.bool_)
        repeated[order[again]] = True
        note(Oddity.REPEATED, repeated)
        order = order[~again]
        return VideoBoxes(
            self.video_id,
            frames,
            index[order],
            tracks[order].tolist(),
            challenge[order],
            np.hstack([low, high])[order],
            findings,
            self.wrong,
        )

    def _of_the_video(self) -> Iterator[Finding]:
        for track_id in sorted(self.as_text.keys() & self.as_number.keys()):
            detail = f"{self.as_number[track_id]} boxes as a number, {self.as_text[track_id]} as text"
            yield Finding(Oddity.MIXED_IDS, self.video_id, None, track_id, detail)
        for key, count in sorted(self.ignored.items()):
            yield Finding(Oddity.IGNORED_KEY, self.video_id, None, None, f"{key}, {count} times")


def _frame_index(key: Any) -> int | None:
    if isinstance(key, str):
        key = int(key) if _DIGITS.fullmatch(key) else None
    elif isinstance(key, float) and key.is_integer():
        key = int(key)
    return key if type(key) is int and 0 <= key <= MAX_FRAME else None


def _track_id(raw: Any) -> str | None:
    if isinstance(raw, str):
        return raw if 0 < len(raw) <= MAX_ID_CHARS and raw.isprintable() and raw.strip() else None
    if isinstance(raw, np.ndarray) and raw.shape == ():
        return _track_id(raw.item())
    if isinstance(raw, float) and raw.is_integer():
        return _track_id(int(raw))
    return str(raw) if type(raw) is int and abs(raw) < 1 << 64 else None


def _box(raw: Any) -> list[float] | None:
    """The four coordinates, or None."""
    if isinstance(raw, np.ndarray):
        return raw.astype(np.float64).tolist() if raw.shape == (4,) and raw.dtype.kind in "fiu" else None
    if not isinstance(raw, list | tuple) or len(raw) != 4:
        return None
    numbers = [n.item() if isinstance(n, np.ndarray) and n.shape == () else n for n in raw]
    if not _NUMBERS.issuperset(map(type, numbers)):
        return None
    try:
        return [float(number) for number in numbers]
    except OverflowError:  # a JSON file's whole number can be that long
        return None
