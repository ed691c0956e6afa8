"""The queue of uploads on disk. What is in it is whole, in order, and outlives the process.

    incoming/<id>/upload.json   who sent it, its size and hash, its place in the order, its state
                  file          the bytes as they came, until the work is done
                  report.json   what came of it

An upload is made in a folder beside the others and renamed, so it is there whole or not at all. One
process at a time holds the queue. Work that a kill cut short begins anew.
"""

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from threading import Condition
from typing import Self

from pydantic import ValidationError

from pipeline.errors import CooolerError, InputError
from pipeline.files import sync_folder, sync_listing, write_text
from sitegen.intake_records import Details, Report, State, Upload, is_id, new_id

if sys.platform != "win32":
    import fcntl

FILE = "file"
MAX_ATTEMPTS = 3
GIVEN_UP = (
    "The server stopped several times while it worked on this file, so it was put aside. "
    "Please tell the organiser."
)

_UPLOAD, _REPORT, _LOCK = "upload.json", "report.json", ".lock"
_ARRIVING, _LEAVING = ".new-", ".gone-"
_MAX_JSON_BYTES = 128 * 2**20


class QueueFullError(CooolerError):
    """There is no room for another upload now."""

    exit_code = 3


class KeyUsedError(InputError):
    """The idempotency key came with other content before."""


class Arriving:
    """An upload that is still on its way: bytes go to a file of their own, counted and hashed."""

    def __init__(self, folder: Path, max_bytes: int) -> None:
        """`folder` is made by the queue; more than `max_bytes` are refused."""
        self.folder = folder
        self.size = 0
        self._max_bytes = max_bytes
        self._hash = hashlib.sha256()
        self._file = (folder / FILE).open("wb")

    @property
    def sha256(self) -> str:
        """The hash of what came until now."""
        return self._hash.hexdigest()

    def write(self, data: bytes) -> None:
        """Take some bytes. Raises ValueError when they are too many."""
        if self.size + len(data) > self._max_bytes:
            raise ValueError(f"more than {self._max_bytes:,} bytes")
        self.size += len(data)
        self._hash.update(data)
        self._file.write(data)

    def close(self) -> None:
        """No more bytes."""
        self._file.close()


class Intake:
    """The queue in a folder. Every method may be called from any thread."""

    def __init__(
        self,
        folder: Path,
        *,
        max_waiting: int = 1_000,
        max_bytes: int = 5 * 2**30,
        keep_finished: int = 1_000,
    ) -> None:
        """Open the queue, made when it is missing. Raises InputError when another process holds it.

        It refuses more than `max_waiting` uploads or `max_bytes` at a time, and forgets all but the
        newest `keep_finished` that are done.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.changed = Condition()
        self._max_waiting = max_waiting
        self._max_bytes = max_bytes
        self._keep_finished = max(1, keep_finished)  # the newest number lives in one of them
        self._arriving = 0
        self._reserved = 0
        self._lock = _hold(folder)
        self._uploads = {upload.upload_id: upload for upload in self._load()}
        self._next = max((upload.number for upload in self._uploads.values()), default=0) + 1
        for upload in self._ordered("working"):
            self._set(upload, state="queued")
        self._forget_old()

    def __enter__(self) -> Self:
        """The queue itself."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Let another process have it."""
        os.close(self._lock)

    @contextmanager
    def arriving(self, max_bytes: int) -> Iterator[Arriving]:
        """Room for an upload of at most `max_bytes`; what is not given to `add` inside is removed.

        Raises QueueFullError when there is no room.
        """
        with self.changed:
            waiting = [upload for upload in self._uploads.values() if upload.is_waiting]
            held = sum(upload.size for upload in waiting) + self._reserved
            if len(waiting) + self._arriving >= self._max_waiting or held + max_bytes > self._max_bytes:
                raise QueueFullError("Too many uploads are waiting. Please try again in some minutes.")
            self._arriving += 1
            self._reserved += max_bytes
        try:
            made = Arriving(Path(tempfile.mkdtemp(dir=self.folder, prefix=_ARRIVING)), max_bytes)
            try:
                yield made
            finally:
                made.close()
                shutil.rmtree(made.folder, ignore_errors=True)
        finally:
            with self.changed:
                self._arriving -= 1
                self._reserved -= max_bytes

    def add(self, arriving: Arriving, details: Details, key: str = "") -> Upload:
        """Put an upload at the end of the queue; the same one again gives the one that is there.

        The same means: the same bytes, kind, name and way of reading, and not refused or failed; with an
        idempotency `key`, whatever became of it. Raises KeyUsedError for a key that came with something else.
        """
        arriving.close()
        hashed = hashlib.sha256(key.encode("utf-8", "replace")).hexdigest() if key else ""
        with self.changed:
            upload = Upload(
                upload_id=new_id(),
                number=self._next,
                details=details,
                size=arriving.size,
                sha256=arriving.sha256,
                received=date.today().isoformat(),
                key=hashed,
            )
            there = self._same(upload)
            if there:
                return there
            self._next += 1
        write_text(arriving.folder / _UPLOAD, upload.model_dump_json())
        sync_folder(arriving.folder)
        with self.changed:
            there = self._same(upload)  # the same may have come while the disk was busy
            if there:
                return there
            arriving.folder.rename(self.folder / upload.upload_id)
            sync_listing(self.folder)
            self._uploads[upload.upload_id] = upload
            self.changed.notify_all()
        return upload

    def find(self, upload_id: str) -> Upload | None:
        """The upload of an id, None when there is none."""
        with self.changed:
            return self._uploads.get(upload_id)

    def place(self, upload: Upload) -> int:
        """How many uploads go before this one, those in work too."""
        with self.changed:
            return sum(other.is_waiting and other.number < upload.number for other in self._uploads.values())

    def waiting(self) -> int:
        """How many uploads are not finished."""
        with self.changed:
            return sum(upload.is_waiting for upload in self._uploads.values())

    def has_queued(self) -> bool:
        """Whether there is something to take."""
        with self.changed:
            return any(upload.state == "queued" for upload in self._uploads.values())

    def report(self, upload: Upload) -> Report | None:
        """What came of an upload, None while it waits."""
        path = self.folder / upload.upload_id / _REPORT
        try:
            if upload.is_waiting or path.stat().st_size > _MAX_JSON_BYTES:
                return None
            return Report.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            return None

    def file(self, upload: Upload) -> Path:
        """Where the bytes of a waiting upload lie."""
        return self.folder / upload.upload_id / FILE

    def take(self) -> Upload | None:
        """The first upload that is queued, from now on in work; None when there is none."""
        with self.changed:
            for upload in self._ordered("queued"):
                if upload.attempts < MAX_ATTEMPTS:
                    return self._set(upload, state="working", attempts=upload.attempts + 1)
                self.finish(upload, "failed", Report(message=GIVEN_UP))
            return None

    def finish(self, upload: Upload, state: State, report: Report) -> None:
        """Note what came of an upload, and let its bytes go."""
        write_text(self.folder / upload.upload_id / _REPORT, report.model_dump_json())
        with self.changed:
            self._set(upload, state=state)
            self.file(upload).unlink(missing_ok=True)
            self._forget_old()

    def _set(self, upload: Upload, **changes: object) -> Upload:
        changed = upload.model_copy(update=changes)
        write_text(self.folder / upload.upload_id / _UPLOAD, changed.model_dump_json())
        self._uploads[upload.upload_id] = changed
        return changed

    def _ordered(self, *states: State) -> list[Upload]:
        found = [upload for upload in self._uploads.values() if upload.state in states]
        return sorted(found, key=lambda upload: upload.number)

    def _same(self, upload: Upload) -> Upload | None:
        for other in self._uploads.values():
            is_same = _content(other) == _content(upload)
            if upload.key and upload.key == other.key:
                if not is_same:
                    raise KeyUsedError(
                        "This Idempotency-Key came with another file or other fields before; use a new one."
                    )
                return other
            if is_same and other.state in {"queued", "working", "accepted"}:
                return other
        return None

    def _forget_old(self) -> None:
        done = self._ordered("good", "accepted", "refused", "failed")
        for upload in done[: max(0, len(done) - self._keep_finished)]:
            leaving = self.folder / f"{_LEAVING}{upload.upload_id}"
            (self.folder / upload.upload_id).rename(leaving)
            shutil.rmtree(leaving, ignore_errors=True)
            del self._uploads[upload.upload_id]

    def _load(self) -> Iterator[Upload]:
        """What lies in the folder, cleared of what a kill left behind."""
        for path in sorted(self.folder.iterdir()):
            if path.is_symlink() or not path.is_dir():
                continue
            if path.name.startswith((_ARRIVING, _LEAVING)):
                shutil.rmtree(path, ignore_errors=True)
            elif is_id(path.name):
                upload = _read(path)
                if upload and not upload.is_waiting:
                    (path / FILE).unlink(missing_ok=True)
                if upload:
                    yield upload


def _content(upload: Upload) -> tuple[str, ...]:
    details = upload.details
    return (upload.sha256, details.kind, details.name, details.source_format, details.caption_column)


def _read(path: Path) -> Upload | None:
    try:
        upload = Upload.model_validate_json((path / _UPLOAD).read_bytes())
    except (OSError, ValidationError):
        sys.stderr.write(f"{path}: no upload.json that can be read; left as it is\n")
        return None
    return upload if upload.upload_id == path.name else None


def _hold(folder: Path) -> int:
    """A lock on the queue that ends with this process (none on Windows)."""
    handle = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    if sys.platform != "win32":
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(handle)
            raise InputError(
                f"{folder}: another server works on this queue; stop it first, or use its address."
            ) from error
    return handle
