"""What a case of the hostile corpus is, the truth it is read against, and a right file of each format."""

import csv
import io
import json
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.records import TruthHazard

MARKER = "HOSTILE-MARKER"
"""The file that hostile code would make in the folder it runs in, if it ever ran."""
ALERT = "alert(4711)"
"""The script that hostile captions carry."""
MIB = 2**20

Verdict = Literal["refused", "good", "either"]
Content = bytes | Callable[[Path], None]

_VIDEOS = ("v1", "v2", "video_0001", "video_0002", "1", "2")
TRUTH = (
    *(TruthHazard(video_id, "1", "cat", "A cat crosses the road.") for video_id in _VIDEOS),
    TruthHazard("v3", "", "", ""),
)


@dataclass(frozen=True, slots=True)
class Case:
    """A hostile file.

    `name` is unique, `[a-z0-9-]`; `file` is the name that the reader sees; `content` are the bytes, or
    a function that makes the file. `verdict` is "refused" or "good" where the definition of the formats
    leaves no choice, "either" where both would be right.
    """

    name: str
    file: str
    content: Content
    verdict: Verdict = "refused"

    def write(self, folder: Path) -> Path:
        """Make the file in a folder of its own under `folder`; give its path."""
        path = folder / self.name / self.file
        path.parent.mkdir(parents=True)
        if isinstance(self.content, bytes):
            path.write_bytes(self.content)
        else:
            self.content(path)
        return path


def is_one_line(text: str) -> bool:
    """Whether a text can be printed: no control, formatting, broken or unknown character in it."""
    return all(char.isprintable() or unicodedata.category(char) == "Zs" for char in text)


def csv_bytes(rows: Sequence[Sequence[object]], space: str = "") -> bytes:
    """Rows as CSV, quoted where they must be; `space` goes after every comma."""
    target = io.StringIO()
    writer = csv.writer(target, lineterminator="\n")
    for row in rows:
        if space:
            target.write(f",{space}".join(str(cell) for cell in row) + "\n")
        else:
            writer.writerow(row)
    return target.getvalue().encode("utf-8", "surrogatepass")


def as_csv(video_id: object = "v1", rank: object = 1, text: object = "A cat.") -> bytes:
    """A CSV file of our columns with one row."""
    return csv_bytes([["video_id", "rank", "description"], [video_id, rank, text]])


def as_jsonl(video_id: object = "v1", rank: object = 1, text: object = "A cat.", **more: object) -> bytes:
    """A JSON Lines file with one row."""
    record = {"video_id": video_id, "rank": rank, "description": text, **more}
    return json.dumps(record).encode() + b"\n"


def as_parquet(video_id: Any = "v1", rank: Any = 1, text: Any = "A cat.", **more: Any) -> bytes:
    """A Parquet file with one row."""
    columns: Mapping[str, Any] = {"video_id": video_id, "rank": rank, "description": text, **more}
    target = io.BytesIO()
    pq.write_table(pa.table({name: [value] for name, value in columns.items()}), target)
    return target.getvalue()


def as_coool(
    video_id: object = "video_0001", frame: object = 0, text: object = "cat crossing", track: object = 7
) -> bytes:
    """A COOOL `results.csv` with one row; ID is video and frame."""
    header = ["ID", "Driver_State_Changed"]
    for slot in range(1, 23):
        header += [f"Hazard_Track_{slot}", f"Hazard_Name_{slot}"]
    row = [f"{video_id}_{frame}", "False", track, text, *[" "] * 42]
    return csv_bytes([header, row])


def as_2coool(video_id: object = 1, text: object = "A cat crosses.", **more: object) -> bytes:
    """A 2COOOL file with one row."""
    cells: dict[str, object] = {
        "video": video_id,
        "Incident window start frame": 10,
        "Incident Detection": 1,
        "Crash Severity": 1,
        "Ego-car involved": 1,
        "Label": "cat",
        "Number of Bicyclists/Scooters": 0,
        "Number of animals involved": 1,
        "Number of pedestrians involved": 0,
        "Number of vehicles involved (excluding ego-car)": 0,
        "Caption Before Incident": text,
        "Reason of Incident": "The driver did not see it.",
    }
    cells |= more
    return csv_bytes([list(cells), list(cells.values())])


def as_scripts(video_id: str = "v1", answer: object = "['A cat crosses the road']") -> bytes:
    """The paper's scripts' JSON: a video with its COS and AOS, the latter a list inside a string."""
    return json.dumps({video_id: ["1. A cat crosses the road", answer]}).encode()


def as_coco(video_id: object = "v1", text: object = "A cat crosses the road.") -> bytes:
    """COCO caption results with one caption."""
    return json.dumps([{"image_id": video_id, "caption": text}]).encode()


RIGHT: dict[str, tuple[str, bytes]] = {
    "csv": ("p.csv", as_csv()),
    "jsonl": ("p.jsonl", as_jsonl(track_ids=["7"], frame_indices=[1, 2])),
    "parquet": ("p.parquet", as_parquet(track_ids=["7"], frame_indices=[1, 2])),
    "coool": ("results.csv", as_coool()),
    "2coool": ("submission.csv", as_2coool()),
    "scripts": ("results.json", as_scripts()),
    "coco": ("captions.json", as_coco()),
}
"""A right file of each format: its name and its bytes."""
