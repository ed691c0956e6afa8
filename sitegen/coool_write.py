"""COOOL results from hazard tracks and reactions: one row for every frame, as the challenge's rules say.

The header counts the slots 1..22, captions hold no commas and at most 35 characters (the rules score no
more), empty slots are empty. Which frames a hazard stands in is decided in pipeline/data/hazard_tracks.py.
"""

import csv
import io
import textwrap
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pipeline.data.hazard_tracks import HazardTrack, hazards_by_frame
from pipeline.errors import InputError
from sitegen.texts import MAX_ROWS

SLOTS = 22
NAME_CHARS = 35
HEADER = (
    "ID",
    "Driver_State_Changed",
    *(f"Hazard_{part}_{slot}" for slot in range(1, SLOTS + 1) for part in ("Track", "Name")),
)
UNNAMED = "hazard"


@dataclass(frozen=True, slots=True)
class Written:
    """COOOL results as bytes, and what did not fit the format.

    `crowded` counts frames with more hazards than slots, `odd_tracks` the tracks whose id is no whole
    number, as the rules want it.
    """

    data: bytes
    rows: int
    crowded: int
    odd_tracks: int


def results_csv(
    frame_counts: Mapping[str, int],
    tracks: Mapping[str, Sequence[HazardTrack]],
    reactions: Mapping[str, int | None],
    names: str = "caption",
) -> Written:
    """The results of the videos in `frame_counts`, sorted by video and frame.

    `reactions` has the frame from which on the driver's state has changed; none where a video has no
    entry or None. `names` is `caption` or `label`: what a hazard is called. Raises InputError for more
    rows than our own reader takes.
    """
    rows = sum(frame_counts.values())
    if rows > MAX_ROWS:
        raise InputError(f"found {rows:,} frames in the run; expected at most {MAX_ROWS:,} rows in a file.")
    sink = io.StringIO(newline="")
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(HEADER)
    crowded = 0
    for video in sorted(frame_counts):
        changed = reactions.get(video)
        for frame, hazards in enumerate(hazards_by_frame(tracks.get(video, ()), frame_counts[video])):
            crowded += len(hazards) > SLOTS
            cells = [cell for hazard in hazards[:SLOTS] for cell in (hazard.track_id, _name(hazard, names))]
            state = changed is not None and frame >= changed
            empty = [""] * (2 * SLOTS - len(cells))
            writer.writerow([f"{video}_{frame}", str(state), *cells, *empty])
    return Written(sink.getvalue().encode(), rows, crowded, _odd_tracks(tracks.values()))


def short_name(text: str) -> str:
    """A caption as the format takes it: one line, no commas, at most 35 characters, cut at a word's end.

    A first word that is longer is cut within. Empty when nothing is left, or what a reader takes as a
    missing value (`nan`).
    """
    plain = "".join(" " if char == "," or unicodedata.category(char)[0] == "C" else char for char in text)
    words = " ".join(plain.split())
    short = textwrap.shorten(words, NAME_CHARS, placeholder="") or words[:NAME_CHARS].strip()
    return "" if short.lower() == "nan" else short


def _name(hazard: HazardTrack, names: str) -> str:
    first, second = hazard.description, hazard.label
    if names == "label":
        first, second = second, first
    return short_name(first) or short_name(second) or UNNAMED


def _odd_tracks(videos: Iterable[Sequence[HazardTrack]]) -> int:
    ids = [track.track_id for tracks in videos for track in tracks]
    return sum(not (track.isascii() and track.isdecimal()) for track in ids)
