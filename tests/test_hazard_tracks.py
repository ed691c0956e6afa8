"""From a run's tables to hazard tracks: by hand."""

import random

from pipeline.data.hazard_tracks import HazardTrack, hazard_tracks, hazards_by_frame
from pipeline.records import Box, Kind, Match, Prediction, TrackBox

BOX = Box(0, 0, 10, 10)


def _boxes(track: str, frames: range | list[int], video: str = "v1") -> list[TrackBox]:
    return [TrackBox(video, frame, track, Kind.TRAFFIC, BOX) for frame in frames]


def _match(track: str, frame: int, label: str, cosine: float, detected: bool = True) -> Match:
    return Match("v1", frame, track, label, cosine, detected, True)


def test_a_tied_track_is_a_hazard_in_every_frame_with_a_box() -> None:
    boxes = _boxes("7", [3, 4, 5, 9, 10]) + _boxes("8", range(20))
    found = hazard_tracks(
        [Prediction("v1", 1, "A cat runs.", "cat", ("7",), (5, 10))],
        [_match("7", 5, "cat", 0.2), _match("7", 10, "Cat ", 0.4), _match("7", 10, "dog", 0.9)],
        boxes,
    )
    (hazard,) = found["v1"]
    assert hazard == HazardTrack("v1", "7", "A cat runs.", "cat", (3, 4, 5, 9, 10), 2, hazard.cosine)
    assert (hazard.first_frame, hazard.last_frame) == (3, 10)
    assert round(hazard.cosine, 9) == 0.3


def test_more_sampled_frames_come_first_then_the_higher_cosine_then_the_rank() -> None:
    predictions = [
        Prediction("v1", 1, "A", "a", ("1", "2", "5")),
        Prediction("v1", 2, "B", "b", ("3", "4")),
    ]
    matches = [
        _match("1", 0, "a", 0.5),
        _match("2", 0, "a", 0.9),
        _match("3", 0, "b", 0.1),
        _match("3", 12, "b", 0.1),
        _match("4", 0, "b", 0.5),
        _match("5", 0, "a", 0.99, detected=False),
    ]
    boxes = [box for track in "12345" for box in _boxes(track, range(2))]
    (order,) = hazard_tracks(predictions, matches, boxes).values()
    assert [hazard.track_id for hazard in order] == ["3", "2", "1", "4", "5"]
    mixed = random.Random(3)
    for rows in (predictions, matches, boxes):
        mixed.shuffle(rows)  # type: ignore[arg-type]
    assert list(hazard_tracks(predictions, matches, boxes).values()) == [order]


def test_a_track_has_one_name_that_of_its_most_confident_prediction() -> None:
    predictions = [Prediction("v1", 1, "A dog", "dog", ("1",)), Prediction("v1", 2, "A cat", "cat", ("1",))]
    matches = [_match("1", 0, "dog", 0.9), _match("1", 0, "cat", 0.2), _match("1", 5, "cat", 0.2)]
    (hazard,) = hazard_tracks(predictions, matches, _boxes("1", range(3)))["v1"]
    assert (hazard.description, hazard.label) == ("A cat", "cat")


def test_without_matches_the_predictions_alone_count_and_without_boxes_nothing_does() -> None:
    predictions = [Prediction("v1", 1, "A dog", None, ("1", "1", "9")), Prediction("v2", 1, "A cat")]
    found = hazard_tracks(predictions, [], _boxes("1", [4]) + _boxes("1", [1], "v2"))
    assert list(found) == ["v1"]
    (hazard,) = found["v1"]
    assert (hazard.track_id, hazard.label, hazard.sampled, hazard.cosine) == ("1", "", 0, 0.0)
    assert hazard_tracks(predictions, [], []) == {}


def test_frames_get_their_hazards_in_the_order_of_the_tracks() -> None:
    first = HazardTrack("v1", "b", "B", "", (1, 2, 99), 2, 0.5)
    second = HazardTrack("v1", "a", "A", "", (2,), 1, 0.5)
    assert hazards_by_frame([first, second], 4) == [[], [first], [first, second], []]
    assert hazards_by_frame([], 0) == []
