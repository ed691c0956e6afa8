"""Records as pages and comparisons see them."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from sitegen.annotate_records import Record

if TYPE_CHECKING:
    from sitegen.agreement import Annotated

_SHOWN_CHARS = 120


def answer(record: Record) -> dict[str, Any]:
    """What a page is told of its save."""
    found = record.problems
    return {
        "revision": record.revision,
        "saved_at": record.saved_at,
        "problems": found,
        "finished": not found,
    }


def content(record: Record | None) -> dict[str, Any]:
    """What a record says; revision 0 when there is none."""
    if record is None:
        return {"revision": 0, "hazards": [], "no_hazard": False, "saved_at": ""}
    hazards = [asdict(hazard) for hazard in record.hazards]
    return {
        "revision": record.revision,
        "hazards": hazards,
        "no_hazard": record.no_hazard,
        "saved_at": record.saved_at,
    }


def short(record: Record | None) -> str:
    """The labels of a record in a line, at most 120 characters of them."""
    if record is None:
        return ""
    text = "no hazard" if record.no_hazard else ", ".join(hazard.label.strip() for hazard in record.hazards)
    return text if len(text) <= _SHOWN_CHARS else f"{text[:_SHOWN_CHARS]}..."


def annotated(records: Iterable[Record]) -> "Annotated":
    """The finished records of one author as they are compared with another's."""
    from sitegen.agreement import Named

    return {
        record.video_id: [
            Named(hazard.label, " ".join(hazard.description.split()), hazard.track_id)
            for hazard in record.hazards
        ]
        for record in records
        if record.is_finished
    }
