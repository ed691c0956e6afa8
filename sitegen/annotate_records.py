"""What an annotator said of a video at one time: the record, its checks, and its line of JSON."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from pipeline.errors import InputError
from pipeline.files import slug
from sitegen import checks

MERGED = "merged"
IMPORTED = "imported"
RESERVED = frozenset({MERGED, IMPORTED})
MAX_HAZARDS = 100

_SESSION_CHARS = 100
_SEEN_AUTHORS = 1_000
_HAZARD_NAMES = frozenset({"hazard_id", "label", "description", "track_id", "first_frame", "last_frame"})


@dataclass(frozen=True, slots=True)
class Said:
    """A hazard as its author wrote it: texts as typed, perhaps still empty; frames are 0-based."""

    hazard_id: str
    label: str
    description: str
    track_id: str | None = None
    first_frame: int | None = None
    last_frame: int | None = None

    def content(self) -> tuple[Any, ...]:
        """What it says, blanks and numbering aside."""
        texts = (" ".join(self.label.split()), " ".join(self.description.split()))
        return (*texts, self.track_id, self.first_frame, self.last_frame)


@dataclass(frozen=True, slots=True)
class Record:
    """One saved state of one video.

    `revision` counts from 1 in each author's journal of a video; `by` wrote it; `saved_at` is ISO 8601
    UTC; (`session`, `sequence`) name the save that a page asked for; `seen` are the revisions of others
    that a merge was made from.
    """

    video_id: str
    hazards: tuple[Said, ...]
    no_hazard: bool
    revision: int
    by: str
    saved_at: str
    session: str
    sequence: int
    seen: Mapping[str, int] = field(default_factory=dict)

    @property
    def problems(self) -> list[str]:
        """Why it is not finished; empty when it is."""
        return problems(self.hazards, self.no_hazard)

    @property
    def is_finished(self) -> bool:
        """Whether it can count as truth."""
        return not self.problems

    def content(self) -> tuple[Any, ...]:
        """What it says, whoever said it and in whatever order."""
        return (self.no_hazard, *sorted((hazard.content() for hazard in self.hazards), key=repr))

    def line(self) -> bytes:
        """The journal's line, its end included."""
        made = json.dumps(asdict(self), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        return made.encode() + b"\n"


def problems(hazards: Iterable[Said], no_hazard: bool) -> list[str]:
    """What is still to do before a state can count as truth, one sentence each."""
    hazards = list(hazards)
    if not hazards and not no_hazard:
        return ["Nothing said yet: pick a hazard, or say that there is none."]
    if hazards and no_hazard:
        return ["It says that there is no hazard, and names one: choose."]
    found = []
    for number, hazard in enumerate(hazards, 1):
        for name, value, check in (
            ("label", hazard.label, checks.text),
            ("description", hazard.description, checks.description),
        ):
            try:
                check(value)
            except checks.Wrong:
                found.append(f"Hazard {number} has no {name}.")
        first, last = hazard.first_frame, hazard.last_frame
        if first is not None and last is not None and last < first:
            found.append(f"Hazard {number} ends before it begins.")
    return found


def author_of(name: str) -> str:
    """An author's name as it is stored, `[a-z0-9-]`. Raises InputError for none left or a taken one."""
    author = slug(name)
    if not author:
        raise InputError(f"author: found {checks.show(name)}; expected a name with letters a-z or digits.")
    if author in RESERVED:
        raise InputError(f"author: {author} is kept for the program; choose another name.")
    return author


def read_state(data: Any) -> tuple[tuple[Said, ...], bool]:
    """The hazards and the no-hazard mark of a JSON object from outside. Raises InputError."""
    if not isinstance(data, dict):
        raise InputError("Found no JSON object; expected one with hazards and no_hazard.")
    listed, no_hazard = data.get("hazards"), data.get("no_hazard")
    if not isinstance(listed, list) or len(listed) > MAX_HAZARDS:
        raise InputError(f"hazards: expected a list of at most {MAX_HAZARDS}.")
    if not isinstance(no_hazard, bool):
        raise InputError(f"no_hazard: found {checks.show(no_hazard)}; expected true or false.")
    hazards = tuple(map(_said, listed))
    if len({hazard.hazard_id for hazard in hazards}) < len(hazards):
        raise InputError("hazards: found one hazard_id twice; expected each once.")
    return hazards, no_hazard


def _said(data: Any) -> Said:
    if not isinstance(data, dict) or set(data) != _HAZARD_NAMES:
        raise InputError(f"hazards: expected objects with {', '.join(sorted(_HAZARD_NAMES))}.")
    track_id = None if data["track_id"] is None else _id(data, "track_id")
    frames = [None if data[name] is None else count_of(data, name) for name in ("first_frame", "last_frame")]
    return Said(_id(data, "hazard_id"), _text(data, "label"), _text(data, "description"), track_id, *frames)


def _text(data: Mapping[str, Any], name: str, most: int = checks.MAX_TEXT_CHARS) -> str:
    value = data.get(name)
    if not isinstance(value, str) or len(value) > most or "\0" in value or not _is_unicode(value):
        found = checks.show(value)
        raise InputError(f"{name}: found {found}; expected text of at most {most:,} characters.")
    return value


def _is_unicode(value: str) -> bool:
    """Whether it can be stored: JSON can carry half a surrogate pair."""
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


def _id(data: Mapping[str, Any], name: str) -> str:
    try:
        return checks.identifier(_text(data, name))
    except checks.Wrong as wrong:
        raise InputError(f"{name}: found {wrong.found}; expected {wrong.expected}.") from wrong


def count_of(data: Mapping[str, Any], name: str) -> int:
    """A whole number of 0 or more, as JSON writes it. Raises InputError."""
    value = data.get(name)
    if type(value) is not int or not 0 <= value <= checks.MAX_WHOLE:
        raise InputError(f"{name}: found {checks.show(value)}; expected a whole number from 0.")
    return value


def session_of(data: Mapping[str, Any]) -> str:
    """The name of a page's session. Raises InputError."""
    return _text(data, "session", _SESSION_CHARS)


def seen_of(data: Mapping[str, Any]) -> dict[str, int]:
    """The revisions that a merge was made from, by author. Raises InputError."""
    seen = data.get("seen", {})
    if not isinstance(seen, dict) or len(seen) > _SEEN_AUTHORS or any(slug(name) != name for name in seen):
        raise InputError("seen: expected an object of authors and revisions.")
    return {name: count_of(seen, name) for name in sorted(seen)}


def record_of(line: bytes, author: str) -> Record:
    """The record of a journal's line. Raises ValueError, RecursionError or InputError for another line."""
    data = json.loads(line)
    hazards, no_hazard = read_state(data)
    by = _text(data, "by")
    if author not in {MERGED, by}:
        raise InputError(f"by: found {checks.show(by)}; expected {author}.")
    return Record(
        video_id=_video_id(data),
        hazards=hazards,
        no_hazard=no_hazard,
        revision=count_of(data, "revision"),
        by=by,
        saved_at=_text(data, "saved_at"),
        session=session_of(data),
        sequence=count_of(data, "sequence"),
        seen=seen_of(data),
    )


def _video_id(data: Mapping[str, Any]) -> str:
    value = _text(data, "video_id")
    if not checks.SAFE_ID.fullmatch(value):
        raise InputError(f"video_id: found {checks.show(value)}; expected a video id.")
    return value
