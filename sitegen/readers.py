"""Outside files to records: truth and predictions as Parquet, CSV or JSON Lines, packed or not.

A file is read whole or refused with every fault in it. The columns and their meaning are those of
`TruthHazard` and `Prediction`, the same in each format. Predictions may also come as other benchmarks
write them (coool.py, outside.py).
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

from pipeline.predictions import Predictions
from pipeline.records import Prediction, TruthHazard
from sitegen import checks
from sitegen.captions import Captions, checked, some
from sitegen.cells import BAD, clean_column, missing_columns, note_repeats, unknown_columns
from sitegen.checks import Faults, visible
from sitegen.columns import COLUMNAR, RawColumns, accepted, raw_columns
from sitegen.coool import coool, twocoool
from sitegen.coool_columns import coool_predictions
from sitegen.formats import NAMES, TABLES, ending_of, format_of, prediction_format_of, refuse_other_kind
from sitegen.outside import coco, scripts
from sitegen.shards import read_shards, shards_columns, shards_sheet
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
_SHA256 = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a predictions file is read; by default its content says so.

    `source_format` is one of `FORMATS`, `caption_column` names the column of a 2COOOL file that holds
    the caption, `video_map` maps a video id of the file to the truth's. Faults call the file `name`.
    """

    source_format: str = ""
    caption_column: str = ""
    video_map: Mapping[str, str] = field(default_factory=dict)
    name: str = ""


@dataclass(frozen=True, slots=True)
class ReadPredictions:
    """What a predictions file holds, sorted by video and rank.

    `source_format` is one of `FORMATS`; `sha256` is of the file's bytes, as it came; `config_sha256` is
    the run configuration that the pipeline noted in its Parquet, else empty; `ending` is what the
    file's name should end in (`csv`, `csv.gz`, `json`), told by its content.
    """

    predictions: Sequence[Prediction]
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
    faults = Faults(visible(options.name or str(path), 1_000))
    content = content_of(path, faults)
    source_format = choose_format(content, options, faults)
    hazards = None if truth is None else list(truth)
    known = _known(hazards)
    found = by_column(content.data, source_format, known, options)
    if found is None:
        found = by_cell(content.data, source_format, known, options, faults)
    ending = ending_of(source_format)
    ending = f"{ending}.{content.packing}" if content.packing else ending
    return _read(found, source_format, content.sha256, ending, hazards)


def read_sharded(
    folder: Path, truth: Iterable[TruthHazard] | None = None, options: ReadOptions | None = None
) -> ReadPredictions:
    """The predictions in a folder of Parquet shards, as `read_predictions` gives those of one file.

    `sha256` is over the shards' names and bytes (see `read_shards`). Raises FaultsError, whose faults name
    the shard and its row.
    """
    options = options or ReadOptions()
    faults = Faults(visible(options.name or str(folder), 1_000))
    if options.source_format not in ("", "parquet") or options.caption_column:
        faults.stop("a folder", "one file of the format that was asked for", "Give the file itself.")
    shards = read_shards(folder, faults)
    hazards = None if truth is None else list(truth)
    known = _known(hazards)
    raw = shards_columns(shards, PREDICTION_COLUMNS)
    found = None if raw is None else _of_columns(raw, known, options)
    if found is None:
        found = _of_cells(shards_sheet(shards, PREDICTION_COLUMNS, faults), known, options, faults)
    return _read(found, "parquet", shards.sha256, "parquet", hazards)


def read_given(
    path: Path, truth: Iterable[TruthHazard] | None = None, options: ReadOptions | None = None
) -> ReadPredictions:
    """The predictions in a file or in a folder of shards; raises as `read_predictions` does."""
    return (read_sharded if path.is_dir() else read_predictions)(path, truth, options)


def _known(hazards: Sequence[TruthHazard] | None) -> set[str] | None:
    return None if hazards is None else {hazard.video_id for hazard in hazards}


def _read(
    found: "_Found", source_format: str, sha256: str, ending: str, hazards: Sequence[TruthHazard] | None
) -> ReadPredictions:
    warnings = [*found.warnings, *found.ids.warnings()]
    if not found.predictions:
        warnings.append("The file holds no prediction.")
    warnings += _missing_videos(found.predictions, hazards or ())
    config = found.config if _SHA256.fullmatch(found.config) else ""
    return ReadPredictions(found.predictions, source_format, sha256, tuple(warnings), config, ending)


@dataclass(frozen=True, slots=True)
class _Found:
    """The predictions in a file, and how the ids of their videos were taken; `config` is unchecked."""

    predictions: Predictions
    ids: VideoIds
    warnings: list[str]
    config: str = ""


def by_column(data: bytes, source_format: str, known: set[str] | None, options: ReadOptions) -> _Found | None:
    """What a file without any fault holds, read column by column; None when in doubt (see columns.py)."""
    if source_format == "coool":
        captions = coool_predictions(data, known, options.video_map)
        return captions and _Found(captions[0].predictions, captions[0].ids, captions[1])
    raw = raw_columns(data, source_format, PREDICTION_COLUMNS) if source_format in COLUMNAR else None
    return None if raw is None else _of_columns(raw, known, options)


def _of_columns(raw: RawColumns, known: set[str] | None, options: ReadOptions) -> _Found | None:
    found = accepted(raw, known, options.video_map)
    if found is None:
        return None
    warnings = unknown_columns(raw.names, PREDICTION_COLUMNS)
    return _Found(found.predictions, found.ids, warnings, raw.metadata.get("config_sha256", ""))


def by_cell(
    data: bytes, source_format: str, known: set[str] | None, options: ReadOptions, faults: Faults
) -> _Found:
    """What a file holds, read cell by cell. Raises FaultsError with every fault."""
    if source_format in TABLES:
        sheet = sheet_of(data, source_format, PREDICTION_COLUMNS, faults)
        return _of_cells(sheet, known, options, faults)
    captions = _captions(data, source_format, options, faults)
    ids = VideoIds(known, options.video_map, captions.rows)
    predictions = Predictions.of(_of_captions(captions, ids, faults))
    return _Found(predictions, ids, captions.warnings)


def _of_cells(sheet: Sheet, known: set[str] | None, options: ReadOptions, faults: Faults) -> _Found:
    ids = VideoIds(known, options.video_map, sheet.cells.get("video_id", ()))
    predictions = Predictions.of(_of_sheet(sheet, ids, faults))
    warnings = unknown_columns(sheet.columns, PREDICTION_COLUMNS)
    return _Found(predictions, ids, warnings, sheet.metadata.get("config_sha256", ""))


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
    missing_columns(sheet, _PREDICTION_REQUIRED, faults)
    videos = clean_column(sheet, "video_id", ids, faults)
    ranks = clean_column(sheet, "rank", lambda value: checks.whole(value, 1), faults)
    descriptions = clean_column(sheet, "description", checks.description, faults)
    labels = clean_column(sheet, "label", checks.text, faults, None)
    tracks = clean_column(sheet, "track_ids", checks.track_ids, faults, ())
    frames = clean_column(sheet, "frame_indices", checks.frame_indices, faults, ())
    note_repeats(sheet, videos, ranks, "rank", faults)
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
    missing_columns(sheet, _TRUTH_REQUIRED, faults)
    if not sheet.rows and not faults.kept:
        faults.stop("no rows", "at least one video", "Add a row for every video of the benchmark.")

    videos = clean_column(sheet, "video_id", checks.safe_identifier, faults)
    labels = clean_column(sheet, "label", checks.text, faults, "")
    descriptions = clean_column(sheet, "description", checks.description, faults, "")
    hazard_ids = clean_column(sheet, "hazard_id", checks.identifier, faults, "")
    tracks = clean_column(sheet, "track_id", checks.identifier, faults, None)
    firsts = clean_column(sheet, "first_frame", lambda value: checks.whole(value, 0), faults, None)
    lasts = clean_column(sheet, "last_frame", lambda value: checks.whole(value, 0), faults, None)
    for row, hazard_id, label, text in zip(sheet.rows, hazard_ids, labels, descriptions, strict=True):
        if label and label is not BAD and text == "":
            mend = "Describe the hazard in a sentence, or clear the label of a video without hazard."
            faults.add(row, "description", "a label without a description", "both or neither", mend)
        if hazard_id == "" and text:
            faults.add(row, "hazard_id", "an empty cell", "an id", "Number the hazards of a video 1, 2, ...")
    for row, first, last in zip(sheet.rows, firsts, lasts, strict=True):
        if isinstance(first, int) and isinstance(last, int) and last < first:
            found = f"{last}, before first_frame {first}"
            faults.add(row, "last_frame", found, "first_frame or later", "Swap or correct the two.")
    note_repeats(sheet, videos, hazard_ids, "hazard_id", faults)
    _no_hazard_alone(sheet, videos, descriptions, faults)
    _one_spelling(sheet, videos, faults)
    faults.raise_if_any()
    rows = zip(videos, hazard_ids, labels, descriptions, tracks, firsts, lasts, strict=True)
    return sorted((TruthHazard(*row) for row in rows), key=attrgetter("video_id", "hazard_id"))


def _no_hazard_alone(sheet: Sheet, videos: list[Any], descriptions: list[Any], faults: Faults) -> None:
    rows_of: dict[str, list[tuple[int, bool]]] = {}
    for row, video, text in zip(sheet.rows, videos, descriptions, strict=True):
        if video is not BAD and text is not BAD:
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
        if video is not BAD:
            before = spelled.setdefault(video.lower(), video)
            if before != video:
                found = f"'{video}' beside '{before}'"
                expected = "video ids that differ in more than case"
                faults.add(row, "video_id", found, expected, "Rename one of them.")


def _missing_videos(predictions: Predictions, truth: Iterable[TruthHazard]) -> list[str]:
    with_hazard = {hazard.video_id for hazard in truth if not hazard.is_no_hazard}
    missing = sorted(with_hazard.difference(predictions.video_ids))
    if not missing:
        return []
    return [
        f"{len(missing)} of {len(with_hazard)} videos with a hazard have no prediction and count as 0: "
        f"{some(missing)}."
    ]
