"""COOOL's annotations and a folder of its videos, as the tables that everything else reads.

The pickle is in memory once; from it, one video at a time becomes columns, is checked, and goes to disk.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.data.coool_checks import check_against, check_tracks
from pipeline.data.coool_pickle import Finding, Oddity, VideoBoxes, Wrong, read_video, shown
from pipeline.data.unpickle import MAX_PICKLE_BYTES, load_plain
from pipeline.errors import Fault, FaultsError, InputError, VideoError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.files import replacing, sha256_file
from pipeline.places import Place
from pipeline.records import Kind, VideoFile
from pipeline.run import SAFE_ID, find_videos, video_id_of
from pipeline.table import SCHEMA_VERSION
from pipeline.tables import BOXES, VIDEO_FILES
from pipeline.video import probe

REPORT_NAME, VIDEOS_NAME = "import-report.json", "videos.parquet"
TOLD_FAULTS = 50
LISTED_FINDINGS = 1_000

Said = Callable[[str, int, int], None]


@dataclass(slots=True)
class ImportReport:
    """What was imported, and all that was odd about it.

    `counts` are findings by kind; `findings` lists the first 1,000 of each kind. The lists of videos are
    None where no folder of videos was given, so that sizes and frame counts could not be checked.
    `unreadable` says why, by video.
    """

    annotated_videos: int = 0
    annotated_frames: int = 0
    boxes: int = 0
    challenge_boxes: int = 0
    tracks: int = 0
    missing_videos: list[str] | None = None
    videos_without_annotations: list[str] | None = None
    unreadable: dict[str, str] | None = None
    counts: Counter[Oddity] = field(default_factory=Counter)
    findings: list[Finding] = field(default_factory=list)

    def add(self, finding: Finding) -> None:
        """Count a finding, and list it while its kind's list is short."""
        self.counts[finding.oddity] += 1
        if self.counts[finding.oddity] <= LISTED_FINDINGS:
            self.findings.append(finding)

    def as_dict(self) -> dict[str, Any]:
        """The report for JSON: findings by kind, each with its count and the first 1,000."""
        plain = asdict(self)
        listed = plain.pop("findings")
        del plain["counts"]
        return {
            "schema_version": SCHEMA_VERSION,
            **plain,
            "findings": {
                oddity.name.lower(): {
                    "meaning": str(oddity),
                    "count": self.counts[oddity],
                    "listed": [
                        {name: value for name, value in finding.items() if name != "oddity"}
                        for finding in listed
                        if finding["oddity"] is oddity
                    ],
                }
                for oddity in Oddity
                if self.counts[oddity]
            },
        }


def import_coool(
    source: Path, boxes: Path, videos: Path | None, *, replace: bool = False, workers: int = 1, said: Said
) -> ImportReport:
    """Write the `boxes` table, and beside it `videos.parquet` and `import-report.json`.

    `source` is the pickle, or the same as JSON by its suffix `.json`; without a folder of `videos` there
    is no `videos.parquet`. `said(what, done, of)` hears of the progress. All files are written or none,
    the same bytes for any number of `workers`. Raises InputError when `boxes` is there and not to be
    replaced or the pickle is refused, and FaultsError with every fault of its form.
    """
    if boxes.exists() and not replace:
        raise InputError(
            f"{boxes}: is there already; expected no such file. Give --replace to write it anew, or --out."
        )
    found = None if videos is None else find_videos(Place(str(videos)))
    said("reading annotations", 0, 1)
    annotations = _annotations(source)
    said("reading annotations", 1, 1)
    report = ImportReport(annotated_videos=len(annotations))
    files: dict[str, VideoFile] = {}
    if found is not None:
        files, report.unreadable = _probe_all(found, workers, said)
        there = {video_id_of(place) for place in found}
        report.missing_videos = sorted(annotations.keys() - there)
        report.videos_without_annotations = sorted(there - annotations.keys())
    with ExitStack() as stack:
        # The last to be renamed is the first given: where the boxes are, the rest is.
        boxes_path = stack.enter_context(replacing(boxes))
        report_path = stack.enter_context(replacing(boxes.parent / REPORT_NAME))
        if found is not None:
            videos_path = stack.enter_context(replacing(boxes.parent / VIDEOS_NAME))
            videos_path.write_bytes(VIDEO_FILES.to_bytes(files.values()))
        _write_boxes(boxes_path, str(source), annotations, files, report, said)
        text = json.dumps(report.as_dict(), indent=1, ensure_ascii=False, allow_nan=False)
        report_path.write_text(text + "\n", encoding="utf-8")
    return report


def _annotations(source: Path) -> dict[str, Any]:
    """Frames by video id. Raises InputError or FaultsError when it is another form."""
    content = _json(source) if source.suffix.lower() == ".json" else load_plain(source)
    if not isinstance(content, dict):
        raise InputError(
            f"{source}: found {shown(content)}; expected a dict of videos, as COOOL's pickle has."
        )
    wrong = [
        Wrong(
            f"video {shown(key)}", "this id", "a text of at most 128 of A-Z a-z 0-9 . _ -, such as video_0001"
        )
        for key in content
        if not (isinstance(key, str) and SAFE_ID.fullmatch(key))
    ]
    if wrong:
        raise _faults(str(source), wrong, len(wrong))
    return content


def _json(source: Path) -> Any:
    try:
        if source.stat().st_size > MAX_PICKLE_BYTES:
            raise InputError(f"{source}: larger than {MAX_PICKLE_BYTES:,} bytes. Split the file by video.")
        return json.loads(source.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{source}: cannot be read as JSON ({str(error)[:80]}); expected UTF-8.") from error


def _faults(source: str, wrong: Sequence[Wrong], count: int) -> FaultsError:
    mend = "Correct the annotations at their source."
    faults = [
        Fault(f"{source}, {w.place}", None, None, w.found, w.expected, mend) for w in wrong[:TOLD_FAULTS]
    ]
    if count > len(faults):
        faults.append(Fault(source, None, None, f"{count - len(faults):,} more faults", "none", mend))
    return FaultsError(faults)


def _probe_all(
    places: Sequence[Place], workers: int, said: Said
) -> tuple[dict[str, VideoFile], dict[str, str]]:
    """What is known of the videos, by id in order, and why others cannot be read."""
    executor = ProcessExecutor(workers) if workers > 1 and len(places) > 1 else SerialExecutor()
    files: dict[str, VideoFile] = {}
    unreadable: dict[str, str] = {}
    for done, result in enumerate(executor.run(_probe, places, _lost), start=1):
        if isinstance(result, VideoFile):
            files[result.video_id] = result
        else:
            unreadable[result[0]] = result[1]
        said("looking at videos", done, len(places))
    return dict(sorted(files.items())), dict(sorted(unreadable.items()))


def _probe(place: Place) -> VideoFile | tuple[str, str]:
    path, video_id = Path(place.where), video_id_of(place)
    try:
        video = probe(path, video_id)
    except VideoError as error:
        # The report is the same wherever the folder lies.
        return video_id, str(error).replace(str(path), path.name)
    return VideoFile(
        video_id,
        path.name,
        video.frame_count,
        video.fps_hz,
        video.width_px,
        video.height_px,
        sha256_file(path),
    )


def _lost(place: Place, why: str) -> tuple[str, str]:
    return video_id_of(place), f"{place.name}: {why}"


def _write_boxes(
    path: Path,
    source: str,
    annotations: dict[str, Any],
    files: Mapping[str, VideoFile],
    report: ImportReport,
    said: Said,
) -> None:
    """One row group a video, in order; fills the report. Raises FaultsError after all videos were read."""
    wrong: list[Wrong] = []
    faults = 0
    marks = {"schema_version": SCHEMA_VERSION, "table": BOXES.name}
    schema = BOXES.schema.with_metadata(marks)
    with pq.ParquetWriter(path, schema, compression="zstd", compression_level=3) as writer:
        total = len(annotations)
        for done, video_id in enumerate(sorted(annotations), start=1):
            # Each is given back as soon as it is read.
            boxes = read_video(video_id, annotations.pop(video_id))
            faults += len(boxes.wrong)
            wrong += boxes.wrong[: TOLD_FAULTS - len(wrong)]
            if not faults:
                _report_video(report, boxes, files.get(video_id))
                if boxes.track_ids:
                    writer.write_table(_columns(boxes, schema))
            said("writing boxes", done, total)
    if wrong:
        raise _faults(source, wrong, faults)


def _report_video(report: ImportReport, boxes: VideoBoxes, file: VideoFile | None) -> None:
    report.annotated_frames += len(boxes.frames)
    report.boxes += len(boxes.track_ids)
    report.challenge_boxes += int(boxes.is_challenge.sum())
    report.tracks += len(set(boxes.track_ids))
    findings: Iterable[Finding] = [*boxes.findings, *check_tracks(boxes)]
    for finding in findings:
        report.add(finding)
    if file is not None:
        for finding in check_against(boxes, file):
            report.add(finding)


def _columns(boxes: VideoBoxes, schema: pa.Schema) -> pa.Table:
    """The rows of BOXES, by column and not by record."""
    count = len(boxes.track_ids)
    return pa.Table.from_arrays(
        [
            pa.array([boxes.video_id] * count, pa.string()),
            pa.array(boxes.frame_index.astype(np.int32)),
            pa.array(boxes.track_ids, pa.string()),
            pa.array(np.where(boxes.is_challenge, str(Kind.CHALLENGE), str(Kind.TRAFFIC)), pa.string()),
            *(pa.array(np.ascontiguousarray(column)) for column in boxes.boxes_px.T),
        ],
        schema=schema,
    )
