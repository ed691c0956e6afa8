"""`submission.toml`: who sent a submission, and the hashes of its files."""

import json
import re
import tomllib
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import date as calendar_date
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.files import slug
from sitegen.checks import show

FILE_NAME = "submission.toml"
MAX_BYTES = 64 * 1024


def _plain(value: str) -> str:
    if any(unicodedata.category(char) in {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"} for char in value):
        raise ValueError("holds a control or formatting character; use plain text on one line")
    return value.strip()


def _date(value: str) -> str:
    return calendar_date.fromisoformat(value).isoformat()


def _url(value: str) -> str:
    if value and not re.fullmatch(r"https?://[^\s<>\"']+", value):
        raise ValueError("is no web address; start it with https:// or leave it empty")
    return value


_Line = Annotated[str, Field(max_length=500), AfterValidator(_plain)]
_Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


@dataclass(frozen=True, slots=True)
class Sender:
    """What the sender says of a submission; only the name is needed. `date` (ISO 8601) is the system's."""

    name: str
    authors: str = ""
    url: str = ""
    date: str = ""
    agents: str = ""
    licence: str = ""
    notes: str = ""


class About(BaseModel):
    """The content of `submission.toml`; an unknown key is an error.

    The name and `agents` to `notes` are the sender's words. `ending` is that of the original file
    (`csv.gz`), empty in older files, where it is the format's. `config_sha256` may be empty.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, AfterValidator(_plain), Field(min_length=1, max_length=80)]
    authors: _Line
    url: Annotated[_Line, AfterValidator(_url)]
    date: Annotated[str, AfterValidator(_date)]
    agents: _Line
    licence: _Line = ""
    notes: Annotated[str, Field(max_length=2_000), AfterValidator(_plain)] = ""
    source_format: Annotated[str, Field(pattern=r"^[a-z0-9]{1,16}$")]
    ending: Annotated[str, Field(pattern=r"^([a-z0-9]{1,16}(\.[a-z0-9]{1,8})?)?$")] = ""
    original_sha256: _Hash
    predictions_sha256: _Hash
    config_sha256: _Hash | Literal[""] = ""

    @property
    def original(self) -> str:
        """The name of the original file in the submission's folder."""
        return f"original.{self.ending or self.source_format}"


def read_sender(path: Path) -> Sender:
    """What a TOML file says of a submission: the fields of `Sender`, `name` at least.

    Raises InputError when it is not readable, holds another key, or a value is no text.
    """
    values = _toml_of(path)
    known = [field.name for field in fields(Sender)]
    wrong = [f"an unknown key {show(key)}" for key in values if key not in known]
    wrong += [f"{key}: {show(value)}" for key, value in values.items() if not isinstance(value, str)]
    if "name" not in values:
        wrong.append("no name")
    if wrong:
        raise InputError(f"{path}: found {'; '.join(wrong)}; expected texts for {', '.join(known)}.")
    return Sender(**values)


def write(folder: Path, about: About) -> None:
    """Write it to a submission's folder."""
    lines = [f"{key} = {_toml(value)}\n" for key, value in about.model_dump().items()]
    (folder / FILE_NAME).write_text("".join(lines), encoding="utf-8")


def _toml(value: str) -> str:
    """A TOML basic string; JSON's escapes are TOML's, but for DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


def validated(values: Mapping[str, object], place: str) -> About:
    """The values, checked. Raises InputError with every wrong one; `place` says where they are from."""
    try:
        about = About.model_validate(values)
    except ValidationError as error:
        faults = [
            f"  {'.'.join(str(part) for part in fault['loc'])}: found {show(fault['input'])}; {fault['msg']}"
            for fault in error.errors(include_url=False)
        ]
        raise InputError("\n".join([f"{place}: {len(faults)} wrong value(s).", *faults])) from error
    if not slug(about.name):
        raise InputError(
            f"{place}: the name '{about.name}' holds no letter a-z or digit, so "
            "no page can be named after it. Add some."
        )
    return about


def read(folder: Path) -> About:
    """What a submission's folder says. Raises InputError when it is missing or wrong."""
    path = folder / FILE_NAME
    return validated(_toml_of(path), str(path))


def _toml_of(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: over {MAX_BYTES // 1024} KB; expected a short TOML file.")
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not readable as TOML: {error}.") from error
