"""A new benchmark folder: settings, an example truth, a README, and workflows for pull requests."""

import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pipeline import __version__
from pipeline.errors import InputError
from sitegen.checks import visible
from sitegen.rendering import find_templates

FILES: dict[str, str] = {
    "coooler.toml": "coooler.toml",
    "truth.csv": "truth.csv",
    "README.md": "README.md",
    "requirements.txt": "requirements.txt",
    "models.txt": "models.txt",
    "gitignore": ".gitignore",
    "check.yml": ".github/workflows/check.yml",
    "comment.yml": ".github/workflows/comment.yml",
    "land.yml": ".github/workflows/land.yml",
}
"""File in `templates/init` -> path in the new folder."""
KEPT_FOLDERS = ("proposals", "submissions", "videos")
MAX_NAME_CHARS = 120

_SHOWN = 10


def write_benchmark(folder: Path, name: str) -> list[Path]:
    """Write a new benchmark called `name` into `folder`; give the files written, by path.

    `folder` is made, or is there and empty; a `.git` in it is no matter. Raises InputError for another
    folder and for a name that is not 1 to 120 printable characters; nothing is written then.
    """
    title = name.strip()
    if not 1 <= len(title) <= MAX_NAME_CHARS or not title.isprintable():
        raise InputError(
            f"The name is '{visible(name)}'; expected 1 to {MAX_NAME_CHARS} printable characters on one line."
        )
    target = folder.resolve()
    _refuse_content(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        new = Path(tempfile.mkdtemp(dir=target.parent, prefix=".new-benchmark-"))
        try:
            written = _fill(new, title)
            _move(new, target)
        finally:
            shutil.rmtree(new, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error}). Choose another folder.") from error
    return sorted(target / path for path in written)


def _refuse_content(target: Path) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f"{target}: is a file; expected a new or an empty folder. Choose another path.")
    there = sorted(path.name for path in target.iterdir() if path.name != ".git")
    if there:
        shown = ", ".join(visible(entry) for entry in there[:_SHOWN])
        rest = f" and {len(there) - _SHOWN:,} more" if len(there) > _SHOWN else ""
        raise InputError(
            f"{target}: holds {shown}{rest}; expected a new or an empty folder. Nothing was written. "
            "Choose another path."
        )


def _fill(new: Path, title: str) -> list[str]:
    """Write every file under `new`; give their paths."""
    source = find_templates() / "init"
    # A TOML basic string is a JSON string, as the title is printable.
    values = {"@NAME@": title, '"@TOML_NAME@"': json.dumps(title, ensure_ascii=False)}
    contents = {
        path: _replaced((source / template).read_text(encoding="utf-8"), values)
        for template, path in FILES.items()
    }
    contents |= {f"{name}/.gitkeep": "" for name in KEPT_FOLDERS}
    for path, text in contents.items():
        (new / path).parent.mkdir(parents=True, exist_ok=True)
        (new / path).write_bytes(text.encode())
    return list(contents)


def _replaced(text: str, values: Mapping[str, str]) -> str:
    for mark, value in {**values, "@VERSION@": __version__}.items():
        text = text.replace(mark, value)
    return text


def _move(new: Path, target: Path) -> None:
    """Put what is in `new` into `target`, all of it or nothing."""
    if not target.exists():
        new.chmod(0o755)
        new.rename(target)
        return
    moved: list[Path] = []
    try:
        for path in sorted(new.iterdir()):
            path.rename(target / path.name)
            moved.append(target / path.name)
    except OSError:
        for path in moved:
            path.rename(new / path.name)
        raise
