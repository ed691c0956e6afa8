"""A benchmark folder: `coooler.toml` and what it points to."""

from dataclasses import dataclass
from pathlib import Path

from pipeline.config import BenchmarkSettings, read_benchmark_settings
from pipeline.errors import ConfigError

FILE_NAME = "coooler.toml"


@dataclass(frozen=True, slots=True)
class Benchmark:
    """A benchmark folder and its settings; every path is absolute."""

    root: Path
    settings: BenchmarkSettings

    @property
    def truth(self) -> Path:
        """The truth file."""
        return self.root / self.settings.truth

    @property
    def videos(self) -> Path:
        """The folder of clips."""
        return self.root / self.settings.videos

    @property
    def boxes(self) -> Path:
        """The `boxes` table."""
        return self.root / self.settings.boxes

    @property
    def submissions(self) -> Path:
        """The folder with a subfolder per submission and the ledger."""
        return self.root / self.settings.submissions

    @property
    def site(self) -> Path:
        """Where the site is built by default."""
        return self.root / self.settings.site


def open_benchmark(root: Path) -> Benchmark:
    """The benchmark in the folder `root`. Raises ConfigError when there is none."""
    root = root.resolve()
    return Benchmark(root, read_benchmark_settings(root / FILE_NAME))


def find_benchmark(start: Path) -> Benchmark:
    """The benchmark that `start` is in: its own `coooler.toml`, a parent's, or `demo/` below it.

    Raises ConfigError when there is none.
    """
    start = start.resolve()
    for folder in (start, *start.parents):
        for candidate in (folder, folder / "demo"):
            if (candidate / FILE_NAME).is_file():
                return open_benchmark(candidate)
    raise ConfigError(
        f"{start}: no {FILE_NAME} here or in a parent folder; expected a benchmark folder. "
        "Change into one, or give the paths as options (see --help)."
    )
