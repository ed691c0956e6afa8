"""What runs wrote of each video, read from their tables when it is asked for."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.by_video import ByVideo, Later
from pipeline.table import Table
from pipeline.tables import MATCHES, OUTCOMES, SNIPPETS, STAGES
from sitegen.gathered import Records

TABLES: tuple[Table[Any], ...] = (STAGES, SNIPPETS, MATCHES, OUTCOMES)


@dataclass(frozen=True, slots=True)
class RunRecords(Mapping[str, Records]):
    """Video id -> its records, sorted, of the `shown` tables; each part is read when it is looked at.

    The repr names the shown tables' content by hashes.
    """

    video_ids: tuple[str, ...]
    tables: Mapping[str, ByVideo[Any]]
    shown: frozenset[str] = frozenset(table.name for table in TABLES)

    def __getitem__(self, video_id: str) -> Records:
        """What is known of a video. Raises FaultsError for a row that is no record of its table."""
        if not any(video_id in table for table in self.tables.values()):
            raise KeyError(video_id)
        parts = {name: Later(table, video_id) for name, table in self.tables.items() if name in self.shown}
        outcome = parts.pop(OUTCOMES.name, ())
        return Records(**parts, outcome=outcome[-1] if outcome else None)

    def __iter__(self) -> Iterator[str]:
        """The videos of which there is a record."""
        return iter(self.video_ids)

    def __len__(self) -> int:
        """How many they are."""
        return len(self.video_ids)

    def __repr__(self) -> str:
        """The videos and the shown tables; of the others it tells nothing, not even a hash."""
        return f"{self.video_ids} {[table for name, table in self.tables.items() if name in self.shown]}"


def read_records(folder: Path) -> RunRecords:
    """The records in the folder of a submission. Raises FaultsError for a table that is damaged."""
    paths = {table: folder / f"{table.name}.parquet" for table in TABLES}
    tables = {table.name: ByVideo(table, path) for table, path in paths.items() if path.is_file()}
    return RunRecords(tuple(sorted({video_id for table in tables.values() for video_id in table})), tables)
