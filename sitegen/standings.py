"""One row of the board: a submission, its scores, what the probes say, and what the ledger holds of it."""

from typing import NamedTuple

from pipeline.scores import Evaluation
from sitegen.ledger import Entry
from sitegen.probes import Probe
from sitegen.submissions import StoredSubmission


class Standing(NamedTuple):
    """`history` is the ledger's entries of the submission, oldest first; `rehearsed` marks a preview."""

    stored: StoredSubmission
    evaluation: Evaluation
    probes: tuple[Probe, ...] = ()
    history: tuple[Entry, ...] = ()
    rehearsed: bool = False
