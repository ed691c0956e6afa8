"""What the page of a video is given and says: frames, tracks, and where hazards were lost."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from pipeline.config import BenchmarkSettings
from pipeline.records import Box, Kind, TrackBox, TruthHazard
from sitegen.contexts import Shell
from sitegen.failures import NAMES, SENTENCES, FailureKind
from sitegen.gathered import KeyframePicture, SiteData, VideoMedia
from sitegen.page_video import Place, video_page
from sitegen.rendering import environment
from sitegen.video_contexts import VideoPage
from tests.video_case import NOT_RANKED, make_site

SHELL = Shell("v", "About v.", "../", "videos", "Test", "1")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_site(tmp_path_factory.mktemp("benchmark"), tmp_path_factory.mktemp("site"))


def film_page(
    tracks: Sequence[tuple[str, Kind]], truth: Sequence[TruthHazard], *, hidden: bool = False
) -> VideoPage:
    """The context of a video of one keyframe with a box of each track, without any system."""
    settings = BenchmarkSettings(name="Test", hide_truth=hidden)
    media = VideoMedia("v", "v", 640, 360, 100, 30.0, (KeyframePicture(120, 4.0, "t.webp", "f.jpg"),))
    boxes = tuple(TrackBox("v", 120, track, kind, Box(1, 1, 9, 9)) for track, kind in tracks)
    data = SiteData(settings, {"v": tuple(truth)}, {"v": boxes}, {"v": media}, {"v": "v"}, ())
    return video_page(data, "v", SHELL, (), Place(None, None, "1 of 1"))


HAZARD, TRAFFIC = Kind.CHALLENGE, Kind.TRAFFIC
MOTORCYCLE = TruthHazard("v", "h1", "Motorcycle", "A motorcycle overtakes", "7", 1, 2)


@pytest.mark.parametrize(
    ("tracks", "alt"),
    [
        (
            [("1", TRAFFIC), ("7", HAZARD), ("2", TRAFFIC)],
            "Frame 120 at 4.0 s: hazard track 7 (Motorcycle), 2 traffic boxes",
        ),
        ([("8", HAZARD), ("7", HAZARD)], "Frame 120 at 4.0 s: hazard track 7 (Motorcycle), hazard track 8"),
        ([("1", TRAFFIC)], "Frame 120 at 4.0 s: 1 traffic box"),
        ([], "Frame 120 at 4.0 s: no boxes"),
    ],
)
def test_a_frame_is_told_by_its_tracks(tracks: list[tuple[str, Kind]], alt: str) -> None:
    page = film_page(tracks, [MOTORCYCLE])
    assert [frame.alt.replace("\u202f", " ").replace("\u00a0", " ") for frame in page.frames] == [alt]


def test_when_the_truth_is_hidden_a_frame_is_told_by_its_time_only() -> None:
    page = film_page([], [], hidden=True)
    assert page.frames[0].alt.endswith("s") and ":" not in page.frames[0].alt
    assert page.tracks == () and "Truth" in environment().get_template("video.html").render(
        page=page, shell=page.shell
    )


def test_tracks_are_in_order_and_many_fold_up() -> None:
    few = film_page([("10", TRAFFIC), ("9", TRAFFIC), ("b", TRAFFIC), ("7", HAZARD)], [MOTORCYCLE])
    assert [(chip.track, chip.title) for chip in few.tracks] == [
        ("7", "Motorcycle"),
        *(("b", ""), ("9", ""), ("10", "")),
    ]
    many = film_page([(str(number), TRAFFIC) for number in range(21)], [MOTORCYCLE])
    template = environment().get_template("video.html")
    texts = [template.render(page=page, shell=page.shell) for page in (few, many)]
    assert ['<details class="tracks' in text for text in texts] == [False, True]
    assert [text.count('<label class="chip') for text in texts] == [4, 21]


def section(site: Path, video: str, slug: str) -> str:
    text = (site / "videos" / f"{video}.html").read_text(encoding="utf-8")
    return text.split(f'<article class="system" id="{slug}"')[1].split("</article>")[0]


def slug_of_evil(site: Path) -> str:
    return next(
        path.stem
        for path in sorted((site / "submissions").glob("*.html"))
        if path.stem not in {"good-system", "silent"}
    )


def test_the_page_says_where_a_hazard_was_lost(site: Path) -> None:
    evil = slug_of_evil(site)
    lost = section(site, "v1", evil)
    assert NAMES[FailureKind.NOT_RANKED] in lost and NOT_RANKED in lost
    wrong = FailureKind.WRONG_OBJECT
    assert NAMES[wrong] in lost and SENTENCES[wrong] in lost
    two = section(site, "v2", evil)
    assert f'href="#{evil}-caption-1"' in two and f'id="{evil}-caption-1"' in two
    assert NAMES[FailureKind.NOT_SEEN] in two and f"#{evil}-scene" not in two  # nothing is recorded there
    found = section(site, "v1", "good-system")
    assert "Found" in found and "1.0000" in found and 'class="fates"' in found
    assert NAMES[FailureKind.EXTRA] in section(site, "v3", "good-system")
    assert "No caption." in section(site, "v1", "silent")
