"""Reads what a dataset card tells from a benchmark's folder."""

import csv
from collections import Counter
from pathlib import Path

from pipeline.benchmark import Benchmark
from pipeline.data.clip_facts import CACHE, clip_files, survey
from pipeline.errors import InputError
from pipeline.execute import default_workers
from sitegen.card import Card
from sitegen.checks import Faults
from sitegen.data_check_run import figures_of_clips, inputs_of, read_boxes, stored_check
from sitegen.data_figures import truth_figures
from sitegen.formats import format_of
from sitegen.gather import read_attribution
from sitegen.readers import read_truth
from sitegen.sheets import sheet_of
from sitegen.unpack import content_of

_AUTHORS = ("author", "annotator")


def read_card(benchmark: Benchmark, licence: str, splits: Path | None) -> Card:
    """Everything that the card of a benchmark tells. Raises InputError when a file cannot be read.

    Clips that the last check knows are not decoded again; for the others their packets are counted.
    """
    truth = read_truth(benchmark.truth)
    ids = {row.video_id for row in truth}
    hidden = benchmark.settings.hide_truth
    boxes = read_boxes(benchmark.boxes, False)
    clips = None
    if benchmark.videos.is_dir():
        files = clip_files(benchmark.videos)
        found = survey(files, benchmark.root / CACHE, decode=False, workers=default_workers(), keep=False)
        clips = [clip for clip in found if clip.video_id in ids]
    inputs = inputs_of(truth, benchmark.boxes, {clip.video_id: clip.sha256 for clip in clips or ()})
    check = None if hidden else stored_check(benchmark.root, inputs)
    return Card(
        name=benchmark.settings.name,
        description=benchmark.settings.description,
        licence=licence,
        videos=len(ids),
        truth=None if hidden else truth_figures(truth),
        clips=None if clips is None else figures_of_clips(clips),
        videos_with_boxes=None if boxes is None else len(ids & set(boxes)),
        annotators=() if hidden else _annotators(benchmark.truth),
        parts=_parts(splits, ids) if splits else (),
        findings=check.findings if check and check.is_current else None,
        attribution=read_attribution(benchmark),
    )


def _annotators(path: Path) -> list[tuple[str, int]]:
    """Who described how many rows, where the truth has a column for that; most first."""
    faults = Faults(str(path))
    content = content_of(path, faults)
    source_format = format_of(content.data, content.name, faults)
    cells = sheet_of(content.data, source_format, _AUTHORS, faults).cells
    column = next((cells[name] for name in _AUTHORS if name in cells), [])
    names = Counter(str(cell).strip() for cell in column if cell is not None and str(cell).strip())
    return sorted(names.items(), key=lambda entry: (-entry[1], entry[0]))


def _parts(path: Path, ids: set[str]) -> list[tuple[str, int]]:
    """The parts of a CSV that `data split` wrote, the largest first."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as source:
            rows = list(csv.DictReader(source))
        parts = {row["video_id"]: row["part"] or "" for row in rows}
    except (OSError, UnicodeDecodeError, csv.Error, KeyError) as error:
        raise InputError(
            f"{path}: not readable as a split ({error}); expected a CSV with video_id and part."
        ) from error
    if missing := sorted(ids - parts.keys()):
        raise InputError(
            f"{path}: {len(missing)} videos of the truth are in no part, such as {missing[0]}. "
            "Split again: coooler data split."
        )
    return sorted(Counter(parts[name] for name in ids).items(), key=lambda entry: (-entry[1], entry[0]))
