"""A submissions folder for tests, and a file to submit to it."""

from pathlib import Path
from typing import Any

from sitegen import ledger
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
        given: dict[str, Any] = {
            "name": name,
            "authors": "Ann",
            "url": "https://example.org/a",
            "date": "2026-01-02",
            "agents": "none",
            "read": read_predictions(original),
            "original": original,
        }
        return store(self.folder, **{**given, **more})

    def events(self) -> list[tuple[str, str]]:
        """What the ledger says."""
        return [(entry.event, entry.slug) for entry in ledger.read(self.folder)]
