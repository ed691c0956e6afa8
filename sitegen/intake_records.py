"""What the queue of uploads keeps on disk of each: who sent what, where it stands, and what came of it."""

import re
import secrets
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from pipeline.errors import Fault

Kind: TypeAlias = Literal["check", "submit"]
State: TypeAlias = Literal["queued", "working", "good", "accepted", "refused", "failed"]

WAITING: frozenset[State] = frozenset({"queued", "working"})
FIELDS: dict[str, int] = {
    "name": 80,
    "authors": 500,
    "url": 500,
    "agents": 500,
    "licence": 500,
    "notes": 2_000,
    "kind": 16,
    "format": 16,
    "caption_column": 200,
}
"""The fields of an upload beside its file, and how many characters each may have."""

_ID = re.compile(r"[A-Za-z0-9_-]{22}")


def new_id() -> str:
    """A random id of 128 bits: whoever knows it may see the upload."""
    return secrets.token_urlsafe(16)


def is_id(text: str) -> bool:
    """Whether a text has the form of an id."""
    return _ID.fullmatch(text) is not None


class Details(BaseModel):
    """What a sender says of an upload. Texts are as they came, only bounded; they are checked later.

    `file_name` is the name on the sender's computer, shown and never used as a path.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Kind = "check"
    name: Annotated[str, Field(max_length=FIELDS["name"])] = ""
    authors: Annotated[str, Field(max_length=FIELDS["authors"])] = ""
    url: Annotated[str, Field(max_length=FIELDS["url"])] = ""
    agents: Annotated[str, Field(max_length=FIELDS["agents"])] = ""
    licence: Annotated[str, Field(max_length=FIELDS["licence"])] = ""
    notes: Annotated[str, Field(max_length=FIELDS["notes"])] = ""
    source_format: Annotated[str, Field(max_length=FIELDS["format"])] = ""
    caption_column: Annotated[str, Field(max_length=FIELDS["caption_column"])] = ""
    file_name: Annotated[str, Field(max_length=255)] = "file"


class Upload(BaseModel):
    """One upload of the queue; `number` is its place in the order of arrival, from 1.

    `attempts` counts how often work on it was begun, `key` is the hash of the sender's idempotency key
    or empty, `received` is a day (ISO 8601).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    upload_id: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{22}$")]
    number: Annotated[int, Field(ge=1)]
    details: Details
    size: Annotated[int, Field(ge=0)]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    received: str
    key: str = ""
    state: State = "queued"
    attempts: int = 0

    @property
    def is_waiting(self) -> bool:
        """Whether it is not finished."""
        return self.state in WAITING


class Report(BaseModel):
    """What came of an upload: a plain sentence, every fault, and the scores when there are any.

    `scores` is as `rehearsal.report` makes it for a check; after a submission it holds `metrics` and the
    counts alone. `slug` names the submission's page.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    message: str = ""
    faults: tuple[Fault, ...] = ()
    warnings: tuple[str, ...] = ()
    source_format: str = ""
    scores: dict[str, Any] = {}
    slug: str = ""
