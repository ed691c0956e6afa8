"""The embedded agents: they look at pixels, never at what a box is annotated as, and repeat themselves."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.classifier import CropClassifier, open_classifier
from pipeline.embedded_language import EmbeddedLanguageAgent
from pipeline.embedded_vision import EmbeddedVisionAgent, light_condition
from pipeline.minilm import open_embedder
from pipeline.prompts import fill
from pipeline.records import Box, Frame, Kind, TrackBox
from pipeline.tables import BOXES
from pipeline.video import read_keyframes

DEMO = Path(__file__).parent.parent / "demo"
SCENE, VIDEO = fill("T1-VLM"), fill("T2-VLM")


@pytest.fixture(scope="module")
def classifier() -> CropClassifier:
    return open_classifier(threads=1)


@pytest.fixture(scope="module")
def language() -> EmbeddedLanguageAgent:
    return EmbeddedLanguageAgent(open_embedder(threads=1))


def _demo(video_id: str, count: int = 6) -> tuple[list[TrackBox], list[Frame]]:
    boxes = [box for box in BOXES.read(DEMO / "boxes.parquet") if box.video_id == video_id]
    frames = read_keyframes(DEMO / "videos" / f"{video_id}.mp4", video_id, count).frames
    return boxes, [
        replace(frame, boxes=tuple(box for box in boxes if box.frame_index == frame.index))
        for frame in frames
    ]


def test_what_a_box_is_annotated_as_changes_nothing(classifier: CropClassifier) -> None:
    boxes, frames = _demo("demo_0006")
    said = []
    for kind in Kind:
        marked = [replace(box, kind=kind) for box in boxes]
        agent = EmbeddedVisionAgent(classifier, {"demo_0006": marked}, 0)
        shown = [replace(f, boxes=tuple(replace(box, kind=kind) for box in f.boxes)) for f in frames]
        said.append([agent.look([frame], SCENE, 0).text for frame in shown])
    assert said[0] == said[1]
    assert any("car" in sentence for sentence in said[0])


def test_other_pixels_under_the_same_boxes_give_another_answer(classifier: CropClassifier) -> None:
    boxes, frames = _demo("demo_0006")
    grey = [replace(frame, rgb=np.full_like(frame.rgb, 128)) for frame in frames]
    real = EmbeddedVisionAgent(classifier, {"demo_0006": boxes}, 0).look(frames, VIDEO, 0).text
    blank = EmbeddedVisionAgent(classifier, {"demo_0006": boxes}, 0).look(grey, VIDEO, 0).text
    assert "car" in real
    assert real != blank


def test_repeated_questions_differ_as_the_seed_says(classifier: CropClassifier) -> None:
    boxes, frames = _demo("demo_0009", 12)

    def answers(seed: int) -> list[str]:
        agent = EmbeddedVisionAgent(classifier, {"demo_0009": boxes}, seed)
        return [agent.look(frames, VIDEO, call).text for call in range(8)]

    assert answers(0) == answers(0)
    assert len({frozenset(answer.split(", ")) for answer in answers(0)} | {*answers(0)}) > 1


@pytest.mark.parametrize(
    ("last", "expected"),
    [
        (Box(80, 80, 160, 160), "is coming closer"),
        (Box(110, 110, 130, 130), "is moving away"),
        (Box(220, 100, 260, 140), "is crossing to the right"),
        (Box(102, 100, 142, 140), "is driving along"),
    ],
)
def test_motion_by_hand(classifier: CropClassifier, last: Box, expected: str) -> None:
    first = TrackBox("v", 0, "1", Kind.TRAFFIC, Box(100, 100, 140, 140))
    track = [first, TrackBox("v", 24, "1", Kind.TRAFFIC, last)]
    middle = TrackBox("v", 12, "1", Kind.TRAFFIC, Box(100, 100, 140, 140))
    agent = EmbeddedVisionAgent(classifier, {"v": [*track, middle]}, 0)
    assert agent._motion(middle) == expected


def test_light_that_hides_the_road() -> None:
    haze = np.full((90, 160, 3), 180, np.uint8)
    night = np.full((90, 160, 3), 20, np.uint8)
    day = np.random.default_rng(0).integers(0, 256, (90, 160, 3), dtype=np.uint8)
    assert "glare" in light_condition(haze)
    assert "shade" in light_condition(night)
    assert light_condition(day) == ""


def test_hazards_are_merged_and_the_conflict_comes_first(language: EmbeddedLanguageAgent) -> None:
    descriptions = [
        "A car is driving along on the right. A motorcycle is coming closer ahead.",
        "A car is driving along on the right.",
        "A motorbike is driving along ahead. A motorcycle is moving away.",
        "No hazards or anomalies.",
        "",
    ]
    items = json.loads(language.complete(fill("T1-LLM", {"descriptions": descriptions}), 0).text)
    assert [item["label"] for item in items] == ["motorcycle", "car"]
    assert items[0]["description"] == "A motorcycle is coming closer ahead."


def test_elements_that_few_lists_name_are_left_out(language: EmbeddedLanguageAgent) -> None:
    lists = ["the car, a dog", "car", "a car", "car", "car", ""]
    assert json.loads(language.complete(fill("T2-LLM", {"lists": lists}), 0).text) == ["car"]


def test_cross_reference_keeps_what_both_hold_by_the_second_lists_name(
    language: EmbeddedLanguageAgent,
) -> None:
    lists = {
        "rhs": ["motorbike: A motorbike swerves.", "sun glare: It blinds."],
        "aes": ["car", "motorcycle"],
    }
    items = json.loads(language.complete(fill("X-LLM", lists), 0).text)
    assert items == [{"label": "motorcycle", "description": "A motorbike swerves."}]
    assert json.loads(language.complete(fill("X-LLM", {"rhs": [], "aes": ["car"]}), 0).text) == []


def test_anomalies_are_the_odd_and_the_conflicting(language: EmbeddedLanguageAgent) -> None:
    cos = [
        "deer: A deer stands ahead.",
        "car: A car is coming closer on the left.",
        "car: A car is driving along on the right.",
        "truck: A truck is moving away ahead.",
    ]
    items = json.loads(language.complete(fill("A-LLM", {"cos": cos}), 0).text)
    assert [item["description"] for item in items] == [
        "A deer stands ahead.",
        "A car is coming closer on the left.",
    ]
    assert json.loads(language.complete(fill("A-LLM", {"cos": []}), 0).text) == []
