"""Servers that fail in every way we know of, and what becomes of the question."""

import logging
import re
import time
from datetime import UTC, datetime
from email.utils import format_datetime

import httpx2
import openai
import pytest

from pipeline.config import EndpointSettings
from pipeline.endpoint import MAX_RETRY_AFTER_S, MAX_WAIT_S
from pipeline.errors import AgentError
from pipeline.prompts import fill
from pipeline.recording import Answer, Recording
from pipeline.replies import Failure, classify, read_answer, retry_after_s, scrub
from tests.chat_server import Act, after, asking, cut, hang, raw, reset, say, status

PROMPT = fill("A-LLM", {"cos": ["cat: runs", "car: waits"]})

TRANSIENT = {
    "429": status(429, "slow down"),
    "500": status(500, "oops"),
    "502": raw("<html><head><title>502 Bad Gateway</title></head></html>", "text/html", 502),
    "503": status(503, "loading the model"),
    "408": status(408),
    "reset": reset(),
    "cut": cut(),
    "half a JSON": raw('{"choices": [{"mess'),
    "HTML": raw("<!DOCTYPE html><title>Sign in</title>", "text/html"),
    "no JSON": raw("OK", "text/plain"),
    "nothing": raw(""),
    "empty choices": raw('{"choices": []}'),
    "null choices": raw('{"choices": null}'),
    "no message": raw('{"choices": [{}]}'),
    "a list": raw("[]"),
    "error in a 200": raw('{"error": {"message": "upstream is gone"}}'),
    "null content": say(None),
    "empty content": say(" \n"),
}


@pytest.mark.parametrize("act", TRANSIENT.values(), ids=TRANSIENT)
def test_what_may_pass_is_tried_again(act: Act) -> None:
    with asking(after(act, act)) as asked:
        assert asked.language.complete(PROMPT, 0).text == "[]"
    assert len(asked.server.requests) == 3
    assert len(asked.waits_s) == 2
    assert asked.server.requests[0] == asked.server.requests[2]


EXHAUSTED = {
    "500": (status(500, "oops"), "HTTP 500: oops"),
    "HTML": (TRANSIENT["HTML"], 'a page of HTML titled "Sign in"'),
    "HTML 502": (TRANSIENT["502"], 'HTTP 502: a page of HTML titled "502 Bad Gateway"'),
    "reset": (reset(), "the connection failed"),
    "cut": (cut(), "the connection failed"),
    "half a JSON": (TRANSIENT["half a JSON"], "the answer is no JSON but"),
    "empty choices": (raw('{"choices": []}'), "the answer has no choice"),
    "error in a 200": (TRANSIENT["error in a 200"], "upstream is gone"),
}


@pytest.mark.parametrize(("act", "what"), EXHAUSTED.values(), ids=EXHAUSTED)
def test_at_the_end_the_error_says_who_what_and_how_often(act: Act, what: str) -> None:
    with asking(lambda *_: act, endpoint={"retries": 3}) as asked, pytest.raises(AgentError) as caught:
        asked.language.complete(PROMPT, 0)
    message = str(caught.value)
    for part in ("role aos", "endpoint near", "model tiny", what, "asked 4 times"):
        assert part in message
    assert len(asked.server.requests) == 4
    assert caught.value.__cause__ is caught.value.__context__ is None  # the client's error may hold the key


FINAL = {
    "404": (status(404, "The model `tiny` does not exist"), r"no such model or address \(HTTP 404: The"),
    "400": (status(400, "bad request"), "HTTP 400: bad request"),
    "no key": (status(401, "no key"), "a key is wanted .*api_key_env"),
    "quota": (status(429, "You exceeded your quota", code="insufficient_quota"), "exceeded your quota"),
    "moved": (Act(status=301, headers={"Location": "http://127.0.0.1:9/v1"}), "HTTP 301"),
    "thinking": (say("", finish="length"), "all 200 tokens were spent .*max_tokens"),
    "filter": (say(None, finish="content_filter"), "refuses: the content filter"),
    "half filtered": (say("A cat", finish="content_filter"), "refuses: the content filter"),
    "refusal": (say(None, refusal="I cannot help with that."), "refuses: I cannot help with that"),
    "filtered input": (status(400, "flagged", code="content_filter"), "refuses: HTTP 400: flagged"),
}  # fmt: skip


@pytest.mark.parametrize(("act", "what"), FINAL.values(), ids=FINAL)
def test_what_will_not_pass_is_not_tried_again(act: Act, what: str) -> None:
    with asking(lambda *_: act) as asked, pytest.raises(AgentError, match=what):
        asked.language.complete(PROMPT, 0)
    assert len(asked.server.requests) == 1
    assert asked.waits_s == []


def test_a_model_that_says_nothing_has_said_nothing() -> None:
    with asking(lambda *_: say("")) as asked:
        assert asked.language.complete(PROMPT, 0).text == ""
        assert len(asked.server.requests) == 3
        assert asked.agents.usage()["aos"].calls == 3  # all of them were paid


def test_a_server_that_hangs_is_left() -> None:
    with asking(after(hang(30)), endpoint={"timeout_s": 0.2}) as asked:
        start = time.monotonic()
        assert asked.language.complete(PROMPT, 0).text == "[]"
        assert time.monotonic() - start < 10
    with (
        asking(lambda *_: hang(30), endpoint={"timeout_s": 0.1, "retries": 1}) as asked,
        pytest.raises(AgentError, match=r"no answer within 0\.1 s; asked 2 times"),
    ):
        asked.language.complete(PROMPT, 0)


def test_a_server_that_is_not_there() -> None:
    with asking(after()) as asked:
        pass
    with (
        asking(after(), endpoint={"base_url": asked.server.base_url, "retries": 2}) as none,
        pytest.raises(AgentError, match=r"the connection failed .*asked 3 times"),
    ):
        none.language.complete(PROMPT, 0)


def test_retry_after_is_obeyed_within_bounds() -> None:
    headers = [
        {"Retry-After": "7"},
        {"Retry-After": "86400"},
        {"retry-after-ms": "250"},
        {"Retry-After": "soon"},
    ]
    with asking(after(*(status(429, headers=one) for one in headers))) as asked:
        asked.language.complete(PROMPT, 0)
    assert asked.waits_s[:3] == [7.0, MAX_RETRY_AFTER_S, 0.25]
    assert 0 <= asked.waits_s[3] <= 4


def test_retry_after_as_a_date() -> None:
    now = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    later = format_datetime(datetime(2026, 1, 2, 3, 4, 35, tzinfo=UTC), usegmt=True)
    assert retry_after_s({"retry-after": later}, now) == 30
    assert retry_after_s({"retry-after": "Thu, 01 Jan 1970 00:00:00 GMT"}, now) == 0
    for nonsense in ("", "soon", "nan", "Thu, 99 Jan 1970 00:00:00 GMT"):
        assert retry_after_s({"retry-after": nonsense}, now) is None
    assert retry_after_s({}, now) is None
    assert retry_after_s({"retry-after": "-5"}, now) == 0
    past = format_datetime(datetime(2020, 1, 1, tzinfo=UTC), usegmt=True)
    with asking(after(status(503, headers={"Retry-After": past}))) as asked:
        asked.language.complete(PROMPT, 0)
    assert asked.waits_s == [0.0]


def test_waits_grow_with_jitter_and_have_a_bound() -> None:
    with asking(after(*[status(500)] * 20), endpoint={"retries": 20}) as asked:
        asked.language.complete(PROMPT, 0)
    bounds = [min(MAX_WAIT_S, 0.5 * 2**turn) for turn in range(20)]
    assert all(0 <= wait <= bound for wait, bound in zip(asked.waits_s, bounds, strict=True))
    assert len(set(asked.waits_s)) == 20
    assert max(asked.waits_s) > 30


KEY = "sk-Zq7Lw2Xv9Rt4Bn6Mk1Pd"


@pytest.mark.parametrize("code", [200, 400, 401, 403, 404, 429, 500])
def test_the_key_is_nowhere(code: int, monkeypatch, tmp_path, caplog, capfd) -> None:
    caplog.set_level(logging.DEBUG)
    monkeypatch.setenv("NEAR_KEY", KEY)
    words = f"Incorrect API key provided: {KEY}. Bearer {KEY[:11]}... is not {KEY[6:]}"
    pages = {
        "json": raw(f'{{"error": {{"message": "{words}"}}}}', code=code),
        "html": raw(f"<html><title>{words}</title>{KEY}</html>", "text/html", code=code),
        "answer": Act(status=code, body=say(words).body, headers={"X-Echo": KEY}),
        "refusal": Act(status=code, body=say(None, refusal=words).body),
    }
    for name, act in pages.items():
        recording = Recording(tmp_path / name)
        settings = {"api_key_env": "NEAR_KEY", "retries": 1}
        with asking(lambda *_, act=act: act, recording, endpoint=settings) as asked:
            try:
                said = repr(asked.language.complete(PROMPT, 0))
            except AgentError as error:
                said = f"{error!r} {error.__cause__} {error.__context__}"
                if code in (401, 403):
                    assert "NEAR_KEY" in said
            assert asked.server.headers[0]["authorization"] == f"Bearer {KEY}"
            said += repr(asked.agents) + repr(asked.agents.endpoints[0]) + repr(asked.agents.usage())
        said += "".join(path.read_text() for path in tmp_path.rglob("*.json"))
        said += caplog.text + "".join(capfd.readouterr())
        assert not [KEY[i : i + 10] for i in range(len(KEY) - 9) if KEY[i : i + 10] in said]


def test_scrub_masks_parts_and_leaves_words() -> None:
    assert scrub(f"a {KEY} b {KEY[3:15]}, {KEY[:9]}", KEY) == f"a [key] b [key], {KEY[:9]}"
    assert scrub("ollama says none", "none") == "ollama says none"
    assert scrub("anything", "") == "anything"


def test_every_error_of_the_client_is_mapped() -> None:
    settings = EndpointSettings(base_url="http://127.0.0.1/v1")
    request = httpx2.Request("POST", "http://127.0.0.1")

    def make(kind: type[Exception]) -> Exception:
        if issubclass(kind, openai.APIStatusError):
            code = kind.__annotations__.get("status_code")
            number = int(re.sub(r"\D", "", str(code)) or 500)
            response = httpx2.Response(number, request=request)
            if kind is openai.OAuthError:
                return openai.OAuthError(response=httpx2.Response(401, request=request), body=None)
            return kind("says", response=response, body={"message": "says"})  # type: ignore[call-arg]
        if issubclass(kind, openai.APIResponseValidationError):
            return kind(httpx2.Response(200, request=request), None)
        if issubclass(kind, openai.APITimeoutError):
            return kind(request)
        if issubclass(kind, openai.APIConnectionError):
            return kind(request=request)
        if issubclass(kind, openai.APIError):
            return kind("says", request, body=None)
        return kind.__new__(kind)

    kinds = {
        value
        for module in (openai, openai._exceptions)
        for value in list(vars(module).values())
        if isinstance(value, type) and issubclass(value, Exception) and value.__module__.startswith("openai")
    }
    assert len(kinds) >= 18
    retried = set()
    for kind in kinds:
        found = classify(make(kind), settings, 0.1)
        assert isinstance(found, Answer | Failure), kind
        if isinstance(found, Failure):
            assert found.what
            if found.retry:
                retried.add(kind.__name__)
    assert retried == {
        "APIStatusError", "APIConnectionError", "APITimeoutError", "APIResponseValidationError",
        "ConflictError", "RateLimitError", "InternalServerError",
    }  # fmt: skip


def test_an_answer_may_come_in_parts_and_with_broken_characters() -> None:
    parts = [{"type": "text", "text": "a "}, {"type": "image"}, {"type": "text", "text": "cat"}, "x"]
    with asking(lambda *_: say(parts)) as asked:
        assert asked.language.complete(PROMPT, 0).text == "a cat"
    found = read_answer('{"choices":[{"message":{"content":"\\ud83d cat"}}],"usage":[1]}', 0.5, 1)
    assert isinstance(found, Answer)
    assert (found.text, found.input_tokens) == ("? cat", None)
    assert isinstance(read_answer("[" * 100_000, 0.5, 1), Failure)
