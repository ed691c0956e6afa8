"""A site's pictures of all clips with two workers, against bare decoding and encoding in turn."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

from bench.keyframes import plain_decode
from bench.timing import Measure, interleaved
from pipeline.benchmark import Benchmark
from pipeline.files import sha256_file
from pipeline.records import RgbImage
from sitegen import media
from sitegen.gather import media_jobs, read_boxes, read_truth_by_video
from sitegen.gathered import path_names
from sitegen.media import MediaJob, MediaSettings, make_media

STEP = 2  # every other video is enough for the ratios


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """A picture that a site shows, as it is given to the encoder (BGR)."""

    bgr: RgbImage
    ending: str
    options: list[int]

    def again(self) -> bytes:
        """Encode it once more."""
        _, data = cv2.imencode(self.ending, self.bgr, self.options)
        return bytes(data.tobytes())


def pictures_of(job: MediaJob) -> list[Encoded]:
    """The pictures of a video that reach the site; those that were too heavy and made again are left out."""
    seen: list[tuple[Encoded, bytes]] = []
    real = media._encoded

    def noting(picture: RgbImage, ending: str, options: list[int]) -> bytes:
        data = real(picture, ending, options)
        bgr = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), np.uint8)
        seen.append((Encoded(bgr, ending, options), data))
        return data

    with patch.object(media, "_encoded", noting):
        kept = {data for _, data in make_media(job).files}
    return [picture for picture, data in seen if data in kept]


def make(job: MediaJob) -> int:
    """The size of a video's files; as in a build they are made in a worker, here they stay there."""
    return sum(len(data) for _, data in make_media(job).files)


def measure(benchmark: Benchmark) -> list[Measure]:
    """Two workers, there before the clock starts, against the floor in one; and one against the floor."""
    truth = read_truth_by_video(benchmark)
    boxes = read_boxes(benchmark, truth)
    jobs = media_jobs(benchmark, path_names(truth), boxes, MediaSettings(), sha256_file)[::STEP]
    clips: list[Path] = [job.clip for job in jobs if job.clip]
    pictures = [picture for job in jobs for picture in pictures_of(job)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        functions: dict[str, Callable[[], object]] = {
            "two": lambda: list(pool.map(make, jobs)),
            "one": lambda: [make(job) for job in jobs],
            "decode": lambda: [plain_decode(clip, "SLICE", 1) for clip in clips],
            "encode": lambda: [picture.again() for picture in pictures],
        }
        times = interleaved(functions)
    floor = times["decode"] + times["encode"]
    what = f"{len(pictures)} pictures of {len(jobs)} videos"
    peer = "bare decode and bare encode of the same pictures, serial"
    note = f"decode {times['decode']:.3g} s, encode {times['encode']:.3g} s"
    return [
        Measure(f"{what}, two workers", times["two"], peer, floor, "at most 0.8", note),
        Measure(f"{what}, one worker", times["one"], peer, floor, ""),
    ]
