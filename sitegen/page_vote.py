"""The voting page: two captions of a video side by side, without names, and the data that it draws from.

The index (systems, video ids) comes with the page. Captions and pictures come in shards, each loaded
when one of its videos is shown. Nothing here is made from the truth but the list of its videos.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

from sitegen.charts import script_json
from sitegen.contexts import Shell
from sitegen.gathered import SiteData, System, VideoMedia
from sitegen.numerals import plural, seconds
from sitegen.words import shorten, visible

INDEX_FILE = "data/votes.js"
SHARD_BYTES = 10 * 1024
SHOWN_CAPTIONS = 5
SHOWN_CHARS = 400
FRAMES = 9
TRUTH_CHARS = 12  # as much of the truth's hash as a signature prints


@dataclass(frozen=True, slots=True)
class VotePage:
    """vote.html

    `choices` says how many comparisons there are; it and `index_file` are empty when there is none.
    """

    shell: Shell
    choices: str
    systems: str
    videos: str
    index_file: str


@dataclass(frozen=True, slots=True)
class Side:
    """What a system said of a video, as it is shown: the best-ranked captions, and how many more."""

    captions: tuple[str, ...]
    more: int

    @property
    def key(self) -> tuple[tuple[str, ...], int]:
        """Equal for sides that say the same: case, spaces and order do not count."""
        return tuple(sorted(" ".join(text.split()).casefold() for text in self.captions)), self.more


@dataclass(frozen=True, slots=True)
class Candidate:
    """A video to vote on: its different sides, and for each system the number of its own."""

    video_id: str
    sides: tuple[Side, ...]
    side_of: tuple[int, ...]

    @property
    def choices(self) -> int:
        """How many comparisons there are here: a voter is asked once about the same two sides."""
        return comb(len(self.sides), 2)


def vote_page(data: SiteData, shell: Shell) -> VotePage:
    """The context of vote.html."""
    found = candidates(data)
    choices = sum(one.choices for one in found)
    if not choices:
        return VotePage(shell, "", "", "", "")
    return VotePage(
        shell,
        plural(choices, "{n} comparison", "{n} comparisons"),
        plural(len(voted_on(data)), "{n} system", "{n} systems"),
        plural(len(found), "{n} video", "{n} videos"),
        INDEX_FILE,
    )


def vote_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The page's data: (path, content); none when there is nothing to compare.

    A shard holds as many videos as fit into 10 KB, one at least.
    """
    found = candidates(data)
    choices = sum(one.choices for one in found)
    if not choices:
        return
    first: list[int] = []
    shards: list[list[str]] = []
    size = SHARD_BYTES
    for place, one in enumerate(found):
        entry = script_json(_entry(data.media[one.video_id], one))
        if size + len(entry) + 1 > SHARD_BYTES:
            first.append(place)
            shards.append([])
            size = len("COOOLER_VOTE_SHARD(9999,[]);\n")
        shards[-1].append(entry)
        size += len(entry) + 1
    systems = voted_on(data)
    index = {
        "benchmark": data.settings.name,
        "truth": systems[0].evaluation.card.signature.truth_sha256[:TRUTH_CHARS],
        "systems": [[one.slug, visible(one.name), one.predictions_sha256] for one in systems],
        "videos": [one.video_id for one in found],
        "first": first,
        "choices": choices,
    }
    yield INDEX_FILE, f"window.COOOLER_VOTES = {script_json(index)};\n".encode()
    for number, entries in enumerate(shards):
        yield shard_path(number), f"COOOLER_VOTE_SHARD({number},[{','.join(entries)}]);\n".encode()


def shard_path(number: int) -> str:
    """The file of a shard, counted from 0."""
    return f"data/votes/{number}.js"


def voted_on(data: SiteData) -> list[System]:
    """The systems on the board, by slug, so that their order tells nothing of their rank."""
    return sorted((one for one in data.systems if not one.rehearsed), key=lambda one: one.slug)


def candidates(data: SiteData) -> list[Candidate]:
    """The videos that have pictures and on which two systems say different things, by id."""
    systems = voted_on(data)
    shown = (video_id for video_id in data.video_ids if data.media[video_id].frames)
    found = (_candidate(video_id, systems) for video_id in shown)
    return [one for one in found if one.choices]


def _candidate(video_id: str, systems: Sequence[System]) -> Candidate:
    sides: dict[Any, tuple[int, Side]] = {}
    side_of = []
    for system in systems:
        side = _side(system, video_id)
        number, _ = sides.setdefault(side.key, (len(sides), side))
        side_of.append(number)
    return Candidate(video_id, tuple(side for _, side in sides.values()), tuple(side_of))


def _side(system: System, video_id: str) -> Side:
    rows = system.predictions.get(video_id, [])
    shown = tuple(shorten(visible(row.description), SHOWN_CHARS) for row in rows[:SHOWN_CAPTIONS])
    return Side(shown, len(rows) - len(shown))


def _entry(media: VideoMedia, one: Candidate) -> dict[str, Any]:
    """A video in a shard; its name for the page, its pictures, what is said of it."""
    cover = media.frames[media.cover]
    entry: dict[str, Any] = {
        "name": visible(one.video_id),
        "poster": cover.full,
        "size": [media.width_px, media.height_px],
        "sides": [[list(side.captions), side.more] for side in one.sides],
        "side_of": one.side_of,
    }
    if media.clip:
        entry["clip"] = media.clip
    else:
        entry["frames"] = [[frame.thumb, frame.full, seconds(frame.time_s)] for frame in _some(media)]
    return entry


def _some(media: VideoMedia) -> list[Any]:
    """At most nine of the keyframes, first and last among them, at equal distance."""
    frames, last = media.frames, len(media.frames) - 1
    wanted = min(FRAMES, len(frames))
    return [frames[round(place * last / max(1, wanted - 1))] for place in range(wanted)]
