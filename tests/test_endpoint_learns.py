"""What is learned of a server while it is asked: schemas, parameters, its limit, and what it costs."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from pipeline.config import Price
from pipeline.metering import Ledger, Limiter
from pipeline.prompts import fill
from pipeline.recording import Answer
from tests.chat_server import GOOD, Act, Body, Script, after, asking, completion, raw, say, status

PROMPT = fill("A-LLM", {"cos": ["cat: runs", "car: waits"]})


def schema_unknown(message: str, code: int = 400) -> Script:
    return lambda body, _: status(code, message) if "response_format" in body else GOOD


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (400, "Invalid parameter: 'response_format' of type 'json_schema' is not supported with this model."),
        (422, "extra fields not permitted: response_format"),
        (404, "No endpoints found that can handle the requested parameters."),
        (400, "This model does not support response format `json_schema`."),
    ],
)
def test_whether_a_server_knows_schemas_is_found_out_once(code: int, message: str) -> None:
    with asking(schema_unknown(message, code)) as asked, ThreadPoolExecutor(8) as pool:
        prompts = [fill("A-LLM", {"cos": [f"cat {i}"]}) for i in range(24)]
        assert all(reply.text == "[]" for reply in pool.map(lambda p: asked.language.complete(p, 0), prompts))
    with_schema = ["response_format" in body for body in asked.server.requests]
    assert with_schema == [True] + [False] * 24
    assert asked.waits_s == []


def test_a_server_that_knows_schemas_gets_the_one_of_the_prompt() -> None:
    prompts = [
        (fill("T1-LLM", {"descriptions": ["a"]}), "object"),
        (fill("T2-LLM", {"lists": ["a"]}), "string"),
        (fill("X-LLM", {"rhs": ["a"], "aes": ["a"]}), "object"),
        (PROMPT, "object"),
    ]
    with asking(lambda *_: say('{"items": []}')) as asked:
        for prompt, _ in prompts:
            asked.language.complete(prompt, 0)
    for body, (_, kind) in zip(asked.server.requests, prompts, strict=True):
        form = body["response_format"]["json_schema"]
        assert body["response_format"]["type"] == "json_schema"
        assert form["strict"] is True
        assert form["schema"]["type"] == "object"
        assert form["schema"]["required"] == ["items"]
        assert form["schema"]["properties"]["items"]["items"]["type"] == kind


def test_schemas_can_be_switched_off() -> None:
    with asking(after(), endpoint={"json_schema": "never"}) as asked:
        asked.language.complete(PROMPT, 0)
    assert "response_format" not in asked.server.requests[0]


def test_other_models_of_a_server_are_found_out_apart() -> None:
    roles = {"cos": {"endpoint": "near", "model": "big"}, "aos": {"endpoint": "near", "model": "tiny"}}
    settings = {"track2": {"enabled": True}}

    def script(body: Body, _: int) -> Act:
        refuses = body["model"] == "tiny" and "response_format" in body
        return status(400, "no response_format here") if refuses else GOOD

    base = {name: {"endpoint": "near", "model": "big"} for name in ("scene", "video", "rhs", "aes")}
    with asking(script, roles={**base, **roles}, **settings) as asked:
        for _ in range(2):
            asked.language.complete(PROMPT, 0)
            asked.language.complete(fill("X-LLM", {"rhs": ["a"], "aes": ["a"]}), 0)
    found = [(body["model"], "response_format" in body) for body in asked.server.requests]
    assert found == [("tiny", True), ("tiny", False), ("big", True), ("tiny", False), ("big", True)]


def test_parameters_that_a_model_does_not_know_are_left_out() -> None:
    def script(body: Body, _: int) -> Act:
        if "seed" in body:
            return raw('{"detail": [{"type": "extra_forbidden", "loc": ["body", "seed"]}]}', code=422)
        if "max_tokens" in body:
            return status(400, "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead.")
        if "temperature" in body:
            return status(400, "Unsupported value: 'temperature' does not support 0.2 with this model.")
        return GOOD

    with asking(script) as asked:
        reply = asked.language.complete(PROMPT, 0)
        assert reply.model == "tiny (temperature not accepted)"
        asked.language.complete(PROMPT, 1)
    assert len(asked.server.requests) == 5
    assert set(asked.server.requests[-1]) == {"model", "messages", "max_completion_tokens", "response_format"}
    assert asked.server.requests[-1]["max_completion_tokens"] == 200


def test_a_limit_is_shared_by_all_roles_and_falls_with_429s() -> None:
    guard = threading.Lock()
    throttled = []

    def script(body: Body, number: int) -> Act:
        with guard:
            if number == 4:
                throttled.append(number)
                return status(429, headers={"Retry-After": "0"})
        return Act(body=GOOD.body, wait_s=0.01)

    with asking(script, endpoint={"max_in_flight": 4}) as asked, ThreadPoolExecutor(12) as pool:
        limiter = asked.agents.endpoints[0].limiter
        prompts = [PROMPT, fill("T1-LLM", {"descriptions": ["a"]}), fill("T2-LLM", {"lists": ["a"]})] * 8
        list(pool.map(lambda pair: asked.language.complete(pair[1], pair[0]), enumerate(prompts)))
        assert 2 <= limiter.limit <= 4
    assert asked.server.most_in_flight <= 4
    assert len(asked.server.requests) == 25
    assert throttled == [4]


def test_the_limit_halves_once_a_burst_and_grows_by_rounds() -> None:
    limiter = Limiter(8)
    with limiter.slot() as one, limiter.slot() as two:
        one.failed(throttled=True)
        two.failed(throttled=True)
    assert limiter.limit == 4  # both were sent under the limit of 8
    for expected in (2, 1, 1):
        with limiter.slot() as slot:
            slot.failed(throttled=True)
        assert limiter.limit == expected
    limits = []
    for _ in range(40):
        with limiter.slot():
            pass
        limits.append(limiter.limit)
    assert limits[:6] == [2, 2, 3, 3, 3, 4]
    assert limits[-1] == 8
    with limiter.slot() as slot:
        slot.failed(throttled=False)
    assert limiter.limit == 8


def test_usage_counts_tokens_and_money_by_role() -> None:
    prices = {"tiny": {"input_per_million": 2.0, "output_per_million": 10.0}}
    with asking(after(say("[]", tokens=None)), prices=prices) as asked:
        asked.language.complete(PROMPT, 0)
        reply = asked.language.complete(PROMPT, 1)
        assert (reply.input_tokens, reply.output_tokens) == (100, 20)
        assert reply.latency_s is not None
        used = asked.agents.usage()["aos"]
    assert (used.calls, used.unmetered, used.input_tokens, used.output_tokens) == (2, 1, 100, 20)
    assert used.money == pytest.approx((100 * 2 + 20 * 10) / 1e6)
    assert used.seconds >= reply.latency_s


def test_without_a_price_there_is_no_money() -> None:
    ledger = Ledger({"other": Price(input_per_million=1, output_per_million=1)})
    ledger.add(
        "aos", "tiny", Answer(outcome="answered", text="", latency_s=1.0, input_tokens=5, output_tokens=5)
    )
    assert ledger.snapshot()["aos"].money is None
    assert completion("x")["choices"]
