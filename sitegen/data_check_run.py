"""Reads a benchmark for the check of its data, runs it, and keeps the result in `data-check.json`.

The result holds the hashes of what was checked, so that a site shows it only for the same data.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.files import sha256_file, sha256_of, write_text
from pipeline.records import TruthHazard
from sitegen.data_check_words import ALIKE
from sitegen.data_findings import CheckInput, Finding, Severity, StoredCheck
from sitegen.evaluate import embed_all, truth_sha256

if TYPE_CHECKING:
    from pipeline.data.clip_facts import ClipFacts
    from pipeline.interfaces import Embedder
    from sitegen.data_figures import BoxFacts, ClipFigures

FILE_NAME = "data-check.json"
MAX_BYTES = 16 << 20
_VERBS = {"VERB", "AUX"}


@dataclass(frozen=True, slots=True)
class Inputs:
    """Hashes of what is checked; empty where there is nothing. `clips_sha256` is of the truth's videos."""

    truth_sha256: str
    boxes_sha256: str
    clips_sha256: str


def inputs_of(truth: Sequence[TruthHazard], boxes: Path, clips: Mapping[str, str]) -> Inputs:
    """The hashes of truth, boxes and clips (video id -> SHA-256; only those of the truth count)."""
    ids = sorted({row.video_id for row in truth})
    lines = [f"{name} {clips[name]}\n" for name in ids if clips.get(name)]
    boxes_sha256 = sha256_file(boxes) if boxes.is_file() else ""
    return Inputs(truth_sha256(truth), boxes_sha256, sha256_of("".join(lines).encode()))


def read_boxes(path: Path, is_needed: bool) -> "dict[str, BoxFacts] | None":
    """The facts of a table of boxes; None when there is none. Raises InputError when a needed one is not."""
    from pipeline.tables import BOXES
    from sitegen.data_figures import box_facts

    if not path.is_file():
        if is_needed:
            raise InputError(f"{path}: no such file; expected the table of boxes (boxes.parquet).")
        return None
    return box_facts(BOXES.read(path))


def read_clips(
    folder: Path,
    is_needed: bool,
    *,
    cache: Path | None,
    decode: bool,
    workers: int,
    tell: Callable[[int, int], None],
) -> "list[ClipFacts] | None":
    """The facts of the clips of a folder; None when it is not there. Raises InputError when it must be."""
    from pipeline.data.clip_facts import clip_files, survey

    if not folder.is_dir():
        if is_needed:
            raise InputError(f"{folder}: no such folder; expected the clips.")
        return None
    return survey(clip_files(folder), cache, decode=decode, workers=workers, tell=tell)


def alike(truth: Sequence[TruthHazard], embedder: "Embedder") -> list[tuple[str, str, float]]:
    """Pairs of videos whose descriptions, not the same, have a cosine above 0.95: (video, video, cosine)."""
    import numpy as np

    rows = [row for row in truth if not row.is_no_hazard]
    vectors = embed_all((row.description for row in rows), embedder)
    found = []
    units = vectors.units[vectors.rows(row.description for row in rows)]
    for place, row in enumerate(rows):
        cosines = units[place + 1 :] @ units[place]
        for after in np.flatnonzero(cosines > ALIKE).tolist():
            other = rows[place + 1 + after]
            if other.description.casefold() != row.description.casefold():
                found.append((row.video_id, other.video_id, round(float(cosines[after]), 4)))
    return sorted(found)


def verbless(truth: Sequence[TruthHazard]) -> list[TruthHazard]:
    """The hazards whose description has no verb, by spaCy. Raises ModelMissingError without its model."""
    from pipeline.chunks import language

    rows = [row for row in truth if not row.is_no_hazard]
    parsed = language().pipe(row.description for row in rows)
    return [row for row, text in zip(rows, parsed, strict=True) if not any(t.pos_ in _VERBS for t in text)]


def figures_of_clips(clips: "Sequence[ClipFacts]") -> "ClipFigures":
    """The clips counted."""
    from sitegen.data_check_clips import rate_of, size_of
    from sitegen.data_figures import clip_figures

    return clip_figures(
        (
            not clip.problem,
            clip.duration_s,
            clip.frame_count,
            clip.size_bytes,
            size_of(clip),
            rate_of(clip),
            clip.codec,
        )
        for clip in clips
    )


def report(
    given: CheckInput, findings: Sequence[Finding], inputs: Inputs, is_decoded: bool
) -> dict[str, Any]:
    """The result of a check as plain JSON types."""
    from sitegen.data_check import annotated_share
    from sitegen.data_figures import truth_figures

    boxes, clips = given.boxes, given.clips
    share = None if boxes is None or clips is None else annotated_share(dict(boxes), list(clips))
    figures: dict[str, Any] = {"truth": asdict(truth_figures(given.truth))}
    figures["clips"] = None if clips is None else asdict(figures_of_clips(clips))
    figures["videos_with_boxes"] = None if boxes is None else len(set(boxes) & set(given.video_ids))
    figures["annotated_share"] = None if share is None else round(share, 6)
    return {
        "schema_version": 1,
        "inputs": asdict(inputs),
        "is_decoded": is_decoded,
        "counts": {str(kind): sum(one.severity == kind for one in findings) for kind in Severity},
        "figures": figures,
        "findings": [asdict(one) for one in findings],
    }


def store(root: Path, made: Mapping[str, Any]) -> Path:
    """Keep a report beside `coooler.toml`."""
    path = root / FILE_NAME
    write_text(path, json.dumps(made, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return path


class _Found(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    severity: Severity
    kind: str = Field(max_length=200)
    where: tuple[str, ...]
    message: str = Field(max_length=10_000)
    mend: str = Field(max_length=2_000)


class _Stored(BaseModel):
    model_config = ConfigDict(frozen=True)

    schema_version: int = Field(ge=1, le=1)
    inputs: dict[str, str]
    is_decoded: bool
    findings: tuple[_Found, ...]


def stored_check(root: Path, inputs: Inputs) -> StoredCheck | None:
    """The result that lies in a benchmark's folder; None when there is none.

    Raises InputError when it is no such result.
    """
    path = root / FILE_NAME
    if not path.is_file():
        return None
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path}: over {MAX_BYTES >> 20} MB; expected what `coooler data check` writes.")
    try:
        kept = _Stored.model_validate_json(path.read_bytes())
    except (ValidationError, OSError) as error:
        raise InputError(
            f"{path}: not a result of `coooler data check`. Run it again, or remove the file."
        ) from error
    findings = tuple(
        Finding(one.severity, one.kind, one.where, one.message, one.mend) for one in kept.findings
    )
    return StoredCheck(findings, kept.is_decoded, kept.inputs == asdict(inputs))
