"""Builds the site: gather, make what pictures are missing, render the pages, write what changed."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from pipeline.files import sha256_of
from pipeline.interfaces import Embedder
from sitegen.blame import blame_board
from sitegen.catalogues import read_language, script_messages
from sitegen.charts import script_json
from sitegen.data_check_run import inputs_of, stored_check
from sitegen.gather import gather, media_jobs, read_boxes, read_truth_by_video
from sitegen.gathered import SiteData, VideoMedia, path_names
from sitegen.language import ENGLISH, speaking
from sitegen.manifest import Content
from sitegen.media import MadeMedia, MediaJob, MediaSettings, make_media, media_from_json, media_to_json
from sitegen.output import Output, open_output
from sitegen.pages import Page, data_files, make_pages
from sitegen.rendering import code_sha256, find_locale, find_templates, render
from sitegen.rendering_pool import rendered
from sitegen.standings import Standing

if TYPE_CHECKING:
    from rich.progress import Progress

Tell = Callable[[str, int, int], None]
"""Told what is being done, how many of it are done, and how many there are."""

CATALOGUE = "assets/catalogue.js"
PLOTLY = "assets/plotly.min.js"
_FEW = 2  # starting processes costs more than this many clips
# Folders of a site that only a build fills.
_OURS = ("data", "list", "media", "restoration", "restored", "submissions", "videos")


@dataclass(frozen=True, slots=True)
class BuildReport:
    """What a build did: files written, left as they were, removed; videos decoded; the tree's hash.

    `bytes` is the size of all files of the site.
    """

    folder: Path
    written: int
    unchanged: int
    removed: int
    decoded: int
    tree_sha256: str
    bytes: int


def build_site(
    benchmark: Benchmark,
    out: Path,
    board: Sequence[Standing],
    bar: "Progress | None" = None,
    *,
    settings: MediaSettings | None = None,
    jobs: int = 2,
    as_of: str = "",
    embedder: Embedder | None = None,
) -> BuildReport:
    """Build the site of `benchmark` with the scored submissions of `board` in the folder `out`.

    The same inputs give the same bytes in every folder. Pictures of a video are made again only
    when its clip, its boxes or the settings changed. `as_of` is the day (ISO 8601) up to which the
    ledger is shown. With an `embedder` it is worked out where hazards were lost. Raises InputError when
    the truth, the boxes, the records or the attribution cannot be read, and when the truth is hidden
    but `out` holds what an unknown build left there.
    """
    read_language(benchmark.settings.language, find_locale())  # that it can be read, before the long part
    tell = _telling(bar)
    truth = read_truth_by_video(benchmark)
    names = path_names(truth)
    boxes = read_boxes(benchmark, truth)
    output = open_output(out)
    contents: dict[str, Content] = {}

    def clip_sha256(clip: Path) -> str:
        contents[clip.name] = output.before.content(clip)
        return contents[clip.name][0]

    todo = media_jobs(benchmark, names, boxes, settings or MediaSettings(), clip_sha256)
    media, remembered, decoded = _all_media(output, todo, jobs, tell)
    data = gather(benchmark, truth, boxes, media, board, as_of)
    if not data.hidden:
        rows = [row for found in truth.values() for row in found]
        clips = {job.video_id: job.clip_sha256 for job in todo}
        data = replace(data, check=stored_check(benchmark.root, inputs_of(rows, benchmark.boxes, clips)))
    inputs = sha256_of(f"{code_sha256()} {embedder.sha256 if embedder else ''} {data!r}".encode())
    digest = output.before.tree if output.keep_all(inputs) else put_pages(output, data, embedder, tell, jobs)
    output.finish(digest, remembered, inputs, contents)
    if data.hidden:
        _nothing_left(output)
    size = sum(output.sizes.values())
    return BuildReport(out, output.written, output.unchanged, output.removed, decoded, digest, size)


def put_pages(output: Output, data: SiteData, embedder: Embedder | None, tell: Tell, jobs: int = 1) -> str:
    """Put all of a site but its pictures, which are there, into `output`; give the tree's hash."""
    code = code_sha256()
    output.add_all(_assets(with_charts=bool(data.systems)))
    total = len(data.names) + len(data.systems) + 8 + (not data.restored.is_empty)
    language = data.settings.language
    with speaking(read_language(language, find_locale())):
        if embedder and not data.hidden:
            data = _with_blame(data, embedder)
        output.add_all(data_files(data))
        keys: dict[str, str] = {}

        def changed() -> Iterator[Page]:
            """The pages that are not there as they should be."""
            for page in make_pages(data):
                key = page.shows and sha256_of(f"{page.shows} {data.settings.address} {code}".encode())
                if output.keep_page(page.path, key):
                    tell("Rendering pages", len(output.pages), total)
                else:
                    keys[page.path] = key
                    yield page

        for page, blank in rendered(changed(), data.settings.address, language, jobs, render):
            output.put_page(page.path, keys.pop(page.path), blank)
            tell("Rendering pages", len(output.pages), total)
    if language != ENGLISH.tag:
        messages = script_json(script_messages(language, find_locale()))
        output.add_all([(CATALOGUE, f"window.COOOLER_CATALOGUE = {messages};\n".encode())])
    return output.stamp()


def _with_blame(data: SiteData, embedder: Embedder) -> SiteData:
    """The data with what is known of where each system lost each hazard."""
    truth = [hazard for video_id in data.video_ids for hazard in data.truth[video_id]]
    blames = blame_board(data.systems, truth, embedder, data.settings.threshold)
    systems = (replace(system, blame=blame) for system, blame in zip(data.systems, blames, strict=True))
    return replace(data, systems=tuple(systems))


def _telling(bar: "Progress | None") -> Tell:
    """Progress as a line of `bar` for each thing done; silent without one."""
    if bar is None:
        return lambda what, done, total: None
    lines: dict[str, Any] = {}

    def tell(what: str, done: int, total: int) -> None:
        if what not in lines:
            lines[what] = bar.add_task(what, total=total)
        bar.update(lines[what], completed=done)

    return tell


def _nothing_left(output: Output) -> None:
    """Raise InputError for files that no known build made, where an earlier one may have shown the truth."""
    paths = (path for folder in _OURS for path in sorted((output.folder / folder).rglob("*")))
    found = [path.relative_to(output.folder).as_posix() for path in paths if not path.is_dir()]
    left = [path for path in found if path not in output.files]
    if left:
        raise InputError(
            f"{output.folder}: {len(left)} files in it are not of this build, such as {left[0]}; they may "
            "show the truth, which is to be hidden. Remove the folder and build again."
        )


def _assets(with_charts: bool) -> Iterator[tuple[str, bytes]]:
    folder = find_templates() / "assets"
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.name.startswith("."):
            yield f"assets/{path.relative_to(folder).as_posix()}", path.read_bytes()
    if with_charts:
        from plotly.offline import get_plotlyjs

        yield PLOTLY, get_plotlyjs().encode()


def _all_media(
    output: Output, todo: Sequence[MediaJob], jobs: int, tell: Tell
) -> tuple[dict[str, VideoMedia], dict[str, Any], int]:
    """The pictures of all videos, made or kept; what the manifest remembers; how many were made."""
    media: dict[str, VideoMedia] = {}
    remembered: dict[str, Any] = {}
    missing = []
    for job in todo:
        kept = _kept(output, job)
        if kept is None:
            missing.append(job)
        else:
            media[job.video_id], remembered[job.video_id] = kept
    for done, (job, made) in enumerate(_make_all(missing, jobs), start=1):
        output.add_all(made.files)
        entry = {"key": job.key, "media": media_to_json(made.media)}
        if made.files:
            output.note(job.name, entry | {"files": {path: output.files[path] for path, _ in made.files}})
        media[job.video_id], remembered[job.video_id] = made.media, entry
        tell("Cutting keyframes", done, len(missing))
    return dict(sorted(media.items())), remembered, len(missing)


def _kept(output: Output, job: MediaJob) -> tuple[VideoMedia, Any] | None:
    """The pictures that an earlier or a killed build made of the same things, when they are still there."""
    before = output.before
    for entry in (before.media.get(job.video_id), output.noted(job.name)):
        if not isinstance(entry, dict) or entry.get("key") != job.key:
            continue
        try:
            found = media_from_json(entry["media"])
            files = entry.get("files") or {path: before.files[path][0] for path in found.paths}
            if output.kept(files):
                return found, {"key": entry["key"], "media": entry["media"]}
        except (KeyError, TypeError, ValueError, AttributeError):
            continue
    return None


def _make_all(todo: Sequence[MediaJob], jobs: int) -> Iterator[tuple[MediaJob, MadeMedia]]:
    """Each job with its pictures, as soon as they are made."""
    if jobs < 2 or len(todo) <= _FEW:
        for job in todo:
            yield job, make_media(job, jobs)
        return
    with ProcessPoolExecutor(min(jobs, len(todo)), mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {pool.submit(make_media, job): job for job in todo}
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
