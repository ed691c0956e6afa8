"""Lists of JSON entries as small script files, each of which hands its part to a function of the page."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

BLOCK = 100
SHARD_BYTES = 10 * 1024

_CALL_BYTES = 200  # at most, around the value of a shard


@dataclass(frozen=True, slots=True)
class Shards:
    """Files `data/<folder>/<name>.js` that call `<function>("<folder>/<name>", [...])`."""

    function: str
    folder: str

    def cut(
        self, name: str, entries: Sequence[str], videos: Sequence[int], ends: list[int]
    ) -> Iterator[tuple[str, bytes]]:
        """Entries in order as files `name/<k>` of at most SHARD_BYTES and BLOCK videos.

        `videos` holds the place of each entry's video; `ends` gets where each file ends.
        """
        start, size = 0, _CALL_BYTES
        for place, entry in enumerate(entries):
            full = size + len(entry) + 1 > SHARD_BYTES
            if place > start and (full or videos[place] // BLOCK != videos[place - 1] // BLOCK):
                yield self.file(f"{name}/{len(ends)}", entries[start:place])
                ends.append(place)
                start, size = place, _CALL_BYTES
            size += len(entry) + 1
        if len(entries) > start:
            yield self.file(f"{name}/{len(ends)}", entries[start:])
            ends.append(len(entries))

    def file(self, name: str, entries: Sequence[str]) -> tuple[str, bytes]:
        """One file: (path, content)."""
        content = f'{self.function}("{self.folder}/{name}",[{",".join(entries)}]);\n'
        return f"data/{self.folder}/{name}.js", content.encode()
