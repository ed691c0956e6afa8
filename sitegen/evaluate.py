"""A submission against the truth: texts to vectors, once each, then the scores."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import pyarrow as pa

from pipeline.errors import Fault, FaultsError, InputError, OutsideError
from pipeline.files import sha256_of
from pipeline.interfaces import Embedder
from pipeline.pairs import PairScores
from pipeline.predictions import Predictions
from pipeline.records import TruthHazard
from pipeline.scores import Evaluation, Signature, Submission
from sitegen.score import (
    METRIC_VERSION,
    Index,
    Real,
    pair_cosines,
    pair_rows,
    score_pairs,
    scorecard,
    similarities,
    unit_rows,
)

_hazard_key = attrgetter("video_id", "hazard_id")


@dataclass(frozen=True, slots=True, eq=False)
class TextVectors:
    """Unit vectors of distinct texts: `units` (T, D) float64, and the row of each text."""

    row_of: dict[str, int]
    units: Real

    def rows(self, texts: Iterable[str]) -> Index:
        """The row numbers of the texts. Raises KeyError for a text that was not embedded."""
        return np.fromiter((self.row_of[text] for text in texts), dtype=np.int64)


def embed_all(texts: Iterable[str], embedder: Embedder) -> TextVectors:
    """Each distinct text embedded once, in one call; in sorted order, so that runs repeat exactly.

    Raises OutsideError when the embedder gives vectors of a wrong shape, zero or not finite.
    """
    distinct = sorted(set(texts))
    if not distinct:
        return TextVectors({}, np.zeros((0, 0)))
    vectors = np.asarray(embedder.embed(distinct))
    if vectors.ndim != 2 or len(vectors) != len(distinct):
        raise OutsideError(
            f"Embedder {embedder.name} gave an array of shape {vectors.shape}; expected ({len(distinct)}, D)."
        )
    try:
        units = unit_rows(vectors)
    except ValueError as error:
        raise OutsideError(f"Embedder {embedder.name}: {error}.") from error
    return TextVectors({text: row for row, text in enumerate(distinct)}, units)


def texts_of(submissions: Iterable[Submission], truth: Iterable[TruthHazard]) -> set[str]:
    """The distinct texts that must be embedded to evaluate the submissions."""
    texts = {hazard.description for hazard in truth if not hazard.is_no_hazard}
    for submission in submissions:
        texts.update(Predictions.of(submission.predictions).texts)
    return texts


def truth_sha256(truth: Iterable[TruthHazard]) -> str:
    """Hash of the content of the truth: the same for every file format and order of rows."""
    names = TruthHazard.__slots__
    rows = [[getattr(hazard, name) for name in names] for hazard in sorted(truth, key=_hazard_key)]
    return sha256_of(json.dumps([names, rows], ensure_ascii=True, separators=(",", ":")).encode())


def evaluate(
    submission: Submission,
    truth: Sequence[TruthHazard],
    embedder: Embedder,
    threshold: float,
    truth_sha256: str,
    *,
    vectors: TextVectors | None = None,
) -> Evaluation:
    """Score a submission over every video of the truth, sorted by id.

    `threshold` in [0, 1], strict (paper: 0.80). `vectors` holds already embedded texts (see
    `embed_all` and `texts_of`), for many submissions at once; without it this function embeds.
    Raises FaultsError for predictions whose video the truth does not know or whose (video, rank)
    comes twice, InputError for a truth without rows or a threshold out of range.
    """
    if not truth:
        raise InputError("The truth has no rows; expected at least one video.")
    if not 0 <= threshold <= 1:
        raise InputError(f"Threshold {threshold:g} is out of range; expected 0 to 1.")
    video_ids = sorted({hazard.video_id for hazard in truth})
    number = {video_id: place for place, video_id in enumerate(video_ids)}
    hazards = sorted((hazard for hazard in truth if not hazard.is_no_hazard), key=_hazard_key)
    predictions = Predictions.of(submission.predictions)
    _check(submission.name, predictions, number)
    vectors = vectors or embed_all(texts_of([submission], truth), embedder)

    video_number = np.array([number[video_id] for video_id in predictions.video_ids], dtype=np.int64)
    prediction_video = video_number[predictions.video.codes]
    hazard_video = np.array([number[row.video_id] for row in hazards], dtype=np.int64)
    pair_prediction, pair_hazard = pair_rows(prediction_video, hazard_video, len(video_ids))
    cosines = pair_cosines(
        vectors.units,
        vectors.rows(predictions.texts)[predictions.description.codes][pair_prediction],
        vectors.rows(row.description for row in hazards)[pair_hazard],
    )
    scores = score_pairs(cosines, prediction_video, hazard_video, len(video_ids), threshold)
    signature = Signature(
        METRIC_VERSION, embedder.name, embedder.sha256, truth_sha256, len(video_ids), threshold
    )
    hazard_ids = pa.array([row.hazard_id for row in hazards], pa.string())
    pairs = PairScores(predictions, hazard_ids, pair_prediction, pair_hazard, cosines, similarities(cosines))
    videos = scores.records(video_ids)
    return Evaluation(submission, pairs, videos, scorecard(videos, signature))


def _check(name: str, predictions: Predictions, number: dict[str, int]) -> None:
    """Raise FaultsError for unknown videos (one fault each) and for ranks given twice."""
    place = f"submission {name!r}"
    faults = [
        Fault(
            place,
            None,
            "video_id",
            repr(video_id),
            f"one of the {len(number)} video ids of the truth",
            "Correct the id, or leave the rows out.",
        )
        for video_id in predictions.video_ids
        if video_id not in number
    ]
    key = predictions.video.codes.astype(np.int64) << 32 | predictions.rank
    faults += [
        Fault(
            place,
            None,
            "rank",
            f"rank {again.rank} twice in video {again.video_id!r}",
            "each rank once in a video",
            "Number the predictions of a video 1, 2, 3, ...",
        )
        for again in map(predictions.__getitem__, np.flatnonzero(key[1:] == key[:-1]).tolist())
    ]
    if faults:
        raise FaultsError(faults)
