"""One model server: how it is asked, how often again, and what it turned out not to accept.

Speaks the OpenAI HTTP API through the official client, with retries of our own: the client knows
nothing of recordings, of a limit shared by all threads, or of contexts that are too long.
Every text that comes from a server is cleaned of the key before it goes anywhere.
"""

import logging
import random
import re
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipeline.config import EndpointSettings
from pipeline.errors import AgentError
from pipeline.metering import Limiter
from pipeline.recording import Answer, AnswerSchema, ImagePart, Message, Request, TextPart
from pipeline.replies import Failure, classify, read_answer, scrub

if TYPE_CHECKING:
    import openai

FIRST_WAIT_S = 0.5
MAX_WAIT_S = 60.0  # between two attempts, unless the server asks for more
MAX_RETRY_AFTER_S = 120.0  # whatever the server asks for
EMPTY_RETRIES = 2  # an empty answer is tried again this often, and then is what the model says

_SHOWN_CHARS = 300
_ABOUT_SCHEMA = re.compile(
    r"response.?format|json.?schema|structured.?output|guided|grammar|requested parameters", re.IGNORECASE
)


def _array(element: dict[str, Any]) -> dict[str, Any]:
    # Strict mode wants an object at the root, every key required and no others (OpenAI's rule).
    return {
        "type": "object",
        "properties": {"items": {"type": "array", "items": element}},
        "required": ["items"],
        "additionalProperties": False,
    }


_ITEM = {
    "type": "object",
    "properties": {"label": {"type": "string"}, "description": {"type": "string"}},
    "required": ["label", "description"],
    "additionalProperties": False,
}
SCHEMAS: dict[AnswerSchema, dict[str, Any]] = {
    "items-1": _array(_ITEM),
    "names-1": _array({"type": "string"}),
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A JPEG, as it is sent, and the hash that stands for it in a recording."""

    jpeg_sha256: str
    data_url: str = field(repr=False)


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked in a role. `answer_schema` is the form wished for, where the server knows forms."""

    role: str
    model: str
    temperature: float
    max_tokens: int
    seed: int
    system: str
    parts: tuple[str | Picture, ...]
    answer_schema: AnswerSchema = ""

    def request(self, *, with_schema: bool) -> Request:
        """The question as a recording knows it."""
        content: str | tuple[TextPart | ImagePart, ...] = self._plain() or tuple(
            TextPart(text=part) if isinstance(part, str) else ImagePart(jpeg_sha256=part.jpeg_sha256)
            for part in self.parts
        )
        system = (Message(role="system", content=self.system),) if self.system else ()
        return Request(
            model=self.model,
            temperature=self.temperature,
            max_tokens=self.max_tokens,
            seed=self.seed,
            answer_schema=self.answer_schema if with_schema else "",
            messages=(*system, Message(role="user", content=content)),
        )

    def body(self, *, with_schema: bool, unknown: frozenset[str]) -> dict[str, Any]:
        """The question as it is sent, without the parameters `unknown` to the server."""
        content: object = self._plain() or [
            {"type": "text", "text": part}
            if isinstance(part, str)
            else {"type": "image_url", "image_url": {"url": part.data_url}}
            for part in self.parts
        ]
        system = [{"role": "system", "content": self.system}] if self.system else []
        limit = "max_completion_tokens" if "max_tokens" in unknown else "max_tokens"
        sampling = {"temperature": self.temperature, "seed": self.seed}
        body: dict[str, Any] = {
            "model": self.model,
            "messages": [*system, {"role": "user", "content": content}],
            limit: self.max_tokens,
            **{name: value for name, value in sampling.items() if name not in unknown},
        }
        if with_schema:
            form = {"name": "answer", "strict": True, "schema": SCHEMAS[self.answer_schema]}
            body["response_format"] = {"type": "json_schema", "json_schema": form}
        return body

    def _plain(self) -> str:
        """The parts as one string when none is a picture: not every chat template takes parts."""
        words = [part for part in self.parts if isinstance(part, str)]
        return "\n\n".join(words) if len(words) == len(self.parts) else ""


@dataclass(slots=True)
class _Known:
    """What a process has learned of one model on one server."""

    schema: bool | None = None
    unknown: frozenset[str] = frozenset()
    finding_out: threading.Lock = field(default_factory=threading.Lock)


class Endpoint:
    """A server, shared by all roles and threads that ask it."""

    def __init__(
        self,
        name: str,
        settings: EndpointSettings,
        key: str = "",
        *,
        sleep: Callable[[float], None] = time.sleep,
        rng: random.Random | None = None,
    ) -> None:
        """`key` is the value of the variable `settings.api_key_env`; it leaves this object in the
        header of a request only. `sleep` takes seconds; `rng` spreads the waits."""
        self.name = name
        self.settings = settings
        self.limiter = Limiter(settings.max_in_flight)
        self._key = key
        self._sleep = sleep
        self._rng = rng or random.Random()  # noqa: S311  jitter, and not the same in every process
        self._models: dict[str, _Known] = {}
        self._guard = threading.Lock()
        self._client: openai.OpenAI | None = None

    def ask(self, question: Question) -> tuple[bool, Answer, tuple[Answer, ...]]:
        """Whether a schema was asked for, the answer, and the answers that were thrown away.

        Waits and asks again as the settings say. Raises AgentError that names role, endpoint,
        model, what happened and how often it was tried.
        """
        with self._guard:
            known = self._models.setdefault(question.model, _Known())
        attempts = 0
        wasted: list[Answer] = []
        while True:
            attempts += 1
            with_schema, outcome = self._attempt(question, known)
            if isinstance(outcome, Answer):
                if outcome.text or len(wasted) == EMPTY_RETRIES or attempts > self.settings.retries:
                    return with_schema, outcome, tuple(wasted)
                wasted.append(outcome)
                outcome = Failure("the answer is empty")
            elif self._adapts(outcome, known, question, with_schema=with_schema):
                attempts -= 1  # the same question in another form is not another try
                continue
            if not outcome.retry or attempts > self.settings.retries:
                break
            self._sleep(self._wait_s(attempts, outcome))
        times = "once" if attempts == 1 else f"{attempts} times"
        # First cleaned, then cut: half a key would not be found.
        what = scrub(outcome.what, self._key)
        what = what if len(what) <= _SHOWN_CHARS else what[:_SHOWN_CHARS] + "..."
        raise AgentError(
            f"role {question.role}, endpoint {self.name}, model {question.model}: {what}; asked {times}."
        )

    def close(self) -> None:
        """Close the connections."""
        if self._client is not None:
            self._client.close()

    def _attempt(self, question: Question, known: _Known) -> tuple[bool, Answer | Failure]:
        wanted = bool(question.answer_schema) and self.settings.json_schema == "auto"
        if not wanted or known.schema is not None:
            return self._send(question, known, with_schema=wanted and known.schema is not False)
        # One thread finds out, the others wait for it; but not for ever on a server that hangs.
        alone = known.finding_out.acquire(timeout=self.settings.timeout_s)
        try:
            sent = self._send(question, known, with_schema=known.schema is not False)
            if isinstance(sent[1], Answer) and sent[1].outcome == "answered":
                known.schema = sent[0]
            elif isinstance(sent[1], Failure) and sent[0] and _ABOUT_SCHEMA.search(sent[1].rejected):
                known.schema = False
            return sent
        finally:
            if alone:
                known.finding_out.release()

    def _send(self, question: Question, known: _Known, *, with_schema: bool) -> tuple[bool, Answer | Failure]:
        unknown = known.unknown
        body = question.body(with_schema=with_schema, unknown=unknown)
        with self.limiter.slot() as slot:
            start = time.perf_counter()
            try:
                # As text, since what comes from a server need not be what the client's types say.
                text = self._opened().post("/chat/completions", cast_to=str, body=body)
            except Exception as error:  # whatever it is, its text may hold the key
                outcome = classify(error, self.settings, time.perf_counter() - start)
            else:
                outcome = read_answer(text, time.perf_counter() - start, question.max_tokens)
            if isinstance(outcome, Failure):
                slot.failed(throttled=outcome.throttled)
                return with_schema, outcome
        note = "temperature not accepted" if "temperature" in unknown else ""
        return with_schema, outcome.model_copy(update={"text": scrub(outcome.text, self._key), "note": note})

    def _adapts(self, failure: Failure, known: _Known, question: Question, *, with_schema: bool) -> bool:
        """Whether the server refused the form of a request, and there is another form to try."""
        if not failure.rejected:
            return False
        if with_schema and _ABOUT_SCHEMA.search(failure.rejected):
            known.schema = False
            return True
        sent = {"seed", "temperature", "max_tokens"} - known.unknown
        named = {name for name in sent if re.search(rf"\b{name}\b", failure.rejected)}
        known.unknown |= named
        return bool(named)

    def _wait_s(self, attempts: int, failure: Failure) -> float:
        """Full jitter over an exponential wait; what the server asks for, when it does."""
        if failure.wait_s is not None:
            return min(failure.wait_s, MAX_RETRY_AFTER_S)
        return self._rng.uniform(0, min(MAX_WAIT_S, FIRST_WAIT_S * 2 ** (attempts - 1)))

    def _opened(self) -> "openai.OpenAI":
        with self._guard:
            if self._client is None:
                # Inside, since it takes a second to load and a replay does not need it.
                import openai

                # At DEBUG the transport logs all headers of a response, and a server may echo the key in one.
                for transport in ("httpcore", "httpcore2"):
                    logging.getLogger(transport).setLevel(logging.INFO)
                self._client = openai.OpenAI(
                    base_url=self.settings.base_url,
                    # Never None: the client would send OPENAI_API_KEY to whatever server this is.
                    api_key=self._key or "none",
                    max_retries=0,
                    timeout=self.settings.timeout_s,
                    http_client=openai.DefaultHttpxClient(follow_redirects=False),
                )
                # From OPENAI_ORG_ID and OPENAI_PROJECT_ID: no business of other servers.
                if not self.settings.base_url.startswith("https://api.openai.com/"):
                    self._client.organization = self._client.project = None
            return self._client
