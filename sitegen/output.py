"""The folder of a built site: each path written once, only when it changed, stale files removed.

A build leaves the folder as it is until all is made: what is new lies in a hidden folder inside it
(`STAGED`) and is moved in at the end, by a list that is written first. A build that is killed before
leaves the site that was there, and its pictures for the next build; one that is killed while it moves
files is carried out by the next.

Files that a build did not write are never touched: what it wrote is listed in a manifest, which may
be deleted at any time (the next build then makes everything again and removes nothing).
"""

import json
import re
import shutil
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.files import fsynced, sha256_file, sha256_of, sync_listing, write_bytes
from sitegen.listings import Touch, listing
from sitegen.manifest import MANIFEST, Manifest, read_manifest

STAGED = ".coooler-next"
# In it: the files to move in, the list by which they are moved, and notes for a build after a killed one.
READY, COMMIT, NOTES = "site", "commit.json", "notes"

# The footer's place for the tree's hash; empty while the hash is computed.
BLANK = b'id="tree-sha256"></code>'
_OPEN, _CLOSE = BLANK[: BLANK.index(b"<")], b"</code>"
_STAMP_BYTES = 64
# Names joined by slashes, none of them a dot or two; a pattern, since pathlib takes longer than the disk.
_INSIDE = re.compile(r"(?!\.{1,2}(?:/|$))[^/\\\0]+(?:/(?!\.{1,2}(?:/|$))[^/\\\0]+)*")
_WRITERS = 8  # a write waits for the disk, so several at a time
_WAITING = 64  # files in memory that wait for a writer


@dataclass(slots=True)
class Output:
    """Collects what belongs to the site in `folder`; `finish` then puts it there.

    `there` is what lies in the folder; `files` maps a path to the SHA-256 of its content, a page's
    without the tree's hash; `pages` maps a page to the key of what it shows.
    """

    folder: Path
    before: Manifest
    there: Mapping[str, Touch]
    files: dict[str, str] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    pages: dict[str, str] = field(default_factory=dict)
    staged: set[str] = field(default_factory=set)
    removed: int = 0
    _writers: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(_WRITERS))
    _writing: list["Future[None]"] = field(default_factory=list)
    _doubtful: bool = False

    @property
    def written(self) -> int:
        """How many files are new or changed."""
        return len(self.staged)

    @property
    def unchanged(self) -> int:
        """How many files stay as they are."""
        return len(self.files) - len(self.staged)

    def add(self, path: str, data: bytes) -> None:
        """Put a file at `path` (relative, `/`-separated); skipped when it is there already.

        Raises ValueError when the path was added before or leads out of the folder.
        """
        self._claim(path, sha256_of(data), len(data))
        if not self._is_there(path, self.files[path], len(data)):
            self._stage(path, data)

    def add_all(self, files: Iterable[tuple[str, bytes]]) -> None:
        """`add` for many files."""
        for path, data in files:
            self.add(path, data)

    def add_page(self, path: str, key: str, make: Callable[[], bytes]) -> None:
        """Put a page, which is made only when the page of before shows something else or is gone.

        `key` is the hash of all that the page shows, empty when that is not known. `make` gives it
        with an empty place for the tree's hash. Raises ValueError when it has not one such place.
        """
        if not self.keep_page(path, key):
            self.put_page(path, key, make())

    def keep_page(self, path: str, key: str) -> bool:
        """Whether the page of before shows the same and is still there; it is then added as it is."""
        known = self.before.files.get(path)
        if not (key and known and self.before.pages.get(path) == key and self._page_is_there(path, *known)):
            return False
        self._claim(path, *known)
        self.pages[path] = key
        return True

    def put_page(self, path: str, key: str, blank: bytes) -> None:
        """Put a page that was made; for `add_page`, and for pages that are made elsewhere."""
        known = self.before.files.get(path)
        if blank.count(BLANK) != 1:
            raise ValueError(f"found {blank.count(BLANK)} places for the tree's hash in a page; expected 1")
        digest, size = sha256_of(blank), len(blank) + _STAMP_BYTES
        self._claim(path, digest, size)
        self.pages[path] = key
        if known != (digest, size) or not self._page_is_there(path, *known):
            self._stage(path, blank)

    def kept(self, paths: Mapping[str, str]) -> bool:
        """Keep files of an earlier build, path -> hash, when all are as they were; else keep none.

        Files that a killed build left ready count as its.
        """
        found: list[tuple[str, str, int, bool]] = []
        for path, digest in paths.items():
            known = self.before.files.get(_checked(path))
            if known and known[0] == digest and self._is_there(path, *known):
                found.append((path, digest, known[1], False))
            elif (ready := self._ready(path)).is_file() and sha256_file(ready) == digest:
                found.append((path, digest, ready.stat().st_size, True))
            else:
                return False
        for path, digest, size, is_staged in found:
            self._claim(path, digest, size)
            self.staged |= {path} if is_staged else set()
        return True

    def keep_all(self, inputs: str) -> bool:
        """Keep all that is not added yet when the build before was made of the same `inputs` (a hash).

        False, and nothing kept, when it was not, or when a file is not as that build left it.
        """
        before = self.before
        left = {path: known for path, known in before.files.items() if path not in self.files}
        same = bool(inputs) and before.inputs == inputs and not self.staged
        same = same and all(path in before.files for path in self.files)
        if not same or not all(
            self._page_is_there(path, *known) if path in before.pages else self._is_there(path, *known)
            for path, known in left.items()
        ):
            return False
        for path, known in left.items():
            self._claim(path, *known)
        self.pages |= before.pages
        return True

    def stamp(self) -> str:
        """Write the tree's hash into every page; give it. Nothing can be added after."""
        self._wait()
        digest = tree_sha256(self.files)
        for path in self.pages:
            self._later(self._stamp, path, digest)
        self._wait()
        if digest != self.before.tree:
            self.staged |= set(self.pages)
        return digest

    def finish(self, digest: str, media: Mapping[str, Any], inputs: str, clips: Mapping[str, Any]) -> None:
        """Move what is staged into place, remove files of the earlier build that are no part of this one."""
        self._wait()
        self._writers.shutdown()
        stale = sorted(set(self.before.files) - set(self.files))
        files = {path: (digest, self.sizes[path]) for path, digest in self.files.items()}
        manifest = Manifest(files, self.pages, media, digest, inputs, clips).text()
        same = not self.staged and not stale and manifest == self.before.written
        if not same:
            plan = {"move": sorted(self.staged), "remove": stale, "manifest": manifest}
            write_bytes(self.folder / STAGED / COMMIT, json.dumps(plan).encode())
            self.removed = _carry_out(self.folder)
        elif self._doubtful:
            (self.folder / MANIFEST).touch()  # all was looked at: the next build need not look again
        shutil.rmtree(self.folder / STAGED, ignore_errors=True)

    def note(self, name: str, entry: Any) -> None:
        """Note for the next build, should this one be killed, what the files added so far are of."""
        self._wait()
        write_bytes(self.folder / STAGED / NOTES / f"{name}.json", json.dumps(entry).encode())

    def noted(self, name: str) -> Any:
        """What a killed build noted under `name`; None when it noted nothing that can be read."""
        try:
            return json.loads((self.folder / STAGED / NOTES / f"{name}.json").read_bytes())
        except (OSError, ValueError):
            return None

    def _claim(self, path: str, digest: str, size: int) -> None:
        if _checked(path) in self.files:
            raise ValueError(f"{path}: written twice in one build")
        self.files[path] = digest
        self.sizes[path] = size

    def _is_there(self, path: str, digest: str, size: int) -> bool:
        """Whether the folder holds this content, looked into only where the file may have changed."""
        if self.before.files.get(path) == (digest, size) and self._is_untouched(path, size):
            return True
        self._doubtful = True
        target = self.folder / path
        return target.is_file() and target.stat().st_size == size and sha256_file(target) == digest

    def _is_untouched(self, path: str, size: int) -> bool:
        return self.before.is_untouched(self.there.get(path), size)

    def _page_is_there(self, path: str, digest: str, size: int) -> bool:
        if self._is_untouched(path, size):
            return True
        self._doubtful = True
        target = self.folder / path
        if not target.is_file() or target.stat().st_size != size:
            return False
        page = target.read_bytes()
        stamp = self.before.tree.encode()
        return page.count(_OPEN + stamp) == 1 and sha256_of(_blanked(page, stamp)) == digest

    def _stage(self, path: str, data: bytes) -> None:
        self.staged.add(path)
        self._later(_put, self._ready(path), data)

    def _stamp(self, path: str, digest: str) -> None:
        staged = self._ready(path)
        if path in self.staged:
            _put(staged, stamped(staged.read_bytes(), digest))
        elif digest != self.before.tree:
            page = (self.folder / path).read_bytes()
            _put(staged, stamped(_blanked(page, self.before.tree.encode()), digest))

    def _ready(self, path: str) -> Path:
        return self.folder / STAGED / READY / path

    def _later(self, work: Callable[..., None], *arguments: object) -> None:
        if len(self._writing) >= _WAITING:
            self._writing.pop(0).result()
        self._writing.append(self._writers.submit(work, *arguments))

    def _wait(self) -> None:
        while self._writing:
            self._writing.pop(0).result()


def open_output(folder: Path) -> Output:
    """The folder with the manifest of the build before, a build that was killed at its end carried out."""
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / STAGED / COMMIT).is_file():
        _carry_out(folder)
        shutil.rmtree(folder / STAGED)
    return Output(folder, read_manifest(folder / MANIFEST), listing(folder))


def _carry_out(folder: Path) -> int:
    """Move the staged files into place, remove the stale ones; say how many. May be done again."""
    staged = folder / STAGED
    plan = json.loads((staged / COMMIT).read_bytes())
    for path in plan["move"]:
        source, target = staged / READY / _checked(path), folder / path
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            source.replace(target)
    for parent in sorted({(folder / path).parent for path in plan["move"]}):
        sync_listing(parent)
    removed = 0
    for path in plan["remove"]:
        try:
            target = folder / _checked(path)
        except ValueError:
            continue
        if target.is_file() or target.is_symlink():
            target.unlink()
            removed += 1
        _prune(target.parent, folder)
    _put(staged / MANIFEST, plan["manifest"].encode())
    (staged / MANIFEST).replace(folder / MANIFEST)
    sync_listing(folder)
    return removed


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
    return page.replace(BLANK, _OPEN + digest.encode() + _CLOSE)


def _blanked(page: bytes, stamp: bytes) -> bytes:
    return page.replace(_OPEN + stamp + _CLOSE, BLANK)


def _put(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with fsynced(path) as target:
        target.write(data)


def _checked(path: str) -> str:
    if not _INSIDE.fullmatch(path):
        raise ValueError(f"{path!r}: not a path inside the site")
    return path


def _prune(folder: Path, top: Path) -> None:
    """Remove folders that became empty, upwards, never `top` itself."""
    while folder != top and folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent
