"""The settings of a run and of a benchmark folder: TOML in, frozen and checked models out.

Unknown keys, wrong types and values out of range are errors, all of them reported together.
"""

import json
import tomllib
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

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
    """

    min_width_px: float = Field(default=175.0, ge=0)
    min_height_px: float = Field(default=175.0, ge=0)
    min_area_px2: float = Field(default=35_000.0, ge=0)
    reference_width_px: int = Field(default=0, ge=0)
    top_percent: float = Field(default=10.0, gt=0, le=100)


class RunConfig(Settings):
    """Everything that changes what `predict` writes."""

    name: str = Field(default="Embedded pipeline", min_length=1, max_length=80)
    agents: Literal["embedded"] = "embedded"
    seed: int = Field(default=0, ge=0)
    frames: FrameSettings = FrameSettings()
    track2: Track2Settings = Track2Settings()
    verify: VerifySettings = VerifySettings()

    @property
    def sha256(self) -> str:
        """Hash of every setting, independent of the order of keys and of defaults left out."""
        return sha256_of(json.dumps(self.model_dump(mode="json"), sort_keys=True).encode())


class DemoSubmission(Settings):
    """One submission that `coooler demo` makes: from a run configuration or a predictions file."""

    name: str
    run: str = ""
    predictions: str = ""
    authors: str = ""
    url: str = ""
    date: str = ""
    agents: str = ""


class BenchmarkSettings(Settings):
    """The content of `coooler.toml`: what a benchmark folder holds. Paths are relative to it."""

    name: str = Field(default="A COOOLER benchmark", min_length=1, max_length=120)
    description: str = ""
    truth: str = "truth.csv"
    videos: str = "videos"
    boxes: str = "boxes.parquet"
    submissions: str = "submissions"
    site: str = "site"
    attribution: str = ""
    show_videos: bool = True
    threshold: float = Field(default=0.80, ge=0, le=1)
    demo: tuple[DemoSubmission, ...] = ()


def _read_toml(path: Path, model: type[M]) -> M:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
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
            lines.append(f"  {key}: found {fault['input']!r}; {fault['msg']}")
        raise ConfigError("\n".join(lines)) from error


def read_run_config(path: Path) -> RunConfig:
    """The run configuration in a TOML file. Raises ConfigError with every fault."""
    return _read_toml(path, RunConfig)


def read_benchmark_settings(path: Path) -> BenchmarkSettings:
    """The benchmark settings in a `coooler.toml`. Raises ConfigError with every fault."""
    return _read_toml(path, BenchmarkSettings)
