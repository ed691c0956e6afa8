"""Works the queue of uploads: one at a time, in the order of arrival, and builds the site after a burst."""

import os
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pipeline.errors import CooolerError, FaultsError, InputError, OutsideError
from pipeline.files import slug
from pipeline.predictions import Predictions
from sitegen.intake import Intake
from sitegen.intake_records import Details, Report, State, Upload
from sitegen.readers import ReadOptions, ReadPredictions
from sitegen.sandbox import Limits, read_apart
from sitegen.words import visible

if TYPE_CHECKING:
    from pipeline.benchmark import Benchmark
    from pipeline.scores import Scorecard
    from sitegen.ledger import Entry

Read: TypeAlias = Callable[[Upload, Path], ReadPredictions]
Judge: TypeAlias = Callable[[Upload, Path, ReadPredictions], Report]

BUILD_EVERY_S = 5.0
UNNAMED = "Preview"
REFUSED = "Nothing was stored. Mend the file and send it again."
FAILED = "Something on the server went wrong with this upload, not with your file. Please tell the organiser."

_RETRY_S = 30.0


class Worker:
    """A thread that takes uploads from a queue until it is stopped.

    Each is read with `read`, then given to `check` or `accept` with its file; `rebuild` is called once
    the queue is empty, or every `build_every` seconds while it is not, when something was accepted.
    FaultsError and InputError refuse an upload; any other error is the server's and never stops the work.
    """

    def __init__(
        self,
        intake: Intake,
        *,
        read: Read,
        check: Judge,
        accept: Judge,
        rebuild: Callable[[], None],
        build_every: float = BUILD_EVERY_S,
        root: Path | None = None,
    ) -> None:
        """`root` is a folder whose path no visitor is told."""
        self.intake = intake
        self._is_due = True  # what an earlier process accepted may not be on the site yet
        self._is_building = False
        self._read = read
        self._judges: dict[str, tuple[State, Judge]] = {
            "check": ("good", check),
            "submit": ("accepted", accept),
        }
        self._rebuild = rebuild
        self._build_every = build_every
        self._built = time.monotonic()
        self._pause = 0.0
        self._root = root
        self._stopping = False
        self._thread = Thread(target=self._work, name="intake", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, seconds: float) -> bool:
        """Take no more uploads; whether the one in work was done within `seconds`."""
        self._stopping = True
        with self.intake.changed:
            self.intake.changed.notify_all()
        self._thread.join(seconds)
        return not self._thread.is_alive()

    @property
    def is_alive(self) -> bool:
        """Whether it works."""
        return self._thread.is_alive()

    @property
    def is_behind(self) -> bool:
        """Whether the site does not show yet all that was accepted."""
        return self._is_due or self._is_building

    def _work(self) -> None:
        while not self._stopping:
            try:
                self._step()
            except Exception:  # a full disk, say; what is queued stays queued
                traceback.print_exc()
                time.sleep(1.0)

    def _step(self) -> None:
        upload = self.intake.take()
        if upload:
            self._do(upload)
        pause = self._pause if upload is None else max(self._pause, self._build_every)
        if self._is_due and time.monotonic() >= self._built + pause:
            self._build()
        if upload is None:
            with self.intake.changed:
                self.intake.changed.wait_for(lambda: self._stopping or self.intake.has_queued(), 1.0)

    def _build(self) -> None:
        began = time.monotonic()
        self._is_building = True
        self._is_due = False
        try:
            self._rebuild()
            self._pause = time.monotonic() - began  # at most half of the time goes into building
        except Exception:
            self._is_due = True
            self._pause = _RETRY_S
            traceback.print_exc()
        self._is_building = False
        self._built = time.monotonic()

    def _do(self, upload: Upload) -> None:
        began = time.monotonic()
        path = self.intake.file(upload)
        done, judge = self._judges[upload.details.kind]
        state: State
        try:
            report = judge(upload, path, self._read(upload, path))
            state = done
        except FaultsError as error:
            faults = tuple(
                replace(fault, file=visible(upload.details.file_name), found=self._plain(fault.found, upload))
                for fault in error.faults
            )
            state, report = "refused", Report(message=REFUSED, faults=faults)
        except InputError as error:
            state, report = "refused", Report(message=self._plain(str(error), upload))
        except Exception as error:
            if isinstance(error, CooolerError):
                sys.stderr.write(f"{upload.upload_id}: {visible(str(error))}\n")
            else:
                traceback.print_exc()
            state, report = "failed", Report(message=FAILED)
        if state == "accepted":
            self._is_due = True
        self.intake.finish(upload, state, report)
        faults_text = f", {len(report.faults)} faults" if report.faults else ""
        sys.stderr.write(
            f"{upload.upload_id} {upload.details.kind} {upload.size:,} bytes: {state}{faults_text}, "
            f"{time.monotonic() - began:.1f} s\n"
        )

    def _plain(self, text: str, upload: Upload) -> str:
        """A message without paths of this server."""
        text = text.replace(str(self.intake.file(upload)), visible(upload.details.file_name))
        for folder in (self.intake.folder, self._root):
            if folder is not None:
                text = text.replace(f"{folder}{os.sep}", "")
        return text


def make_worker(benchmark: "Benchmark", site: Path, intake: Intake, limits: Limits | None = None) -> Worker:
    """The worker of a benchmark: reads apart, checks or submits, builds the board into `site`."""
    from sitegen.about import Sender
    from sitegen.board import known_videos, rebuild_board, rehearse, submit_read
    from sitegen.rehearsal import report as told

    def read(upload: Upload, path: Path) -> ReadPredictions:
        details = upload.details
        options = ReadOptions(details.source_format, details.caption_column)
        try:
            truth = known_videos(benchmark)
        except InputError as error:
            raise OutsideError(f"The truth cannot be read: {error}") from error
        return read_apart(path, truth, options, limits)

    def check(upload: Upload, path: Path, read: ReadPredictions) -> Report:
        board = rehearse(benchmark, read, path, Sender(**sender_of(upload.details)))
        place = next(number for number, one in enumerate(board) if one.rehearsed)
        return _report(read, told(board, place))

    def accept(upload: Upload, path: Path, read: ReadPredictions) -> Report:
        known = in_ledger(benchmark, upload) if upload.attempts > 1 else None
        if known:
            return _report(read, _scores(known), known.slug)
        standing = submit_read(benchmark, read, path, Sender(**sender_of(upload.details)), today=_today())
        return _report(read, _scores(standing.evaluation.card), standing.stored.slug)

    def rebuild() -> None:
        rebuild_board(benchmark, site, today=_today())

    return Worker(intake, read=read, check=check, accept=accept, rebuild=rebuild, root=benchmark.root)


def sender_of(details: Details) -> dict[str, str]:
    """What a sender said, as the fields of `about.Sender`; a check needs no name."""
    return {
        "name": details.name if details.kind == "submit" else details.name or UNNAMED,
        "authors": details.authors,
        "url": details.url,
        "date": _today(),
        "agents": details.agents,
        "licence": details.licence,
        "notes": details.notes,
    }


def _today() -> str:
    return date.today().isoformat()


def _report(read: ReadPredictions, scores: dict[str, Any], place: str = "") -> Report:
    counts = {
        "predictions": len(read.predictions),
        "videos_with_predictions": len(Predictions.of(read.predictions).video_ids),
    }
    return Report(
        warnings=read.warnings, source_format=read.source_format, scores={**counts, **scores}, slug=place
    )


def _scores(card: "Scorecard | Entry") -> dict[str, Any]:
    names: tuple[Literal["besm", "sam", "detection_rate", "hazard_recall"], ...]
    names = ("besm", "sam", "detection_rate", "hazard_recall")
    values = {name: getattr(card, name) for name in names}
    metrics = {name: None if value is None else {"value": value} for name, value in values.items()}
    return {"metrics": metrics, "signature": str(card.signature)}


def in_ledger(benchmark: "Benchmark", upload: Upload) -> "Entry | None":
    """The ledger's entry of this very upload, when a kill came between storing and noting it here."""
    from sitegen import ledger

    entries = ledger.read(benchmark.submissions)
    place = slug(upload.details.name)
    last = next((one for one in reversed(ledger.versions(entries).get(place, []))), None)
    if last is None or place in ledger.withdrawn(entries) or last.original_sha256 != upload.sha256:
        return None
    return last if last.name == upload.details.name.strip() else None
