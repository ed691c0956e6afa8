"""How many annotated boxes motion proposes: `python -m bench.proposals [CLIP ...]`, a table of demo clips.

A box is found when a proposal of its frame overlaps it by an IoU of at least 0.3; a track is found when
half of its boxes are. How many proposals are of nothing cannot be told: the demo's boxes are not of all
that is seen.
"""

import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from pipeline.data.linking import iou, named
from pipeline.data.propose import ProposeSettings, propose_clip
from pipeline.records import Box, Kind, TrackBox
from pipeline.tables import BOXES

DEMO = Path(__file__).parent.parent / "demo"
LEAST_IOU = 0.3


def main() -> None:
    """Print the table, and a last row for all clips."""
    annotated: dict[str, list[TrackBox]] = defaultdict(list)
    for row in BOXES.read(DEMO / "boxes.parquet"):
        annotated[row.video_id].append(row)
    print("| clip | frames | proposed tracks | proposals a frame | boxes found | of hazards | tracks found |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    total: list[tuple[TrackBox, bool]] = []
    frames = proposals = tracks = 0
    for video_id in sys.argv[1:] or sorted(annotated):
        count, made = propose_clip(DEMO / "videos" / f"{video_id}.mp4", ProposeSettings())
        boxes: dict[int, list[Box]] = defaultdict(list)
        for row in named(video_id, made):
            boxes[row.frame_index].append(row.box)
        found = [(row, _is_found(row, boxes)) for row in annotated[video_id]]
        here = sum(map(len, boxes.values()))
        _print(video_id, count, len(made), here, found)
        total, frames = total + found, frames + count
        proposals, tracks = proposals + here, tracks + len(made)
    _print("all", frames, tracks, proposals, total)


def _is_found(row: TrackBox, boxes: Mapping[int, list[Box]]) -> bool:
    return any(iou(row.box, box) >= LEAST_IOU for box in boxes[row.frame_index])


def _print(
    name: str, frames: int, tracks: int, proposals: int, found: Iterable[tuple[TrackBox, bool]]
) -> None:
    rows = list(found)
    by_track: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for row, hit in rows:
        by_track[row.video_id, row.track_id].append(hit)
    whole = [2 * sum(hits) >= len(hits) for hits in by_track.values()]
    hazards = [hit for row, hit in rows if row.kind is Kind.CHALLENGE]
    shares = " | ".join(map(_share, ([hit for _, hit in rows], hazards, whole)))
    print(f"| {name} | {frames} | {tracks} | {proposals / frames:.1f} | {shares} |", flush=True)


def _share(hits: list[bool]) -> str:
    return f"{sum(hits)} of {len(hits)} ({sum(hits) / len(hits):.0%})" if hits else "–"


if __name__ == "__main__":
    main()
