"""A benchmark whose clips came restored: records, masks and pictures beside them, some of them broken."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.benchmark import Benchmark
from pipeline.data.restored_pictures import before_after
from pipeline.files import sha256_of
from sitegen.restoration import ENDING, FOLDER
from tests.site_fixtures import EVIL, make_benchmark

TELEA = "un-blending by temporal statistics, Telea inpainting where opaque"
PLAIN = "non-local means (OpenCV)"


def pictures(seed: int, marked: bool = True) -> dict[str, bytes]:
    """Before, after and, when something is masked, the overlay; 320x180 px."""
    random = np.random.default_rng(seed)
    after = np.repeat(random.integers(0, 255, (18, 32, 3), np.uint8), 10, axis=0).repeat(10, axis=1)
    before, mask = after.copy(), np.zeros((180, 320), np.bool_)
    before[20:40, 20:110] = 255
    mask[18:42, 18:112] = marked
    return before_after(before, after, mask)


def record(video_id: str, files: dict[str, bytes], /, **changes: Any) -> dict[str, Any]:
    """What `data restore` writes about a clip, with fields changed."""
    steps = [
        {"step": "watermark", "method": TELEA, "settings": {"boxes_px": [[20, 20, 110, 40]], "reason": ""}},
        {"step": "denoise", "method": PLAIN, "sha256": "", "settings": {"strength": 4.0}},
    ]
    return {
        "schema_version": 1,
        "video_id": video_id,
        "source": f"{video_id}.mov",
        "source_sha256": "a" * 64,
        "frames": 30,
        "width_px": 320,
        "height_px": 180,
        "rate_hz": "25",
        "steps": steps,
        "notes": [],
        "files_sha256": {f"{FOLDER}/{video_id}.{end}": sha256_of(data) for end, data in files.items()},
        **changes,
    }


def put(folder: Path, stem: str, made: dict[str, Any], files: dict[str, bytes]) -> None:
    """Write a record and its pictures into the folder of records."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{stem}{ENDING}").write_text(json.dumps(made), encoding="utf-8")
    for ending, data in files.items():
        (folder / f"{stem}.{ending}").write_bytes(data)


def make_restored(root: Path) -> Benchmark:
    """Two good records (one of a video that the truth has not, hostile words in it) and two broken ones."""
    benchmark = make_benchmark(root)
    folder = benchmark.videos / FOLDER
    files = pictures(1)
    put(folder, "v1", record("v1", files), files)
    plain = pictures(2, marked=False)
    nothing = {"boxes_px": [], "reason": f"no logo {EVIL}"}
    steps = [{"step": EVIL[:40], "method": EVIL, "settings": nothing}]
    put(folder, "v9 <b>", record("v9 <b>", plain, steps=steps, notes=[EVIL], source=EVIL), plain)
    put(folder, "v2", record("v2", files), {**files, "before.webp": files["after.webp"]})
    put(folder, "v3", record("v3", files, frames=-1), files)
    return benchmark
