"""What can be said of a clip file without knowing what it shows, and the hashes of what it shows.

One sequential pass a clip, clips in parallel. The result is kept in a small Parquet table, keyed by the
file's name, size and time of change, so that only new and changed clips are decoded again. The table
can be deleted at any time.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pyarrow as pa
from av.container import InputContainer
from av.error import FFmpegError
from av.video.reformatter import VideoReformatter

from pipeline.data.clip_hash import MAX_HASHES, RATE_HZ, frame_hash
from pipeline.errors import FaultsError
from pipeline.execute import ProcessExecutor, SerialExecutor
from pipeline.files import sha256_file
from pipeline.table import Row, Table, metadata

CACHE = ".coooler-clips.parquet"
CLIPS = (".mp4", ".m4v", ".webm", ".mov", ".mkv", ".avi")

_VERSION = "1"  # of what is found out; a table of another version is made anew
_FEW = 3  # starting processes costs more than this many clips
_MAX_TAGS, _MAX_TAG_CHARS = 64, 500
_VARIES = 0.1  # share by which the time between frames may differ from the usual


@dataclass(frozen=True, slots=True)
class ClipFacts:
    """A clip as it was found; `problem` says why it cannot be read, `damage` what could not be decoded.

    `frame_count` is of decoded frames, or of packets when nothing was decoded; `claimed_frames` is what
    the header says, 0 when it says nothing. `hashes` are 64-bit, at 5 Hz; empty when nothing was decoded.
    `tags` are the container's and the streams' metadata.
    """

    video_id: str
    file: str
    size_bytes: int
    mtime_ns: int
    sha256: str
    is_decoded: bool = False
    problem: str = ""
    damage: str = ""
    container: str = ""
    codec: str = ""
    pixel_format: str = ""
    width_px: int = 0
    height_px: int = 0
    fps_hz: float = 0.0
    frame_count: int = 0
    claimed_frames: int = 0
    is_variable_rate: bool = False
    has_audio: bool = False
    tags: tuple[tuple[str, str], ...] = ()
    hashes: tuple[int, ...] = field(default=(), repr=False)

    @property
    def duration_s(self) -> float:
        """Frames by rate; 0 when the rate is not known."""
        return self.frame_count / self.fps_hz if self.fps_hz else 0.0


def _row(facts: ClipFacts) -> Row:
    row = {name: getattr(facts, name) for name in ClipFacts.__slots__}
    row["tags"] = [{"name": name, "value": value} for name, value in facts.tags]
    return row


def _facts(row: Row) -> ClipFacts:
    tags = tuple((tag["name"], tag["value"]) for tag in row["tags"])
    return ClipFacts(**{**row, "tags": tags, "hashes": tuple(row["hashes"])})


_TYPES = {str: pa.string(), int: pa.int64(), bool: pa.bool_(), float: pa.float64()}
CLIP_TABLE: Table[ClipFacts] = Table(
    "clips",
    pa.schema(
        [
            *(
                pa.field(name, _TYPES[kind], nullable=False)
                for name, kind in ClipFacts.__annotations__.items()
                if kind in _TYPES
            ),
            pa.field("tags", pa.list_(pa.struct([("name", pa.string()), ("value", pa.string())]))),
            pa.field("hashes", pa.list_(pa.uint64())),
        ]
    ),
    lambda facts: (facts.file,),
    _row,
    _facts,
)


def clip_files(folder: Path) -> list[Path]:
    """The clips of a folder, sorted by name."""
    return [path for path in sorted(folder.glob("*")) if path.suffix.lower() in CLIPS and path.is_file()]


def look(path: Path, decode: bool = True) -> ClipFacts:
    """The facts of one clip, by decoding it whole or from its packets alone. Never raises for its content."""
    stat = path.stat()
    facts = ClipFacts(path.stem, path.name, stat.st_size, stat.st_mtime_ns, sha256_file(path), decode)
    if not stat.st_size:
        return replace(facts, problem="the file is empty")
    try:
        # A clip is a local file: a playlist disguised as one must not make FFmpeg open anything else.
        with av.open(f"file:{path.resolve()}", options={"protocol_whitelist": "file"}) as container:
            if not container.streams.video:
                return replace(facts, problem="it holds no video stream")
            facts = _described(facts, container)
        with av.open(f"file:{path.resolve()}", options={"protocol_whitelist": "file"}) as container:
            return _decoded(facts, container) if decode else facts
    except (FFmpegError, ValueError, OSError) as error:
        return replace(facts, problem=f"FFmpeg cannot read it ({error.__class__.__name__})")


def _described(facts: ClipFacts, container: InputContainer) -> ClipFacts:
    stream = container.streams.video[0]
    context = stream.codec_context
    rate = stream.average_rate or stream.guessed_rate
    fps_hz = float(rate) if rate and 0 < rate < 10_000 else 0.0
    tags: dict[str, str] = {}
    for holder in (container, *container.streams):
        for name, value in sorted(holder.metadata.items()):
            tags.setdefault(name[:_MAX_TAG_CHARS], value[:_MAX_TAG_CHARS])
    times = sorted(packet.pts for packet in container.demux(stream) if packet.size and packet.pts is not None)
    return replace(
        facts,
        container=container.format.name,
        codec=context.name,
        pixel_format=context.pix_fmt or "",
        width_px=context.width,
        height_px=context.height,
        fps_hz=fps_hz,
        frame_count=len(times),
        claimed_frames=stream.frames,
        is_variable_rate=_varies(times),
        has_audio=bool(container.streams.audio),
        tags=tuple(sorted(tags.items())[:_MAX_TAGS]),
        problem="" if times else "it holds no frame",
    )


def _varies(times: Sequence[int]) -> bool:
    """Whether frames come at uneven times, by more than a tick and a tenth of the usual gap."""
    gaps = sorted(later - earlier for earlier, later in pairwise(times))
    if not gaps:
        return False
    usual = gaps[len(gaps) // 2]
    return max(usual - gaps[0], gaps[-1] - usual) > max(1.0, _VARIES * usual)


def _decoded(facts: ClipFacts, container: InputContainer) -> ClipFacts:
    stream = container.streams.video[0]
    stream.codec_context.thread_count = 1  # clips run in parallel
    # One for all frames: each new one would set up the conversion again.
    reformatter = VideoReformatter()
    hashes: list[int] = []
    count = broken = 0
    start_s = None
    for packet in container.demux(stream):
        try:
            frames = packet.decode()
        except FFmpegError:
            broken += 1
            continue
        for frame in frames:
            time_s = frame.time if frame.time is not None else count / (facts.fps_hz or RATE_HZ)
            start_s = time_s if start_s is None else start_s
            # A hair early: times are rounded to ticks.
            due = time_s - start_s + 1e-3 >= len(hashes) / RATE_HZ and len(hashes) < MAX_HASHES
            if due:
                grey = reformatter.reformat(frame, format="gray", threads=1).to_ndarray()
                hashes.append(frame_hash(np.asarray(grey, np.uint8)))
            count += 1
    if not count:
        return replace(facts, problem="no frame of it can be decoded")
    damage = f"{broken} packets cannot be decoded" if broken else ""
    return replace(facts, frame_count=count, damage=damage, hashes=tuple(hashes))


@dataclass(frozen=True, slots=True)
class _Look:
    decode: bool

    def __call__(self, path: Path) -> ClipFacts:
        return look(path, self.decode)


def _lost(path: Path, why: str) -> ClipFacts:
    stat = path.stat()
    sha256 = sha256_file(path)
    return ClipFacts(path.stem, path.name, stat.st_size, stat.st_mtime_ns, sha256, True, f"decoding: {why}")


def survey(
    paths: Iterable[Path],
    cache: Path | None = None,
    *,
    decode: bool = True,
    workers: int = 1,
    keep: bool = True,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> list[ClipFacts]:
    """The facts of clips, sorted by file name; those that `cache` knows are not looked at again.

    `tell` is told how many clips are done, of how many. What is found is kept in `cache`, unless `keep`
    is False.
    """
    paths = sorted(paths)
    known = {facts.file: facts for facts in known_clips(cache)} if cache else {}
    found: dict[Path, ClipFacts] = {}
    for path in paths:
        facts, stat = known.get(path.name), path.stat()
        same = facts and (facts.size_bytes, facts.mtime_ns) == (stat.st_size, stat.st_mtime_ns)
        if facts and same and (facts.is_decoded or not decode):
            found[path] = facts
    missing = [path for path in paths if path not in found]
    done = len(found)
    tell(done, len(paths))
    by_name = {path.name: path for path in paths}
    for facts in _looked(missing, decode, workers):
        found[by_name[facts.file]] = facts
        done += 1
        tell(done, len(paths))
    result = [found[path] for path in paths]
    if cache and keep and (missing or len(known) != len(result)):
        CLIP_TABLE.write(cache, result, {"version": _VERSION})
    return result


def _looked(paths: Sequence[Path], decode: bool, workers: int) -> Iterator[ClipFacts]:
    alone = workers < 2 or len(paths) <= _FEW
    executor = SerialExecutor() if alone else ProcessExecutor(min(workers, len(paths)))
    return executor.run(_Look(decode), paths, _lost)


def known_clips(cache: Path) -> list[ClipFacts]:
    """What the table holds; nothing when it is not there, of another version or damaged."""
    try:
        if not cache.is_file() or metadata(cache).get("version") != _VERSION:
            return []
        return CLIP_TABLE.read(cache)
    except (FaultsError, OSError, ValueError, TypeError, pa.ArrowException):
        return []
