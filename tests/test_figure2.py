"""The paper's figure 2 from records made by hand: order, marks, scale, groups, limits, hostile labels."""

import re
from collections.abc import Sequence

import pytest

from pipeline.records import (
    Box,
    Exclusion,
    Item,
    Kind,
    Match,
    Parse,
    Reply,
    Snippet,
    Stage,
    StageOutput,
    TrackBox,
)
from sitegen.figure2 import MAX_COLUMNS, MAX_GROUP_TRACKS, MAX_ROWS, Figure2, Picture, Place, figure2
from sitegen.gathered import CropPicture, KeyframePicture, VideoMedia
from sitegen.rendering import environment
from sitegen.thumbnails import snippet_pictures

EVIL = '</td><script>alert(1)</script>"\u202e{{ 7*7 }}' + "w" * 500


def _snippet(track: str, frame: int, kind: Kind = Kind.TRAFFIC, box: Box | None = None) -> Snippet:
    return Snippet(TrackBox("v", frame, track, kind, box or Box(10, 20, 60, 50)), None)


def _cos(*labels: str) -> StageOutput:
    items = tuple(Item(rank, label, f"A {label}.") for rank, label in enumerate(labels, start=1))
    return StageOutput("v", Stage.COS, 0, "X-LLM", "0" * 64, Reply("", "m"), items, Parse.JSON)


def _row(track: str, frame: int, detected: Sequence[str] = (), **cosines: float) -> list[Match]:
    return [
        Match("v", frame, track, label, cosine, label in detected, label == "cat")
        for label, cosine in cosines.items()
    ]


def _figure(
    matches: Sequence[Match],
    snippets: Sequence[Snippet] = (),
    stages: Sequence[StageOutput] = (),
    pictures: dict[Place, Picture] | None = None,
) -> Figure2:
    made = figure2(stages, snippets, matches, pictures or {})
    assert made is not None
    return made


def _html(figure: Figure2, root: str = "../") -> str:
    source = "{% import 'figure2.html' as f %}{{ f.figure2(figure, name, root) }}"
    return environment().from_string(source).render(figure=figure, name="A & B", root=root)


SMALL = [
    *_row("10", 4, ["car"], cat=0.10, car=0.30),
    *_row("9", 4, ["car"], cat=0.20, car=0.25),
    *_row("7", 9, ["cat"], cat=0.35, car=0.15),
    *_row("7", 4, ["cat"], cat=0.30, car=-0.15),
]
HAZARD = [
    _snippet("7", 4, Kind.CHALLENGE),
    _snippet("7", 9, Kind.CHALLENGE),
    _snippet("9", 4),
    _snippet("10", 4),
]


def test_rows_columns_and_cells() -> None:
    figure = _figure(SMALL, HAZARD, [_cos("car", "cat")])
    assert [(column.label, column.in_aos) for column in figure.columns] == [("car", False), ("cat", True)]
    assert [(t.track, t.hazard, t.count, [r.frame for r in t.rows]) for t in figure.tracks] == [
        ("7", True, "2 snippets", [4, 9]),
        ("9", False, "1 snippet", [4]),
        ("10", False, "1 snippet", [4]),
    ]
    cells = [
        [(cell.text, cell.level, cell.detected) for cell in row.cells]
        for track in figure.tracks
        for row in track.rows
    ]
    assert cells == [
        [("−0.150", 0, False), ("0.300", 9, True)],
        [("0.150", 6, False), ("0.350", 10, True)],
        [("0.250", 8, True), ("0.200", 7, False)],
        [("0.300", 9, True), ("0.100", 5, False)],
    ]
    assert (figure.low, figure.high, figure.left_out) == ("−0.150", "0.350", ())
    assert figure.summary == "4 snippets of 3 tracks against 2 labels"


def test_groups_share_a_label_and_the_aos_comes_first() -> None:
    figure = _figure(SMALL, HAZARD, [_cos("car", "cat")])
    assert [(group.label, group.in_aos, group.tracks, group.more) for group in figure.groups] == [
        ("cat", True, (("7", True, "frames 4, 9"),), ""),
        ("car", False, (("9", False, "frame 4"), ("10", False, "frame 4")), ""),
    ]
    many = [match for frame in range(0, 90, 3) for match in _row("7", frame, ["cat"], cat=0.3)]
    assert _figure(many).groups[0].tracks == (("7", False, "30 frames, 0 to 87"),)


def test_without_comparisons_there_is_no_figure() -> None:
    assert figure2([_cos("car")], [Snippet(HAZARD[0].track_box, Exclusion.TOO_LOW)], [], {}) is None


def test_columns_without_a_record_of_the_cos_go_by_name() -> None:
    figure = _figure(_row("1", 0, b=0.1, a=0.2, c=0.3), (), [_cos("c")])
    assert [column.label for column in figure.columns] == ["c", "a", "b"]


def test_one_value_has_no_scale_but_is_drawn() -> None:
    figure = _figure(_row("1", 0, ["cat"], cat=-0.0001))
    assert [cell.text for cell in figure.tracks[0].rows[0].cells] == ["0.000"]
    assert figure.tracks[0].rows[0].cells[0].level == 0


def test_cells_that_are_not_there_are_dashes() -> None:
    figure = _figure([*_row("1", 0, cat=0.2), *_row("1", 3, car=0.3)])
    texts = [[cell.text for cell in row.cells] for row in figure.tracks[0].rows]
    assert texts == [["–", "0.200"], ["0.300", "–"]]


def test_of_a_long_track_the_telling_rows_are_kept() -> None:
    matches = [
        match
        for frame in range(25)
        for match in _row("1", frame, ["cat"] if frame == 20 else [], cat=0.1 + frame / 1000)
    ]
    own = {("1", 2): Picture("c.webp", 9, 9), ("1", 3): Picture("t.webp", 9, 9, "0 0 4 4")}
    figure = _figure(matches, pictures=own)
    (track,) = figure.tracks
    assert track.count == "8 of 25 snippets"
    assert [row.frame for row in track.rows] == [2, 18, 19, 20, 21, 22, 23, 24]
    assert [row.picture for row in track.rows][:2] == [own["1", 2], None]


def test_a_crowded_video_stays_readable_and_says_what_is_left_out() -> None:
    labels = {f"label {at:02}": 0.1 + at / 1000 for at in range(40)}
    best = list(labels)[30:]
    matches = [
        match
        for track in range(60)
        for frame in range(25)
        for match in _row(str(track), frame, best, **labels)
    ]
    figure = _figure(matches, [], [_cos(*labels)])
    assert sum(len(track.rows) for track in figure.tracks) == MAX_ROWS
    assert all(len(track.rows) == 3 and track.count == "3 of 25 snippets" for track in figure.tracks)
    assert [column.label for column in figure.columns] == [*list(labels)[: MAX_COLUMNS - 10], *best]
    assert figure.left_out == ("44 more tracks with 1,100 snippets", "24 more labels")
    assert all(len(group.tracks) == MAX_GROUP_TRACKS for group in figure.groups)
    assert figure.groups[0].more == "and 48 more tracks"
    html = _html(figure)
    assert "Not drawn: 44 more tracks with 1,100 snippets; 24 more labels." in html
    assert len(html.encode()) < 70_000


def test_marks_do_not_rest_on_colour() -> None:
    html = _html(_figure(SMALL, HAZARD, [_cos("car", "cat")]))
    assert html.count('hit"') == 4 and html.count('✓</b><span class="sr"> detected</span>') == 4
    assert re.search(r'<th scope="col" class="aos">.*?AOS</b> cat', html)
    assert 'aria-label="Snippets against labels, A &amp; B" tabindex="0"' in html
    assert html.count('scope="rowgroup"') == 3 and html.count('scope="row"') == 4
    assert "<script" not in html and "style=" not in html


def test_hostile_words_stay_words() -> None:
    matches = [Match("v", 3, EVIL, EVIL, 0.5, True, True)]
    html = _html(_figure(matches, [_snippet(EVIL, 3)], [_cos(EVIL)]))
    assert "<script" not in html and "\u202e" not in html and "49" not in html
    assert "&lt;/td&gt;&lt;script&gt;" in html and "w" * 100 not in html


def test_track_ids_of_any_kind_are_ordered() -> None:
    tracks = ["b", "10", "9", "1" * 5000, "a", "٣", "²"]
    figure = _figure([match for track in tracks for match in _row(track, 0, cat=0.1)])
    shown = [track.track for track in figure.tracks]
    assert shown == ["9", "٣", "10", "1" * 23 + "…", "a", "b", "²"]


@pytest.fixture
def media() -> VideoMedia:
    return VideoMedia(
        "v",
        "v",
        width_px=640,
        height_px=360,
        frames=(KeyframePicture(4, 0.1, "media/v/t4.webp", "media/v/f4.jpg"),),
        crops=(CropPicture("7", Kind.CHALLENGE, 9, 50, 30, "media/v/c0.webp", 50, 30),),
    )


def test_a_snippet_is_seen_by_its_crop_or_as_part_of_its_keyframe(media: VideoMedia) -> None:
    snippets = [
        _snippet("7", 9),
        _snippet("7", 4),
        _snippet("8", 4, box=Box(-20, 300.5, 30.25, 400)),
        _snippet("9", 4, box=Box(700, 0, 800, 100)),
        _snippet("9", 5),
        _snippet("nan", 4, box=Box(float("nan"), 0, 9, 9)),
    ]
    found = snippet_pictures(media, snippets)
    assert found == {
        ("7", 9): Picture("media/v/c0.webp", 50, 30),
        ("7", 4): Picture("media/v/t4.webp", 640, 360, "10 20 50 30"),
        ("8", 4): Picture("media/v/t4.webp", 640, 360, "0 300.5 30.2 59.5"),
    }
    html = _html(_figure(SMALL, snippets, pictures=found))
    assert '<img class="fig2-pic" src="../media/v/c0.webp" width="50" height="30" alt=""' in html
    assert 'viewBox="10 20 50 30"' in html and '<image href="../media/v/t4.webp" width="640"' in html


def test_without_media_the_snippets_are_named() -> None:
    assert snippet_pictures(VideoMedia("v", "v", problem="No clip."), HAZARD) == {}
    html = _html(_figure(SMALL, HAZARD))
    assert "<img" not in html and "<image" not in html and html.count("frame 4") >= 3
