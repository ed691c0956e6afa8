"""The pages of restored clips: what was done to each, by which method, and a frame before and after."""

from collections.abc import Iterator
from dataclasses import dataclass

from sitegen.contexts import Link, Shell
from sitegen.gathered import SiteData
from sitegen.language import N_
from sitegen.language import gettext as _
from sitegen.numerals import plural
from sitegen.page_board import video_href
from sitegen.pager import Pager, pager
from sitegen.restoration import Picture, Restoration
from sitegen.words import shorten, visible

CLIPS = 100
"""So many clips stand on a page."""

SHOWN_PROBLEMS = 100

STEPS = {"watermark": N_("Watermark"), "denoise": N_("Noise"), "deblur": N_("Blur")}


@dataclass(frozen=True, slots=True)
class StepView:
    """One thing that was done: its name, the method as the record has it, and a remark."""

    name: str
    method: str
    note: str


@dataclass(frozen=True, slots=True)
class BoxView:
    """A watermark's box in pixels of the video."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class ClipView:
    """A restored clip. `video` leads to its page, None when the benchmark has no such video."""

    anchor: str
    title: str
    video: Link | None
    facts: str
    source: str
    source_sha256: str
    steps: tuple[StepView, ...]
    notes: tuple[str, ...]
    before: Picture
    after: Picture
    overlay: Picture | None
    boxes: tuple[BoxView, ...]
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class RestorationPage:
    """restoration.html, restoration/2.html and so on; `pager` is None where there is one page.

    `problems` are the records that could not be used, told of on the first page; `marked` says whether any
    clip here has a mask or boxes.
    """

    shell: Shell
    summary: str
    clips: tuple[ClipView, ...]
    problems: tuple[str, ...]
    marked: bool
    pager: Pager | None


def page_count(data: SiteData) -> int:
    """How many pages there are; none where nothing was restored."""
    return 0 if data.restored.is_empty else max(1, -(-len(data.restored.clips) // CLIPS))


def path_of(number: int) -> str:
    """The path of a page, from 1."""
    return "restoration.html" if number == 1 else f"restoration/{number}.html"


def restoration_page(data: SiteData, number: int, shell: Shell) -> RestorationPage:
    """The context of a page, from 1."""
    clips = tuple(_clip(data, one) for one in data.restored.clips[(number - 1) * CLIPS : number * CLIPS])
    marked = any(clip.boxes or clip.overlay for clip in clips)
    summary = plural(len(data.restored.clips), "{n} clip", "{n} clips")
    problems = data.restored.problems if number == 1 else ()
    if len(problems) > SHOWN_PROBLEMS:
        more = plural(len(problems) - SHOWN_PROBLEMS, "and {n} more", "and {n} more")
        problems = (*problems[:SHOWN_PROBLEMS], more)
    pages = page_count(data)
    links = pager(number, pages, path_of) if pages > 1 else None
    return RestorationPage(shell, summary, clips, problems, marked, links)


def restoration_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The pages' pictures: (path, content). Raises InputError when one was changed meanwhile."""
    for clip in data.restored.clips:
        for picture in (clip.before, clip.after, clip.overlay):
            if picture:
                yield picture.path, picture.read()


def restored_href(data: SiteData, video_id: str) -> str:
    """Where a video's pictures before and after are, from the site's root; empty when it has none."""
    clip = data.restored.by_video.get(video_id)
    return f"{path_of(clip.place // CLIPS + 1)}#clip-{clip.name}" if clip else ""


def _clip(data: SiteData, one: Restoration) -> ClipView:
    record = one.record
    known = record.video_id in data.truth
    size = f"{record.width_px} × {record.height_px} px"
    return ClipView(
        f"clip-{one.name}",
        visible(record.video_id),
        Link(visible(record.video_id), video_href(data, record.video_id)) if known else None,
        f"{plural(record.frames, '{n} frame', '{n} frames')} · {size}",
        shorten(visible(record.source), 80),
        record.source_sha256,
        tuple(
            StepView(
                _(STEPS[step.step]) if step.step in STEPS else visible(step.step),
                visible(step.method),
                _remark(step.step, len(step.settings.boxes_px), step.settings.reason),
            )
            for step in record.steps
        ),
        tuple(visible(note) for note in record.notes),
        one.before,
        one.after,
        one.overlay,
        tuple(
            BoxView(x1, y1, x2 - x1, y2 - y1)
            for step in record.steps
            for x1, y1, x2, y2 in step.settings.boxes_px
            if x1 < x2 and y1 < y2
        ),
        record.width_px,
        record.height_px,
    )


def _remark(step: str, boxes: int, reason: str) -> str:
    """What a step found, where it looked for something."""
    if reason:
        return _("nothing removed: {reason}").format(reason=shorten(visible(reason), 300))
    if step != "watermark":
        return ""
    return plural(boxes, "{n} place", "{n} places") if boxes else _("nothing removed")
