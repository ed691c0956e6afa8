"""The settings of a run and of a benchmark folder: TOML in, frozen and checked models out.

Unknown keys, wrong types and values out of range are errors, all of them reported together.
"""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pipeline.errors import ConfigError
from pipeline.files import sha256_of

M = TypeVar("M", bound="Settings")


class Settings(BaseModel):
    """A table of settings; frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FrameSettings(Settings):
    """Which frames are looked at (paper: N = 25 at equal interval)."""

    count: int = Field(default=25, ge=1, le=10_000)


class Track2Settings(Settings):
    """Track 2 (paper: the whole video is asked about 20 times)."""

    enabled: bool = True
    queries: int = Field(default=20, ge=1, le=1_000)


class VerifySettings(Settings):
    """Which snippets count, and what is detected (paper: 175 px, 35,000 px², top 10th percentile).

    `reference_width_px`: the frame width that the limits are meant for. When it is not 0, the
    limits are scaled by frame width / reference width, the area by its square (ours).

    `upscale` pads and enlarges small crops instead of dropping them (ours): a square around the box,
    grown by `upscale_context` of its longer side all around, at least `upscale_min_side_px` a side.
    """

    min_width_px: float = Field(default=175.0, ge=0)
    min_height_px: float = Field(default=175.0, ge=0)
    min_area_px2: float = Field(default=35_000.0, ge=0)
    reference_width_px: int = Field(default=0, ge=0)
    top_percent: float = Field(default=10.0, gt=0, le=100)
    upscale: bool = False
    upscale_context: float = Field(default=0.25, ge=0, le=4)
    upscale_min_side_px: int = Field(default=224, ge=16, le=1024)


class EndpointSettings(Settings):
    """A server that speaks the OpenAI HTTP API. The key comes from the environment, never from a file."""

    base_url: str = Field(pattern=r"^https?://[^\s@]+$")
    api_key_env: str = Field(default="", pattern=r"^[A-Za-z_][A-Za-z0-9_]*$|^$")
    max_in_flight: int = Field(default=8, ge=1, le=256)
    timeout_s: float = Field(default=120.0, gt=0, le=3_600)
    retries: int = Field(default=6, ge=0, le=20)
    json_schema: Literal["auto", "never"] = "auto"


class RoleSettings(Settings):
    """Which model answers in one of the paper's roles, and how it is asked.

    `image_width_px` and `jpeg_quality` say how frames are sent (ours); larger frames are reduced.
    """

    endpoint: str = ""
    model: str = ""
    temperature: float = Field(default=0.2, ge=0, le=2)
    max_tokens: int = Field(default=200, ge=1, le=100_000)
    image_width_px: int = Field(default=640, ge=16, le=8_192)
    jpeg_quality: int = Field(default=85, ge=1, le=100)


# What the paper or its scripts set for each role (PAPER section 2); ours where both are silent.
_ROLE_DEFAULTS: dict[str, dict[str, float]] = {
    "scene": {"temperature": 0.2, "max_tokens": 512},
    "video": {"temperature": 0.2, "max_tokens": 512},
    "rhs": {"temperature": 0.5, "max_tokens": 200},
    "aes": {"temperature": 0.2, "max_tokens": 100},
    "cos": {"temperature": 0.2, "max_tokens": 200},
    "aos": {"temperature": 0.2, "max_tokens": 200},
}


class Roles(Settings):
    """The paper's roles. What a role does not say is as in the paper, also when it says something."""

    scene: RoleSettings
    video: RoleSettings
    rhs: RoleSettings
    aes: RoleSettings
    cos: RoleSettings
    aos: RoleSettings

    @model_validator(mode="before")
    @classmethod
    def _papers_defaults(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        merged = dict(given)
        for role, defaults in _ROLE_DEFAULTS.items():
            said = given.get(role, {})
            merged[role] = {**defaults, **said} if isinstance(said, dict) else said
        return merged


class Price(Settings):
    """What a model's tokens cost, per million, in the currency of the configuration."""

    input_per_million: float = Field(ge=0)
    output_per_million: float = Field(ge=0)


class RunConfig(Settings):
    """Everything that changes what `predict` writes, and how it goes about it.

    `vision`, `language` and `matcher` choose who answers: `embedded` and `conse` are the named
    baselines that need no network; `http` asks the servers of `roles`; `clip` needs the ONNX folder
    `clip_folder`.
    """

    name: str = Field(default="Embedded pipeline", min_length=1, max_length=80)
    vision: Literal["embedded", "http"] = "embedded"
    language: Literal["embedded", "http"] = "embedded"
    matcher: Literal["conse", "clip"] = "conse"
    clip_folder: str = ""
    seed: int = Field(default=0, ge=0)
    frames: FrameSettings = FrameSettings()
    track2: Track2Settings = Track2Settings()
    verify: VerifySettings = VerifySettings()
    roles: Roles = Roles.model_validate({})
    endpoints: dict[str, EndpointSettings] = {}
    prices: dict[str, Price] = {}
    currency: str = Field(default="USD", max_length=8)

    @model_validator(mode="after")
    def _clip_has_a_folder(self) -> Self:
        if self.matcher == "clip" and not self.clip_folder:
            raise ValueError('matcher "clip" needs clip_folder: the folder of an ONNX export of CLIP')
        return self

    @property
    def models(self) -> dict[str, str]:
        """The model behind each role that is asked over HTTP."""
        asked = [*(["scene", "video"] if self.vision == "http" else [])]
        asked += ["rhs", "aes", "cos", "aos"] if self.language == "http" else []
        return {role: getattr(self.roles, role).model for role in asked}

    @property
    def sha256(self) -> str:
        """Hash of every setting that can change an answer, independent of order and of defaults.

        Where the servers are, how many requests may be in flight and what tokens cost are left out.
        """
        settings = self.model_dump(mode="json", exclude={"endpoints", "prices", "currency", "clip_folder"})
        return sha256_of(json.dumps(settings, sort_keys=True).encode())


class DemoSubmission(Settings):
    """One submission that `coooler demo` makes: from a run configuration or a predictions file.

    With `board` off, the run is made and reported, but not put on the board.
    """

    name: str
    board: bool = True
    run: str = ""
    predictions: str = ""
    authors: str = ""
    url: str = ""
    date: str = ""
    agents: str = ""
    licence: str = ""


class BenchmarkSettings(Settings):
    """The content of `coooler.toml`: what a benchmark folder holds. Paths are relative to it.

    `address` is where the site will be seen, ending in a slash; pages name it as theirs. With
    `hide_truth` the site shows scores, but no truth text, hazard box, crop or cosine of a pair.
    `language` (BCP 47) is that of the site's words; every language but English needs a catalogue.
    """

    name: str = Field(default="A COOOLER benchmark", min_length=1, max_length=120)
    description: str = ""
    truth: str = "truth.csv"
    videos: str = "videos"
    boxes: str = "boxes.parquet"
    submissions: str = "submissions"
    site: str = "site"
    language: str = Field(default="en", pattern=r"^[a-z]{2,3}(-[A-Za-z0-9]{2,8})*$")
    address: str = Field(default="", pattern=r"^(https?://[^\s<>\"']+/)?$")
    attribution: str = ""
    show_videos: bool = True
    hide_truth: bool = False
    threshold: float = Field(default=0.80, ge=0, le=1)
    demo: tuple[DemoSubmission, ...] = ()


def read_toml(path: Path, model: type[M], parse_float: Callable[[str], Any] = float) -> M:
    """The settings in a TOML file. Raises ConfigError with every fault."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"), parse_float=parse_float)
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such file; expected a TOML file with the settings.") from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: not readable as TOML: {error}") from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        lines = [f"{path}: {error.error_count()} wrong setting(s)."]
        for fault in error.errors(include_url=False):
            key = ".".join(str(part) for part in fault["loc"])
            lines.append(f"  {key}: found {fault['input']!r}; {fault['msg']}" if key else f"  {fault['msg']}")
        raise ConfigError("\n".join(lines)) from error


def read_run_config(path: Path) -> RunConfig:
    """The run configuration in a TOML file. Raises ConfigError with every fault."""
    return read_toml(path, RunConfig)


def read_benchmark_settings(path: Path) -> BenchmarkSettings:
    """The benchmark settings in a `coooler.toml`. Raises ConfigError with every fault."""
    return read_toml(path, BenchmarkSettings)
