"""What a page of few videos shows of a site's data, and nothing else: the rest cannot change the page."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from itertools import takewhile

from pipeline.records import Prediction
from pipeline.scores import Evaluation, PairScore, Scorecard, Signature, Submission, VideoScore
from sitegen.failures import Blame, Failure
from sitegen.gathered import Records, SiteData, System
from sitegen.language import said_again
from sitegen.restoration import Restorations
from sitegen.uncertainty import Interval, Uncertainty

_NAN = float("nan")
_NO_CARD = Scorecard(_NAN, _NAN, _NAN, None, 0, Signature("", "", "", "", 0, _NAN))
_NO_INTERVAL = Interval(_NAN, _NAN)
_UNSURE = Uncertainty(_NO_INTERVAL, _NO_INTERVAL, _NO_INTERVAL, None, 0, 0, 0, _NAN)


def of_video(data: SiteData, video_id: str) -> SiteData:
    """The data of one video: its truth, boxes and pictures, and of each system its words and scores there.

    No totals and no ranks: systems keep their order alone.
    """
    restored = data.restored.by_video.get(video_id)
    return SiteData(
        data.settings,
        {video_id: data.truth[video_id]},
        {video_id: data.boxes.get(video_id, ())},
        {video_id: data.media[video_id]},
        {video_id: data.names[video_id]},
        tuple(_on_video(system, video_id) for system in data.systems),
        restored=Restorations((restored,) if restored else ()),
        proposed_by=data.proposed_by,
    )


def of_lines(data: SiteData, system: System, video_ids: Sequence[str]) -> tuple[SiteData, System]:
    """The data for lines of one system on these videos: their truth, its words and its scores there."""
    said = [row for video_id in video_ids for row in system.predictions.get(video_id, ())]
    scores = [score for video_id in video_ids if (score := system.scores.get(video_id))]
    one = _system(system, said, scores)
    truth = {video_id: data.truth[video_id] for video_id in video_ids}
    names = {video_id: data.names[video_id] for video_id in video_ids}
    return SiteData(data.settings, truth, {}, {}, names, (one,)), one


def _on_video(system: System, video_id: str) -> System:
    score = system.scores.get(video_id)
    records = system.records.get(video_id)
    return _system(
        system,
        system.predictions.get(video_id, ()),
        (score,) if score else (),
        system.pairs.get(video_id, ()),
        {video_id: records.read()} if records else {},
        system.blame and Blame(failures_of(system.blame.failures, video_id), ()),
    )


def _system(
    system: System,
    said: Sequence[Prediction],
    scores: Sequence[VideoScore],
    pairs: Sequence[PairScore] = (),
    records: Mapping[str, Records] | None = None,
    blame: Blame | None = None,
) -> System:
    submission = Submission(system.name, "", "", "", "", tuple(said))
    return System(
        0,
        0,
        system.slug,
        said_again(system.agents),  # a worker process gets it as plain text
        system.is_baseline,
        Evaluation(submission, tuple(pairs), tuple(scores), _NO_CARD),
        _UNSURE,
        "",
        records=records or {},
        rehearsed=system.rehearsed,
        blame=blame,
    )


def failures_of(failures: Sequence[Failure], video_id: str) -> tuple[Failure, ...]:
    """The failures on one video, of all that are sorted by video."""
    start = bisect_left(failures, video_id, key=lambda failure: failure.video_id)
    return tuple(takewhile(lambda failure: failure.video_id == video_id, failures[start:]))
