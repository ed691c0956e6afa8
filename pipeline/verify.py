"""Verification: box crops against the COS labels, and what that says about the AOS (paper).

Every snippet (box crop) of every sampled frame is compared with every COS label. In each row of
that matrix the entries in the top 10th percentile are *detected*; detected entries that share a
label are grouped, and the groups whose label is in the AOS give the hazard's tracks and frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.config import VerifySettings
from pipeline.interfaces import ImageTextMatcher
from pipeline.records import Box, Exclusion, Frame, Item, Match, Prediction, RgbImage, Snippet
from pipeline.video import crop


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
            picture = None if reason else crop(frame.rgb, track_box.box)
            if reason is None and picture is None:
                reason = Exclusion.OUTSIDE_FRAME
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
