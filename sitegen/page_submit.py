"""The submit page: what a predictions file holds, a check in the visitor's browser, the ways to send it.

The check itself is in the page's scripts; what it needs to know of the truth stands in a file of its own.
"""

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass, replace

from sitegen.charts import script_json
from sitegen.checks import MAX_ID_CHARS, MAX_LIST_ITEMS, MAX_TEXT_CHARS
from sitegen.contexts import Shell
from sitegen.formats import MAX_BYTES
from sitegen.gathered import SiteData
from sitegen.language import N_, whole
from sitegen.language import gettext as _
from sitegen.readers import PREDICTION_COLUMNS

TRUTH_FILE = "data/submit.js"
SAMPLE_FILE = "data/sample-predictions.csv"

PLACEHOLDER = "Placeholder: the hazard of this video, in your system's own words"


@dataclass(frozen=True, slots=True)
class ColumnView:
    """A column of a predictions file."""

    name: str
    required: bool
    meaning: str
    example: str


@dataclass(frozen=True, slots=True)
class SubmitPage:
    """submit.html

    `truth_file` is loaded by the page, `sample_file` is offered; paths are from the site's root.
    """

    shell: Shell
    columns: tuple[ColumnView, ...]
    n_videos: str
    limit: str
    hidden: bool
    truth_file: str
    sample_file: str


_LIMITS = {"video_id": MAX_ID_CHARS, "description": MAX_TEXT_CHARS, "track_ids": MAX_LIST_ITEMS}

COLUMNS = (
    ColumnView("video_id", True, N_("One of the benchmark's video ids, {limit} characters at most."), ""),
    ColumnView(
        "rank", True, N_("1, 2, 3, … in each video; each number once. 1 is what you are surest of."), "1"
    ),
    ColumnView(
        "description",
        True,
        N_("What the hazard is, in words: 1 to {limit} characters."),
        "A cat crosses the road",
    ),
    ColumnView("label", False, N_("The hazard in a word or two."), "cat"),
    ColumnView(
        "track_ids",
        False,
        N_("The tracks of its boxes: a JSON list, or ids between semicolons; {limit} at most."),
        "7;9",
    ),
    ColumnView("frame_indices", False, N_("The frames it is seen in, from 0; a list as before."), "[12, 13]"),
)


def submit_page(data: SiteData, shell: Shell) -> SubmitPage:
    """The context of submit.html."""
    return SubmitPage(
        shell=shell,
        columns=tuple(_in_words(column, data.video_ids[0]) for column in COLUMNS),
        n_videos=whole(len(data.truth)),
        limit=f"{MAX_BYTES // 2**20} MB",
        hidden=data.hidden,
        truth_file=TRUTH_FILE,
        sample_file=SAMPLE_FILE,
    )


def _in_words(column: ColumnView, video_id: str) -> ColumnView:
    """The column in the page's language; of the column of ids, the first one is the example."""
    meaning = _(column.meaning).format(limit=whole(_LIMITS.get(column.name, 0)))
    return replace(column, meaning=meaning, example=video_id if column.name == "video_id" else column.example)


def submit_files(data: SiteData) -> Iterator[tuple[str, bytes]]:
    """The files that the page loads and offers: (path, content)."""
    yield TRUTH_FILE, _known(data)
    yield SAMPLE_FILE, _sample(data)


def _known(data: SiteData) -> bytes:
    """A script with the truth's video ids, sorted, and which of them have a hazard.

    `hazards` has a 1 for a video with a hazard and a 0 for one without; it is left out when the truth
    is hidden.
    """
    known: dict[str, object] = {"ids": data.video_ids}
    if not data.hidden:
        has_hazard = (any(not row.is_no_hazard for row in data.truth[video]) for video in data.video_ids)
        known["hazards"] = "".join("01"[found] for found in has_hazard)
    return f"window.COOOLER_SUBMIT = {script_json(known)};\n".encode()


def _sample(data: SiteData) -> bytes:
    """A CSV that passes the check: one row a video, and a second one for the first of them."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(PREDICTION_COLUMNS)
    for place, video_id in enumerate(data.video_ids):
        if place == 0:
            writer.writerow([video_id, 1, PLACEHOLDER, "hazard", '["7", "9"]', "[12, 13]"])
            writer.writerow([video_id, 2, f"{PLACEHOLDER}, second guess", "", "", ""])
        else:
            writer.writerow([video_id, 1, PLACEHOLDER, "", "", ""])
    return out.getvalue().encode()
