"""Vectors on disk, so that no text is embedded twice by anyone on this machine.

A model's folder holds segments. A segment is written whole, named by the hash of its content and
never changed: processes need no lock, and a crash leaves nothing half written. Layout, little endian:

    8 bytes  b"COOOLVEC"
    2 x u32  n rows, D values a row
    n x 32   SHA-256 of each text's UTF-8, ascending
    n x u32  CRC-32 of key and vector, checked whenever a row is used
    n x D    float32 unit vectors, read through a memory map

When 8 segments of one size class exist they are merged into one, so that a row is rewritten about
log8(n) times in its life and lookups see few files.
"""

import contextlib
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import OutsideError
from pipeline.files import sha256_of, write_bytes
from pipeline.interfaces import Embedder

_MAGIC = b"COOOLVEC"
_MERGE_AT = 8

Keys = NDArray[np.uint8]  # (n, 32)
Vectors = NDArray[np.float32]  # (n, D)


def _keys(texts: Sequence[str]) -> Keys:
    """SHA-256 of each text, shape (n, 32); lone surrogates have hashes too."""
    joined = b"".join(bytes.fromhex(sha256_of(text.encode("utf-8", "surrogatepass"))) for text in texts)
    return np.frombuffer(joined, np.uint8).reshape(-1, 32)


def _prefixes(keys: Keys) -> NDArray[np.uint64]:
    """The first 8 bytes of each key as a number in the keys' own order, shape (n,)."""
    return np.ascontiguousarray(keys).view(">u8")[:, 0].astype(np.uint64)


def _checksums(keys: Keys, vectors: Vectors) -> NDArray[np.uint32]:
    """CRC-32 of each key with its vector, shape (n,)."""
    crcs = [zlib.crc32(v.tobytes(), zlib.crc32(k.tobytes())) for k, v in zip(keys, vectors, strict=True)]
    return np.array(crcs, "<u4")


def _segment_bytes(keys: Keys, vectors: Vectors) -> bytes:
    """A segment file of these rows, each key once."""
    _, first = np.unique(_prefixes(keys), return_index=True)
    keys, vectors = keys[first], vectors[first].astype("<f4")
    head = _MAGIC + np.array(vectors.shape, "<u4").tobytes()
    return b"".join([head, keys.tobytes(), _checksums(keys, vectors).tobytes(), vectors.tobytes()])


class _Segment:
    """One segment file, mapped into memory."""

    def __init__(self, path: Path) -> None:
        """Raises ValueError when the file is not a whole segment, OSError when it is gone."""
        data = np.memmap(path, np.uint8, "r")
        if len(data) < 16 or data[:8].tobytes() != _MAGIC:
            raise ValueError("not a segment")
        n, width = (int(value) for value in data[8:16].view("<u4"))
        if n == 0 or width == 0 or len(data) != 16 + n * (36 + 4 * width):
            raise ValueError("not whole")
        self.path = path
        self.keys: Keys = data[16 : 16 + 32 * n].reshape(n, 32)
        self._crcs = data[16 + 32 * n : 16 + 36 * n].view("<u4")
        self.vectors: Vectors = data[16 + 36 * n :].view("<f4").reshape(n, width)
        self._prefixes = _prefixes(self.keys)

    def sound(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Which of these rows are as they were written."""
        same: NDArray[np.bool_] = _checksums(self.keys[rows], self.vectors[rows]) == self._crcs[rows]
        return same

    def find(self, keys: Keys) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Positions in `keys` that are here, and their rows."""
        rows = np.minimum(np.searchsorted(self._prefixes, _prefixes(keys)), len(self.keys) - 1)
        at = np.flatnonzero((self.keys[rows] == keys).all(axis=1))
        at = at[self.sound(rows[at])]
        return at, rows[at]


class CachedEmbedder:
    """An Embedder that asks the wrapped one only for texts that no segment holds."""

    def __init__(self, embedder: Embedder, folder: Path) -> None:
        """`folder` may be shared by models and processes; it is made when something is written."""
        self._embedder = embedder
        self._root = folder
        self._folder = folder / embedder.sha256[:32]
        self._segments: dict[str, _Segment] = {}
        self.embedded_count = 0  # texts that the wrapped embedder was really asked for

    def __reduce__(self) -> tuple[type["CachedEmbedder"], tuple[Embedder, Path]]:
        """Pickles as its parts: memory maps stay in their process."""
        return (CachedEmbedder, (self._embedder, self._root))

    @property
    def name(self) -> str:
        """The wrapped model's name."""
        return self._embedder.name

    @property
    def sha256(self) -> str:
        """The wrapped model's hash."""
        return self._embedder.sha256

    def embed(self, texts: Sequence[str]) -> Vectors:
        """Unit vectors, shape (len(texts), D), in the order of the texts.

        Raises what the wrapped embedder raises, and OutsideError when the cache cannot be written.
        """
        distinct = list(dict.fromkeys(texts))
        if not distinct:
            return self._embedder.embed([])
        keys = _keys(distinct)
        found, vectors = self._look_up(keys)
        if not found.all():
            self._refresh()
            found, vectors = self._look_up(keys)
        missing = np.flatnonzero(~found)
        if len(missing):
            fresh = self._embedder.embed([distinct[at] for at in missing])
            self.embedded_count += len(missing)
            if vectors is None:
                vectors = np.empty((len(distinct), fresh.shape[1]), np.float32)
            vectors[missing] = fresh
            self._write(keys[missing], fresh)
        assert vectors is not None
        rows = {text: at for at, text in enumerate(distinct)}
        return vectors[[rows[text] for text in texts]]

    def _look_up(self, keys: Keys) -> tuple[NDArray[np.bool_], Vectors | None]:
        """Which keys were found, shape (n,), and (n, D) vectors filled there; None: no segment at all."""
        found = np.zeros(len(keys), bool)
        vectors: Vectors | None = None
        for segment in self._segments.values():
            width = segment.vectors.shape[1]
            if vectors is None:
                vectors = np.empty((len(keys), width), np.float32)
            wanted = np.flatnonzero(~found)
            if len(wanted) == 0 or width != vectors.shape[1]:
                continue
            at, rows = segment.find(keys[wanted])
            vectors[wanted[at]] = segment.vectors[rows]
            found[wanted[at]] = True
        return found, vectors

    def _refresh(self) -> None:
        """Map the segments that are on disk now; what is no segment is removed."""
        # A segment that another process merged between listing and opening is in a newer one: list again.
        for _ in range(3):
            names = sorted(path.name for path in self._folder.glob("*.vec"))
            self._segments = {name: self._segments[name] for name in names if name in self._segments}
            gone = False
            for name in names:
                if name in self._segments:
                    continue
                try:
                    self._segments[name] = _Segment(self._folder / name)
                except FileNotFoundError:
                    gone = True
                except (ValueError, OSError):
                    with contextlib.suppress(OSError):
                        (self._folder / name).unlink()
            if not gone:
                return

    def _write(self, keys: Keys, vectors: Vectors) -> None:
        """Write a segment, then merge a size class that has grown to 8 segments."""
        self._store(_segment_bytes(keys, vectors))
        while group := self._full_class():
            rows = [np.flatnonzero(segment.sound(np.arange(len(segment.keys)))) for segment in group]
            keys = np.concatenate([segment.keys[at] for segment, at in zip(group, rows, strict=True)])
            vectors = np.concatenate([segment.vectors[at] for segment, at in zip(group, rows, strict=True)])
            kept = self._store(_segment_bytes(keys, vectors)) if len(keys) else ""
            for segment in group:
                if segment.path.name == kept:
                    continue
                del self._segments[segment.path.name]
                # Another process may have merged the same segments, or (Windows) still map them.
                with contextlib.suppress(OSError):
                    segment.path.unlink()

    def _full_class(self) -> list[_Segment]:
        """8 or more segments of similar size (within a factor of 8), or none."""
        classes: dict[tuple[int, int], list[_Segment]] = {}
        for segment in self._segments.values():
            n, width = segment.vectors.shape
            classes.setdefault((width, n.bit_length() // 3), []).append(segment)
        return next((group for group in classes.values() if len(group) >= _MERGE_AT), [])

    def _store(self, data: bytes) -> str:
        """Write a segment file, map it, and return its name."""
        name = f"{sha256_of(data)}.vec"
        try:
            write_bytes(self._folder / name, data)
        except OSError as error:
            raise OutsideError(
                f"{self._folder}: cannot be written ({error.strerror}); expected a folder for vectors. "
                "Set COOOLER_CACHE to a folder that can be written."
            ) from error
        # Another process may have merged it already; then it is found there when it is asked for.
        with contextlib.suppress(FileNotFoundError):
            self._segments[name] = _Segment(self._folder / name)
        return name
