"""What can go wrong with a hazard or a caption: the kinds, in words, and the records of them.

`blame.py` says what each kind means exactly, and finds them.
"""

from dataclasses import dataclass
from enum import StrEnum

from sitegen.language import N_
from sitegen.language import gettext as _

NEAR_MISS = 0.10
"""How far under the threshold a similarity is still a near miss (ours)."""


class FailureKind(StrEnum):
    """What went wrong with a hazard or, the last two, with a caption."""

    NOT_SEEN = "not-seen"
    NOT_RANKED = "not-ranked"
    LOST_IN_MERGING = "lost-in-merging"
    NOT_ANOMALOUS = "not-anomalous"
    TOO_SMALL = "too-small"
    NEAR_MISS = "near-miss"
    OTHER_WORDS = "other-words"
    NOTHING_SAID = "nothing-said"
    WRONG_OBJECT = "wrong-object"
    EXTRA = "extra"


NAMES: dict[FailureKind, str] = {
    FailureKind.NOT_SEEN: N_("Not seen"),
    FailureKind.NOT_RANKED: N_("Not ranked"),
    FailureKind.LOST_IN_MERGING: N_("Lost in merging"),
    FailureKind.NOT_ANOMALOUS: N_("Not judged an anomaly"),
    FailureKind.TOO_SMALL: N_("Too small"),
    FailureKind.NEAR_MISS: N_("Near miss"),
    FailureKind.OTHER_WORDS: N_("Other words"),
    FailureKind.NOTHING_SAID: N_("Nothing said"),
    FailureKind.WRONG_OBJECT: N_("Wrong object"),
    FailureKind.EXTRA: N_("Extra hazard"),
}

SENTENCES: dict[FailureKind, str] = {
    FailureKind.NOT_SEEN: N_("No scene description and no video answer mentions the hazard."),
    FailureKind.NOT_RANKED: N_("The vision agent mentions the hazard, but the Ranked Hazards Set does not."),
    FailureKind.LOST_IN_MERGING: N_(
        "The hazard was ranked, but is not in the Critical Object Set, where both tracks are merged."
    ),
    FailureKind.NOT_ANOMALOUS: N_("The hazard was among the objects, but was not judged an anomaly."),
    FailureKind.TOO_SMALL: N_(
        "The hazard is named at the end, but all its snippets were under the size limits, so that nothing "
        "was compared, and no caption passes the threshold."
    ),
    FailureKind.NEAR_MISS: N_("The best caption is at most 0.10 under the threshold."),
    FailureKind.OTHER_WORDS: N_("The hazard is named at the end, but in words too far from the truth’s."),
    FailureKind.NOTHING_SAID: N_("No caption mentions the hazard; where it was lost is not recorded."),
    FailureKind.WRONG_OBJECT: N_(
        "The caption mentions no hazard of the video, and one of them is not found."
    ),
    FailureKind.EXTRA: N_("The caption mentions no hazard of the video, and there is none left to find."),
}


def name_of(kind: FailureKind) -> str:
    """The kind in a word or two."""
    return _(NAMES[kind])


def meaning_of(kind: FailureKind) -> str:
    """What the kind means, in a sentence."""
    return _(SENTENCES[kind])


@dataclass(frozen=True, slots=True)
class Failure:
    """One failure: of a hazard, or (`hazard_id` None) of a caption.

    `similarity` in [0, 1] is the best of that hazard over all captions, or of that caption over all hazards;
    `prediction_rank` is the caption that is meant, None where the hazard has none. `evidence` is a sentence
    ready to print. `stages_known` says whether the video's stages are recorded.
    """

    kind: FailureKind
    video_id: str
    hazard_id: str | None
    prediction_rank: int | None
    similarity: float
    evidence: str
    stages_known: bool


@dataclass(frozen=True, slots=True)
class FunnelStep:
    """How many hazards are still alive after a step; None: it is not recorded for any video.

    `stage` is `truth`, `seen`, `ranked`, `merged`, `anomalous` or `matched`. In a video without records only
    what captions mention is known to have been alive.
    """

    stage: str
    alive: int | None


@dataclass(frozen=True, slots=True)
class Blame:
    """The failures of a system, by video, hazards before captions, and its funnel."""

    failures: tuple[Failure, ...]
    funnel: tuple[FunnelStep, ...]
