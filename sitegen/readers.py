"""Outside files to records: truth and predictions as Parquet, CSV or JSON Lines, packed or not.

A file is read whole or refused with every fault in it. The columns and their meaning are those of
`TruthHazard` and `Prediction`, the same in each format. Predictions may also come as other benchmarks
write them (coool.py, outside.py).
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

from pipeline.records import Prediction, TruthHazard
from sitegen import checks
from sitegen.captions import Captions, checked, some
from sitegen.checks import Faults, Wrong, is_missing, visible
from sitegen.coool import coool, twocoool
from sitegen.formats import NAMES, TABLES, ending_of, format_of, prediction_format_of, refuse_other_kind
from sitegen.outside import coco, scripts
from sitegen.sheets import Sheet, sheet_of
from sitegen.texts import limit_rows
from sitegen.unpack import Content, content_of
from sitegen.video_ids import VideoIds, read_video_map

__all__ = [
    "FORMATS",
    "PREDICTION_COLUMNS",
    "ReadOptions",
    "ReadPredictions",
    "choose_format",
    "read_predictions",
    "read_truth",
    "read_video_map",
]

FORMATS = tuple(NAMES)
PREDICTION_COLUMNS = ("video_id", "rank", "description", "label", "track_ids", "frame_indices")
TRUTH_COLUMNS = ("video_id", "hazard_id", "label", "description", "track_id", "first_frame", "last_frame")

_PREDICTION_REQUIRED = PREDICTION_COLUMNS[:3]
_TRUTH_REQUIRED = TRUTH_COLUMNS[:4]
_SHOWN_COLUMNS = 20
_SHA256 = re.compile(r"[0-9a-f]{64}")
_TEXTS = {str, type(None)}
_NUMBERS = {int, type(None)}
_BAD: Any = object()  # a cell whose fault is already noted


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a predictions file is read; by default its content says so.

    `source_format` is one of `FORMATS`, `caption_column` names the column of a 2COOOL file that holds
    the caption, `video_map` maps a video id of the file to the truth's.
    """

    source_format: str = ""
    caption_column: str = ""
    video_map: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ReadPredictions:
    """What a predictions file holds, sorted by video and rank.

    `source_format` is one of `FORMATS`; `sha256` is of the file's bytes, as it came; `config_sha256` is
    the run configuration that the pipeline noted in its Parquet, else empty; `ending` is what the
    file's name should end in (`csv`, `csv.gz`, `json`), told by its content.
    """

    predictions: tuple[Prediction, ...]
    source_format: str
    sha256: str
    warnings: tuple[str, ...]
    config_sha256: str = ""
    ending: str = ""


def read_predictions(
    path: Path, truth: Iterable[TruthHazard] | None = None, options: ReadOptions | None = None
) -> ReadPredictions:
    """The predictions in a file; with `truth`, their videos must be among its videos.

    A file with a header but no rows is accepted with a warning: it predicts nothing. Hazard videos
    of the truth that have no prediction are a warning. Raises FaultsError with every fault.
    """
    options = options or ReadOptions()
    faults = Faults(visible(str(path), 1_000))
    content = content_of(path, faults)
    source_format = choose_format(content, options, faults)
    hazards = None if truth is None else list(truth)
    known = None if hazards is None else {hazard.video_id for hazard in hazards}
    if source_format in TABLES:
        sheet = sheet_of(content.data, source_format, PREDICTION_COLUMNS, faults)
        ids = VideoIds(known, options.video_map, sheet.cells.get("video_id", ()))
        predictions = _of_sheet(sheet, ids, faults)
        warnings = _unknown_columns(sheet, PREDICTION_COLUMNS)
        config = sheet.metadata.get("config_sha256", "")
    else:
        captions = _captions(content.data, source_format, options, faults)
        ids = VideoIds(known, options.video_map, captions.rows)
        predictions = _of_captions(captions, ids, faults)
        warnings = captions.warnings
        config = ""
    predictions.sort(key=attrgetter("video_id", "rank"))
    warnings += ids.warnings()
    if not predictions:
        warnings.append("The file holds no prediction.")
    warnings += _missing_videos(predictions, hazards or ())
    ending = ending_of(source_format)
    return ReadPredictions(
        tuple(predictions),
        source_format,
        content.sha256,
        tuple(warnings),
        config if _SHA256.fullmatch(config) else "",
        f"{ending}.{content.packing}" if content.packing else ending,
    )


def choose_format(content: Content, options: ReadOptions, faults: Faults) -> str:
    """The format that was asked for, else the one that the content looks like.

    Raises FaultsError when the content is no predictions file, or not of the format that was asked for.
    """
    asked = options.source_format
    if not asked:
        found = prediction_format_of(content.data, content.name, faults, options.caption_column)
    elif asked in NAMES:
        refuse_other_kind(content.data, asked, faults)
        found = asked
    else:
        faults.stop(f"no format '{visible(asked)}'", f"one of {', '.join(NAMES)}", "Ask for one of these.")
    if options.caption_column and found != "2coool":
        mend = "Leave the caption column out, or ask for the format 2coool."
        faults.stop(f"{NAMES[found]}, and a caption column chosen", "2COOOL results", mend)
    return found


def _captions(data: bytes, source_format: str, options: ReadOptions, faults: Faults) -> Captions:
    if source_format == "2coool":
        return twocoool(data, options.caption_column, faults)
    read = {"coool": coool, "scripts": scripts, "coco": coco}
    return read[source_format](data, faults)


def _of_captions(captions: Captions, ids: VideoIds, faults: Faults) -> list[Prediction]:
    """The predictions of an outside format, with the truth's video ids."""
    limit_rows(len(captions.predictions), faults)
    videos = {raw: checked(ids, raw, faults, row, captions.column) for raw, row in captions.rows.items()}
    faults.raise_if_any()
    return [
        row if videos[row.video_id] == row.video_id else replace(row, video_id=videos[row.video_id] or "")
        for row in captions.predictions
    ]


def _of_sheet(sheet: Sheet, ids: VideoIds, faults: Faults) -> list[Prediction]:
    """The predictions of a file with our columns."""
    _missing_columns(sheet, _PREDICTION_REQUIRED, faults)
    videos = _column(sheet, "video_id", ids, faults)
    ranks = _column(sheet, "rank", lambda value: checks.whole(value, 1), faults)
    descriptions = _column(sheet, "description", checks.description, faults)
    labels = _column(sheet, "label", checks.text, faults, None)
    tracks = _column(sheet, "track_ids", checks.track_ids, faults, ())
    frames = _column(sheet, "frame_indices", checks.frame_indices, faults, ())
    _unique(sheet, videos, ranks, "rank", faults)
    faults.raise_if_any()
    rows = zip(videos, ranks, descriptions, labels, tracks, frames, strict=True)
    return [Prediction(*row) for row in rows]


def read_truth(path: Path) -> list[TruthHazard]:
    """The truth in a file, sorted by video and hazard.

    A row without label and description says that its video has no hazard, and must be the video's
    only row; its `hazard_id` may be empty. Raises FaultsError with every fault.
    """
    faults = Faults(visible(str(path), 1_000))
    content = content_of(path, faults)
    source_format = format_of(content.data, content.name, faults)
    sheet = sheet_of(content.data, source_format, TRUTH_COLUMNS, faults)
    _missing_columns(sheet, _TRUTH_REQUIRED, faults)
    if not sheet.rows and not faults.kept:
        faults.stop("no rows", "at least one video", "Add a row for every video of the benchmark.")

    videos = _column(sheet, "video_id", checks.safe_identifier, faults)
    labels = _column(sheet, "label", checks.text, faults, "")
    descriptions = _column(sheet, "description", checks.description, faults, "")
    hazard_ids = _column(sheet, "hazard_id", checks.identifier, faults, "")
    tracks = _column(sheet, "track_id", checks.identifier, faults, None)
    firsts = _column(sheet, "first_frame", lambda value: checks.whole(value, 0), faults, None)
    lasts = _column(sheet, "last_frame", lambda value: checks.whole(value, 0), faults, None)
    for row, hazard_id, label, text in zip(sheet.rows, hazard_ids, labels, descriptions, strict=True):
        if label and label is not _BAD and text == "":
            mend = "Describe the hazard in a sentence, or clear the label of a video without hazard."
            faults.add(row, "description", "a label without a description", "both or neither", mend)
        if hazard_id == "" and text:
            faults.add(row, "hazard_id", "an empty cell", "an id", "Number the hazards of a video 1, 2, ...")
    for row, first, last in zip(sheet.rows, firsts, lasts, strict=True):
        if isinstance(first, int) and isinstance(last, int) and last < first:
            found = f"{last}, before first_frame {first}"
            faults.add(row, "last_frame", found, "first_frame or later", "Swap or correct the two.")
    _unique(sheet, videos, hazard_ids, "hazard_id", faults)
    _no_hazard_alone(sheet, videos, descriptions, faults)
    _one_spelling(sheet, videos, faults)
    faults.raise_if_any()
    rows = zip(videos, hazard_ids, labels, descriptions, tracks, firsts, lasts, strict=True)
    return sorted((TruthHazard(*row) for row in rows), key=attrgetter("video_id", "hazard_id"))


def _column(
    sheet: Sheet, name: str, check: Callable[[Any], Any], faults: Faults, missing: Any = _BAD
) -> list[Any]:
    """The clean values of a column, `_BAD` where a fault was noted.

    A cell that holds nothing becomes `missing`; left at `_BAD`, the column is required and `check`
    words the fault. Equal texts and numbers are checked once: ids, ranks and captions repeat.
    """
    cells = sheet.cells.get(name)
    if cells is None:
        return [_BAD if name in faults.kept else missing] * len(sheet.rows)
    kinds = set(map(type, cells))
    results: Iterator[Any] = (_result(value, check, missing) for value in cells)
    if kinds <= _TEXTS or kinds <= _NUMBERS:
        of_value = {value: _result(value, check, missing) for value in dict.fromkeys(cells)}
        results = map(of_value.__getitem__, cells)
        if Wrong not in set(map(type, of_value.values())):
            return list(results)
    clean: list[Any] = []
    for row, result in zip(sheet.rows, results, strict=True):
        is_wrong = type(result) is Wrong
        if is_wrong:
            faults.add(row, name, result.found, result.expected, result.mend)
        clean.append(_BAD if is_wrong else result)
    return clean


def _result(value: Any, check: Callable[[Any], Any], missing: Any) -> Any:
    """The clean value of a cell, or what is wrong with it."""
    try:
        return missing if missing is not _BAD and is_missing(value) else check(value)
    except Wrong as wrong:
        return wrong.with_traceback(None)


def _missing_columns(sheet: Sheet, required: Sequence[str], faults: Faults) -> None:
    if not sheet.columns and faults.kept:  # no line could be read, so nothing is known of columns
        return
    spelled = {name.strip().lower().replace(" ", "_").replace("-", "_"): name for name in sheet.columns}
    for name in required:
        if name not in sheet.columns:
            near = spelled.get(name)
            found = f"the columns {', '.join(visible(column) for column in sheet.columns[:_SHOWN_COLUMNS])}"
            mend = f"Rename '{visible(near)}' to '{name}'." if near else "Add the column."
            faults.add(None, name, f"no such column, but {found}", f"a column `{name}`", mend)


def _unknown_columns(sheet: Sheet, known: Sequence[str]) -> list[str]:
    unknown = [visible(name) for name in sheet.columns if name not in known]
    if not unknown:
        return []
    return [f"Ignored unknown columns: {some(unknown)}."]


def _unique(sheet: Sheet, videos: list[Any], numbers: list[Any], column: str, faults: Faults) -> None:
    first_row: dict[tuple[Any, Any], int] = {}
    for row, key in zip(sheet.rows, zip(videos, numbers, strict=True), strict=True):
        before = first_row.setdefault(key, row)
        if before != row and _BAD not in key and key[1] != "":
            again = f"{column} '{visible(str(key[1]))}' again"
            found = f"{again} in video '{visible(key[0])}' (first in row {before})"
            faults.add(row, column, found, f"each {column} once in a video", "Renumber or remove the row.")


def _no_hazard_alone(sheet: Sheet, videos: list[Any], descriptions: list[Any], faults: Faults) -> None:
    rows_of: dict[str, list[tuple[int, bool]]] = {}
    for row, video, text in zip(sheet.rows, videos, descriptions, strict=True):
        if video is not _BAD and text is not _BAD:
            rows_of.setdefault(video, []).append((row, text == ""))
    for video, rows in rows_of.items():
        if len(rows) > 1:
            for row in [row for row, is_no_hazard in rows if is_no_hazard]:
                found = f"a no-hazard row, but {len(rows)} rows for video '{video}'"
                mend = "Describe the hazard, or leave one of the rows out."
                faults.add(row, "description", found, "one row for a video without hazard", mend)


def _one_spelling(sheet: Sheet, videos: list[Any], faults: Faults) -> None:
    """Ids that differ only in case would name one page on many file systems."""
    spelled: dict[str, str] = {}
    for row, video in zip(sheet.rows, videos, strict=True):
        if video is not _BAD:
            before = spelled.setdefault(video.lower(), video)
            if before != video:
                found = f"'{video}' beside '{before}'"
                expected = "video ids that differ in more than case"
                faults.add(row, "video_id", found, expected, "Rename one of them.")


def _missing_videos(predictions: Sequence[Prediction], truth: Iterable[TruthHazard]) -> list[str]:
    predicted = {prediction.video_id for prediction in predictions}
    with_hazard = {hazard.video_id for hazard in truth if not hazard.is_no_hazard}
    missing = sorted(with_hazard - predicted)
    if not missing:
        return []
    return [
        f"{len(missing)} of {len(with_hazard)} videos with a hazard have no prediction and count as 0: "
        f"{some(missing)}."
    ]
