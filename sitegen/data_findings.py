"""What a check of a benchmark's data looks at, and what it finds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from pipeline.records import TruthHazard
from sitegen.data_figures import BoxFacts

if TYPE_CHECKING:
    from pipeline.data.clip_facts import ClipFacts
    from pipeline.data.clip_hash import NearCopy

SHOWN = 6  # names in a message; `where` has all


class Severity(StrEnum):
    """How much a finding matters: an error makes scores wrong or impossible, a warning may."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found: its kind, the videos (or files) it is about, what was found, how to mend it."""

    severity: Severity
    kind: str
    where: tuple[str, ...]
    message: str
    mend: str


@dataclass(frozen=True, slots=True)
class CheckInput:
    """All that is checked. `boxes` and `clips` are None when there is no table of boxes, or no folder.

    `pairs` are near-copies of clips, `alike` are pairs of videos with descriptions that say
    nearly the same (video, video, cosine), `verbless` are the hazards described without a verb; all three
    are empty where that was not looked at.
    """

    truth: Sequence[TruthHazard]
    boxes: Mapping[str, BoxFacts] | None = None
    clips: "Sequence[ClipFacts] | None" = None
    pairs: "Sequence[NearCopy]" = ()
    alike: Sequence[tuple[str, str, float]] = ()
    verbless: Sequence[TruthHazard] = ()

    @property
    def video_ids(self) -> list[str]:
        """The videos of the truth, sorted."""
        return sorted({row.video_id for row in self.truth})


@dataclass(frozen=True, slots=True)
class StoredCheck:
    """A check as it was kept; `is_current` says whether the data are still those that were checked."""

    findings: tuple[Finding, ...]
    is_decoded: bool
    is_current: bool


def some(names: Sequence[str]) -> str:
    """The first few names, and how many more there are."""
    shown = ", ".join(names[:SHOWN])
    return f"{shown} and {len(names) - SHOWN} more" if len(names) > SHOWN else shown
