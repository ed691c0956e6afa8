"""Files wherever they lie: a path, or any URL that `fsspec` knows (s3://, gs://, memory://, ...)."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import OutsideError
from pipeline.files import sha256_file, sha256_of, write_bytes

_CHUNK_BYTES = 2**20


def is_url(place: str) -> bool:
    """Whether `place` is a URL and not a path."""
    scheme, mark, _ = place.partition("://")
    return bool(mark) and scheme.isalnum() and len(scheme) > 1


@dataclass(frozen=True, slots=True)
class Entry:
    """What lies at a place: `kind` is `file`, `directory` or `other`; `size` in bytes, None if unknown."""

    name: str
    kind: str
    size: int | None


@dataclass(frozen=True, slots=True)
class Place:
    """A file or folder; `where` is a path or a URL. Picklable."""

    where: str

    def __str__(self) -> str:
        """As it was given."""
        return self.where

    def __truediv__(self, name: str) -> "Place":
        """The place called `name` in this folder."""
        if is_url(self.where):
            return Place(f"{self.where.rstrip('/')}/{name}")
        return Place(str(Path(self.where) / name))

    @property
    def name(self) -> str:
        """The last part."""
        return self.where.rstrip("/").rsplit("/", 1)[-1] if is_url(self.where) else Path(self.where).name

    def is_file(self) -> bool:
        """Whether there is a file."""
        if not is_url(self.where):
            return Path(self.where).is_file()
        system, path = _open(self.where)
        with _outside(self.where):
            return bool(system.isfile(path))

    def is_folder(self) -> bool:
        """Whether there is a folder."""
        if not is_url(self.where):
            return Path(self.where).is_dir()
        system, path = _open(self.where)
        with _outside(self.where):
            return bool(system.isdir(path))

    def files(self) -> list["Place"]:
        """The files in this folder, sorted by name."""
        if not is_url(self.where):
            return [Place(str(path)) for path in sorted(Path(self.where).iterdir()) if path.is_file()]
        system, path = _open(self.where)
        with _outside(self.where):
            found = system.ls(path, detail=True)
        names = sorted(entry["name"].rsplit("/", 1)[-1] for entry in found if entry["type"] == "file")
        return [self / name for name in names]

    def local(self) -> Path | None:
        """The path of what lies on this computer, also behind a `file://` URL; None elsewhere."""
        if not is_url(self.where):
            return Path(self.where)
        from fsspec.implementations.local import LocalFileSystem

        system, path = _open(self.where)
        return Path(path) if isinstance(system, LocalFileSystem) else None

    def entry(self) -> Entry:
        """What a URL leads to. Raises FileNotFoundError when there is nothing."""
        system, path = _open(self.where)
        with _outside(self.where):
            return _entry(system.info(path))

    def entries(self) -> list[Entry]:
        """What is in the folder that a URL leads to, each name once, sorted."""
        system, path = _open(self.where)
        with _outside(self.where):
            found = system.ls(path, detail=True)
            # Some stores list the folder itself too.
            within = [one for one in found if one["name"].strip("/") != path.strip("/")]
            by_name = {entry.name: entry for entry in map(_entry, within)}
        return [by_name[name] for name in sorted(by_name)]

    def chunks(self) -> Iterator[bytes]:
        """The content of the file that a URL leads to, a piece at a time, however long it is."""
        system, path = _open(self.where)
        with _outside(self.where), system.open(path, "rb") as source:
            while chunk := source.read(_CHUNK_BYTES):
                yield chunk

    def read(self) -> bytes:
        """The file's content. Raises FileNotFoundError when there is none."""
        if not is_url(self.where):
            return Path(self.where).read_bytes()
        system, path = _open(self.where)
        with _outside(self.where):
            data: bytes = system.cat_file(path)
        return data

    def write(self, data: bytes) -> None:
        """Write the file, whole or not at all (stores put objects whole)."""
        if not is_url(self.where):
            write_bytes(Path(self.where), data)
            return
        system, path = _open(self.where)
        with _outside(self.where):
            system.makedirs(path.rsplit("/", 1)[0], exist_ok=True)
            system.pipe_file(path, data)

    def remove(self) -> None:
        """Remove the file if it is there."""
        if not is_url(self.where):
            Path(self.where).unlink(missing_ok=True)
        elif self.is_file():
            system, path = _open(self.where)
            with _outside(self.where):
                system.rm_file(path)

    def identity(self) -> str:
        """What tells this content from any other: its hash, or for a URL the store's own mark."""
        if not is_url(self.where):
            return sha256_file(Path(self.where))
        system, path = _open(self.where)
        with _outside(self.where):
            return sha256_of(f"{self.where} {system.ukey(path)}".encode())

    @contextmanager
    def as_path(self) -> Iterator[Path]:
        """A path to read the file at: itself, or a copy that is gone afterwards."""
        if not is_url(self.where):
            yield Path(self.where)
            return
        system, path = _open(self.where)
        with tempfile.TemporaryDirectory() as folder:
            local = Path(folder) / self.name
            with _outside(self.where):
                system.get_file(path, str(local))
            yield local


def _entry(told: dict[str, Any]) -> Entry:
    return Entry(str(told["name"]).rstrip("/").rsplit("/", 1)[-1], str(told["type"]), told.get("size"))


def _open(url: str) -> tuple[Any, str]:
    import fsspec

    with _outside(url):
        system, path = fsspec.core.url_to_fs(url)
        return system, path


@contextmanager
def _outside(where: str) -> Iterator[None]:
    """Failures of a store as errors of ours; a missing file stays a FileNotFoundError."""
    try:
        yield
    except FileNotFoundError:
        raise
    except ImportError as error:
        scheme = where.partition("://")[0]
        raise OutsideError(
            f"{where}: what reads {scheme}:// is not installed ({error}). Install it beside this package."
        ) from error
    except Exception as error:  # each store raises its own
        raise OutsideError(f"{where}: {type(error).__name__}: {error}") from error
