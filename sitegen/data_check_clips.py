"""What is odd about the clips of a benchmark: files that cannot be read or played, copies, tags that tell."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from pipeline.data.clip_facts import ClipFacts
from pipeline.data.clip_hash import Groups
from sitegen.data_findings import CheckInput, Finding, Severity, some

# What browsers play by and large: (containers, codecs, pixel formats).
_PLAYED = (("mp4", "webm"), ("h264", "vp8", "vp9", "av1", "libdav1d"), ("yuv420p", "yuvj420p"))
_PRIVATE = {
    "a place": re.compile(r"gps|location|©xyz|\bxyz\b|latitude|longitude|geo", re.I),
    "a date": re.compile(r"creation_?time|date|timecode", re.I),
    "a device": re.compile(r"\bmake\b|\bmodel\b|camera|device|serial|artist|author|owner", re.I),
}


def clip_findings(given: CheckInput) -> Iterator[Finding]:
    """Findings about files, copies and tags."""
    clips = list(given.clips or ())
    good = [clip for clip in clips if not clip.problem]
    for clip in clips:
        if clip.problem:
            mend = "Copy the file again, or convert it."
            where = (clip.video_id,)
            yield Finding(Severity.ERROR, "unreadable clip", where, f"{clip.file}: {clip.problem}.", mend)
    for name, names in _same(clips, lambda clip: clip.video_id.casefold()):
        message = f"{len(names)} files share the id {name}: {some(sorted(c.file for c in names))}."
        ids = tuple(sorted(clip.file for clip in names))
        yield Finding(Severity.ERROR, "one id, several files", ids, message, "Keep one of them.")
    yield from _odd(good)
    yield from _majority(good)
    yield from _copies(given, clips)
    yield from _private(good)


def _odd(clips: Sequence[ClipFacts]) -> Iterator[Finding]:
    for clip in clips:
        if clip.damage:
            yield _warning("damaged clip", clip, clip.damage, "Copy the file again, or re-encode it.")
        if clip.claimed_frames and clip.claimed_frames != clip.frame_count:
            said = f"the header counts {clip.claimed_frames} frames, there are {clip.frame_count}"
            yield _warning("header counts wrong", clip, said, "Re-encode it: coooler data frames.")
    kinds: list[tuple[str, Callable[[ClipFacts], bool], str, str]] = [
        (
            "uneven frame times",
            lambda clip: clip.is_variable_rate,
            "have a variable frame rate, so a frame's index is no time",
            "Re-encode them at one rate.",
        ),
        (
            "sound",
            lambda clip: clip.has_audio,
            "have sound, which may hold voices",
            "Take the sound out, unless it is meant to be there.",
        ),
        (
            "not for browsers",
            lambda clip: not _is_played(clip),
            "do not play in every browser (H.264, VP9 or AV1 with yuv420p in mp4 or webm do)",
            "Re-encode them as H.264, yuv420p, mp4.",
        ),
    ]
    for kind, test, message, mend in kinds:
        if found := tuple(clip.video_id for clip in clips if test(clip)):
            text = f"{len(found)} of {len(clips)} clips {message}: {some(found)}."
            yield Finding(Severity.WARNING, kind, found, text, mend)


def _is_played(clip: ClipFacts) -> bool:
    containers, codecs, pixels = _PLAYED
    holds = any(name in clip.container.split(",") for name in containers)
    suffix = clip.file.rsplit(".", 1)[-1].lower()
    return holds and suffix in {"mp4", "m4v", "webm"} and clip.codec in codecs and clip.pixel_format in pixels


def _warning(kind: str, clip: ClipFacts, message: str, mend: str) -> Finding:
    return Finding(Severity.WARNING, kind, (clip.video_id,), f"{clip.file}: {message}.", mend)


def _majority(clips: Sequence[ClipFacts]) -> Iterator[Finding]:
    sides: list[tuple[str, Callable[[ClipFacts], str]]] = [("size", size_of), ("frame rate", rate_of)]
    for what, of in sides:
        counts = Counter(of(clip) for clip in clips)
        if len(counts) > 1:
            usual = min(counts, key=lambda name: (-counts[name], name))
            odd = tuple(clip.video_id for clip in clips if of(clip) != usual)
            listed = ", ".join(f"{name} ({counts[name]})" for name in sorted(counts) if name != usual)
            message = f"{counts[usual]} clips have the {what} {usual}, {len(odd)} another: {listed}."
            mend = "Fine if meant; sizes decide which boxes count as small."
            yield Finding(Severity.NOTE, f"another {what}", odd, message, mend)


def size_of(clip: ClipFacts) -> str:
    """Width and height, as text."""
    return f"{clip.width_px}x{clip.height_px}"


def rate_of(clip: ClipFacts) -> str:
    """Frames a second, as text."""
    return f"{clip.fps_hz:.5g} fps" if clip.fps_hz else "no rate"


def _copies(given: CheckInput, clips: Sequence[ClipFacts]) -> Iterator[Finding]:
    mend = "Keep one, or keep them in one part: coooler data split does."
    for _, names in _same([clip for clip in clips if clip.size_bytes], lambda clip: clip.sha256):
        files = tuple(sorted(clip.video_id for clip in names))
        message = f"{len(files)} clips are the same file: {some(files)}."
        yield Finding(Severity.ERROR, "duplicate clips", files, message, mend)
    groups = Groups({name for pair in given.pairs for name in (pair.first, pair.second)})
    for pair in given.pairs:
        groups.join(pair.first, pair.second)
    sha256 = {clip.video_id: clip.sha256 for clip in clips}
    for group in groups.sets():
        if len({sha256.get(name, name) for name in group}) == 1:
            continue  # the same file: said already
        pairs = [pair for pair in given.pairs if pair.first in group]
        far = max(pair.distance_bits for pair in pairs)
        turned = ", one mirrored" if any(pair.mirrored for pair in pairs) else ""
        message = (
            f"{len(group)} clips look the same (up to {far:.1f} of 64 bits apart{turned}): {some(group)}."
        )
        yield Finding(Severity.WARNING, "near-duplicate clips", group, message, mend)


def _private(clips: Sequence[ClipFacts]) -> Iterator[Finding]:
    for what, pattern in _PRIVATE.items():
        holders = {
            clip.video_id: sorted(name for name, value in clip.tags if value and pattern.search(name))
            for clip in clips
        }
        if found := tuple(name for name, tags in holders.items() if tags):
            tags = sorted({tag for name in found for tag in holders[name]})
            message = f"The metadata of {len(found)} clips tells {what} ({some(tags)}): {some(found)}."
            mend = "Strip it: ffmpeg -i IN -map_metadata -1 -c copy OUT."
            yield Finding(Severity.WARNING, "private metadata", found, message, mend)


def _same(
    clips: Sequence[ClipFacts], key: Callable[[ClipFacts], str]
) -> Iterator[tuple[str, list[ClipFacts]]]:
    groups: dict[str, list[ClipFacts]] = {}
    for clip in clips:
        groups.setdefault(key(clip), []).append(clip)
    yield from ((name, found) for name, found in sorted(groups.items()) if len(found) > 1)
