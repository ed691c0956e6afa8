"""What model servers were asked and what they said, one small file a request: never paid twice.

    <folder>/ab/ab12...ef.json     named by the SHA-256 of the request in canonical JSON

A request is the model, the sampling, whether a schema was asked for, and the messages, in which
each picture is the SHA-256 of its JPEG. No picture, key or address is kept. A file whose name is not
the hash of the request in it is corrupt. Source: ours.
"""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import AgentError, OutsideError
from pipeline.files import sha256_of, write_bytes

# A prompt of ten thousand descriptions fits; what is larger did not come from us.
MAX_RECORD_BYTES = 16 << 20
MAX_ANSWER_CHARS = 1 << 18

_SHA256 = r"^[0-9a-f]{64}$"

AnswerSchema: TypeAlias = Literal["", "items-1", "names-1"]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class TextPart(_Strict):
    """Words in a message that also holds pictures."""

    type: Literal["text"] = "text"
    text: str


class ImagePart(_Strict):
    """A picture in a message, by the hash of its JPEG bytes."""

    type: Literal["image"] = "image"
    jpeg_sha256: str = Field(pattern=_SHA256)


class Message(_Strict):
    """One message of a request."""

    role: Literal["system", "user"]
    content: str | tuple[TextPart | ImagePart, ...]


class Request(_Strict):
    """All that an answer depends on, but for the server. `answer_schema` is empty without a schema.

    The sampling is what the configuration asks for, even where a server knows no `seed`, so that
    repeated questions stay apart.
    """

    model: str = Field(min_length=1)
    temperature: float = Field(ge=0)
    max_tokens: int = Field(ge=1)
    seed: int = Field(ge=0)
    answer_schema: AnswerSchema
    messages: tuple[Message, ...] = Field(min_length=1, max_length=2)

    @property
    def sha256(self) -> str:
        """Hex SHA-256 of the request as JSON with sorted keys, no spaces, ASCII only."""
        return sha256_of(_json(self.model_dump(mode="json"), indent=None).encode())


class Answer(_Strict):
    """How a request ended. `latency_s` is that of the request that brought the answer.

    `refused`: the model or a content filter declined, `text` says how. `too long`: the server holds
    the request to be longer than its context, `text` is what it said. Both are kept so that a replay
    goes the way of the run. `note` says what the server did not accept.
    """

    outcome: Literal["answered", "refused", "too long"]
    text: str = Field(max_length=MAX_ANSWER_CHARS)
    note: str = Field(default="", max_length=1_000)
    latency_s: float = Field(ge=0)
    input_tokens: int | None = Field(default=None, ge=0)
    output_tokens: int | None = Field(default=None, ge=0)


class Record(_Strict):
    """The content of one file."""

    format: Literal[1] = 1
    request: Request
    answer: Answer

    @property
    def name(self) -> str:
        """The file's path inside a recording."""
        return _name(self.request.sha256)

    def as_bytes(self) -> bytes:
        """The record as it is written, always the same bytes."""
        return (_json(self.model_dump(mode="json"), indent=1) + "\n").encode()


class Recording:
    """A folder of answers. Safe for many threads, and for many processes at once."""

    def __init__(self, folder: Path) -> None:
        """`folder` is made when the first answer is kept."""
        self.folder = folder
        self._guard = threading.Lock()
        self._asking: dict[str, tuple[threading.Lock, list[None]]] = {}

    def path(self, sha256: str) -> Path:
        """Where the answer to a request lies, or would lie."""
        return self.folder / _name(sha256)

    def find(self, request: Request, *, strict: bool = False) -> Answer | None:
        """The answer to a request, None when there is none.

        A corrupt file counts as none, to be asked and written anew; when `strict`, it raises
        AgentError with its name.
        """
        path = self.path(request.sha256)
        try:
            with path.open("rb") as source:
                data = source.read(MAX_RECORD_BYTES + 1)
            return checked(data, _name(request.sha256)).answer
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            if strict:
                found = why(error)
                raise AgentError(
                    f"{path}: found {found}; expected a recorded answer. Record it anew."
                ) from None
            return None

    def keep(self, request: Request, answer: Answer) -> None:
        """Write an answer, whole or not at all. Raises OutsideError when the disk does not take it."""
        path = self.path(request.sha256)
        try:
            write_bytes(path, Record(request=request, answer=answer).as_bytes())
        except OSError as error:
            raise OutsideError(f"{path}: the answer could not be recorded: {error.strerror}.") from error

    @contextmanager
    def alone(self, request: Request) -> Iterator[None]:
        """One thread at a time for a request, so that two that ask it pay once."""
        key = request.sha256
        with self._guard:
            lock, waiting = self._asking.setdefault(key, (threading.Lock(), []))
            waiting.append(None)
        try:
            with lock:
                yield
        finally:
            with self._guard:
                waiting.pop()
                if not waiting:
                    del self._asking[key]


def checked(data: bytes, name: str) -> Record:
    """The record in a file's bytes. Raises ValueError when it is none or belongs elsewhere."""
    if len(data) > MAX_RECORD_BYTES:
        raise ValueError(f"more than {MAX_RECORD_BYTES} bytes")
    record = Record.model_validate_json(data)
    if record.name != name:
        raise ValueError("a request that does not fit the file's name")
    return record


def why(error: Exception) -> str:
    """What was found instead of a record, without the content itself."""
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"][:6])
        return f"{where[:100]!a}: {first['msg'][:200]}"
    return str(error)[:300] or type(error).__name__


def _name(sha256: str) -> str:
    return f"{sha256[:2]}/{sha256}.json"


def _json(value: object, indent: int | None) -> str:
    separators = (",", ":") if indent is None else (",", ": ")
    return json.dumps(value, sort_keys=True, separators=separators, indent=indent)
