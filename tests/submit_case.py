"""One file of the corpus of the submit page, and the truth that it is checked against."""

import json
from dataclasses import dataclass

from pipeline.records import TruthHazard

HEAD = "video_id,rank,description\n"
FULL = "video_id,rank,description,label,track_ids,frame_indices\n"
IDS = (
    "v1",
    "v2",
    "v3",
    *(f"video_{number:04d}" for number in range(1, 13)),
    "other_07",
    "a.b-c_d",
    "long" * 30,
)
NO_HAZARD = ("v3", "video_0012")
TRUTH = [
    TruthHazard(video, "1", *(("", "") if video in NO_HAZARD else ("cat", "A cat crosses the road.")))
    for video in IDS
]


@dataclass(frozen=True, slots=True)
class Case:
    """A file. With `close`, the words found may differ a little; with `closed`, the page cannot open it."""

    name: str
    content: bytes
    close: bool = False
    closed: bool = False


def csv_case(text: str, **more: bool) -> Case:
    """A CSV of a text; surrogates pass."""
    return Case("p.csv", text.encode("utf-8", "surrogatepass"), **more)


def record(**cells: object) -> str:
    """A line of JSON Lines that is right, but for `cells`."""
    return json.dumps({"video_id": "v1", "rank": 1, "description": "x", **cells})
