"""Checks the data of a benchmark before it is published: records in, findings out. Pure."""

from collections.abc import Iterator

from pipeline.data.clip_facts import ClipFacts
from pipeline.records import TruthHazard
from sitegen.data_check_clips import clip_findings
from sitegen.data_check_leaks import leak_findings
from sitegen.data_check_words import label_findings, word_findings
from sitegen.data_figures import BoxFacts
from sitegen.data_findings import CheckInput, Finding, Severity

_ORDER = {severity: place for place, severity in enumerate(Severity)}
MANY_CALM = 0.5  # share of videos without a hazard from which on silence scores well


def check_data(given: CheckInput) -> list[Finding]:
    """Every finding, the gravest first, then by kind and place."""
    found = [
        *_coverage(given),
        *_hazards(given),
        *clip_findings(given),
        *word_findings(given),
        *label_findings(given),
        *leak_findings(given),
    ]
    return sorted(found, key=lambda one: (_ORDER[one.severity], one.kind, one.where, one.message))


def _coverage(given: CheckInput) -> Iterator[Finding]:
    ids = given.video_ids
    if given.clips is not None:
        clips = {clip.video_id for clip in given.clips}
        if missing := tuple(name for name in ids if name not in clips):
            yield Finding(
                Severity.ERROR,
                "truth without video",
                missing,
                f"{len(missing)} of {len(ids)} videos of the truth have no clip.",
                "Add the clips, named as the truth names them, or take the rows out.",
            )
        if extra := tuple(sorted(clips - set(ids))):
            yield Finding(
                Severity.WARNING,
                "video without truth",
                extra,
                f"{len(extra)} clips have no row in the truth, so nothing said of them counts.",
                "Describe them, with an empty row where there is no hazard, or take them out.",
            )
    if given.boxes is not None:
        if bare := tuple(name for name in ids if name not in given.boxes):
            yield Finding(
                Severity.WARNING,
                "no boxes",
                bare,
                f"{len(bare)} of {len(ids)} videos have no box.",
                "Annotate them: coooler data annotate.",
            )
        if stray := tuple(sorted(set(given.boxes) - set(ids))):
            yield Finding(
                Severity.NOTE,
                "boxes without truth",
                stray,
                f"{len(stray)} videos with boxes are not in the truth.",
                "Add them to the truth, or take their boxes out.",
            )
    calm = tuple(row.video_id for row in given.truth if row.is_no_hazard)
    if ids and len(calm) > MANY_CALM * len(ids):
        yield Finding(
            Severity.WARNING,
            "no-hazard share",
            calm,
            f"{len(calm)} of {len(ids)} videos have no hazard: a system that says nothing scores "
            f"{len(calm) / len(ids):.0%}.",
            "Add videos with hazards.",
        )
    if ids and not calm:
        yield Finding(
            Severity.NOTE,
            "no-hazard share",
            (),
            "Every video has a hazard, so nothing measures false alarms.",
            "Add some videos without a hazard.",
        )


def _hazards(given: CheckInput) -> Iterator[Finding]:
    clips = {clip.video_id: clip for clip in given.clips or () if not clip.problem}
    for row in given.truth:
        clip = clips.get(row.video_id)
        last = row.last_frame if row.last_frame is not None else row.first_frame
        if clip and last is not None and last >= clip.frame_count:
            yield _wrong(
                row,
                "frames beyond the clip",
                f"ends at frame {last}, but the clip has frames 0 to {clip.frame_count - 1}",
                "Correct the frames; they count from 0.",
            )
        if given.boxes is not None and row.track_id is not None:
            yield from _track(row, row.track_id, given.boxes.get(row.video_id))
    if proposed := sorted(name for name, facts in (given.boxes or {}).items() if facts.proposed_tracks):
        yield Finding(
            Severity.NOTE,
            "proposed boxes",
            tuple(proposed),
            f"The tracks of {len(proposed)} videos were proposed by a program; nobody annotated them.",
            "Annotate them, or say so wherever results are shown.",
        )
    told: dict[str, set[str | None]] = {name: set() for name in given.video_ids}
    for row in given.truth:
        told[row.video_id].add(row.track_id)
    for name, facts in sorted((given.boxes or {}).items()):
        clip = clips.get(name)
        if clip and facts.last_frame >= clip.frame_count:
            yield Finding(
                Severity.ERROR,
                "boxes beyond the clip",
                (name,),
                f"A box is in frame {facts.last_frame}, but the clip has frames 0 to {clip.frame_count - 1}.",
                "The boxes may be of another cut of the clip, or count from 1.",
            )
        if name in told and (untold := sorted(facts.hazard_tracks - told[name])):
            yield Finding(
                Severity.NOTE,
                "undescribed hazard track",
                (name,),
                f"{len(untold)} tracks are boxed as hazards, but no row of the truth names them.",
                "Describe them, or make them traffic.",
            )


def _track(row: TruthHazard, track: str, facts: BoxFacts | None) -> Iterator[Finding]:
    if facts is None or track not in facts.frames_of:
        yield _wrong(
            row, "unknown track", f"names track {track}, which has no box", "Correct the track's id."
        )
        return
    if track in facts.traffic_tracks and track not in facts.hazard_tracks:
        yield Finding(
            Severity.WARNING,
            "hazard boxed as traffic",
            (row.video_id,),
            f"Hazard {row.hazard_id} is track {track}, which is boxed as traffic.",
            "Make the track a challenge object, or point the hazard at another.",
        )
    low, high = facts.frames_of[track]
    first, last = row.first_frame, row.last_frame
    if first is not None and last is not None and (last < low or first > high):
        yield _wrong(
            row,
            "track elsewhere",
            f"is in frames {first} to {last}, its track {track} in {low} to {high}",
            "Correct the frames or the track.",
        )


def _wrong(row: TruthHazard, kind: str, message: str, mend: str) -> Finding:
    return Finding(Severity.ERROR, kind, (row.video_id,), f"Hazard {row.hazard_id} {message}.", mend)


def annotated_share(boxes: dict[str, BoxFacts], clips: list[ClipFacts]) -> float | None:
    """Frames with a box over all frames of the readable clips; None when there is no frame."""
    frames = sum(clip.frame_count for clip in clips if not clip.problem)
    covered = [boxes[clip.video_id].frames for clip in clips if not clip.problem and clip.video_id in boxes]
    return min(1.0, sum(covered) / frames) if frames else None
