"""The folder of a built site: each path written once, only when it changed, stale files removed.

Files that a build did not write are never touched: what it wrote is listed in a manifest, which may
be deleted at any time (the next build then makes everything again and removes nothing).
"""

import json
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from pipeline.files import sha256_file, sha256_of, write_bytes

MANIFEST = ".coooler-manifest.json"
FORMAT = 1

# The footer's place for the tree's hash; empty while the hash is computed.
BLANK = b'id="tree-sha256"></code>'
_WRITERS = 8  # a write waits for the disk, so several at a time


@dataclass(slots=True)
class Output:
    """Collects what belongs to the site in `folder`; `finish` then removes what no longer does."""

    folder: Path
    before: Mapping[str, Any]
    files: dict[str, str] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    written: int = 0
    unchanged: int = 0

    def add(self, path: str, data: bytes) -> None:
        """Put a file at `path` (relative, `/`-separated); skipped when it is there already.

        Raises ValueError when the path was added before or leads out of the folder.
        """
        self.add_all([(path, data)])

    def add_all(self, files: Iterable[tuple[str, bytes]]) -> None:
        """`add` for many files."""
        claimed = [self._claim(path, data) for path, data in files]
        with ThreadPoolExecutor(_WRITERS) as pool:
            written = sum(pool.map(self._write, claimed))
        self.written += written
        self.unchanged += len(claimed) - written

    def kept(self, paths: Mapping[str, str]) -> bool:
        """Keep files of an earlier build, path -> hash, when all are as they were; else keep none."""
        for path, digest in paths.items():
            target = self.folder / _checked(path)
            if not target.is_file() or sha256_file(target) != digest:
                return False
        for path, digest in paths.items():
            self._claim_path(path)
            self.files[path] = digest
            self.sizes[path] = (self.folder / path).stat().st_size
        self.unchanged += len(paths)
        return True

    def finish(self, media: Mapping[str, Any]) -> int:
        """Remove files of the earlier build that were not added again; write the manifest; say how many."""
        removed = 0
        stale = set(self.before.get("files", {})) - set(self.files)
        for path in sorted(stale):
            try:
                target = self.folder / _checked(path)
            except ValueError:
                continue
            if target.is_file() or target.is_symlink():
                target.unlink()
                removed += 1
            _prune(target.parent, self.folder)
        manifest = {"format": FORMAT, "files": self.files, "media": media}
        text = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
        target = self.folder / MANIFEST
        if not target.is_file() or target.read_text(encoding="utf-8") != text:
            write_bytes(target, text.encode())
        return removed

    def _claim(self, path: str, data: bytes) -> tuple[str, bytes]:
        self._claim_path(path)
        self.files[path] = sha256_of(data)
        self.sizes[path] = len(data)
        return path, data

    def _claim_path(self, path: str) -> None:
        if _checked(path) in self.files:
            raise ValueError(f"{path}: written twice in one build")

    def _write(self, file: tuple[str, bytes]) -> bool:
        """Write a file unless it is there already; say whether it was written."""
        path, data = file
        target = self.folder / path
        if target.is_file() and target.stat().st_size == len(data) and target.read_bytes() == data:
            return False
        write_bytes(target, data)
        return True


def open_output(folder: Path) -> Output:
    """The folder with the manifest of the build before, or with none when there is no usable one."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        before = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        before = {}
    usable = isinstance(before, dict) and before.get("format") == FORMAT
    usable = usable and all(isinstance(before.get(part), dict) for part in ("files", "media"))
    return Output(folder, before if usable else {})


def tree_sha256(files: Mapping[str, str]) -> str:
    """The hash of a tree: SHA-256 over the sorted lines "hash  path", each ended by a newline.

    `files` maps a path to the SHA-256 of its content, a page's with the footer's hash left empty.
    """
    lines = sorted(f"{digest}  {path}\n" for path, digest in files.items())
    return sha256_of("".join(lines).encode())


def stamped(page: bytes, digest: str) -> bytes:
    """A page with the tree's hash in its footer. Raises ValueError unless there is one place for it."""
    if page.count(BLANK) != 1:
        raise ValueError(f"found {page.count(BLANK)} places for the tree's hash in a page; expected 1")
    return page.replace(BLANK, BLANK.replace(b"><", b">" + digest.encode() + b"<"))


def _checked(path: str) -> str:
    pure = PurePosixPath(path)
    if pure.is_absolute() or str(pure) != path or ".." in pure.parts or "\\" in path or "\0" in path:
        raise ValueError(f"{path!r}: not a path inside the site")
    return path


def _prune(folder: Path, top: Path) -> None:
    """Remove folders that became empty, upwards, never `top` itself."""
    while folder != top and folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent
