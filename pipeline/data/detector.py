"""Boxes by an object detector that the user has: an ONNX network on onnxruntime, on the CPU.

Two layouts of the public exports are known. Both take one picture, (1, 3, H, W) floats in [0, 1], RGB:

- *raw*: one output (1, 4 + C, N), as YOLOv8 and its kin are exported: middle x, middle y, width and height
  in px of the input, then a score for each of C classes. Overlaps are suppressed here.
- *suppressed*: outputs `boxes` (N, 4) as x1, y1, x2, y2 in px of the input, `scores` (N,) and `labels` (N,),
  each perhaps with a leading 1: an export with its own suppression.

The file is the user's, yet nothing in it is trusted before it was checked.
"""

import ast
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.linking import Candidate
from pipeline.errors import InputError
from pipeline.files import sha256_of
from pipeline.graphs import open_session, remembered_sha256, require_self_contained
from pipeline.records import Box, RgbImage

Rows: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]
"""Sides (n, 4) in px of the network's input, scores (n,), classes (n,)."""

SUPPRESSED = ("boxes", "scores", "labels")
FREE_SIDE_PX = 640  # where the network takes any size
MAX_SIDE_PX = 2048
MAX_NETWORK_BYTES = (1 << 31) - 1  # one protobuf holds no more
MAX_CLASSES = 10_000
MAX_ROWS = 200_000
MAX_NAMES_BYTES = 1 << 20
MOST_CANDIDATES = 2_000  # that overlaps are looked for among
FARTHEST_PX = 100_000
PER_FRAME = 100
GREY = 114  # of the bars beside the picture, as these networks are trained
_CHECKS_VERSION = "detector 1"


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """`every_frames`: only each so manieth frame is looked at; boxes under `min_score` are dropped.

    Of boxes of one class that overlap by more than `suppress_iou` the best is kept.
    """

    min_score: float = 0.25
    suppress_iou: float = 0.5
    every_frames: int = 3


@dataclass(frozen=True, slots=True)
class Fit:
    """How a picture lies in the network's input: px = px of the picture * `scale` + left or top."""

    scale: float
    left_px: int
    top_px: int


def read_names(path: Path) -> tuple[str, ...]:
    """Class names, one a line, in the order of the classes. Raises InputError when it is no such file."""
    try:
        if path.stat().st_size > MAX_NAMES_BYTES:
            raise InputError(f"{path}: found more than {MAX_NAMES_BYTES:,} bytes; expected a name a line.")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not readable as UTF-8 text; expected class names, one a line.") from error
    names = tuple(line.strip() for line in text.strip().splitlines())
    if not names or not all(names) or len(names) > MAX_CLASSES:
        raise InputError(f"{path}: found {len(names)} lines; expected a name a line, 1 to {MAX_CLASSES:,}.")
    return names


def detector_sha256(path: Path) -> str:
    """SHA-256 of a network that holds all its tensors. Raises InputError when it is none."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected an ONNX detector (--detector).")
    if path.stat().st_size > MAX_NETWORK_BYTES:
        raise InputError(
            f"{path}: found {path.stat().st_size:,} bytes; expected at most {MAX_NETWORK_BYTES:,}."
        )

    def check_and_hash() -> str:
        data = path.read_bytes()
        require_self_contained(data, str(path))
        return sha256_of(data)

    return remembered_sha256([path], _CHECKS_VERSION, check_and_hash)


class Detector:
    """An open network; give it pictures of any size."""

    def __init__(self, path: Path, names: Sequence[str] = (), threads: int | None = 1) -> None:
        """Open it. `names` are the classes; without them those in the file's metadata (`names`).

        Raises InputError when the network has another layout, or another number of classes.
        """
        detector_sha256(path)
        self._path = path
        self._session = open_session(path, threads)
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        found = [output.name for output in outputs]
        self.layout = "suppressed" if set(SUPPRESSED) <= set(found) else "raw"
        if len(inputs) != 1 or (self.layout == "raw" and len(outputs) != 1):
            raise self._wrong(
                f"{len(inputs)} inputs and the outputs {', '.join(found)[:200]}",
                "one picture in, and out either one tensor (1, 4 + C, N) or boxes, scores and labels",
            )
        self._input = inputs[0].name
        shape = inputs[0].shape
        if inputs[0].type != "tensor(float)" or not _is_picture(shape):
            raise self._wrong(f"an input of {inputs[0].type} {shape}", "tensor(float) (1, 3, H, W)")
        self._height, self._width = (side if type(side) is int else FREE_SIDE_PX for side in shape[2:])
        known = self._session.get_modelmeta().custom_metadata_map.get("names", "")
        self.names = tuple(names) or self._names(known)
        if self.layout == "raw":
            rows = outputs[0].shape[1] if len(outputs[0].shape) == 3 else None
            if len(outputs[0].shape) != 3 or (type(rows) is int and rows != 4 + len(self.names)):
                raise self._wrong(
                    f"an output of {outputs[0].shape}",
                    f"(1, {4 + len(self.names)}, N): sides and {len(self.names)} named classes (--names)",
                )

    def find(self, rgb: RgbImage, settings: DetectorSettings) -> list[tuple[Box, float, str]]:
        """Boxes in pixels of the picture, cut off at its edges, with score and class, the best first.

        Raises InputError when the network cannot be run or what it gives is not what the layout says.
        """
        pixels, fit = letterbox(rgb, self._width, self._height)
        names = [*SUPPRESSED] if self.layout == "suppressed" else None
        try:
            made: list[Any] = self._session.run(names, {self._input: pixels})
        except Exception as error:  # onnxruntime's exceptions share no base but Exception
            raise self._wrong(f"that it cannot be run ({str(error)[:200]})", "a detector") from error
        sides, scores, classes = self._suppressed(*made) if names else self._raw(made[0], settings)
        best = np.argsort(-scores, kind="stable")[:MOST_CANDIDATES]
        best = best[scores[best] >= settings.min_score]
        sides, scores, classes = np.clip(sides[best], -FARTHEST_PX, FARTHEST_PX), scores[best], classes[best]
        if names is None and len(sides):
            corners = np.column_stack([sides[:, :2], sides[:, 2:] - sides[:, :2]])
            kept = cv2.dnn.NMSBoxesBatched(
                corners.tolist(), scores.tolist(), classes.tolist(), settings.min_score, settings.suppress_iou
            )
            chosen = np.asarray(kept, np.int64).ravel()
            sides, scores, classes = sides[chosen], scores[chosen], classes[chosen]
        height, width = rgb.shape[:2]
        sides = (sides - [fit.left_px, fit.top_px] * 2) / fit.scale
        sides = np.clip(sides, 0, [width, height] * 2)
        found = [
            (Box(*box), score, self.names[label])
            for box, score, label in zip(sides.tolist(), scores.tolist(), classes.tolist(), strict=True)
            if box[2] - box[0] >= 1 and box[3] - box[1] >= 1
        ]
        found.sort(key=lambda one: (-one[1], one[0].x1_px, one[0].y1_px, one[0].x2_px, one[0].y2_px, one[2]))
        return found[:PER_FRAME]

    def _raw(self, made: Any, settings: DetectorSettings) -> Rows:
        """Rows of the layout *raw* whose best class is sure enough."""
        rows = 4 + len(self.names)
        shape: Any = getattr(made, "shape", ())
        if len(shape) != 3 or shape[:2] != (1, rows) or shape[2] > MAX_ROWS or made.dtype.kind != "f":
            raise self._wrong(f"an output of shape {shape}", f"floats (1, {rows}, N), N at most {MAX_ROWS:,}")
        table = made[0].astype(np.float64)
        if not np.isfinite(table).all():
            raise self._wrong("numbers that are not finite", "finite sides and scores")
        low, high = (table[4:].min(), table[4:].max()) if table.shape[1] else (0.0, 0.0)
        if low < -1e-3 or high > 1 + 1e-3:
            raise self._wrong(f"scores from {low:.3g} to {high:.3g}", "0 to 1 (after the sigmoid)")
        classes = table[4:].argmax(axis=0)
        scores = np.clip(table[4:].max(axis=0), 0.0, 1.0)
        sure = scores >= settings.min_score
        x, y, across, down = table[:4, sure]
        sides = np.column_stack([x - across / 2, y - down / 2, x + across / 2, y + down / 2])
        return sides, scores[sure], classes[sure].astype(np.int64)

    def _suppressed(self, boxes: Any, scores: Any, labels: Any) -> Rows:
        """Rows of the layout *suppressed*."""
        shapes: list[Any] = [getattr(made, "shape", ()) for made in (boxes, scores, labels)]
        if [len(shape) for shape in shapes] == [3, 2, 2] and all(shape[0] == 1 for shape in shapes):
            boxes, scores, labels = boxes[0], scores[0], labels[0]
        count = len(scores) if scores.ndim else -1
        if (
            boxes.shape != (count, 4)
            or scores.shape != (count,)
            or labels.shape != (count,)
            or count > MAX_ROWS
        ):
            raise self._wrong(f"boxes, scores and labels of {shapes}", "(N, 4), (N,) and (N,)")
        if boxes.dtype.kind != "f" or scores.dtype.kind != "f" or labels.dtype.kind not in "iuf":
            found = ", ".join(str(made.dtype) for made in (boxes, scores, labels))
            raise self._wrong(f"boxes, scores and labels of {found}", "floats, floats and whole numbers")
        numbers = [np.asarray(made, np.float64) for made in (boxes, scores, labels)]
        if not all(np.isfinite(made).all() for made in numbers):
            raise self._wrong("numbers that are not finite", "finite sides, scores and labels")
        classes = numbers[2]
        if count and (classes.min() < 0 or classes.max() >= len(self.names)):
            raise self._wrong(
                f"labels from {classes.min():g} to {classes.max():g}",
                f"0 to {len(self.names) - 1}, as there are {len(self.names)} names (--names)",
            )
        return numbers[0], np.clip(numbers[1], 0.0, 1.0), classes.astype(np.int64)

    def _names(self, text: str) -> tuple[str, ...]:
        """The names in a file's metadata: a list, or a mapping from 0, 1, …; JSON or Python."""
        value: Any = None
        if len(text) <= MAX_NAMES_BYTES:
            for read in (json.loads, ast.literal_eval):
                try:
                    value = read(text)
                    break
                except (ValueError, SyntaxError, RecursionError, MemoryError, TypeError):
                    continue
        if isinstance(value, dict):
            ordered = {str(key): name for key, name in value.items()}
            value = [ordered.get(str(number)) for number in range(len(ordered))]
        if not isinstance(value, list) or not 1 <= len(value) <= MAX_CLASSES:
            raise self._wrong("no class names in it", "`names` in its metadata, or --names")
        if not all(isinstance(name, str) and name.strip() for name in value):
            raise self._wrong(f"the class names {str(value)[:100]}", "a text for each of 0, 1, 2, …")
        return tuple(name.strip() for name in value)

    def _wrong(self, found: str, expected: str) -> InputError:
        return InputError(f"{self._path}: found {found}; expected {expected}. See docs/proposals.md.")


def letterbox(rgb: RgbImage, width_px: int, height_px: int) -> tuple[NDArray[np.float32], Fit]:
    """A picture (H, W, 3) as (1, 3, height, width) in [0, 1], whole, centred, with grey bars."""
    high, wide = rgb.shape[:2]
    scale = min(width_px / wide, height_px / high)
    size = (max(1, round(wide * scale)), max(1, round(high * scale)))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    canvas = np.full((height_px, width_px, 3), GREY, np.uint8)
    left, top = (width_px - size[0]) // 2, (height_px - size[1]) // 2
    canvas[top : top + size[1], left : left + size[0]] = small
    pixels = canvas.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255)
    return np.ascontiguousarray(pixels), Fit(scale, left, top)


def detected_boxes(
    frames: Iterable[RgbImage], detector: Detector, settings: DetectorSettings
) -> list[Candidate]:
    """What the detector sees in the frames of a clip, (H, W, 3) each, in the frames' pixels."""
    return [
        Candidate(index, box, score, label)
        for index, rgb in enumerate(frames)
        if index % settings.every_frames == 0
        for box, score, label in detector.find(rgb, settings)
    ]


def _is_picture(shape: Sequence[Any]) -> bool:
    """Whether an input's shape is (1, 3, H, W); a side that is not stated may be any."""
    if len(shape) != 4:
        return False
    batch, channels, *sides = shape
    return (
        (type(batch) is not int or batch == 1)
        and (type(channels) is not int or channels == 3)
        and all(type(side) is not int or 32 <= side <= MAX_SIDE_PX for side in sides)
    )
