"""`submission.toml`: who sent a submission, and the hashes of its files."""

import json
import re
import tomllib
import unicodedata
from collections.abc import Mapping
from datetime import date as calendar_date
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.files import slug
from sitegen.checks import show

FILE_NAME = "submission.toml"


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


class About(BaseModel):
    """The content of `submission.toml`; an unknown key is an error. `config_sha256` may be empty."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, AfterValidator(_plain), Field(min_length=1, max_length=80)]
    authors: _Line
    url: Annotated[_Line, AfterValidator(_url)]
    date: Annotated[str, AfterValidator(_date)]
    agents: _Line
    source_format: Literal["csv", "jsonl", "parquet"]
    original_sha256: _Hash
    predictions_sha256: _Hash
    config_sha256: _Hash | Literal[""] = ""


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
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not readable as TOML: {error}.") from error
    return validated(values, str(path))
