"""The state that annotators share: journals in memory, saves one at a time, the truth that follows."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock, RLock
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pipeline.errors import CooolerError, FaultsError, InputError
from pipeline.files import locked, sha256_of
from sitegen.annotate_answers import annotated, answer, content, short
from sitegen.annotate_journal import Journal, append, journal_files, journal_path, read_journals, read_more
from sitegen.annotate_records import (
    IMPORTED,
    MERGED,
    RESERVED,
    Record,
    author_of,
    count_of,
    problems,
    read_state,
    seen_of,
    session_of,
)
from sitegen.annotate_truth import Counting, Standing, counting, said_of, write_truth

if TYPE_CHECKING:
    from pipeline.records import TruthHazard
    from sitegen.agreement import AgreementReport

Mine: TypeAlias = Literal["todo", "unfinished", "done"]


class UnknownVideoError(InputError):
    """A video that is not among those to annotate."""


class StaleError(InputError):
    """A save that was made from an older state than the stored one, `current` (as `Desk.state` gives it)."""

    def __init__(self, current: dict[str, Any]) -> None:
        """Nothing was saved."""
        super().__init__("Somebody saved this video in the meantime; nothing was overwritten.")
        self.current = current


@dataclass(frozen=True, slots=True)
class VideoState:
    """A video in the list of one author: `others` is how many others finished it, `state` what counts of it,
    `hazards` the labels that count, in short."""

    video_id: str
    mine: Mine
    others: int
    state: Standing
    hazards: str


class Desk:
    """What was said of the videos, by whom, and what counts.

    Safe for threads, and for processes that write into the same folder. Each save is on the disk
    before `save` returns, the truth file follows at once.
    """

    def __init__(
        self,
        name: str,
        clips: Sequence[str],
        folder: Path,
        out: Path,
        *,
        replace: bool = False,
        notice: Callable[[str], object] = lambda text: sys.stderr.write(text + "\n"),
    ) -> None:
        """`clips` are the ids of the videos with a clip; journals are in `folder`, the truth goes to `out`.

        Raises FaultsError for damaged journals.
        """
        self.name = name
        self.out = out
        self.key = sha256_of(str(folder.resolve()).encode())[:12]
        self.rows = 0
        self._clips = frozenset(clips)
        self._folder = folder
        self._replace = replace
        self._notice = notice
        self._trouble = ""
        self._lock = RLock()
        self._embedding = Lock()
        self._counted: dict[str, Counting] = {}
        self._journals, notices = read_journals(folder)
        for text in notices:
            notice(text)
        for video_id in self.video_ids:
            self._count(video_id)

    @property
    def video_ids(self) -> tuple[str, ...]:
        """Every video with a clip or of which something was said, sorted."""
        with self._lock:
            said = (journal.latest.keys() for journal in self._journals.values())
            return tuple(sorted(self._clips.union(*said)))

    def authors(self) -> list[str]:
        """Who wrote so far, sorted."""
        with self._lock:
            self._refresh()
            return [author for author in sorted(self._journals) if author not in RESERVED]

    def overview(self, author: str) -> list[VideoState]:
        """Every video, as `author` sees it in the list."""
        with self._lock:
            self._refresh()
            return [self._overview(video_id, author) for video_id in self.video_ids]

    def counted(self) -> list[Counting]:
        """What counts of each video, sorted by video."""
        with self._lock:
            self._refresh()
            return [self._counted.get(video_id, Counting(video_id, "none")) for video_id in self.video_ids]

    def state(self, video_id: str, author: str, merge: bool) -> dict[str, Any]:
        """What `author`, or the merge, says of a video; for a merge also what all others say.

        `revision` 0: nothing yet. `imported` is what the work began with, or None. Raises
        UnknownVideoError, InputError for a name that cannot be an author's.
        """
        self._check(video_id, author)
        with self._lock:
            self._refresh()
            return self._state(video_id, author, merge)

    def save(self, video_id: str, author: str, merge: bool, data: Any) -> dict[str, Any]:
        """Store what a page sent (`hazards`, `no_hazard`, `base`, `session`, `sequence`, `seen`).

        Gives `revision`, `saved_at`, `problems` and `finished` once it is on the disk. A save of a session
        that came already, or an older one, stores nothing and gives what is stored. Raises StaleError when
        another session saved after `base`, UnknownVideoError, InputError for what cannot be stored.
        """
        self._check(video_id, author)
        hazards, no_hazard = read_state(data)
        session, sequence, base = session_of(data), count_of(data, "sequence"), count_of(data, "base")
        seen = seen_of(data) if merge else {}
        place = MERGED if merge else author
        with self._changing():
            journal = self._journals.get(place) or Journal(place)
            before = journal.saves.get((video_id, session))
            if before and sequence <= before.sequence:
                return answer(before)
            latest = journal.latest.get(video_id)
            if base != journal.revision(video_id) and not (latest and latest.session == session):
                raise StaleError(self._state(video_id, author, merge))
            revision = journal.revision(video_id) + 1
            record = Record(video_id, hazards, no_hazard, revision, author, _now(), session, sequence, seen)
            self._append(place, [record])
            self._write_truth()
        return answer(record)

    def take_truth(self, hazards: "Sequence[TruthHazard]") -> None:
        """Begin with an existing truth; what was imported before and is the same is not stored again."""
        by_video = said_of(hazards)
        with self._changing():
            journal = self._journals.get(IMPORTED) or Journal(IMPORTED)
            records = []
            for video_id, said in by_video.items():
                revision = journal.revision(video_id) + 1
                record = Record(
                    video_id, tuple(said), not said, revision, IMPORTED, _now(), "import", revision
                )
                known = journal.latest.get(video_id)
                if known is None or known.content() != record.content():
                    records.append(record)
            if records:
                self._append(IMPORTED, records)

    def write_truth(self) -> None:
        """Derive the truth file again. Raises InputError for a file that annotating did not write."""
        with self._changing():
            self.rows = write_truth(self.out, self._counted.values(), self._replace)

    def agreement(self) -> "AgreementReport":
        """How far each pair of annotators agrees; loads the text embedder when it is first asked for."""
        from sitegen.agreement import report

        with self._lock:
            self._refresh()
            said = {author: annotated(self._journals[author].latest.values()) for author in self.authors()}
        texts = {
            hazard.description
            for videos in said.values()
            for hazards in videos.values()
            for hazard in hazards
        }
        try:
            with self._embedding:
                from pipeline.minilm import open_embedder

                ordered = sorted(texts)
                vectors = dict(zip(ordered, open_embedder().embed(ordered), strict=True)) if ordered else {}
        except CooolerError as error:
            return report(said, None, str(error))
        return report(said, vectors)

    def _check(self, video_id: str, author: str) -> None:
        if author_of(author) != author:
            raise InputError("author: expected a name in a-z, 0-9 and '-'.")
        if video_id not in self._clips and video_id not in self.video_ids:
            raise UnknownVideoError("There is no such video.")

    def _overview(self, video_id: str, author: str) -> VideoState:
        own = self._journals[author].latest.get(video_id) if author in self._journals else None
        # A record without anything in it is one that was taken back.
        is_begun = own is not None and (own.no_hazard or own.hazards)
        mine: Mine = "todo" if own is None or not is_begun else "done" if own.is_finished else "unfinished"
        others = sum(
            name != author and name not in RESERVED and record.is_finished
            for name, record in self._said(video_id).items()
        )
        counted = self._counted.get(video_id, Counting(video_id, "none"))
        return VideoState(video_id, mine, others, counted.standing, short(counted.record))

    def _state(self, video_id: str, author: str, merge: bool) -> dict[str, Any]:
        said = self._said(video_id)
        record = said.get(MERGED if merge else author)
        imported = said.get(IMPORTED)
        others = sorted(name for name in said if name not in RESERVED) if merge else []
        if merge and imported:
            others.append(IMPORTED)
        return {
            "video_id": video_id,
            "author": author,
            **content(record),
            "by": record.by if record else "",
            "problems": record.problems if record else problems((), False),
            "imported": content(imported) if imported else None,
            "others": [
                {"author": name, **content(said[name]), "finished": said[name].is_finished} for name in others
            ],
        }

    def _said(self, video_id: str) -> dict[str, Record]:
        return {
            author: journal.latest[video_id]
            for author, journal in self._journals.items()
            if video_id in journal.latest
        }

    def _count(self, video_id: str) -> None:
        self._counted[video_id] = counting(video_id, self._said(video_id))

    def _refresh(self) -> None:
        """Take what other processes wrote; what they spoiled is said, and left."""
        for path in journal_files(self._folder):
            journal = self._journals.get(path.stem) or Journal(path.stem)
            if path.stat().st_size <= journal.read_bytes:
                continue
            before = dict(journal.latest)
            try:
                read_more(path, journal)
            except FaultsError as error:
                self._say(str(error))
            if journal.latest:
                self._journals[path.stem] = journal
            for video_id, record in journal.latest.items():
                if before.get(video_id) is not record:
                    self._count(video_id)

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Alone in this process and beside others, with all that they wrote known."""
        with self._lock, locked(self._folder):
            self._refresh()
            yield

    def _append(self, author: str, records: Sequence[Record]) -> None:
        append(journal_path(self._folder, author), author, records)
        self._refresh()

    def _write_truth(self) -> None:
        """The truth after a save; when that fails, the save is safe all the same, and the fault is said."""
        try:
            self.rows = write_truth(self.out, self._counted.values(), self._replace)
            self._trouble = ""
        except (OSError, InputError) as error:
            self._say(f"{self.out} could not be written; the annotations are safe in {self._folder}. {error}")

    def _say(self, trouble: str) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._notice(trouble)


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
