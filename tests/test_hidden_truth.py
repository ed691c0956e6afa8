"""An organiser who hides the truth: nothing in the whole built site tells of it."""

import html
import json
import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from pipeline.files import sha256_file
from sitegen.build import build_site
from sitegen.gather import gather, media_jobs, read_boxes, read_truth_by_video
from sitegen.gathered import VideoMedia, path_names
from sitegen.media import MediaSettings
from sitegen.output import MANIFEST
from sitegen.uncertainty import uncertainties
from tests.hidden_case import (
    COSINE,
    TRACK,
    TRUTH_WORDS,
    captions,
    changed,
    hiding,
    make,
    make_board,
    truth_rows,
)
from tests.site_fixtures import Board

ASSETS = "assets/"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Benchmark, Board]:
    rows = truth_rows()
    benchmark = make(tmp_path_factory.mktemp("secret") / "b", rows)
    return benchmark, make_board(benchmark, rows)


@pytest.fixture(scope="module")
def site(made: tuple[Benchmark, Board], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    build_site(hiding(made[0]), out, made[1])
    return out


@pytest.fixture(scope="module")
def open_site(made: tuple[Benchmark, Board], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("open")
    build_site(made[0], out, made[1])
    return out


def texts(site: Path) -> Iterator[tuple[str, str]]:
    """Each file of a site in every reading of it, with its name: (path, text in lower case)."""
    for path in sorted(site.rglob("*")):
        if not path.is_file():
            continue
        name = path.relative_to(site).as_posix()
        data = path.read_bytes()
        readings = [data.decode("utf-8", errors="replace"), data.decode("utf-16-le", errors="replace")]
        if path.suffix == ".parquet":
            readings.append(json.dumps(pq.read_table(path).to_pylist()))
        readings.append(html.unescape(readings[0]))
        readings.append(re.sub(r"\\u([0-9a-fA-F]{4})", lambda found: chr(int(found[1], 16)), readings[0]))
        yield name, "\n".join([name, *readings]).casefold()


def secrets() -> list[str]:
    rows = [row for row in truth_rows() if not row.is_no_hazard]
    words = {row.label for row in rows} | {row.description for row in rows} | set(TRUTH_WORDS)
    return sorted(words | {"hz-ibex", "trk-okapi", "47119", "48131", "47,119", "48,131"})


def hits(site: Path, needles: Sequence[str]) -> list[tuple[str, str]]:
    return [
        (name, needle)
        for name, text in texts(site)
        if not name.startswith(ASSETS)
        for needle in needles
        if needle.casefold() in text
    ]


def test_no_word_of_the_truth_is_anywhere(site: Path, open_site: Path) -> None:
    shown = {needle for _, needle in hits(open_site, secrets())}
    assert {"Zebraphant", "hz-ibex", "trk-okapi", "47119"} <= shown  # the search finds them
    assert hits(site, secrets()) == []


def test_nothing_says_which_videos_have_no_hazard(site: Path, open_site: Path) -> None:
    words = ["No hazard", "Rightly silent", "False alarm", "Not detected", "without a hazard"]
    assert {word for _, word in hits(open_site, words)} == set(words)
    assert {name for name, _ in hits(site, words)} <= {"method.html", "submit.html"}  # the rule


def test_what_is_left_out_of_the_search_is_of_no_benchmark(site: Path) -> None:
    templates = Path(__file__).parent.parent / "templates" / "assets"
    for path in sorted((site / "assets").rglob("*")):
        if path.is_file() and path.name != "plotly.min.js":
            assert path.read_bytes() == (templates / path.relative_to(site / "assets")).read_bytes()


def numbers_of_pairs_and_videos(board: Board) -> set[str]:
    """Cosines, similarities and scores of single videos as pages and files print them, but 0 and 1."""
    values = {COSINE}
    for standing in board:
        for pair in standing.evaluation.pairs:
            values |= {pair.cosine, pair.similarity}
        for video in standing.evaluation.videos:
            values |= {video.best, video.worst, video.mean, video.besm, video.sam}
    kept = [value for value in values if abs(value) > 1e-9 and abs(value - 1) > 1e-9]
    printed = {f"{value:.{digits}f}" for value in kept for digits in (3, 4, 5, 6)}
    return printed | {repr(value) for value in kept} | {f"{value * 100:.1f}\u202f%" for value in kept}


def totals(board: Board) -> set[str]:
    """What may be shown: scores over all videos, the ends of their intervals, how often one is first."""
    values = []
    evaluations = [standing.evaluation for standing in board]
    for evaluation, sure in zip(evaluations, uncertainties(evaluations), strict=True):
        card = evaluation.card
        values += [card.besm, card.sam, card.detection_rate, card.hazard_recall or 0.0, sure.first_share]
        for span in (sure.besm, sure.sam, sure.detection_rate, sure.hazard_recall):
            values += [span.low, span.high] if span else []
    return {f"{value:.{digits}f}" for value in values for digits in (2, 4, 6)}


def found_numbers(site: Path, numbers: set[str]) -> set[tuple[str, str]]:
    found = set()
    for name, text in texts(site):
        if name.startswith(ASSETS):
            continue
        there = set(re.findall(r"(?<![\w.])-?\d+\.\d+(?:e-?\d+)?(?:\u202f%)?(?![\w.]*\d)", text))
        found |= {(name, number) for number in there & numbers}
    return found


def test_no_cosine_and_no_score_of_a_video_is_anywhere(
    made: tuple[Benchmark, Board], site: Path, open_site: Path
) -> None:
    numbers = numbers_of_pairs_and_videos(made[1])
    shown = {number for _, number in found_numbers(open_site, numbers)}
    pairs = [pair for standing in made[1] for pair in standing.evaluation.pairs]
    assert {f"{pair.cosine:.4f}" for pair in pairs} <= shown  # the search finds them
    assert found_numbers(site, numbers - totals(made[1])) == set()


def test_numbers_of_two_digits_are_totals(made: tuple[Benchmark, Board], site: Path) -> None:
    """At two digits a cosine and a total can look alike, so every such number must be known."""
    allowed = totals(made[1]) | {"0.80"}
    for path in sorted(site.rglob("*.html")):
        if path.name in {"method.html", "submit.html"}:
            continue
        there = set(re.findall(r"(?<![\d.])\d\.\d\d(?![\d.])", path.read_text(encoding="utf-8")))
        assert there <= allowed, path
        if path.parent.name == "videos":
            assert not there, path


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_another_truth_with_the_same_totals_makes_the_same_bytes(site: Path, tmp_path: Path) -> None:
    rows, track = changed(truth_rows()), f"{TRACK}-b"
    other = make(tmp_path / "b", rows, track, left_px=70.0)
    build_site(hiding(other), tmp_path / "site", make_board(other, rows, track))
    assert contents(tmp_path / "site") == contents(site)


def test_the_pages_are_given_nothing_of_the_truth(made: tuple[Benchmark, Board]) -> None:
    """No row of truth, no pair, no video's score, no track."""
    benchmark = hiding(made[0])
    truth = read_truth_by_video(benchmark)
    media = {video_id: VideoMedia(video_id, video_id) for video_id in truth}
    data = gather(benchmark, truth, read_boxes(benchmark, truth), media, made[1])
    assert data.hidden and set(data.truth.values()) == {()} and not data.boxes
    for system in data.systems:
        assert not system.evaluation.pairs and not system.evaluation.videos
        assert system.evaluation.submission.warnings == ()
        assert not any(row.track_ids or row.frame_indices for row in system.evaluation.submission.predictions)
        assert not any(said.snippets or said.matches for said in system.records.values())
        assert any(said.stages for said in system.records.values())
    jobs = media_jobs(
        benchmark, path_names(truth), read_boxes(benchmark, truth), MediaSettings(), sha256_file
    )
    assert not any(job.boxes for job in jobs)


def test_switching_leaves_nothing_of_the_open_site(
    made: tuple[Benchmark, Board], site: Path, open_site: Path, tmp_path: Path
) -> None:
    out = tmp_path / "site"
    shutil.copytree(open_site, out)
    assert list(out.glob("media/*/c[0-9]*.webp"))
    (out / "CNAME").write_text("example.org\n", encoding="utf-8")  # of the host, at the top: stays
    build_site(hiding(made[0]), out, made[1])
    assert (out / "CNAME").exists()
    assert {**contents(site), "CNAME": b"example.org\n"} == contents(out)


def test_what_an_unknown_build_left_is_refused(
    made: tuple[Benchmark, Board], open_site: Path, tmp_path: Path
) -> None:
    out = tmp_path / "site"
    shutil.copytree(open_site, out)
    (out / MANIFEST).unlink()
    with pytest.raises(InputError, match=r"files in it are not of this build, such as "):
        build_site(hiding(made[0]), out, made[1])


def test_pages_say_so_and_still_show_scores_and_captions(made: tuple[Benchmark, Board], site: Path) -> None:
    index = (site / "index.html").read_text(encoding="utf-8")
    assert "keeps the truth of this benchmark back" in index and "Every system on every video" not in index
    for standing in made[1]:
        assert f"{standing.evaluation.card.besm:.4f}" in index
    video = (site / "videos" / "v1.html").read_text(encoding="utf-8")
    assert "The organiser keeps it back" in video and "<h1>v1</h1>" in video
    assert captions(0)[0].description in video and "What each stage said" in video and "A car." in video
    assert "clip.mp4" in video and '<svg class="boxes"' not in video
    submission = (site / "submissions" / "system-1.html").read_text(encoding="utf-8")
    assert "Constant caption" in submission and captions(1)[0].description in submission
    assert 'id="hidden"' in (site / "method.html").read_text(encoding="utf-8")
    figures = (site / "data" / "leaderboard.js").read_text(encoding="utf-8")
    assert "besm-sam" in figures and "distribution" not in figures
