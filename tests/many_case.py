"""A benchmark of more videos than one page holds, none with a clip, and its site."""

from dataclasses import replace
from pathlib import Path

from pipeline.benchmark import open_benchmark
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Submission
from sitegen.build import put_pages
from sitegen.evaluate import evaluate, truth_sha256
from sitegen.gather import gather
from sitegen.gathered import SiteData, VideoMedia, path_names
from sitegen.output import open_output
from sitegen.standings import Standing
from sitegen.submissions import StoredSubmission
from tests.site_fixtures import EVIL, WordEmbedder

VIDEOS = 450
THINGS = ("cat", "dog", "deer", "tyre", "ladder")


def made_truth(videos: int = VIDEOS) -> dict[str, tuple[TruthHazard, ...]]:
    """Things by turns; every ninth video has no hazard, v0010 two of them, and v0011 a hostile one."""
    truth = {}
    for number in range(videos):
        name, thing = f"v{number:04}", THINGS[number % len(THINGS)]
        row = TruthHazard(name, "1", thing, f"A {thing} on the road")
        truth[name] = (replace(row, label="", description="") if number % 9 == 8 else row,)
    truth["v0010"] = (*truth["v0010"], TruthHazard("v0010", "2", "Deer", "A deer waits"))
    truth["v0011"] = (TruthHazard("v0011", "1", EVIL, f"A {EVIL} ahead"),)
    return truth


def made_data(root: Path, videos: int = VIDEOS, *, hidden: bool = False) -> SiteData:
    """One system is right on all but cats, one on deer only; both say nothing where there is nothing."""
    settings = 'name = "Many"\n' + ("hide_truth = true\n" if hidden else "")
    (root / "coooler.toml").write_text(settings, encoding="utf-8")
    truth = made_truth(videos)
    rows = [row for found in truth.values() for row in found]
    names = path_names(truth)
    media = {video_id: VideoMedia(video_id, name, problem="No clip") for video_id, name in names.items()}
    board = []
    for name, known in (("Broad", THINGS[1:]), ("Narrow", ("deer",))):
        said = tuple(
            Prediction(row.video_id, int(row.hazard_id), row.description)
            for row in rows
            if row.label.casefold() in known
        )
        submission = Submission(name, "", "", "2026-01-01", "csv", said)
        stored = StoredSubmission(name.lower(), root, submission, "", name, "0" * 64, "", ())
        board.append(Standing(stored, evaluate(submission, rows, WordEmbedder(), 0.8, truth_sha256(rows))))
    return gather(open_benchmark(root), truth, {}, media, board)


def make_site(root: Path, out: Path, *, hidden: bool = False) -> None:
    """The whole site, written."""
    output = open_output(out)
    digest = put_pages(output, made_data(root, hidden=hidden), None, lambda what, done, total: None)
    output.finish(digest, {}, "", {})
