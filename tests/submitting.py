"""A submissions folder for tests, and a file to submit to it."""

from pathlib import Path
from typing import Any

from sitegen import ledger
from sitegen.about import Sender
from sitegen.readers import read_predictions
from sitegen.submissions import store

CSV = "video_id,rank,description\nv1,1,A cat.\nv2,1,A dog.\n"


class Bench:
    """A submissions folder, and a file to submit."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.folder = root / "submissions"

    def submit(self, name: str = "Team A", content: str = CSV, **more: Any) -> Path:
        """Store `content` as a submission."""
        original = self.root / "given.csv"
        original.write_text(content)
        said = {"authors": "Ann", "url": "https://example.org/a", "date": "2026-01-02", "agents": "none"}
        said.update({field: more.pop(field) for field in Sender.__slots__ if field in more})
        read = more.pop("read", None) or read_predictions(original)
        return store(self.folder, Sender(name, **said), read, more.pop("original", original), **more)

    def events(self) -> list[tuple[str, str]]:
        """What the ledger says."""
        return [(entry.event, entry.slug) for entry in ledger.read(self.folder)]
