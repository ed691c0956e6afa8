"""Reads what a site is made of: truth, boxes, records of pipeline runs, clips."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from pipeline.benchmark import Benchmark
from pipeline.by_video import ByVideo, Later
from pipeline.errors import ConfigError
from pipeline.records import TrackBox, TruthHazard
from pipeline.table import metadata
from pipeline.tables import BOXES, USAGE
from sitegen import ledger
from sitegen.gathered import SiteData, System, VideoMedia, path_names
from sitegen.hiding import totals_only, videos_only, words_only
from sitegen.language import N_, Said
from sitegen.language import gettext as _
from sitegen.leaderboard import Ranked, rank
from sitegen.ledger import Entry
from sitegen.media import MediaJob, MediaSettings
from sitegen.readers import read_truth
from sitegen.restoration import read_restorations
from sitegen.run_records import read_records
from sitegen.standings import Standing
from sitegen.uncertainty import Uncertainty, require_same_signature, uncertainties
from sitegen.votes import load_votes

CLIPS = (".mp4", ".m4v", ".webm", ".mov", ".mkv", ".avi")


def read_truth_by_video(benchmark: Benchmark) -> dict[str, tuple[TruthHazard, ...]]:
    """Video id -> its truth rows."""
    rows = groupby(read_truth(benchmark.truth), lambda row: row.video_id)
    return {video_id: tuple(found) for video_id, found in rows}


def read_boxes(benchmark: Benchmark, video_ids: Iterable[str]) -> Mapping[str, tuple[TrackBox, ...]]:
    """Video id -> all boxes of it; empty when there is no table of boxes, or when the truth is hidden."""
    if benchmark.settings.hide_truth or not benchmark.boxes.is_file():
        return {}
    return ByVideo(BOXES, benchmark.boxes, set(video_ids))


def read_attribution(benchmark: Benchmark) -> str:
    """The text that says where the clips come from; empty when the settings name none.

    Raises ConfigError when the file that the settings name cannot be read.
    """
    name = benchmark.settings.attribution
    if not name:
        return ""
    path = benchmark.root / name
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: not readable ({error}); expected the text that `attribution` names."
        ) from error


def media_jobs(
    benchmark: Benchmark,
    names: Mapping[str, str],
    boxes: Mapping[str, tuple[TrackBox, ...]],
    settings: MediaSettings,
    clip_sha256: Callable[[Path], str],
) -> list[MediaJob]:
    """What every video's pictures are made of, in the order of the ids."""
    clips = {path.stem: path for path in sorted(benchmark.videos.glob("*")) if path.suffix.lower() in CLIPS}
    jobs = []
    for video_id, name in sorted(names.items()):
        clip = clips.get(video_id)
        digest = clip_sha256(clip) if clip else ""
        shown = benchmark.settings.show_videos
        jobs.append(MediaJob(video_id, name, clip, digest, Later(boxes, video_id), shown, settings))
    return jobs


def gather(
    benchmark: Benchmark,
    truth: Mapping[str, tuple[TruthHazard, ...]],
    boxes: Mapping[str, tuple[TrackBox, ...]],
    media: Mapping[str, VideoMedia],
    board: Sequence[Standing],
    as_of: str = "",
) -> SiteData:
    """All data of the site; systems best first. Raises InputError when their signatures differ.

    When the organiser keeps the truth back, nothing of it is in the data; see `hiding`. `as_of` is the
    day (ISO 8601) up to which the ledger is shown, all of it when empty.
    """
    hidden = benchmark.settings.hide_truth
    evaluations = [standing.evaluation for standing in board]
    require_same_signature(evaluations)
    unsure = uncertainties(evaluations)
    names = [evaluation.submission.name for evaluation in evaluations]
    known = dict(zip(names, zip(board, unsure, strict=True), strict=True))
    ranked = rank(evaluations, "besm", unsure)
    systems = [_system(row, *known[row.evaluation.submission.name], hidden) for row in ranked]
    on_keyframes = {}
    for video_id in boxes:
        wanted = {frame.index for frame in media[video_id].frames}
        on_keyframes[video_id] = (
            tuple(row for row in boxes[video_id] if row.frame_index in wanted) if wanted else ()
        )
    entries, ledger_file = read_ledger(benchmark, as_of)
    return SiteData(
        benchmark.settings,
        videos_only(truth) if hidden else truth,
        on_keyframes,
        media,
        path_names(truth),
        tuple(systems),
        read_attribution(benchmark),
        entries,
        ledger_file,
        load_votes(benchmark, {one.stored.slug: one.stored.predictions_sha256 for one in board}),
        restored=read_restorations(benchmark.videos),
        proposed_by=metadata(benchmark.boxes).get("proposed_by", "") if boxes else "",
    )


def read_ledger(benchmark: Benchmark, as_of: str) -> tuple[tuple[Entry, ...], bytes]:
    """The ledger's entries up to a day, and their lines as they lie on disk; nothing when there is none."""
    path = benchmark.submissions / ledger.FILE_NAME
    if not path.is_file():
        return (), b""
    entries = ledger.until(ledger.read(benchmark.submissions), as_of)
    lines = path.read_bytes().splitlines(keepends=True)
    return tuple(entries), b"".join(lines[: len(entries)])


def _system(row: Ranked, standing: Standing, uncertainty: Uncertainty, hidden: bool) -> System:
    stored, evaluation = standing.stored, standing.evaluation
    records = read_records(stored.folder)
    usage = stored.folder / f"{USAGE.name}.parquet"
    facts = (
        (N_("SHA-256 of the file as it came"), stored.original_sha256),
        (N_("SHA-256 of the predictions"), stored.predictions_sha256),
        (N_("SHA-256 of the configuration"), stored.config_sha256),
    )
    agents = stored.agents or Said(lambda: _("Not stated"))
    return System(
        rank=row.rank,
        place=row.place,
        slug=stored.slug,
        agents=agents,
        is_baseline="baseline" in agents.casefold(),
        evaluation=totals_only(evaluation) if hidden else evaluation,
        uncertainty=uncertainty,
        predictions_sha256=stored.predictions_sha256,
        facts=facts,
        records=words_only(records) if hidden else records,
        probes=standing.probes,
        history=standing.history,
        usage=tuple(USAGE.read(usage)) if usage.is_file() else (),
        licence=stored.licence,
        notes=stored.notes,
        rehearsed=standing.rehearsed,
    )
