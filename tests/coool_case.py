"""Annotations in the shape of COOOL's pickle, as large and as odd as a test or a measurement wants them."""

import random
from typing import Any

import numpy as np

Frames = dict[Any, Any]


def annotations(videos: int, frames: int, objects: int, *, odd: bool = True) -> dict[str, Frames]:
    """`video_0001` ... with `objects` tracks that drift through 1280 x 720 px; the same every time.

    The first object of each frame is the challenge's. When `odd`: track ids are numbers in one video and
    texts in the next, every tenth frame has no objects (an empty dict, empty lists, or None by turns), and
    the tracks with an odd number begin left of the frame.
    """
    chance = random.Random(0)
    made = {}
    for number in range(1, videos + 1):
        starts = [(chance.uniform(0, 1100), chance.uniform(0, 600)) for _ in range(objects)]
        content: Frames = {}
        for frame in range(frames):
            if odd and frame % 10 == 9:
                content[frame] = ({}, {"challenge_object": [], "traffic_scene": []}, None)[frame // 10 % 3]
                continue
            entries = []
            for track, (x_px, y_px) in enumerate(starts):
                left = (-20.0 if odd and track % 2 else x_px) + 0.1 * frame
                track_id = f"t{track}" if odd and number % 2 else track
                entries.append({"track_id": track_id, "bbox": [left, y_px, left + 60.5, y_px + 40.25]})
            content[frame] = {"challenge_object": entries[:1], "traffic_scene": entries[1:]}
        made[f"video_{number:04}"] = content
    return made


def as_numpy(value: Any) -> Any:
    """The same with boxes as float32 arrays and frame indices as numpy's."""
    if isinstance(value, dict):
        return {np.int64(k) if isinstance(k, int) else k: as_numpy(v) for k, v in value.items()}
    if isinstance(value, list):
        is_box = len(value) == 4 and all(isinstance(n, float) for n in value)
        return np.array(value, np.float32) if is_box else [as_numpy(v) for v in value]
    return value
