"""The record of a restored clip: what was done, with what, from what, and whether it still holds."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import av
import cv2
import onnxruntime

from pipeline import __version__
from pipeline.data.nafnet import network_sha256
from pipeline.data.restore import FOLDER, Restored, RestoreSettings
from pipeline.data.watermark_find import PixelBox
from pipeline.files import sha256_file, sha256_of, write_text

SCHEMA_VERSION = 1
MAX_RECORD_BYTES = 1 << 20

# What the pictures depend on; a change in it makes old results stale.
_CODE = (
    "decode",
    "denoise",
    "encode",
    "nafnet",
    "restore",
    "restored_pictures",
    "tiles",
    "watermark",
    "watermark_find",
)


@dataclass(frozen=True, slots=True)
class RestoreJob:
    """One clip to restore: picklable, and all that its result depends on; `boxes` None: look for logos."""

    clip: Path
    out: Path
    settings: RestoreSettings
    boxes: tuple[PixelBox, ...] | None

    @property
    def stem(self) -> str:
        """The clip's id, which its results are named by."""
        return self.clip.stem

    @property
    def record(self) -> Path:
        """Where the record is."""
        return self.out / FOLDER / f"{self.stem}.restore.json"


def key_of(job: RestoreJob) -> dict[str, Any]:
    """All that the result depends on."""
    settings = job.settings
    models = {
        step: network_sha256(model) if model and step in settings.steps else ""
        for step, model in (("denoise", settings.denoise_model), ("deblur", settings.deblur_model))
    }
    uses_boxes = job.boxes is not None and "watermark" in settings.steps
    return {
        "source_sha256": sha256_file(job.clip),
        "settings": {
            "steps": list(settings.steps),
            "models_sha256": models,
            "watermark_boxes_px": [list(box) for box in job.boxes or ()] if uses_boxes else None,
            "crf": settings.crf,
            "preset": settings.preset,
        },
        "software": _software(any(models.values())),
    }


@cache
def _software(runs_networks: bool) -> dict[str, str]:
    folder = Path(__file__).parent
    code = "".join(f"{name} {sha256_file(folder / f'{name}.py')}\n" for name in _CODE)
    versions = {
        "coooler": __version__,
        "code_sha256": sha256_of(code.encode()),
        "ffmpeg": av.ffmpeg_version_info,
        "opencv": cv2.__version__,
    }
    return {**versions, "onnxruntime": onnxruntime.__version__} if runs_networks else versions


def write_record(job: RestoreJob, key: Mapping[str, Any], made: Restored) -> dict[str, Any]:
    """Write the record of a clip whose files are all there, and give it back."""
    timeline = made.timeline
    names = [f"{job.stem}.mp4", *(f"{FOLDER}/{name}" for name in made.files)]
    record = {
        "schema_version": SCHEMA_VERSION,
        "video_id": job.stem,
        "source": job.clip.name,
        "frames": timeline.frames,
        "width_px": timeline.size_px[0],
        "height_px": timeline.size_px[1],
        "rate_hz": str(timeline.rate_hz),
        "constant_rate": timeline.pts is None,
        "steps": list(made.steps),
        "notes": list(timeline.notes),
        "files_sha256": {name: sha256_file(job.out / name) for name in names},
        **key,
    }
    write_text(job.record, f"{json.dumps(record, indent=2, ensure_ascii=False)}\n")
    return record


def finished(job: RestoreJob) -> dict[str, Any] | None:
    """The record of a clip that was restored from the same to what is there now, else None."""
    record = _read(job)
    if record is None or f"{job.stem}.mp4" not in record["files_sha256"]:
        return None
    try:
        same = all(record.get(name) == value for name, value in key_of(job).items())
        whole = all(sha256_file(job.out / name) == sha256 for name, sha256 in record["files_sha256"].items())
    except OSError:
        return None
    return record if same and whole else None


def clear(job: RestoreJob) -> None:
    """Take away what an earlier run left of a clip, its record first."""
    record = _read(job)
    job.record.unlink(missing_ok=True)
    for name in record["files_sha256"] if record else ():
        (job.out / name).unlink(missing_ok=True)


def _read(job: RestoreJob) -> dict[str, Any] | None:
    """The record, None when there is none that names files of this clip alone."""
    try:
        if job.record.stat().st_size > MAX_RECORD_BYTES:
            return None
        record = json.loads(job.record.read_bytes())
        files = record["files_sha256"]
        parts = [name.removeprefix(f"{FOLDER}/") for name in files]
        ours = all(part.startswith(f"{job.stem}.") and "/" not in part and "\\" not in part for part in parts)
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return None
    whole = record.get("schema_version") == SCHEMA_VERSION and isinstance(files, dict)
    return record if whole and ours and isinstance(record.get("steps"), list) else None
