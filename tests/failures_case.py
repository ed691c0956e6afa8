"""Generated failures of generated systems, and their page in a folder, without building a site."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pipeline.config import BenchmarkSettings
from pipeline.records import Box, Kind, Prediction, TrackBox, TruthHazard
from pipeline.scores import Evaluation, Scorecard, Submission
from sitegen.contexts import Shell
from sitegen.failure_files import failure_files
from sitegen.failures import Blame, Failure, FailureKind, FunnelStep
from sitegen.gathered import SiteData, System, VideoMedia, path_names
from sitegen.page_failures import failures_page
from sitegen.rendering import environment, find_templates
from sitegen.uncertainty import Interval, Uncertainty
from tests.site_fixtures import EVIL
from tests.test_uncertainty import SIGNATURE

SHELL = Shell("Failures", "Where hazards are lost.", "", "failures", "Generated", "0")
WHO = (
    "Cat",
    "Deer",
    "Dog",
    "Cyclist",
    "Truck",
    "Tyre",
    "Goose",
    "Box",
    "Ladder",
    "Child",
    "Fog",
    "Bus",
    "Cow",
)
ALL = Interval(0.0, 1.0)
KINDS = tuple(FailureKind)
CAPTIONS = {FailureKind.WRONG_OBJECT, FailureKind.EXTRA}
ODD_ID = "odd/\u202eid <b>"


def generated(n_videos: int, n_systems: int, each: int = 1) -> tuple[SiteData, dict[str, Blame]]:
    """Systems that fail `each` times a video, by kinds in turn; texts and ids try to break out."""
    ids = sorted([f"v{number:04d}" for number in range(1, n_videos)] + [ODD_ID])
    truth = {
        video_id: tuple(
            TruthHazard(
                video_id, f"h{more}", WHO[(n + more) % len(WHO)], f"It is number {n} on the road", "7"
            )
            for more in range(each)
        )
        for n, video_id in enumerate(ids)
    }
    names = path_names(ids)
    media = {
        video_id: VideoMedia(video_id, names[video_id], 640, 480, problem="No clip.") for video_id in ids
    }
    sides = (20.0, 60.0, 200.0)
    boxes = {
        video_id: (TrackBox(video_id, 0, "7", Kind.CHALLENGE, Box(0, 0, sides[n % 3], sides[n % 3])),)
        for n, video_id in enumerate(ids)
        if n % 4
    }
    systems, blames = [], {}
    for place in range(n_systems):
        chance = np.random.default_rng(place)
        said = [
            Prediction(v, rank, f"A {WHO[int(chance.integers(13))].lower()} {place} {EVIL if n == 3 else ''}")
            for n, v in enumerate(ids)
            for rank in range(1, each + 1)
        ]
        systems.append(_system(place, said))
        failures = tuple(
            _failure(video_id, (n + place + more) % 10, float(chance.random()) * 0.8, bool(n % 5), more)
            for n, video_id in enumerate(ids)
            for more in range(each)
        )
        alive = (len(ids), len(ids) - 1, len(ids) // 2, None, len(ids) // 2, 1)
        stages = ("truth", "seen", "ranked", "merged", "anomalous", "matched")
        blames[f"system-{place}"] = Blame(
            failures, tuple(FunnelStep(stage, count) for stage, count in zip(stages, alive, strict=True))
        )
    settings = BenchmarkSettings(name="Generated")
    return SiteData(settings, truth, boxes, media, names, tuple(systems)), blames


def _system(place: int, said: list[Prediction]) -> System:
    name = f"System {place} {EVIL}" if place == 1 else f"System {place}"
    submission = Submission(name, "", "", "2026-01-02", "csv", tuple(said))
    card = Scorecard(0.5, 0.5, 0.5, 0.5, 1, SIGNATURE)
    return System(
        rank=place + 1,
        place=place + 1,
        slug=f"system-{place}",
        agents="Generated",
        is_baseline=False,
        evaluation=Evaluation(submission, (), (), card),
        uncertainty=Uncertainty(ALL, ALL, ALL, None, 1, 1, 1, 1.0),
        predictions_sha256="0" * 64,
    )


def _failure(video_id: str, kind: int, similarity: float, spoke: bool, more: int) -> Failure:
    one = KINDS[kind]
    hazard = None if one in CAPTIONS else f"h{more}"
    rank = more + 1 if spoke or hazard is None else None
    evidence = f"Frame {more} speaks of “{one.value}” in {video_id}"
    return Failure(one, video_id, hazard, rank, similarity, evidence, kind % 2 == 0)


def write_page(data: SiteData, blames: Mapping[str, Blame], folder: Path) -> Path:
    """failures.html with its assets and data, and a bare page for each video."""
    files = dict(failure_files(data, blames))
    page = failures_page(data, blames, SHELL)
    html = environment().get_template("failures.html").render(page=page, shell=SHELL)
    files["failures.html"] = html.encode()
    for path in (find_templates() / "assets").iterdir():
        files[f"assets/{path.name}"] = path.read_bytes()
    for name in data.names.values():
        files[f"videos/{name}.html"] = f"<!doctype html><title>{name}</title>".encode()
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder
