"""Verification: box crops against the COS labels, and what that says about the AOS (paper).

Every snippet (box crop) of every sampled frame is compared with every COS label. In each row of
that matrix the entries in the top 10th percentile are *detected*; detected entries that share a
label are grouped, and the groups whose label is in the AOS give the hazard's tracks and frames.

The size limits cost the paper its small hazards. With `upscale` (ours) a snippet under the limits is
not ignored: it is compared with what surrounds it, enlarged.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.config import VerifySettings
from pipeline.interfaces import ImageTextMatcher
from pipeline.records import Box, Exclusion, Frame, Item, Match, Prediction, RgbImage, Snippet
from pipeline.video import crop

LEAST_VISIBLE_PX = 4  # less than this of a box inside the frame is no picture of anything


@dataclass(frozen=True, slots=True)
class Verification:
    """Every snippet with its reason if ignored, every cell of the matrix, and the predictions."""

    snippets: tuple[Snippet, ...]
    matches: tuple[Match, ...]
    predictions: tuple[Prediction, ...]


def exclusion(box: Box, width_px: int, height_px: int, limits: VerifySettings) -> Exclusion | None:
    """Why a snippet is ignored, or None. Sizes are those of the annotated box.

    Paper: width < 175 px, height < 175 px, or area <= 35,000 px². Ours: limits scaled by the
    frame's width when `reference_width_px` is set; a box wholly outside the frame has no pixels.
    """
    if box.x2_px <= 0 or box.y2_px <= 0 or box.x1_px >= width_px or box.y1_px >= height_px:
        return Exclusion.OUTSIDE_FRAME
    scale = width_px / limits.reference_width_px if limits.reference_width_px else 1.0
    if box.width_px < limits.min_width_px * scale:
        return Exclusion.TOO_NARROW
    if box.height_px < limits.min_height_px * scale:
        return Exclusion.TOO_LOW
    if box.area_px2 <= limits.min_area_px2 * scale**2:
        return Exclusion.AREA_TOO_SMALL
    return None


def enlarged(rgb: RgbImage, box: Box, context: float, min_side_px: int) -> RgbImage | None:
    """A square picture of a small box in a frame (H, W, 3), at least `min_side_px` a side (ours).

    The square lies around the part of the box inside the frame, its side that part's longer side
    grown by `context` of itself on both ends; pixels beyond the frame's edge repeat the edge. Cubic
    interpolation where it is enlarged. None when less than 4 px of the box are inside, either way.
    """
    import cv2

    height_px, width_px = rgb.shape[:2]
    x1, x2 = (min(max(x, 0.0), float(width_px)) for x in (box.x1_px, box.x2_px))
    y1, y2 = (min(max(y, 0.0), float(height_px)) for y in (box.y1_px, box.y2_px))
    if not min(x2 - x1, y2 - y1) >= LEAST_VISIBLE_PX:  # NaN is no size either
        return None
    side = math.ceil(max(x2 - x1, y2 - y1) * (1 + 2 * context))
    left, top = (math.floor((low + high - side) / 2) for low, high in ((x1, x2), (y1, y2)))
    inside = rgb[max(top, 0) : top + side, max(left, 0) : left + side]
    square = cv2.copyMakeBorder(
        inside,
        max(-top, 0),
        max(top + side - height_px, 0),
        max(-left, 0),
        max(left + side - width_px, 0),
        cv2.BORDER_REPLICATE,
    )
    if side < min_side_px:
        square = cv2.resize(square, (min_side_px, min_side_px), interpolation=cv2.INTER_CUBIC)
    return np.asarray(square, np.uint8)


def exclusion_counts(snippets: Iterable[Snippet]) -> dict[Exclusion, int]:
    """How many snippets each reason left out; every reason is there, 0 where it left out none."""
    counts = Counter(snippet.excluded for snippet in snippets)
    return {reason: counts[reason] for reason in Exclusion}


def rescue_counts(
    snippets: Iterable[Snippet], width_px: int, height_px: int, limits: VerifySettings
) -> dict[Exclusion, int]:
    """How many snippets of one video are compared only because of `upscale`, by the limit they miss.

    `width_px` x `height_px` is the size of the frames; every reason is there.
    """
    kept = (snippet.track_box.box for snippet in snippets if snippet.excluded is None)
    counts = Counter(exclusion(box, width_px, height_px, limits) for box in kept)
    return {reason: counts[reason] for reason in Exclusion}


def detected(cosines: NDArray[np.float32], top_percent: float) -> NDArray[np.bool_]:
    """Which entries lie in the top `top_percent` of their row; shapes (S, L) -> (S, L).

    At or over the row's (100 - top_percent)th percentile by linear interpolation, so at least
    one entry a row.
    """
    if cosines.size == 0:
        return np.zeros(cosines.shape, dtype=bool)
    limits = np.percentile(cosines.astype(np.float64), 100.0 - top_percent, axis=1, keepdims=True)
    # The percentile of equal values may come out above them by rounding: the best always counts.
    limits = np.minimum(limits, cosines.max(axis=1, keepdims=True))
    flagged: NDArray[np.bool_] = cosines >= limits
    return flagged


def verify(
    video_id: str,
    frames: Sequence[Frame],
    cos: Sequence[Item],
    aos: Sequence[Item],
    matcher: ImageTextMatcher,
    limits: VerifySettings,
) -> Verification:
    """Compare the snippets of `frames` with the COS labels and tie the AOS to tracks."""
    snippets: list[Snippet] = []
    kept: list[Snippet] = []
    crops: list[RgbImage] = []
    for frame in frames:
        height_px, width_px = frame.rgb.shape[:2]
        for track_box in frame.boxes:
            reason = exclusion(track_box.box, width_px, height_px, limits)
            picture = None
            if reason is None:
                picture = crop(frame.rgb, track_box.box)
                reason = Exclusion.OUTSIDE_FRAME if picture is None else None
            elif limits.upscale:
                picture = enlarged(
                    frame.rgb, track_box.box, limits.upscale_context, limits.upscale_min_side_px
                )
                reason = reason if picture is None else None
            snippet = Snippet(track_box, reason)
            snippets.append(snippet)
            if picture is not None:
                kept.append(snippet)
                crops.append(picture)
    labels = list(dict.fromkeys(label_of(item) for item in cos))
    anomalous = {_same(label_of(item)) for item in aos}
    matches: list[Match] = []
    if crops and labels:
        cosines = matcher.cosines(crops, labels)
        flags = detected(cosines, limits.top_percent)
        for row, snippet in enumerate(kept):
            place = snippet.track_box
            matches += [
                Match(
                    video_id,
                    place.frame_index,
                    place.track_id,
                    label,
                    float(cosines[row, column]),
                    bool(flags[row, column]),
                    _same(label) in anomalous,
                )
                for column, label in enumerate(labels)
            ]
    return Verification(tuple(snippets), tuple(matches), _predictions(video_id, aos, matches))


def label_of(item: Item) -> str:
    """An item's label, or its description where the model gave only a sentence."""
    return item.label or item.description


def _same(label: str) -> str:
    return " ".join(label.casefold().split())


def _predictions(video_id: str, aos: Sequence[Item], matches: Sequence[Match]) -> tuple[Prediction, ...]:
    """The descriptions in AOS (paper), each with the tracks and frames that were detected for it."""
    predictions: list[Prediction] = []
    for item in aos:
        found = [match for match in matches if match.detected and _same(match.label) == _same(label_of(item))]
        predictions.append(
            Prediction(
                video_id,
                len(predictions) + 1,
                item.description or item.label,
                item.label or None,
                tuple(sorted({match.track_id for match in found})),
                tuple(sorted({match.frame_index for match in found})),
            )
        )
    return tuple(predictions)
