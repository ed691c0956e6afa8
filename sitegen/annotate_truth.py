"""Which annotations count, and the truth file that they make."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from pipeline.errors import InputError
from sitegen.annotate_records import IMPORTED, MERGED, RESERVED, Record, Said

if TYPE_CHECKING:
    from pipeline.records import TruthHazard
    from pipeline.table import Row, Table

Standing: TypeAlias = Literal["none", "imported", "one", "agree", "differ", "merged", "changed"]
WRITTEN_BY = "coooler data annotate"

_EMPTY_ID = "h1"


@dataclass(frozen=True, slots=True)
class Counting:
    """What counts of a video. `record` is None while nothing does; `author` names all who agree on it.

    `standing`: nobody finished it (none; imported: but the work began with something), one annotator did
    (one), several did and say the same (agree) or not (differ: it awaits a merge), a merge was made
    (merged), after which somebody wrote again (changed).
    """

    video_id: str
    standing: Standing
    record: Record | None = None
    author: str = ""
    saved_at: str = ""


def counting(video_id: str, said: Mapping[str, Record]) -> Counting:
    """What counts of a video, given the last record of each author, of the merge and of the import.

    A finished merge counts, else what all who finished the video say alike. What was imported is where
    the work began: it counts only while nobody has finished the video.
    """
    merged = said.get(MERGED)
    writers = {author: record for author, record in sorted(said.items()) if author not in RESERVED}
    if merged and merged.is_finished:
        is_changed = any(record.revision > merged.seen.get(name, 0) for name, record in writers.items())
        return _of("changed" if is_changed else "merged", merged, merged.by)
    done = {author: record for author, record in writers.items() if record.is_finished}
    if not done:
        imported = said.get(IMPORTED)
        if imported is None or not imported.is_finished:
            return Counting(video_id, "none")
        return _of("imported", imported, IMPORTED)
    if len({record.content() for record in done.values()}) > 1:
        return Counting(video_id, "differ")
    latest = max(done.values(), key=lambda record: (record.saved_at, record.by))
    return _of("one" if len(done) == 1 else "agree", latest, "+".join(done))


def _of(standing: Standing, record: Record, author: str) -> Counting:
    return Counting(record.video_id, standing, record, author, record.saved_at)


def truth_of(counted: Counting) -> "list[TruthHazard]":
    """The rows of a video in the truth; none while nothing counts."""
    from pipeline.records import TruthHazard

    record = counted.record
    if record is None:
        return []
    if record.no_hazard:
        return [TruthHazard(record.video_id, _EMPTY_ID, "", "")]
    return [
        TruthHazard(
            record.video_id,
            hazard.hazard_id,
            " ".join(hazard.label.split()),
            " ".join(hazard.description.split()),
            hazard.track_id,
            hazard.first_frame,
            hazard.last_frame,
        )
        for hazard in record.hazards
    ]


def said_of(hazards: "Iterable[TruthHazard]") -> dict[str, list[Said]]:
    """The hazards of a truth as an annotator would have said them, by video, sorted."""
    found: dict[str, list[Said]] = {}
    for row in sorted(hazards, key=lambda row: (row.video_id, row.hazard_id)):
        said = found.setdefault(row.video_id, [])
        if not row.is_no_hazard:
            frames = row.first_frame, row.last_frame
            said.append(Said(row.hazard_id, row.label, row.description, row.track_id, *frames))
    return found


def write_truth(path: Path, counted: Iterable[Counting], replace: bool = False) -> int:
    """Write the rows that count, whole or not at all, and only when they changed; gives their number.

    Nothing is written while there is neither a row nor a file. Raises InputError as `check_ours` does.
    """
    rows = [(row, one.author, one.saved_at) for one in counted for row in truth_of(one)]
    if not rows and not path.exists():
        return 0
    if not replace:
        check_ours(path)
    data = _table().to_bytes(rows, {"written_by": WRITTEN_BY})
    if not path.is_file() or path.read_bytes() != data:
        from pipeline.files import sync_listing, write_bytes

        write_bytes(path, data)
        sync_listing(path.parent)
    return len(rows)


def _table() -> "Table[tuple[TruthHazard, str, str]]":
    """The truth's columns, and who wrote a row and when."""
    import pyarrow as pa

    from pipeline.table import Table
    from pipeline.tables import TRUTH

    def to_row(row: "tuple[TruthHazard, str, str]") -> "Row":
        return {**TRUTH.to_row(row[0]), "author": row[1], "saved_at": row[2]}

    text = pa.string()
    return Table(
        TRUTH.name,
        TRUTH.schema.append(pa.field("author", text)).append(pa.field("saved_at", text)),
        lambda row: TRUTH.key(row[0]),
        to_row,
        lambda row: (TRUTH.from_row({name: row[name] for name in TRUTH.schema.names}), *_made(row)),
    )


def _made(row: "Row") -> tuple[str, str]:
    return row["author"] or "", row["saved_at"] or ""


def check_ours(path: Path) -> None:
    """Raise InputError when there is a file that annotating did not write."""
    if path.exists() and not _is_ours(path):
        raise InputError(
            f"{path}: found a file that `{WRITTEN_BY}` did not write; it is left as it is. To go on from it, "
            f"give it as --truth and another file as --out; to write over it, add --replace."
        )


def _is_ours(path: Path) -> bool:
    import pyarrow as pa

    from pipeline.table import metadata

    try:
        return metadata(path).get("written_by") == WRITTEN_BY
    except (pa.ArrowException, OSError, UnicodeDecodeError):
        return False
