"""What is odd about a video's boxes as a whole: tracks that jump, boxes outside, frames that differ."""

from collections.abc import Iterator

import numpy as np

from pipeline.data.coool_pickle import Finding, Oddity, VideoBoxes
from pipeline.records import VideoFile

# Between two frames in a row, the centre moves by more than this many times the longer side of the larger
# box: even with the camera shaking, that is another object (ours).
JUMP_SIDES = 2.0
# Between two frames in a row, the area changes by more than this factor (ours).
RESIZE_RATIO = 4.0
# Half a second at COOOL's 30 fps: longer than most posts and mirrors hide something (ours).
GAP_FRAMES = 15


def check_tracks(boxes: VideoBoxes) -> Iterator[Finding]:
    """Tracks that jump or change their size from one frame to the next, or are away for long."""
    if not boxes.track_ids:
        return
    names, track = np.unique(np.array(boxes.track_ids, np.str_), return_inverse=True)
    order = np.lexsort((boxes.frame_index, track))
    frame, corners, track = boxes.frame_index[order], boxes.boxes_px[order], track[order]
    step = np.diff(frame)
    same = np.diff(track) == 0
    following = same & (step == 1)
    centre = (corners[:, :2] + corners[:, 2:]) / 2
    sides = corners[:, 2:] - corners[:, :2]
    longer, area = sides.max(axis=1), sides.prod(axis=1)
    moved = np.hypot(*np.diff(centre, axis=0).T)
    in_sides = moved / np.maximum(longer[:-1], longer[1:])
    ratio = np.maximum(area[:-1], area[1:]) / np.minimum(area[:-1], area[1:])
    jump, resize, gap = (
        following & (in_sides > JUMP_SIDES),
        following & (ratio > RESIZE_RATIO),
        step > GAP_FRAMES,
    )
    for oddity, rows, values, detail in (
        (Oddity.JUMP, jump, moved, "by {:.0f} px at once"),
        (Oddity.RESIZE, resize, ratio, "by a factor of {:.1f}"),
        (Oddity.GAP, same & gap, step - 1, "after {:.0f} frames without it"),
    ):
        for row in np.flatnonzero(rows):
            where, name = int(frame[row + 1]), str(names[track[row + 1]])
            yield Finding(oddity, boxes.video_id, where, name, detail.format(values[row]))


def check_against(boxes: VideoBoxes, video: VideoFile) -> Iterator[Finding]:
    """Boxes that leave the frame, annotated frames after the video's end, frames without an annotation."""
    low, high = boxes.boxes_px[:, :2], boxes.boxes_px[:, 2:]
    size = np.array([video.width_px, video.height_px])
    wholly = ((high <= 0) | (low >= size)).any(axis=1)
    partly = ((low < 0) | (high > size)).any(axis=1) & ~wholly
    for oddity, rows in ((Oddity.OUTSIDE, wholly), (Oddity.PARTLY_OUTSIDE, partly)):
        for row in np.flatnonzero(rows):
            corners = ", ".join(f"{number:.6g}" for number in boxes.boxes_px[row])
            detail = f"{corners} in {video.width_px} x {video.height_px} px"
            where = int(boxes.frame_index[row])
            yield Finding(oddity, boxes.video_id, where, boxes.track_ids[row], detail)
    beyond = boxes.frames[boxes.frames >= video.frame_count]
    inside = len(boxes.frames) - len(beyond)
    if len(beyond):
        detail = f"{len(beyond)} frames, {beyond[0]} to {beyond[-1]}; the video has {video.frame_count}"
        yield Finding(Oddity.BEYOND_END, boxes.video_id, int(beyond[0]), None, detail)
    if inside < video.frame_count:
        known = boxes.frames[:inside]
        # The first place where the ascending frames are not 0, 1, 2, ...
        first = int(np.argmax(np.append(known, -1) != np.arange(inside + 1)))
        detail = f"{video.frame_count - inside} of {video.frame_count} frames, the first is {first}"
        yield Finding(Oddity.NOT_ANNOTATED, boxes.video_id, first, None, detail)
