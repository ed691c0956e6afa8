"""The tables between the steps: for each, its columns, its sort key, and how a record becomes a row."""

from collections.abc import Iterable
from typing import Any

import pyarrow as pa

from pipeline.records import (
    Box,
    Exclusion,
    Item,
    Kind,
    Match,
    Parse,
    Prediction,
    Reaction,
    Reply,
    Snippet,
    Stage,
    StageOutput,
    TrackBox,
    TruthHazard,
    UsageRow,
    VideoFile,
    VideoOutcome,
)
from pipeline.scores import PairScore, VideoScore
from pipeline.table import Row, Table


def _box_row(track_box: TrackBox) -> Row:
    box = track_box.box
    return {
        "video_id": track_box.video_id,
        "frame_index": track_box.frame_index,
        "track_id": track_box.track_id,
        "kind": str(track_box.kind),
        "x1_px": box.x1_px,
        "y1_px": box.y1_px,
        "x2_px": box.x2_px,
        "y2_px": box.y2_px,
    }


def _box(row: Row) -> TrackBox:
    box = Box(row["x1_px"], row["y1_px"], row["x2_px"], row["y2_px"])
    return TrackBox(row["video_id"], row["frame_index"], row["track_id"], Kind(row["kind"]), box)


def _box_key(track_box: TrackBox) -> tuple[Any, ...]:
    return (track_box.video_id, track_box.frame_index, track_box.track_id)


def _plain(record: Any) -> Row:
    return {name: getattr(record, name) for name in record.__slots__}


def _prediction(row: Row) -> Prediction:
    return Prediction(
        row["video_id"],
        row["rank"],
        row["description"],
        row["label"],
        tuple(row["track_ids"] or ()),
        tuple(row["frame_indices"] or ()),
    )


def _stage_row(output: StageOutput) -> Row:
    reply = output.reply
    return {
        "video_id": output.video_id,
        "stage": str(output.stage),
        "call": output.call,
        "frame_index": output.frame_index,
        "prompt_id": output.prompt_id,
        "request_sha256": output.request_sha256,
        "reply_text": reply.text,
        "reply_model": reply.model,
        "reply_latency_s": reply.latency_s,
        "reply_input_tokens": reply.input_tokens,
        "reply_output_tokens": reply.output_tokens,
        "items": [_plain(item) for item in output.items],
        "parse": str(output.parse),
    }


def _stage(row: Row) -> StageOutput:
    return StageOutput(
        row["video_id"],
        Stage(row["stage"]),
        row["call"],
        row["prompt_id"],
        row["request_sha256"],
        Reply(
            row["reply_text"],
            row["reply_model"],
            row["reply_latency_s"],
            row["reply_input_tokens"],
            row["reply_output_tokens"],
        ),
        tuple(Item(**item) for item in row["items"]),
        Parse(row["parse"]),
        row["frame_index"],
    )


def _snippet(row: Row) -> Snippet:
    return Snippet(_box(row), None if row["excluded"] is None else Exclusion(row["excluded"]))


_STRING, _INT, _REAL, _BOOL = pa.string(), pa.int32(), pa.float64(), pa.bool_()
_STAGE_ORDER = {stage: place for place, stage in enumerate(Stage)}


def _schema(optional: Iterable[str] = (), **columns: pa.DataType) -> pa.Schema:
    missing = set(optional)
    return pa.schema([pa.field(name, kind, nullable=name in missing) for name, kind in columns.items()])


_BOX_COLUMNS = {
    "video_id": _STRING,
    "frame_index": _INT,
    "track_id": _STRING,
    "kind": _STRING,
    "x1_px": _REAL,
    "y1_px": _REAL,
    "x2_px": _REAL,
    "y2_px": _REAL,
}

BOXES: Table[TrackBox] = Table("boxes", _schema(**_BOX_COLUMNS), _box_key, _box_row, _box)

VIDEO_FILES: Table[VideoFile] = Table(
    "video_files",
    _schema(
        video_id=_STRING,
        file=_STRING,
        frame_count=_INT,
        fps_hz=_REAL,
        width_px=_INT,
        height_px=_INT,
        sha256=_STRING,
    ),
    lambda video: (video.video_id,),
    _plain,
    lambda row: VideoFile(**row),
)

TRUTH: Table[TruthHazard] = Table(
    "truth",
    _schema(
        ("track_id", "first_frame", "last_frame"),
        video_id=_STRING,
        hazard_id=_STRING,
        label=_STRING,
        description=_STRING,
        track_id=_STRING,
        first_frame=_INT,
        last_frame=_INT,
    ),
    lambda hazard: (hazard.video_id, hazard.hazard_id),
    _plain,
    lambda row: TruthHazard(**row),
)

PREDICTIONS: Table[Prediction] = Table(
    "predictions",
    _schema(
        ("label", "track_ids", "frame_indices"),
        video_id=_STRING,
        rank=_INT,
        description=_STRING,
        label=_STRING,
        track_ids=pa.list_(_STRING),
        frame_indices=pa.list_(_INT),
    ),
    lambda prediction: (prediction.video_id, prediction.rank),
    _plain,
    _prediction,
)

STAGES: Table[StageOutput] = Table(
    "stages",
    _schema(
        ("frame_index", "reply_latency_s", "reply_input_tokens", "reply_output_tokens"),
        video_id=_STRING,
        stage=_STRING,
        call=_INT,
        frame_index=_INT,
        prompt_id=_STRING,
        request_sha256=_STRING,
        reply_text=_STRING,
        reply_model=_STRING,
        reply_latency_s=_REAL,
        reply_input_tokens=_INT,
        reply_output_tokens=_INT,
        items=pa.list_(pa.struct([("rank", _INT), ("label", _STRING), ("description", _STRING)])),
        parse=_STRING,
    ),
    lambda output: (output.video_id, _STAGE_ORDER[output.stage], output.call),
    _stage_row,
    _stage,
)

SNIPPETS: Table[Snippet] = Table(
    "snippets",
    _schema(("excluded",), **_BOX_COLUMNS, excluded=_STRING),
    lambda snippet: _box_key(snippet.track_box),
    lambda snippet: {
        **_box_row(snippet.track_box),
        "excluded": None if snippet.excluded is None else str(snippet.excluded),
    },
    _snippet,
)

MATCHES: Table[Match] = Table(
    "matches",
    _schema(
        video_id=_STRING,
        frame_index=_INT,
        track_id=_STRING,
        label=_STRING,
        cosine=_REAL,
        detected=_BOOL,
        in_aos=_BOOL,
    ),
    lambda match: (match.video_id, match.frame_index, match.track_id, match.label),
    _plain,
    lambda row: Match(**row),
)

REACTIONS: Table[Reaction] = Table(
    "reactions",
    _schema(("frame_index",), video_id=_STRING, frame_index=_INT, score=_REAL, signal_hz=pa.list_(_REAL)),
    lambda reaction: (reaction.video_id,),
    _plain,
    lambda row: Reaction(**{**row, "signal_hz": tuple(row["signal_hz"])}),
)

OUTCOMES: Table[VideoOutcome] = Table(
    "outcomes",
    _schema(
        video_id=_STRING,
        file=_STRING,
        frame_count=_INT,
        fps_hz=_REAL,
        width_px=_INT,
        height_px=_INT,
        error=_STRING,
        note=_STRING,
    ),
    lambda outcome: (outcome.video_id,),
    _plain,
    lambda row: VideoOutcome(**row),
)

USAGE: Table[UsageRow] = Table(
    "usage",
    _schema(
        ("input_tokens", "output_tokens", "seconds", "cost"),
        video_id=_STRING,
        role=_STRING,
        model=_STRING,
        calls=_INT,
        input_tokens=pa.int64(),
        output_tokens=pa.int64(),
        seconds=_REAL,
        cost=_REAL,
    ),
    lambda row: (row.video_id, row.role),
    _plain,
    lambda row: UsageRow(**row),
)

PAIRS: Table[PairScore] = Table(
    "pairs",
    _schema(video_id=_STRING, prediction_rank=_INT, hazard_id=_STRING, cosine=_REAL, similarity=_REAL),
    lambda pair: (pair.video_id, pair.prediction_rank, pair.hazard_id),
    _plain,
    lambda row: PairScore(**row),
)

VIDEOS: Table[VideoScore] = Table(
    "videos",
    _schema(
        video_id=_STRING,
        n_predictions=_INT,
        n_hazards=_INT,
        n_hazards_found=_INT,
        best=_REAL,
        worst=_REAL,
        mean=_REAL,
        besm=_REAL,
        sam=_REAL,
        detected=_BOOL,
    ),
    lambda score: (score.video_id,),
    _plain,
    lambda row: VideoScore(**row),
)

TABLES: tuple[Table[Any], ...] = (
    BOXES,
    VIDEO_FILES,
    TRUTH,
    PREDICTIONS,
    STAGES,
    SNIPPETS,
    MATCHES,
    REACTIONS,
    OUTCOMES,
    USAGE,
    PAIRS,
    VIDEOS,
)
