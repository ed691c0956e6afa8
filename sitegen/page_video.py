"""The page of one video: its pictures, its truth, and every system's words against it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.records import Kind, TrackBox, TruthHazard
from pipeline.scores import VideoScore
from sitegen.contexts import Fact, Link, Shell
from sitegen.gathered import KeyframePicture, SiteData, System, VideoMedia
from sitegen.numerals import number, plural, score, seconds
from sitegen.verdicts import best_pairs, cosine_score, title_of, verdict
from sitegen.video_contexts import (
    CaptionView,
    CropView,
    FilmFrame,
    MatrixRow,
    OverlayBox,
    Result,
    SystemView,
    Transcript,
    TruthView,
    VideoPage,
)
from sitegen.words import difference, shorten, visible


@dataclass(frozen=True, slots=True)
class Place:
    """Where a video stands among all: its neighbours, and "3 of 12"."""

    before: Link | None
    after: Link | None
    text: str


def video_page(
    data: SiteData,
    video_id: str,
    shell: Shell,
    transcripts: Sequence[Transcript],
    place: Place,
) -> VideoPage:
    """The context of a video's page."""
    truth = data.truth[video_id]
    media = data.media[video_id]
    boxes = data.boxes.get(video_id, ())
    frames = film(media, boxes, hidden=data.hidden)
    hazards = [hazard for hazard in truth if not hazard.is_no_hazard]
    truth_views = tuple(_truth_view(hazard) for hazard in hazards)
    recorded = {made.slug for made in transcripts}
    unrecorded = [visible(system.name) for system in data.systems if system.slug not in recorded]
    return VideoPage(
        shell=shell,
        video_id=visible(video_id),
        hidden=data.hidden,
        heading=visible(video_id if data.hidden else title_of(truth)),
        facts=_facts(data, media, boxes),
        truth=truth_views,
        problem=visible(media.problem),
        note=visible(media.note),
        width=media.width_px,
        height=media.height_px,
        frames=frames,
        cover=frames[media.cover] if frames else None,
        clip=media.clip,
        has_boxes=any(frame.boxes for frame in frames),
        crops=_crops(data, video_id, media),
        systems=tuple(_system_view(data, system, video_id, hazards) for system in data.systems),
        matrix_columns=truth_views,
        matrix=_matrix(data, video_id, hazards),
        transcripts=tuple(transcripts),
        unrecorded=", ".join(unrecorded),
        threshold=f"{data.settings.threshold:.2f}",
        threshold_share=round(data.settings.threshold * 100),
        label_px=number(_label_px(media)),
        previous=place.before,
        following=place.after,
        place=place.text,
    )


def film(media: VideoMedia, boxes: Sequence[TrackBox], *, hidden: bool = False) -> tuple[FilmFrame, ...]:
    """The film strip: every keyframe with its boxes; when the truth is hidden, without a word on boxes."""
    by_frame: dict[int, list[TrackBox]] = {}
    for box in boxes:
        by_frame.setdefault(box.frame_index, []).append(box)
    frames = tuple(
        _film_frame(media, place, picture, by_frame.get(picture.index, []))
        for place, picture in enumerate(media.frames)
    )
    return tuple(replace(frame, alt=_when(frame.index, frame.time)) for frame in frames) if hidden else frames


def _film_frame(
    media: VideoMedia, place: int, picture: KeyframePicture, boxes: Sequence[TrackBox]
) -> FilmFrame:
    hazards = sum(box.kind is Kind.CHALLENGE for box in boxes)
    others = len(boxes) - hazards
    parts = [plural(hazards, "hazard box", "hazard boxes")] if hazards else []
    parts += [plural(others, "traffic box", "traffic boxes")] if others else []
    alt = f"{_when(picture.index, seconds(picture.time_s))}: {' and '.join(parts) or 'no boxes'}"
    # Hazards last, so that they are drawn on top.
    ordered = sorted(boxes, key=lambda box: (box.kind is Kind.CHALLENGE, box.track_id))
    return FilmFrame(
        place + 1,
        picture.index,
        seconds(picture.time_s),
        picture.thumb,
        picture.full,
        alt,
        tuple(_overlay(box, media) for box in ordered),
        place == media.cover,
    )


def _when(index: int, time: str) -> str:
    return f"Frame {index} at {time}"


def _overlay(box: TrackBox, media: VideoMedia) -> OverlayBox:
    x1, x2 = (min(max(value, 0.0), float(media.width_px)) for value in (box.box.x1_px, box.box.x2_px))
    y1, y2 = (min(max(value, 0.0), float(media.height_px)) for value in (box.box.y1_px, box.box.y2_px))
    size = _label_px(media)
    text_y = y1 - size * 0.35 if y1 > size * 1.4 else y1 + size
    return OverlayBox(
        number(x1),
        number(y1),
        number(max(0.0, x2 - x1)),
        number(max(0.0, y2 - y1)),
        number(text_y),
        shorten(visible(box.track_id), 16),
        box.kind is Kind.CHALLENGE,
    )


def _label_px(media: VideoMedia) -> float:
    """Height of the track labels, in the video's pixels."""
    return max(media.width_px / 45, 8.0)


def _facts(data: SiteData, media: VideoMedia, boxes: Sequence[TrackBox]) -> tuple[Fact, ...]:
    tracks = {box.track_id: box.kind for box in boxes}
    hazards = sum(kind is Kind.CHALLENGE for kind in tracks.values())
    facts = []
    if media.frame_count:
        length = seconds(media.frame_count / media.fps_hz) if media.fps_hz else "unknown"
        facts = [
            Fact("Length", length),
            Fact("Frames", f"{media.frame_count:,} at {media.fps_hz:g} per second"),
            Fact("Size", f"{media.width_px} × {media.height_px} px"),
        ]
    facts.append(Fact("Keyframes", str(len(media.frames))))
    if not data.hidden:
        facts.append(Fact("Tracks on them", f"{hazards} hazard, {len(tracks) - hazards} traffic"))
    return tuple(facts)


def _truth_view(hazard: TruthHazard) -> TruthView:
    where = []
    if hazard.track_id:
        where.append(f"track {visible(hazard.track_id)}")
    if hazard.first_frame is not None and hazard.last_frame is not None:
        where.append(f"frames {hazard.first_frame} to {hazard.last_frame}")
    return TruthView(
        visible(hazard.hazard_id), visible(hazard.label), visible(hazard.description), ", ".join(where)
    )


def _crops(data: SiteData, video_id: str, media: VideoMedia) -> tuple[CropView, ...]:
    """Crops of hazard tracks, and of those that a system's verification took for its hazard."""
    seen: dict[str, list[str]] = {}
    blamed: set[str] = set()
    for system in data.systems:
        records = system.records.get(video_id)
        best: dict[str, tuple[float, str]] = {}
        for match in records.matches if records else ():
            best[match.track_id] = max(best.get(match.track_id, (-2.0, "")), (match.cosine, match.label))
            if match.detected and match.in_aos:
                blamed.add(match.track_id)
        for track_id, (cosine, label) in best.items():
            line = f"{visible(system.name)}: {shorten(visible(label), 40)} ({cosine:.2f})"
            seen.setdefault(track_id, []).append(line)
    views = []
    shown: set[str] = set()
    for crop in media.crops:
        hazard = crop.kind is Kind.CHALLENGE
        if not hazard and crop.track_id not in blamed:
            continue
        track = shorten(visible(crop.track_id), 24)
        first = crop.track_id not in shown
        shown.add(crop.track_id)
        views.append(
            CropView(
                crop.path,
                crop.picture_width_px,
                crop.picture_height_px,
                f"{'Hazard' if hazard else 'Traffic'} track {track}, cut from frame {crop.frame_index}",
                track,
                hazard,
                f"frame {crop.frame_index}, {crop.width_px} × {crop.height_px} px",
                tuple(seen.get(crop.track_id, ())) if first else (),
            )
        )
    return tuple(sorted(views, key=lambda view: not view.hazard))


def _system_view(data: SiteData, system: System, video_id: str, hazards: Sequence[TruthHazard]) -> SystemView:
    best = best_pairs(system, video_id)
    words = {hazard.hazard_id: hazard.description for hazard in hazards}
    captions = []
    for row in system.predictions.get(video_id, []):
        pair = best.get(row.rank)
        text = visible(row.description)
        captions.append(
            CaptionView(
                row.rank,
                visible(row.label or ""),
                text,
                ", ".join(visible(track) for track in row.track_ids),
                visible(pair.hazard_id) if pair else "",
                cosine_score(pair, data.settings.threshold) if pair else None,
                "" if pair or data.hidden else "The truth has no hazard here: a false alarm.",
                difference(visible(words[pair.hazard_id]), text) if pair else (),
            )
        )
    empty = "This system said nothing here."
    if not data.hidden:
        right = "This system described no hazard here, which is right."
        wrong = "This system described no hazard here; the video counts as 0 for it."
        empty = wrong if hazards else right
    return SystemView(
        system.slug,
        visible(system.name),
        visible(system.agents),
        system.is_baseline,
        None if data.hidden else _result(system.scores[video_id]),
        tuple(captions),
        empty,
    )


def _result(video: VideoScore) -> Result:
    kind, text = verdict(video)
    return Result(score(video.besm), score(video.sam), kind, text)


def _matrix(data: SiteData, video_id: str, hazards: Sequence[TruthHazard]) -> tuple[MatrixRow, ...]:
    rows = []
    order = [hazard.hazard_id for hazard in hazards]
    if not order:
        return ()
    for system in data.systems:
        pairs = {(p.prediction_rank, p.hazard_id): p for p in system.pairs.get(video_id, ())}
        best = best_pairs(system, video_id)
        predictions = system.predictions.get(video_id, [])
        for place, row in enumerate(predictions):
            cells = [cosine_score(pairs[row.rank, hazard], data.settings.threshold) for hazard in order]
            rows.append(
                MatrixRow(
                    visible(system.name),
                    place == 0,
                    len(predictions),
                    row.rank,
                    shorten(visible(row.description), 160),
                    tuple(cells),
                    order.index(best[row.rank].hazard_id),
                )
            )
    return tuple(rows)
