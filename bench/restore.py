"""`python -m bench.restore`: what restoring is worth on clips spoilt in known ways, and how long it takes.

The table is printed and written between the markers in docs/restore.md. The plain methods' numbers were
chosen on the clips in `TUNED_ON`, which are left out here.
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path

from av.video.reformatter import VideoReformatter

from bench.degrade import BLUR_SIGMA_PX, KINDS, LOGO_ALPHA, NOISE_SIGMA, degraded, psnr, ssim
from pipeline.data.decode import decoded, read_header
from pipeline.data.encode import EXACT, write_h264
from pipeline.data.restore import STEPS, RestoreSettings, plan_for, read_timeline, restore_clip
from pipeline.execute import ProcessExecutor, default_workers
from pipeline.files import write_text
from pipeline.records import RgbImage
from pipeline.video import upright

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "restore.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
TUNED_ON = frozenset({"demo_0001", "demo_0004", "demo_0009", "demo_0013"})
FRAMES, EVERY = 14, 8
ONE_IN = 3  # of the clips that are left: non-local means take their time
SOURCE_CRF = 10
RATE = Fraction(25, EVERY)

STAGES = ("as spoilt", "watermark removed", "then denoised", "then sharpened", "as written, H.264 at CRF 18")


@dataclass(frozen=True, slots=True)
class Job:
    """A clip to spoil in some ways and to restore."""

    clip: Path
    kinds: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Score:
    """Mean PSNR in dB and SSIM of a clip's frames after each of `STAGES`."""

    job: Job
    psnr_db: tuple[float, ...]
    ssim: tuple[float, ...]


def pictures(clip: Path, every: int = 1) -> list[RgbImage]:
    """At most `FRAMES` frames of a clip, one of `every`."""
    reformatter = VideoReformatter()
    frames = islice(decoded(clip), 0, FRAMES * every, every)
    return [upright(frame, reformatter, EXACT) for frame in frames]


def spoil(clip: Path, kinds: tuple[str, ...], target: Path) -> list[RgbImage]:
    """Write a spoilt piece of a clip to `target`, as H.264; gives its clean frames."""
    clean = pictures(clip, EVERY)
    spoilt = (degraded(rgb, kinds, seed) for seed, rgb in enumerate(clean))
    write_h264(target, spoilt, rate=RATE, size=(clean[0].shape[1], clean[0].shape[0]), crf=SOURCE_CRF)
    return clean


def score(job: Job) -> Score:
    """Spoil, restore, and compare with the clean frames after every step."""
    with tempfile.TemporaryDirectory() as name:
        source = Path(name) / job.clip.name
        clean = spoil(job.clip, job.kinds, source)
        height, width = clean[0].shape[:2]
        settings = RestoreSettings()
        plan = plan_for(source, settings, None, read_timeline(source, read_header(source)))
        stages = [pictures(source)]
        stages.append([plan.erase(rgb) if plan.erase else rgb for rgb in stages[-1]])
        for method in plan.methods:
            stages.append([method(rgb) for rgb in stages[-1]])
        written = Path(name) / "written.mp4"
        size = (width, height)
        write_h264(written, stages[-1], rate=RATE, size=size, crf=settings.crf, preset=settings.preset)
        stages.append(pictures(written))
    pairs = [list(zip(found, clean, strict=True)) for found in stages]
    return Score(
        job,
        tuple(statistics.fmean(psnr(*pair) for pair in stage) for stage in pairs),
        tuple(statistics.fmean(ssim(*pair) for pair in stage) for stage in pairs),
    )


def step_table(scores: list[Score]) -> list[str]:
    """Means over the clips after each step, and on how many the PSNR is above that of the spoilt clip."""
    lines = ["| after | PSNR | SSIM | clips above the spoilt one |", "|---|---:|---:|---:|"]
    for at, stage in enumerate(STAGES):
        above = sum(one.psnr_db[at] > one.psnr_db[0] for one in scores)
        better = f"{above} of {len(scores)}" if at else ""
        decibels = statistics.fmean(one.psnr_db[at] for one in scores)
        alike = statistics.fmean(one.ssim[at] for one in scores)
        lines.append(f"| {stage} | {decibels:.2f} dB | {alike:.4f} | {better} |")
    return lines


def alone_table(scores: list[Score]) -> list[str]:
    """Each way to spoil a clip alone: before and after all steps."""
    lines = ["| spoilt by | PSNR before | after | SSIM before | after |", "|---|---:|---:|---:|---:|"]
    for kinds in dict.fromkeys(one.job.kinds for one in scores):
        those = [one for one in scores if one.job.kinds == kinds]
        found = [statistics.fmean(one.psnr_db[at] for one in those) for at in (0, -1)]
        alike = [statistics.fmean(one.ssim[at] for one in those) for at in (0, -1)]
        lines.append(
            f"| {' + '.join(kinds) or 'nothing'} | {found[0]:.2f} dB | {found[1]:.2f} dB "
            f"| {alike[0]:.4f} | {alike[1]:.4f} |"
        )
    return lines


def cpu_s(function: Callable[[], None]) -> float:
    """Seconds of processor time of all threads, the least of three runs: other programs disturb it little."""
    found = []
    for _ in range(3):
        start = time.process_time()
        function()
        found.append(time.process_time() - start)
    return min(found)


def speed_table(clip: Path) -> list[str]:
    """How many times the processor time of decoding and encoding the same clip it takes."""
    with tempfile.TemporaryDirectory() as name:
        source = Path(name) / clip.name
        clean = spoil(clip, KINDS, source)
        size = (clean[0].shape[1], clean[0].shape[0])

        def plain() -> None:
            write_h264(Path(name) / "plain.mp4", decoded(source), rate=RATE, size=size)

        def restoring(steps: tuple[str, ...]) -> None:
            restore_clip(source, Path(name) / "out", RestoreSettings(steps))

        chosen = {"nothing": (), **{step: (step,) for step in STEPS}, "all three": STEPS}
        functions = {what: lambda steps=steps: restoring(steps) for what, steps in chosen.items()}
        times = {what: cpu_s(function) for what, function in {"plain": plain, **functions}.items()}
    lines = ["| steps | processor time, decoding and encoding = 1 |", "|---|---:|"]
    return [*lines, *(f"| {what} | {times[what] / times['plain']:.1f} |" for what in chosen)]


def main() -> None:
    """Measure, print, and write the tables into docs/restore.md."""
    clips = sorted((HERE.parent / "demo" / "videos").glob("*.mp4"))
    held_out = [clip for clip in clips if clip.stem not in TUNED_ON][::ONE_IN]
    ways: list[tuple[str, ...]] = [KINDS, *((kind,) for kind in KINDS), ()]
    jobs = [Job(clip, kinds) for kinds in ways for clip in held_out]
    scores: list[Score] = []
    for found in ProcessExecutor(default_workers()).run(score, jobs, _never):
        scores.append(found)
        print(f"{len(scores)} of {len(jobs)}", file=sys.stderr)
    scores.sort(key=lambda one: (ways.index(one.job.kinds), one.job.clip))
    text = "\n".join(
        [
            f"{len(held_out)} clips, {FRAMES} frames each, 640x360 px. Spoilt by a Gaussian blur of "
            f"{BLUR_SIGMA_PX:g} px, noise of {NOISE_SIGMA:g} grey levels and a white logo, "
            f"{LOGO_ALPHA:.0%} see-through, all at once; means over the clips.",
            "",
            *step_table([one for one in scores if one.job.kinds == KINDS]),
            "",
            "Each alone, before and after all three steps:",
            "",
            *alone_table(scores),
            "",
            *speed_table(held_out[0]),
        ]
    )
    print(text)
    before, rest = PAGE.read_text("utf-8").split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    write_text(PAGE, f"{before}{BEGIN}\n{text}\n{END}{after}")


def _never(job: Job, why: str) -> Score:
    raise RuntimeError(f"{job.clip}: {why}")


if __name__ == "__main__":
    main()
