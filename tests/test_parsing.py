"""Answers of models to items: a table of real-looking answers, and that nothing breaks it."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.parsing import MAX_ANSWER_CHARS, MAX_ITEMS, parse
from pipeline.records import Parse

TABLE = [
    ('[{"label": "Cat", "description": "crossing the road"}]', Parse.JSON, [("Cat", "crossing the road")]),
    ('```json\n["car", "dog"]\n```', Parse.JSON, [("car", ""), ("dog", "")]),
    ('Here you are:\n["car", "dog"]\nAnything else?', Parse.JSON, [("car", ""), ("dog", "")]),
    ('{"hazards": [{"object": "deer", "action": "leaps"}]}', Parse.JSON, [("deer", "leaps")]),
    ('{"Cat": "sits", "Dog": "runs"}', Parse.JSON, [("Cat", "sits"), ("Dog", "runs")]),
    ("['car', \"dog's ball\"]", Parse.LITERAL, [("car", ""), ("dog's ball", "")]),
    ("('car', 'dog')", Parse.LITERAL, [("car", ""), ("dog", "")]),
    ("1. **Motorcycle**: crosses the line\n2. Car - parked", Parse.LINES,
     [("Motorcycle", "crosses the line"), ("Car", "parked")]),
    ("Sure!\n- Cat\n- Dog\n", Parse.LINES, [("Cat", ""), ("Dog", "")]),
    ("* A person is walking along the very edge of the road towards us, waving.", Parse.LINES,
     [("", "A person is walking along the very edge of the road towards us, waving.")]),
    ("car, truck, person", Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ("car, car, Car", Parse.COMMAS, [("car", "")]),
    ("A cat is on the road. It runs.", Parse.PROSE, [("", "A cat is on the road."), ("", "It runs.")]),
    ("<think>cars, maybe [1, 2]</think>['dog']", Parse.LITERAL, [("dog", "")]),
    ("<think>never closed, [1]", Parse.FAILED, []),
    ("[]", Parse.EMPTY, []),
    ("```json\n[]\n```", Parse.EMPTY, []),
    ("None.", Parse.EMPTY, []),
    ("There are no anomalies in the list.", Parse.EMPTY, []),
    ("", Parse.FAILED, []),
    ("  \n ", Parse.FAILED, []),
    ("!!!", Parse.FAILED, []),
    ("__import__('os').system('true')", Parse.PROSE, [("", "__import__('os').system('true')")]),
    ("[__import__('os')]", Parse.PROSE, [("", "[__import__('os')]")]),
]  # fmt: skip

# As models write them: with and without a schema, cut at the token limit, with thoughts and apologies.
ANSWERS = [
    ('{"items": [{"label": "Deer", "description": "leaps across the road"}, {"label": '
     '"Cone", "description": "stands in the lane"}]}',
     Parse.JSON,
     [("Deer", "leaps across the road"),
      ("Cone", "stands in the lane")]),
    ('{"items": ["car", "traffic light", "deer"]}',
     Parse.JSON, [("car", ""), ("traffic light", ""), ("deer", "")]),
    ('{"items": []}', Parse.EMPTY, []),
    ("{}", Parse.EMPTY, []),
    ('{"label": "Deer", "description": "leaps across the road"}',
     Parse.JSON, [("Deer", "leaps across the road")]),
    ('{"anomalies": []}', Parse.EMPTY, []),
    ('{"anomaly": "A deer leaps across the road"}', Parse.JSON, [("A deer leaps across the road", "")]),
    ('{"answer": "none"}', Parse.EMPTY, []),
    ('{"result": {"items": [{"name": "dog", "details": "runs"}]}}', Parse.JSON, [("dog", "runs")]),
    ('[["dog", "runs onto the road"], ["car", "waits"]]',
     Parse.JSON, [("dog", "runs onto the road"), ("car", "waits")]),
    ('[{"label": "cat", "description": "crosses the road"}, {"label": "dog", "descr',
     Parse.JSON, [("cat", "crosses the road")]),
    ('{"items": [{"label": "cat", "description": "crosses"}, {"label": "do',
     Parse.JSON, [("cat", "crosses")]),
    ('["car", "truck", "pede', Parse.JSON, [("car", ""), ("truck", "")]),
    ("['car', 'truck', 'pede", Parse.LITERAL, [("car", ""), ("truck", "")]),
    ('[{"label": "cat", "description": "crosses",},]', Parse.LITERAL, [("cat", "crosses")]),
    ('[{\'label\': \'cat\', \'description\': "it\'s crossing"}]', Parse.LITERAL, [("cat", "it's crossing")]),
    ('[{label: "cat", description: "crosses"}]', Parse.JSON, [("cat", "crosses")]),
    ("Sure! Here is the list:\n"
     "\n"
     "```json\n"
     '[{"label": "cat", "description": "crosses"}]\n'
     "```\n"
     "\n"
     "Let me know if you need more [or less].",
     Parse.JSON,
     [("cat", "crosses")]),
    ('Here is the [ranked] list:\n["car", "dog"]', Parse.JSON, [("car", ""), ("dog", "")]),
    ('[{"label": "cat", "description": "crosses"}]\n[{"label": "dog", "description": "runs"}]',
     Parse.JSON, [("cat", "crosses"), ("dog", "runs")]),
    ('{"label": "cat", "description": "crosses"}\n{"label": "dog", "description": "runs"}',
     Parse.JSON, [("cat", "crosses"), ("dog", "runs")]),
    ('List3: ["car", "dog"]', Parse.JSON, [("car", ""), ("dog", "")]),
    ('cat = ["car", "dog"]', Parse.JSON, [("car", ""), ("dog", "")]),
    ('["car", "dog"]. These are the most relevant.', Parse.JSON, [("car", ""), ("dog", "")]),
    ('<think>\nThe list has [a] and [b].\n</think>\n\n{"items": ["dog"]}', Parse.JSON, [("dog", "")]),
    ('I think it is this.</think>["dog"]', Parse.JSON, [("dog", "")]),
    ("<|channel|>analysis<|message|>We need [list]<|end|><|start|>assistant<|channel|>"
     'final<|message|>["dog"]',
     Parse.JSON,
     [("dog", "")]),
    ('[THINK]maybe a cat[/THINK]["dog"]', Parse.JSON, [("dog", "")]),
    ('◁think▷hm, [cat]◁/think▷["dog"]', Parse.JSON, [("dog", "")]),
    ("1. Pedestrian: crossing the street\n"
     "2. Cyclist: riding on the right\n"
     "3. Parked car: blocking the lane",
     Parse.LINES,
     [("Pedestrian", "crossing the street"),
      ("Cyclist", "riding on the right"),
      ("Parked car", "blocking the lane")]),
    ("A white van is parked with no hazard lights on. A dog runs.", Parse.PROSE,
     [("", "A white van is parked with no hazard lights on."), ("", "A dog runs.")]),
    ("A deer is on the road and there are no other hazards.", Parse.PROSE,
     [("", "A deer is on the road and there are no other hazards.")]),
    ("1. **Pedestrian** - crossing the street\n   - Risk: high\n2. **Cyclist** - riding",
     Parse.LINES, [("Pedestrian", "crossing the street"), ("Cyclist", "riding")]),
    ("**1. Pedestrian:** crossing the street\n**2. Cyclist:** riding",
     Parse.LINES, [("Pedestrian", "crossing the street"), ("Cyclist", "riding")]),
    ("### Hazards\n"
     "\n"
     "1. **Deer:** Leaping across.\n"
     "2. **Debris:** Lying in the lane.\n"
     "\n"
     "These are the hazards in the scene.",
     Parse.LINES,
     [("Deer", "Leaping across."),
      ("Debris", "Lying in the lane.")]),
    ("- Deer: leaping\n- Car: braking", Parse.LINES, [("Deer", "leaping"), ("Car", "braking")]),
    ("• Deer\n• Car", Parse.LINES, [("Deer", ""), ("Car", "")]),
    ("Hazards:\n* **Deer** (leaping across the road)\n* **Car** (braking)",
     Parse.LINES, [("Deer", "leaping across the road"), ("Car", "braking")]),
    ("1- Deer: leaping\n2- Car: braking", Parse.LINES, [("Deer", "leaping"), ("Car", "braking")]),
    ("(1) Deer: leaping\n(2) Car: braking", Parse.LINES, [("Deer", "leaping"), ("Car", "braking")]),
    ("1. Deer\nIt leaps across the road.\n2. Car\nIt brakes.",
     Parse.LINES, [("Deer", "It leaps across the road."), ("Car", "It brakes.")]),
    ("Deer: leaping across the road\nCar: braking",
     Parse.LINES, [("Deer", "leaping across the road"), ("Car", "braking")]),
    ("Deer\nCar\nTruck", Parse.LINES, [("Deer", ""), ("Car", ""), ("Truck", "")]),
    ("cars, a traffic light, pedestrians, and a dog",
     Parse.COMMAS, [("cars", ""), ("a traffic light", ""), ("pedestrians", ""), ("a dog", "")]),
    ("Cars, trucks, buses.", Parse.COMMAS, [("Cars", ""), ("trucks", ""), ("buses", "")]),
    ("The objects on the road are cars, trucks, and a dog.",
     Parse.COMMAS, [("cars", ""), ("trucks", ""), ("a dog", "")]),
    ("car, truck, person, car, truck, person, car, truck, person,",
     Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ("car; truck; person", Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ("car | truck | person", Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ('"car", "truck", "person"', Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ("car,\ntruck,\nperson", Parse.COMMAS, [("car", ""), ("truck", ""), ("person", "")]),
    ("car", Parse.COMMAS, [("car", "")]),
    ("Car.", Parse.COMMAS, [("Car", "")]),
    ("A white cat is crossing the road from left to right.",
     Parse.PROSE, [("", "A white cat is crossing the road from left to right.")]),
    ("In the image, there is a black dog on the road. It is running towards the car. T"
     "here is also debris.",
     Parse.PROSE,
     [("", "In the image, there is a black dog on the road."),
      ("", "It is running towards the car."),
      ("", "There is also debris.")]),
    ("The anomaly is the deer crossing the road.",
     Parse.PROSE, [("", "The anomaly is the deer crossing the road.")]),
    ("The anomalies in the list are:\n1. Deer - crossing\n2. Debris - on the road",
     Parse.LINES, [("Deer", "crossing"), ("Debris", "on the road")]),
    ("None of the objects are anomalies.", Parse.EMPTY, []),
    ("No anomalies detected.", Parse.EMPTY, []),
    ("There are no hazards or anomalies in the image.", Parse.EMPTY, []),
    ("There is no anomaly in the list of traffic objects.", Parse.EMPTY, []),
    ("Based on the list, there are no anomalies.", Parse.EMPTY, []),
    ("The list is empty.", Parse.EMPTY, []),
    ("N/A", Parse.EMPTY, []),
    ("null", Parse.EMPTY, []),
    ('"none"', Parse.EMPTY, []),
    ('["none"]', Parse.EMPTY, []),
    ('[{"label": "none", "description": ""}]', Parse.EMPTY, []),
    ('{"items": [{"label": "None", "description": "No anomalies are present."}]}', Parse.EMPTY, []),
    ("No.", Parse.EMPTY, []),
    ("Nothing unusual.", Parse.EMPTY, []),
    ("I do not see any hazards in the image.", Parse.EMPTY, []),
    ("I'm sorry, but I can't assist with that.", Parse.FAILED, []),
    ("| Rank | Object | Description |\n|---|---|---|\n| 1 | Deer | leaps |\n| 2 | Car | brakes |",
     Parse.LINES, [("Deer", "leaps"), ("Car", "brakes")]),
    ("<ul><li>Deer</li><li>Car</li></ul>", Parse.LINES, [("Deer", ""), ("Car", "")]),
    ("1.Deer: leaps\n2.Car: brakes", Parse.LINES, [("Deer", "leaps"), ("Car", "brakes")]),
    ("a) Deer\nb) Car", Parse.LINES, [("Deer", ""), ("Car", "")]),
    ("i. Deer\nii. Car", Parse.LINES, [("Deer", ""), ("Car", "")]),
    ('["car", "car", "Car"]', Parse.JSON, [("car", "")]),
    ('{"1": "Deer: leaps", "2": "Car: brakes"}', Parse.JSON, [("Deer", "leaps"), ("Car", "brakes")]),
    ('{"Deer": {"description": "leaps"}, "Car": {"description": "brakes"}}',
     Parse.JSON, [("Deer", "leaps"), ("Car", "brakes")]),
    ('[{"rank": 1, "object": "deer", "description": "leaps"}, {"rank": 2, "object": "c'
     'ar", "description": "brakes"}]',
     Parse.JSON,
     [("deer", "leaps"),
      ("car", "brakes")]),
    ('[{"Object": "deer", "Description": "leaps"}]', Parse.JSON, [("deer", "leaps")]),
    ('[{"label": "deer", "description": null}]', Parse.JSON, [("deer", "")]),
    ('[{"label": "deer", "description": ["leaps", "runs"]}]', Parse.JSON, [("deer", "leaps; runs")]),
    ("[1, 2, 3]", Parse.FAILED, []),
    ("[null]", Parse.EMPTY, []),
    ('"car, truck"', Parse.COMMAS, [("car", ""), ("truck", "")]),
    ('"car"', Parse.COMMAS, [("car", "")]),
    ("Le chien traverse la route.", Parse.PROSE, [("", "Le chien traverse la route.")]),
    ("1. 猫：穿过马路\n2. 汽车", Parse.LINES, [("猫", "穿过马路"), ("汽车", "")]),
    ("car、truck", Parse.COMMAS, [("car", ""), ("truck", "")]),
    ("Answer: car, truck, bus", Parse.COMMAS, [("car", ""), ("truck", ""), ("bus", "")]),
    ("```\ncar, truck, bus\n```", Parse.COMMAS, [("car", ""), ("truck", ""), ("bus", "")]),
    ('```python\nhazards = ["deer", "car"]\n```', Parse.JSON, [("deer", ""), ("car", "")]),
    ("```\n1. Deer: leaps\n2. Car: brakes\n```", Parse.LINES, [("Deer", "leaps"), ("Car", "brakes")]),
    ('{"items": [{"label": "deer", "description": "leaps"}]}<|im_end|>', Parse.JSON, [("deer", "leaps")]),
    ('["deer"]</s>', Parse.JSON, [("deer", "")]),
    ('"items": ["deer", "car"]', Parse.JSON, [("deer", ""), ("car", "")]),
    ('json\n["deer"]', Parse.JSON, [("deer", "")]),
    ('["deer", "car"', Parse.JSON, [("deer", ""), ("car", "")]),
    ('{"items": ["deer"]', Parse.JSON, [("deer", "")]),
    ("[]\n\nThere are no anomalies.", Parse.EMPTY, []),
    ("Anomalies: []", Parse.EMPTY, []),
    ('<answer>["deer"]</answer>', Parse.JSON, [("deer", "")]),
    ("The following are potential hazards: 1. Deer: leaps, 2. Car: brakes",
     Parse.LINES, [("Deer", "leaps"), ("Car", "brakes")]),
    ("1. Deer: leaps 2. Car: brakes 3. Dog: sits",
     Parse.LINES, [("Deer", "leaps"), ("Car", "brakes"), ("Dog", "sits")]),
    ('["deer\'s antler", \'a "big" car\']', Parse.LITERAL, [("deer's antler", ""), ('a "big" car', "")]),
    ('[{"label": "deer", "description": "says \\"hello\\""}, {"label": "car, red", "desc'
     'ription": "a [b] c"}]',
     Parse.JSON,
     [("deer", 'says "hello"'),
      ("car, red", "a [b] c")]),
    ('[{"label": "deer" "description": "leaps"}]', Parse.JSON, [("deer", "leaps")]),
    ("Deer – leaping across the road; Car – braking",
     Parse.COMMAS, [("Deer", "leaping across the road"), ("Car", "braking")]),
    ("There are no pedestrians. A deer crosses the road.", Parse.PROSE, [("", "A deer crosses the road.")]),
    ("No anomalies detected. The road is clear.", Parse.EMPTY, []),
    ("There are no animals, but a tire lies on the road.",
     Parse.PROSE, [("", "There are no animals, but a tire lies on the road.")]),
    ("1. Deer\n   - Description: leaps across\n   - Risk: high\n2. Car\n   - Description: brakes",
     Parse.LINES, [("Deer", "leaps across"), ("Car", "brakes")]),
    ("A deer [1] leaps across the road.", Parse.PROSE, [("", "A deer [1] leaps across the road.")]),
    ("1. None", Parse.EMPTY, []),
    ("- No anomalies", Parse.EMPTY, []),
    ("Deer: leaping across the road", Parse.COMMAS, [("Deer", "leaping across the road")]),
    ("Debris: No hazard lights on", Parse.COMMAS, [("Debris", "No hazard lights on")]),
    ('["A deer, standing still, near the lane"]',
     Parse.JSON, [("A deer, standing still, near the lane", "")]),
    ('["car, truck, bus"]', Parse.JSON, [("car", ""), ("truck", ""), ("bus", "")]),
    ("Result:\ncar, truck, bus", Parse.COMMAS, [("car", ""), ("truck", ""), ("bus", "")]),
    ("## Answer\ncar, truck, bus", Parse.COMMAS, [("car", ""), ("truck", ""), ("bus", "")]),
    ("car, truck, bus\n\nI removed the articles.", Parse.COMMAS, [("car", ""), ("truck", ""), ("bus", "")]),
    ('{"items": "car, truck, bus"}', Parse.JSON, [("car", ""), ("truck", ""), ("bus", "")]),
    ('{"hazards": ["Deer: leaps", "Car: brakes"]}', Parse.JSON, [("Deer", "leaps"), ("Car", "brakes")]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "how", "expected"), [*TABLE, *ANSWERS])
def test_table(text: str, how: Parse, expected: list[tuple[str, str]]) -> None:
    items, found = parse(text)
    assert (found, [(item.label, item.description) for item in items]) == (how, expected)
    assert [item.rank for item in items] == list(range(1, len(items) + 1))


_SYNTAX = st.text(alphabet="[]{}()\"'\\,:-*`<>think/ \n0123456789ab🚗", max_size=400)


@given(st.one_of(st.text(max_size=400), _SYNTAX))
def test_never_raises_and_is_bounded(text: str) -> None:
    items, how = parse(text)
    assert len(items) <= MAX_ITEMS
    assert bool(items) == (how not in (Parse.EMPTY, Parse.FAILED))


@pytest.mark.parametrize(
    "piece",
    [
        *(
            "[",
            '{"a":',
            "(",
            "<think>",
            "```",
            "1. ",
            "a, ",
            "**",
            "- a\n",
            "\\",
            "[1]",
            '{"a": 1} ',
            "[1, ",
            "'a, ",
        ),
        *(
            '"a", ',
            "a|",
            "</think>",
            "<|channel|>final<|message|>",
            "a: b\n",
            "| a |\n",
            "no ",
            "\n",
            "1) a ",
            "a;",
        ),
        *("(a b) ", "{a:", '["a', "<li>", "x", "I'm sorry "),
    ],
)
def test_long_answers_are_cut_and_quick(piece: str) -> None:
    start = time.process_time()
    parse(piece * (2 * MAX_ANSWER_CHARS // len(piece)))
    assert time.process_time() - start < 5  # a guard against blow-up, not a benchmark
