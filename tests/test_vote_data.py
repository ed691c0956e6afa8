"""What the voting page is given: sides, shards, the schedule's index; nothing of the truth."""

import json
from dataclasses import replace
from typing import Any

import pytest

from pipeline.config import BenchmarkSettings
from pipeline.records import Prediction, TruthHazard
from pipeline.scores import Evaluation, Scorecard, Signature, Submission
from sitegen.contexts import Shell
from sitegen.gathered import KeyframePicture, SiteData, System, VideoMedia
from sitegen.page_vote import INDEX_FILE, SHARD_BYTES, candidates, vote_files, vote_page
from sitegen.rendering import environment
from sitegen.uncertainty import Interval, Uncertainty
from tests.site_fixtures import EVIL

SHELL = Shell("Vote", "About", "", "vote", "Bench", "0")
SECRET = "a moose that nobody names"


def system(name: str, said: dict[str, list[str]], **changes: Any) -> System:
    rows = tuple(
        Prediction(video_id, rank, text)
        for video_id, texts in said.items()
        for rank, text in enumerate(texts, start=1)
    )
    card = Scorecard(0.0, 0.0, 0.0, 0.0, 1, Signature("1", "e", "e" * 64, "0123456789ab" + "c" * 52, 1, 0.8))
    span = Interval(0.0, 0.0)
    return System(
        1,
        1,
        name.lower(),
        "",
        False,
        Evaluation(Submission(name, "", "", "", "csv", rows), (), (), card),
        Uncertainty(span, span, span, span, 1, 1, 1, 1.0),
        name.lower() * 64,
        **changes,
    )


def media(video_id: str, clip: bool = True, frames: int = 25) -> VideoMedia:
    folder = f"media/{video_id}"
    made = tuple(
        KeyframePicture(n, n / 10, f"{folder}/t{n:06d}.webp", f"{folder}/f{n:06d}.jpg") for n in range(frames)
    )
    return VideoMedia(
        video_id,
        video_id,
        640,
        360,
        30,
        10.0,
        made,
        (),
        min(2, frames - 1),
        "",
        f"{folder}/clip.mp4" if clip else "",
    )


def site(*systems: System, clip: bool = True, frames: int = 25, videos: int = 3, **settings: Any) -> SiteData:
    ids = [f"v{n:04d}" for n in range(1, videos + 1)]
    return SiteData(
        BenchmarkSettings(name="Bench </script>", **settings),
        {video_id: (TruthHazard(video_id, "h1", "Moose", SECRET),) for video_id in ids},
        {},
        {video_id: media(video_id, clip, frames) for video_id in ids},
        {video_id: video_id for video_id in ids},
        systems,
    )


def read(data: SiteData) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The index, and every shard's videos in their order."""
    files = dict(vote_files(data))
    index = json.loads(files.pop(INDEX_FILE).decode().removeprefix("window.COOOLER_VOTES = ").rstrip(";\n"))
    entries: list[dict[str, Any]] = []
    for number, start in enumerate(index["first"]):
        text = files.pop(f"data/votes/{number}.js").decode()
        assert start == len(entries) and "<" not in text
        entries += json.loads(text.removeprefix(f"COOOLER_VOTE_SHARD({number},").removesuffix(");\n"))
    assert not files
    return index, entries


def test_sides_are_shown_once_and_equal_ones_never_compared() -> None:
    a = system("A", {"v0001": ["A cat", "A dog"], "v0002": ["A car"]})
    b = system("B", {"v0001": ["a  DOG", "A cat "], "v0002": ["A car"], "v0003": []})
    c = system("C", {"v0001": ["A cat"], "v0002": ["A car"]})
    data = site(c, a, b)
    (one,) = candidates(data)
    assert one.video_id == "v0001" and one.choices == 1
    index, entries = read(data)
    assert [row[:2] for row in index["systems"]] == [["a", "A"], ["b", "B"], ["c", "C"]]  # not as ranked
    assert index["truth"] == "0123456789ab" and index["benchmark"] == "Bench </script>"
    assert index["videos"] == ["v0001"] and index["choices"] == 1
    assert entries[0]["side_of"] == [0, 0, 1]
    assert entries[0]["sides"] == [[["A cat", "A dog"], 0], [["A cat"], 0]]


def test_silence_is_a_side_and_long_lists_are_cut() -> None:
    data = site(system("A", {}), system("B", {"v0001": ["w" * 900, *"bcdefg"]}))
    _, entries = read(data)
    silent, many = entries[0]["sides"]
    assert silent == [[], 0]
    assert many[0][0] == "w" * 399 + "…" and many[0][1:] == list("bcde") and many[1] == 2


def test_the_pictures_of_a_video() -> None:
    a, b = system("A", {}), system("B", {"v0001": ["A cat"]})
    _, (with_clip,) = read(site(a, b))
    assert with_clip["clip"] == "media/v0001/clip.mp4" and "frames" not in with_clip
    assert with_clip["poster"] == "media/v0001/f000002.jpg" and with_clip["size"] == [640, 360]
    _, (without,) = read(site(a, b, clip=False))
    numbers = [int(thumb[-11:-5]) for thumb, _, _ in without["frames"]]
    assert "clip" not in without and numbers == [0, 3, 6, 9, 12, 15, 18, 21, 24]
    assert len(read(site(a, b, clip=False, frames=1))[1][0]["frames"]) == 1
    assert candidates(site(a, b, clip=False, frames=0)) == []


@pytest.mark.parametrize("systems", [[], [system("A", {"v0001": ["A cat"]})]])
def test_nothing_to_compare(systems: list[System]) -> None:
    data = site(*systems)
    assert list(vote_files(data)) == []
    page = vote_page(data, SHELL)
    html = environment().get_template("vote.html").render(page=page, shell=SHELL)
    assert "nothing to compare yet" in html and "vote.js" not in html


def test_a_preview_is_not_voted_on() -> None:
    a, b = system("A", {}), system("B", {"v0001": ["A cat"]}, rehearsed=True)
    assert list(vote_files(site(a, b))) == []


def test_shards_are_small_however_many_videos_there_are() -> None:
    said = {f"v{n:04d}": [f"A cat number {n} crosses the road from the left"] for n in range(1, 401)}
    systems = [system(f"S{k}", {i: [f"{text}, says {k}"] for i, [text] in said.items()}) for k in range(20)]
    data = site(*systems, videos=400)
    files = dict(vote_files(data))
    index = files.pop(INDEX_FILE)
    assert len(index) <= 400 / 100 * 10 * 1024
    assert max(map(len, files.values())) <= SHARD_BYTES < 2 * min(len(f) for f in list(files.values())[:-1])
    parsed, entries = read(data)
    assert [entry["name"] for entry in entries] == parsed["videos"] == list(said)
    assert parsed["choices"] == 400 * 190


@pytest.mark.parametrize("hidden", [False, True])
def test_nothing_of_the_truth_and_no_markup_of_others(hidden: bool) -> None:
    a, b = system("A", {"v0001": [EVIL]}), system("B </script>", {"v0001": ["A cat"]})
    data = site(a, replace(b, slug="b"), hide_truth=hidden)
    html = environment().get_template("vote.html").render(page=vote_page(data, SHELL), shell=SHELL)
    whole = html.encode() + b"".join(content for _, content in vote_files(data))
    assert b"moose" not in whole.lower() and b"B </script" not in whole
    assert (
        b"alert(1)" in whole and b"\\u202e" not in whole and "⟨U+202E⟩" in read(data)[1][0]["sides"][0][0][0]
    )
    assert b"B </" not in html.encode() and "A cat" not in html
