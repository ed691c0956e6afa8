"""Which video of the truth an id in a predictions file means: the id itself, by a map, or by its number."""

import re
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from sitegen import checks
from sitegen.captions import checked
from sitegen.checks import Faults, Wrong, show, visible
from sitegen.formats import bounded_bytes
from sitegen.texts import RepeatedKeys, csv_rows, json_value

_SUGGESTIONS = 20
_NUMBER = re.compile(r"[0-9]{1,18}")
_LAST_NUMBER = re.compile(r"[0-9]{1,18}\Z")
_MAP_COLUMNS = ("file_id", "video_id")
_A_MAP = "a CSV with the columns file_id,video_id or a JSON object of ids"


class VideoIds:
    """The check of a file's video ids, and what they become.

    `known` are the truth's ids, None when there is no truth; `video_map` renames ids of the file; `ids`
    are all that the file holds, raw. Where none of them is among the truth's, a plain number is taken as
    the one video whose id ends in it.
    """

    def __init__(self, known: set[str] | None, video_map: Mapping[str, str], ids: Iterable[object]) -> None:
        """Nothing is looked up before it is needed."""
        self._known = known
        self._map = video_map
        self._ids = ids
        self._numbers: dict[int, list[str]] | None = None
        self._suggested = 0
        self._taken: dict[str, str] = {}
        self.by_number: dict[str, str] = {}

    def __call__(self, value: object) -> str:
        """The video that an id means. Raises `Wrong` for an id that is unsafe or not among the truth's."""
        clean = checks.identifier(value, "a video id")
        video = self._map.get(clean, clean)
        if self._known is not None and video not in self._known:
            video = self._of_number(value, clean, video)
        elif self._known is None:
            video = checks.safe_identifier(value if video == clean else video)
        before = self._taken.setdefault(video, clean)
        if before != clean:
            found = f"{show(value)}, which is taken as '{video}', as '{visible(before)}' is"
            raise Wrong(found, "one id for each video", "Correct one of the two, or the video map.")
        return video

    def warnings(self) -> list[str]:
        """What was taken by its number."""
        if not self.by_number:
            return []
        first, video = next(iter(self.by_number.items()))
        more = len(self.by_number) - 1
        rest = f", and {more:,} more by their numbers" if more else " by its number"
        return [f"Took video '{visible(first)}' as '{video}'{rest}."]

    def _of_number(self, value: object, clean: str, video: str) -> str:
        known = self._known or set()
        same: list[str] = []
        if _NUMBER.fullmatch(video):
            if self._numbers is None:
                self._numbers = self._find_numbers(known)
            same = self._numbers.get(int(video), [])
            if len(same) == 1:
                self.by_number[clean] = same[0]
                return same[0]
        found = show(value) if video == clean else f"{show(value)}, by the map '{visible(video)}'"
        raise Wrong(found, f"one of the truth's {len(known)} video ids", self._mend(video, same))

    def _find_numbers(self, known: set[str]) -> dict[int, list[str]]:
        """The truth's ids by the number in which they end; none when the file has ids of the truth."""
        texts = (str(value).strip() for value in self._ids if isinstance(value, str | int))
        if any(self._map.get(text, text) in known for text in texts):
            return {}
        numbers: dict[int, list[str]] = {}
        for video in sorted(known):
            if found := _LAST_NUMBER.search(video):
                numbers.setdefault(int(found[0]), []).append(video)
        return numbers

    def _mend(self, video: str, same: list[str]) -> str:
        if same:
            return (
                f"{len(same)} ids end in this number, such as '{same[0]}' and '{same[1]}'; give a video map."
            )
        near: list[str] = []
        if self._suggested < _SUGGESTIONS:
            self._suggested += 1
            near = get_close_matches(video, self._known or (), 1, 0.8)
        return f"Did you mean '{near[0]}'?" if near else "Correct the id, or leave the row out."


def read_video_map(path: Path) -> dict[str, str]:
    """Ids of a predictions file to the truth's: a CSV `file_id,video_id`, or a JSON object of texts.

    Raises FaultsError with every fault: an id given twice, two ids for one video, empty or unsafe ids.
    """
    faults = Faults(visible(str(path), 1_000))
    data = bounded_bytes(path, faults, _A_MAP)
    is_json = data.removeprefix(b"\xef\xbb\xbf").lstrip().startswith((b"{", b"["))
    entries = _json_entries(data, faults) if is_json else _csv_entries(data, faults)
    columns = (None, None) if is_json else _MAP_COLUMNS
    found: dict[str, str] = {}
    of_video: dict[str, str] = {}
    for row, raw_id, raw_video in entries:
        file_id = checked(_file_id, raw_id, faults, row, columns[0])
        video_id = checked(checks.safe_identifier, raw_video, faults, row, columns[1])
        if file_id is not None and file_id in found:
            again = f"'{visible(file_id)}' again"
            faults.add(row, columns[0], again, "each id of the file once", "Remove one of the two.")
        elif file_id is not None and video_id is not None:
            found[file_id] = video_id
            other = of_video.setdefault(video_id, file_id)
            if other != file_id:
                twice = f"'{video_id}' for '{visible(file_id)}' and for '{visible(other)}'"
                faults.add(
                    row, columns[1], twice, "one id of the file for each video", "Correct one of them."
                )
    if not entries and not faults.kept:
        faults.stop("no entry", _A_MAP, "Add a row for every id to rename.")
    faults.raise_if_any()
    return found


_file_id: Callable[[Any], str] = checks.identifier


def _csv_entries(data: bytes, faults: Faults) -> list[tuple[int, object, object]]:
    entries: list[tuple[int, object, object]] = []
    with csv_rows(data, faults) as rows:
        names = [name.strip().lower() for name in next(rows, [])]
        if sorted(names) != sorted(_MAP_COLUMNS):
            shown = ", ".join(visible(name) for name in names[:20])
            faults.stop(f"the columns {shown}", _A_MAP, "Write file_id,video_id in the first line.")
        places = [names.index(name) for name in _MAP_COLUMNS]
        for row, cells in enumerate(rows, start=1):
            if len(cells) == len(names):
                entries.append((row, cells[places[0]], cells[places[1]]))
            else:
                faults.add(
                    row, None, f"{len(cells)} cells", "2 cells", "Write the two ids, with a comma between."
                )
    return entries


def _json_entries(data: bytes, faults: Faults) -> list[tuple[int, object, object]]:
    value, _ = json_value(data, faults)
    if not isinstance(value, dict):
        faults.stop(f"a JSON {type(value).__name__}", _A_MAP, 'Write {"id in the file": "id in the truth"}.')
    pairs = value.pairs if isinstance(value, RepeatedKeys) else list(value.items())
    return [(row, key, video) for row, (key, video) in enumerate(pairs, start=1)]
