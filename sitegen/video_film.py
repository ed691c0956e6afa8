"""The film strip of a video's page: its keyframes, their boxes, and the tracks that can be switched."""

from collections.abc import Mapping, Sequence

from pipeline.records import Kind, TrackBox, TruthHazard
from sitegen.gathered import VideoMedia
from sitegen.language import N_
from sitegen.language import gettext as _
from sitegen.numerals import number, plural, seconds
from sitegen.video_contexts import FilmFrame, OverlayBox, TrackChip
from sitegen.words import shorten, visible


def film(
    media: VideoMedia, boxes: Sequence[TrackBox], labels: Mapping[str, str], *, hidden: bool = False
) -> tuple[FilmFrame, ...]:
    """The film strip: every keyframe with its boxes; when the truth is hidden, without a word on boxes.

    `labels` maps the track of a truth hazard to its label.
    """
    by_frame: dict[int, list[TrackBox]] = {}
    for box in boxes:
        by_frame.setdefault(box.frame_index, []).append(box)
    frames = []
    drawn = _Overlays(media)
    moment = _("Frame {n} at {time}")
    for place, picture in enumerate(media.frames):
        # Hazards last, so that they are drawn on top.
        ordered = sorted(
            by_frame.get(picture.index, ()), key=lambda box: (box.kind is Kind.CHALLENGE, box.track_id)
        )
        time = seconds(picture.time_s)
        when = moment.format(n=picture.index, time=time)
        frames.append(
            FilmFrame(
                place + 1,
                picture.index,
                time,
                picture.thumb,
                picture.full,
                when if hidden else f"{when}: {_boxes_text(ordered, labels) or _('no boxes')}",
                tuple(map(drawn.of, ordered)),
                place == media.cover,
            )
        )
    return tuple(frames)


def _boxes_text(boxes: Sequence[TrackBox], labels: Mapping[str, str]) -> str:
    """What the boxes of a frame are: hazard tracks by name, others by their number; empty without any."""
    kinds = [box.kind for box in boxes]
    seen = dict.fromkeys(box.track_id for box in boxes if box.kind is Kind.CHALLENGE)
    parts = [_("hazard track {track}").format(track=named_track(track, labels)) for track in seen]
    proposed, others = kinds.count(Kind.PROPOSED), kinds.count(Kind.TRAFFIC)
    parts += [plural(proposed, "{n} proposed box", "{n} proposed boxes")] if proposed else []
    parts += [plural(others, "{n} traffic box", "{n} traffic boxes")] if others else []
    return ", ".join(parts)


def track_labels(hazards: Sequence[TruthHazard]) -> dict[str, str]:
    """Track id -> the labels of the truth hazards that it is; no track without a label."""
    found: dict[str, dict[str, None]] = {}
    for hazard in hazards:
        if hazard.track_id and hazard.label:
            found.setdefault(hazard.track_id, {})[shorten(visible(hazard.label), 40)] = None
    return {track: ", ".join(labels) for track, labels in found.items()}


def named_track(track: str, labels: Mapping[str, str]) -> str:
    """A track as texts name it, with its label where it has one."""
    label = labels.get(track)
    return shorten(visible(track), 24) + (f" ({label})" if label else "")


def chips(boxes: Sequence[TrackBox], labels: Mapping[str, str]) -> tuple[TrackChip, ...]:
    """The tracks of these boxes, hazards first; a track with boxes of both kinds is a hazard."""
    hazards = {box.track_id for box in boxes if box.kind is Kind.CHALLENGE}
    proposed = {box.track_id for box in boxes if box.kind is Kind.PROPOSED} - hazards
    order = sorted({box.track_id for box in boxes}, key=lambda track: (track not in hazards, _by_size(track)))
    return tuple(
        TrackChip(
            visible(track),
            shorten(visible(track), 16),
            labels.get(track, ""),
            track in hazards,
            track in proposed,
        )
        for track in order
    )


def _by_size(track: str) -> tuple[int, str]:
    """Sorts 9 before 10, and p9 before p10."""
    return (len(track), track) if track.removeprefix("p").isdecimal() else (0, track)


PROPOSERS = {
    "motion": N_("motion"),
    "detector": N_("a detector"),
    "detector,motion": N_("a detector and motion"),
}
"""What proposed tracks, in words, by the mark `proposed_by` of a `boxes` table."""


def proposer(proposed_by: str) -> str:
    """What proposed the tracks of a benchmark, in words."""
    return _(PROPOSERS.get(proposed_by, N_("a program")))


def tracks_text(tracks: Sequence[TrackChip], proposed_by: str = "") -> str:
    """How many tracks there are, by kind; `proposed_by` is the mark of the `boxes` table."""
    hazards, proposed = sum(track.hazard for track in tracks), sum(track.proposed for track in tracks)
    if proposed and proposed == len(tracks):
        text = _("{n} proposed by {proposer}, not annotated")
        return text.format(n=proposed, proposer=proposer(proposed_by))
    others = len(tracks) - hazards - proposed
    text = _("{hazards} hazard, {others} traffic").format(hazards=hazards, others=others)
    return _("{tracks}, {n} proposed").format(tracks=text, n=proposed) if proposed else text


class _Overlays:
    """Boxes as they are drawn on the pictures of one video."""

    def __init__(self, media: VideoMedia) -> None:
        self._right, self._bottom = float(media.width_px), float(media.height_px)
        self._size = label_px(media)
        self._named: dict[str, tuple[str, str]] = {}

    def of(self, box: TrackBox) -> OverlayBox:
        """The part of a box that lies on the picture."""
        right, bottom, size, corners = self._right, self._bottom, self._size, box.box
        x1, x2 = min(max(corners.x1_px, 0.0), right), min(max(corners.x2_px, 0.0), right)
        y1, y2 = min(max(corners.y1_px, 0.0), bottom), min(max(corners.y2_px, 0.0), bottom)
        named = self._named.get(box.track_id)
        if named is None:
            track = visible(box.track_id)
            named = self._named[box.track_id] = track, shorten(track, 16)
        return OverlayBox(
            number(x1),
            number(y1),
            number(max(0.0, x2 - x1)),
            number(max(0.0, y2 - y1)),
            number(y1 - size * 0.35 if y1 > size * 1.4 else y1 + size),
            *named,
            box.kind is Kind.CHALLENGE,
            box.kind is Kind.PROPOSED,
        )


def label_px(media: VideoMedia) -> float:
    """Height of the track labels, in the video's pixels."""
    return max(media.width_px / 45, 8.0)
