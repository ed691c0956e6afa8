"""What came back from a model server, good or bad, read as an answer or as a failure. Pure.

A server is not trusted to send what the API promises: pages of HTML, half a JSON, no choice, an
error under status 200 and contents in parts all happen. Source: ours.
"""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any

from pipeline.config import EndpointSettings
from pipeline.recording import MAX_ANSWER_CHARS, Answer

_MASKED_RUN = 10  # so many characters of a key in a row are masked: servers cut what they echo
_RETRIED = frozenset({408, 409, 425, 429})  # and all from 500 on

_TOO_LONG = re.compile(
    r"context[ _](length|size|window)|maximum context|exceed_context|(prompt|input|request) is too long"
    r"|too many (input )?tokens|reduce the length|input length|at most \d+ (image|multi)|too many images",
    re.IGNORECASE,
)
_FILTERED = re.compile(
    r"content.?filter|content.?policy|content management policy|safety system", re.IGNORECASE
)
_TITLE = re.compile(r"<title[^>]*>\s*([^<]{1,100})", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a request brought no answer.

    `wait_s` is what the server asks to wait; `rejected` are the words of one that refuses the form
    of the request, in full, for whoever wants to try another form.
    """

    what: str
    retry: bool = True
    throttled: bool = False
    wait_s: float | None = None
    rejected: str = ""


def scrub(text: str, key: str) -> str:
    """`text` with each run of 10 or more characters of the key masked.

    Shorter keys than that are what local servers are given ("none", "ollama"): words, no secrets.
    """
    if len(key) < _MASKED_RUN:
        return text
    runs = {key[start : start + _MASKED_RUN] for start in range(len(key) - _MASKED_RUN + 1)}
    if not any(run in text for run in runs):
        return text
    hidden = [False] * len(text)
    for start in range(len(text) - _MASKED_RUN + 1):
        if text[start : start + _MASKED_RUN] in runs:
            hidden[start : start + _MASKED_RUN] = [True] * _MASKED_RUN
    masked = "".join("\0" if hide else char for char, hide in zip(text, hidden, strict=True))
    return re.sub("\0+", "[key]", masked)


def classify(error: Exception, settings: EndpointSettings, latency_s: float) -> Answer | Failure:
    """An exception of the client as a failure; as an answer where a replay must know of it."""
    import openai

    if isinstance(error, openai.APIStatusError):
        return _status(error, settings, latency_s)
    if isinstance(error, openai.APITimeoutError):
        return Failure(f"no answer within {settings.timeout_s:g} s")
    if isinstance(error, openai.APIConnectionError):
        cause = type(error.__cause__).__name__ if error.__cause__ else "unknown cause"
        return Failure(f"the connection failed ({cause})")
    if isinstance(error, openai.APIResponseValidationError):
        return Failure("the answer is not what the API promises")
    if isinstance(error, openai.ContentFilterFinishReasonError):
        return Answer(outcome="refused", text="the content filter stopped the answer", latency_s=latency_s)
    # The rest (web sockets, webhooks, identities) does not come from a chat request.
    return Failure(f"unexpected {type(error).__name__}", retry=False)


def read_answer(raw: str, latency_s: float, max_tokens: int) -> Answer | Failure:
    """The body of a response with status 200 as an answer, else as a failure to try again."""
    try:
        body = json.loads(raw)
    except (ValueError, RecursionError):
        return Failure(f"the answer is no JSON but {_page(raw)}")
    if not isinstance(body, dict) or not body.get("choices"):
        error = _says(body) if isinstance(body, dict) and body.get("error") else ""
        return Failure(f"the answer has no choice{f': {error}' if error else ''}")
    try:
        choice = body["choices"][0]
        message, finish = choice["message"], choice.get("finish_reason")
        text, refusal = _content(message.get("content")), message.get("refusal")
    except (TypeError, KeyError, AttributeError, IndexError):
        return Failure("the answer's first choice has no message")
    if finish == "content_filter" or (isinstance(refusal, str) and refusal):
        why = refusal if isinstance(refusal, str) and refusal else "the content filter stopped the answer"
        return _answer("refused", why, body, latency_s)
    if not text.strip() and finish == "length":
        advice = "raise the role's max_tokens, or switch the model's thinking off"
        return Failure(f"all {max_tokens} tokens were spent before the answer began: {advice}", retry=False)
    return _answer("answered", text if text.strip() else "", body, latency_s)


def retry_after_s(headers: Mapping[str, str], now: datetime) -> float | None:
    """How many seconds a server asks to wait, not negative; None when it does not say."""
    for name, unit in (("retry-after-ms", 1e-3), ("retry-after", 1.0)):
        value = headers.get(name, "").strip()
        try:
            seconds = float(value) * unit
        except ValueError:
            continue
        return max(0.0, seconds) if not math.isnan(seconds) else None
    try:
        when = parsedate_to_datetime(headers.get("retry-after", ""))
    except (ValueError, TypeError, OverflowError):
        return None
    when = when if when.tzinfo else when.replace(tzinfo=UTC)
    return max(0.0, (when - now).total_seconds())


def _status(  # noqa: PLR0911  one return for each kind of error
    error: Any, settings: EndpointSettings, latency_s: float
) -> Answer | Failure:
    """An error with an HTTP status; `error` is an openai.APIStatusError."""
    status: int = error.status_code
    full = error.body if isinstance(error.body, str) else json.dumps(error.body, ensure_ascii=False)
    says = _says(error.body)
    shown = f"HTTP {status}: {says}" if says else f"HTTP {status}"
    if status == 401 or (status == 403 and not _FILTERED.search(full)):
        # The words of the server stay out: they like to show parts of the key.
        if settings.api_key_env:
            return Failure(f"the key in {settings.api_key_env} is refused (HTTP {status})", retry=False)
        what = f"a key is wanted (HTTP {status}): name its environment variable as the endpoint's api_key_env"
        return Failure(what, retry=False)
    if status in {400, 403, 413, 422} and _FILTERED.search(full):
        return _answer("refused", shown, None, latency_s)
    if status == 413 or (status in {400, 422, 500} and _TOO_LONG.search(full)):
        return _answer("too long", shown, None, latency_s)
    if status == 429:
        paid_up = "insufficient_quota" not in full
        headers = error.response.headers
        return Failure(shown, paid_up, throttled=True, wait_s=retry_after_s(headers, datetime.now(UTC)))
    if status in _RETRIED or status >= 500:
        return Failure(shown, wait_s=retry_after_s(error.response.headers, datetime.now(UTC)))
    if status == 404:
        advice = "check the role's model and the endpoint's base_url"
        return Failure(f"no such model or address ({shown}): {advice}", retry=False, rejected=full)
    return Failure(shown, retry=False, rejected=full if status in {400, 422} else "")


def _says(body: object) -> str:
    """The words of an error's body, on one line, not longer than a person wants to read."""
    if isinstance(body, str):
        return _page(body) if body.strip() else ""
    error = body.get("error", body) if isinstance(body, dict) else body
    message = error.get("message") if isinstance(error, dict) else error
    text = message if isinstance(message, str) else json.dumps(body, ensure_ascii=False) if body else ""
    return " ".join(text.split())


def _page(raw: str) -> str:
    """What a text is that should have been JSON."""
    if "<html" in raw[:2_000].lower() or raw.lstrip()[:9].lower() == "<!doctype":
        title = _TITLE.search(raw[:10_000])
        return f'a page of HTML titled "{" ".join(title[1].split())}"' if title else "a page of HTML"
    start = " ".join(raw[:2_000].split())
    return f'"{start}"' if start else "nothing"


def _content(content: object) -> str:
    """The text of a message; some servers send it in parts."""
    if isinstance(content, list):
        parts = [part.get("text") for part in content if isinstance(part, dict)]
        return "".join(part for part in parts if isinstance(part, str))
    return content if isinstance(content, str) else ""


def _answer(outcome: Any, text: str, body: dict[str, Any] | None, latency_s: float) -> Answer:
    # Lone surrogates, which JSON can spell, cannot be written as UTF-8.
    clean = text.encode("utf-8", "replace").decode()[:MAX_ANSWER_CHARS]
    usage = body.get("usage") if body else None
    read, written = (
        _count(usage.get(name)) if isinstance(usage, dict) else None
        for name in ("prompt_tokens", "completion_tokens")
    )
    return Answer(
        outcome=outcome,
        text=clean,
        latency_s=round(latency_s, 6),
        input_tokens=read,
        output_tokens=written,
    )


def _count(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 53 else None
