"""What questions cost, by hand."""

from pipeline.config import Price
from pipeline.records import Parse, Reply, Stage, StageOutput, UsageRow
from pipeline.usage import usage_of


def _said(stage: Stage, call: int, tokens: tuple[int, int] | None, latency_s: float | None) -> StageOutput:
    used = tokens or (None, None)
    reply = Reply("x", "m", latency_s, used[0], used[1])
    return StageOutput("v", stage, call, "p", "00", reply, (), Parse.EMPTY)


def test_sums_by_role_and_money_by_model() -> None:
    outputs = [
        _said(Stage.SCENE, 0, (1_000, 100), 0.5),
        _said(Stage.SCENE, 1, (3_000, 300), 1.5),
        _said(Stage.CHUNKS, 0, None, None),
        _said(Stage.AOS, 0, (10, 1), 0.25),
        _said(Stage.COS, 0, None, None),
    ]
    prices = {"big": Price(input_per_million=2.0, output_per_million=10.0)}
    assert usage_of(outputs, {"scene": "big", "aos": "free"}, prices) == [
        UsageRow("v", "aos", "free", 1, 10, 1, 0.25, None),
        UsageRow("v", "cos", "", 1, None, None, None, None),
        UsageRow("v", "scene", "big", 2, 4_000, 400, 2.0, 0.012),
    ]
