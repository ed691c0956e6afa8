"""What the pages may know when the organiser keeps the truth back: nothing that a page could tell of it.

A caption's cosine, a video's score and a verdict all tell of the truth. So do boxes and tracks: of those
that are drawn or listed the hazards could only be left out, and the gap would point at them. Scores over
all videos stay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pipeline.columns import Coded
from pipeline.predictions import FRAMES, TRACKS, Predictions
from pipeline.records import TruthHazard
from pipeline.scores import Evaluation
from pipeline.tables import OUTCOMES, STAGES
from sitegen.run_records import RunRecords


def videos_only(truth: Mapping[str, Sequence[TruthHazard]]) -> dict[str, tuple[TruthHazard, ...]]:
    """The videos of the truth, each without a row, whether it has a hazard or none."""
    return dict.fromkeys(truth, ())


def totals_only(evaluation: Evaluation) -> Evaluation:
    """The scorecard and the captions; no pair, no video's score, no track of a caption, no warning.

    The check's warnings name videos with a hazard.
    """
    submission = evaluation.submission
    said = Predictions.of(submission.predictions)
    captions = replace(
        said,
        track_ids=Coded.same((), len(said), TRACKS),
        frame_indices=Coded.same((), len(said), FRAMES),
    )
    return Evaluation(replace(submission, predictions=captions, warnings=()), (), (), evaluation.card)


def words_only(records: RunRecords) -> RunRecords:
    """What the stages said; not which tracks were looked at, since the hazards are among them."""
    return replace(records, shown=frozenset({STAGES.name, OUTCOMES.name}))
