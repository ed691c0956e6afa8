"""COOOL results read for scoring: what a file says of each frame of each video."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.records import TruthHazard
from sitegen.captions import checked, counted, some
from sitegen.checks import Faults, show, visible
from sitegen.coool import FrameRow, frame_rows
from sitegen.formats import refuse_other_kind
from sitegen.texts import MAX_ROWS
from sitegen.unpack import content_of
from sitegen.video_ids import VideoIds

_STATES = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False, "": False}


@dataclass(frozen=True, slots=True)
class FrameSay:
    """What results say of one frame: whether the driver's state has changed, the tracks and the names."""

    changed: bool
    tracks: tuple[str, ...] = ()
    names: tuple[str, ...] = ()


SILENT = FrameSay(False)
"""What a frame without a row says."""


@dataclass(frozen=True, slots=True)
class Results:
    """The frames that a file speaks of, by video and frame index; `warnings` name what is odd."""

    videos: Mapping[str, Mapping[int, FrameSay]]
    sha256: str
    warnings: tuple[str, ...]


def read_results(
    path: Path, truth: Iterable[TruthHazard], video_map: Mapping[str, str], name: str = ""
) -> Results:
    """The results in a file, which faults call `name`; its videos must be among the truth's.

    An empty state counts as not changed. Raises FaultsError with every fault.
    """
    faults = Faults(visible(name or str(path), 1_000))
    content = content_of(path, faults)
    refuse_other_kind(content.data, "coool", faults)
    rows = list(frame_rows(content.data, faults))
    first_rows: dict[str, int] = {}
    for read in rows:
        first_rows.setdefault(read.video, read.row)
    ids = VideoIds({hazard.video_id for hazard in truth}, video_map, first_rows)
    names = {raw: checked(ids, raw, faults, row, "ID") for raw, row in first_rows.items()}
    videos: dict[str, dict[int, FrameSay]] = {name: {} for name in names.values() if name}
    for read in rows:
        video = names[read.video]
        say = _say(read, faults)
        if video and say:
            videos[video][read.frame] = say
    faults.raise_if_any()
    return Results(videos, content.sha256, (*_warnings(rows, videos), *ids.warnings()))


def _say(read: FrameRow, faults: Faults) -> FrameSay | None:
    changed = _STATES.get(read.state.lower())
    if changed is None:
        mend = "Write True from the frame on at which the driver reacts, False before."
        faults.add(read.row, "Driver_State_Changed", show(read.state), "True or False", mend)
        return None
    tracks = tuple(slot.track for slot in read.slots if slot.track)
    return FrameSay(changed, tracks, tuple(slot.name for slot in read.slots if slot.name))


def _warnings(rows: list[FrameRow], videos: Mapping[str, Mapping[int, FrameSay]]) -> list[str]:
    warnings = []
    empty = sum(not read.state for read in rows)
    if empty:
        warnings.append(f"{counted(empty, 'row has', 'rows have')} no driver state, taken as False.")
    back = 0
    for frames in videos.values():
        states = [frames[index].changed for index in sorted(frames)]
        back += states != sorted(states)
    if back:
        said = counted(back, "video", "videos")
        warnings.append(f"The driver's state goes back to False in {said}; the rules let it change once.")
    return warnings


def frame_counts(
    results: Results,
    truth: Iterable[TruthHazard],
    driver_states: Mapping[str, int | None],
    clips: Mapping[str, int],
) -> tuple[dict[str, int], list[str]]:
    """How many frames each video of the truth has, and what there is to warn of.

    A video without a clip is as long as the file, the truth and the driver's states need, at least one
    frame. Raises InputError for more frames than a file can have rows.
    """
    lengths: dict[str, int] = {}
    for hazard in truth:
        ends = [0, hazard.first_frame or 0, hazard.last_frame or 0, driver_states.get(hazard.video_id) or 0]
        ends += results.videos.get(hazard.video_id, {})
        lengths[hazard.video_id] = max(lengths.get(hazard.video_id, 1), max(ends) + 1)
    guessed = sorted(lengths.keys() - clips.keys())
    counts = {video: clips.get(video, length) for video, length in sorted(lengths.items())}
    total = sum(counts.values())
    if total > MAX_ROWS:
        raise InputError(
            f"found {total:,} frames in the videos; expected at most {MAX_ROWS:,}. Is a frame number wrong?"
        )
    warnings = []
    if guessed:
        warnings.append(
            f"No clip of {some(guessed)}: taken to be as long as the file and the truth say, so that rows "
            "missing at the end may go unseen."
        )
    said = {video: results.videos.get(video, {}) for video in counts}
    inside = {video: sum(frame < counts[video] for frame in said[video]) for video in counts}
    silent = total - sum(inside.values())
    past = sum(len(said[video]) - inside[video] for video in counts)
    if silent:
        warnings.append(f"{counted(silent, 'frame has', 'frames have')} no row: no hazard, state False.")
    if past:
        warnings.append(f"{counted(past, 'row is', 'rows are')} past the end of a clip and not looked at.")
    return counts, warnings
