"""What the build before left: its files with hashes and sizes, and what they were made of."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from pipeline.files import sha256_file
from sitegen.listings import Touch, touch_of

MANIFEST = ".coooler-manifest.json"
FORMAT = 2

Content: TypeAlias = tuple[str, int]
"""SHA-256 and size in bytes."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """The record of a build; all empty when there is none that can be used.

    `files` maps a path to its content, a page's hash being that without the tree's hash in it; `pages`
    maps a page to the key of what it shows; `media` keeps the pictures of each video, `clips` the
    content of each clip; `inputs` is the hash of all that the site was made of. `written` is the
    manifest's text on disk, `time_ns` when it was written: last of all the build's files.
    """

    files: Mapping[str, Content] = field(default_factory=dict)
    pages: Mapping[str, str] = field(default_factory=dict)
    media: Mapping[str, Any] = field(default_factory=dict)
    tree: str = ""
    inputs: str = ""
    clips: Mapping[str, Content] = field(default_factory=dict)
    written: str = ""
    time_ns: int = 0

    def text(self) -> str:
        """The manifest as JSON; the same for the same content."""
        names = ("files", "pages", "media", "tree", "inputs", "clips")
        return json.dumps({"format": FORMAT} | {name: getattr(self, name) for name in names}, sort_keys=True)

    def is_untouched(self, touch: Touch | None, size: int) -> bool:
        """Whether a file has the size that it had, and was not touched since the manifest was written."""
        return touch is not None and touch[0] == size and max(touch[1:]) < self.time_ns

    def content(self, clip: Path) -> Content:
        """Hash and size of a clip; it is read only when it may have changed."""
        known = self.clips.get(clip.name)
        if known and self.is_untouched(touch_of(clip), known[1]):
            return known
        return sha256_file(clip), clip.stat().st_size


def read_manifest(path: Path) -> Manifest:
    """The manifest, or an empty one when there is none, or none that this version wrote."""
    try:
        time_ns, text = path.stat().st_mtime_ns, path.read_text(encoding="utf-8")
        found = json.loads(text)
        if found["format"] != FORMAT:
            return Manifest()
        return Manifest(
            _contents(found["files"]),
            {str(page): str(key) for page, key in found["pages"].items()},
            dict(found["media"]),
            str(found["tree"]),
            str(found["inputs"]),
            _contents(found["clips"]),
            text,
            time_ns,
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return Manifest()


def _contents(found: Mapping[str, Any]) -> dict[str, Content]:
    return {path: (str(digest), int(size)) for path, (digest, size) in found.items()}
