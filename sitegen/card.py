"""A dataset card in Markdown: what a benchmark's data are, with figures that are counted, not typed. Pure.

The headings are those that readers of dataset cards know (Gebru et al. 2021, "Datasheets for Datasets";
the front matter is YAML). Every outside text is escaped: a label cannot become markup.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

from sitegen.data_figures import ClipFigures, TruthFigures
from sitegen.data_findings import Finding, Severity
from sitegen.words import shorten, visible

PAPER = """@article{shriram2025multiagent,
  title   = {Towards a Multi-Agent Vision-Language System for Zero-Shot Novel Hazardous Object
             Detection for Autonomous Driving Safety},
  author  = {Shriram, Shashank and Perisetla, Srinivasa and Keskar, Aryan and Krishnaswamy, Harsha and
             Bossen, Tonko Emil Westerhof and M{\\o}gelmose, Andreas and Greer, Ross},
  journal = {arXiv preprint arXiv:2504.13399},
  year    = {2025}
}"""

MAX_LABELS = 20
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
# What makes markup or a link anywhere, and what makes a list, heading or line at the start.
_MARKUP = re.compile(r"([\\`*_\[\]<>&|~$@]|:(?=//)|(?<=www)\.)", re.I)
_START = re.compile(r"^(\d{0,9})([#+=.)-])")
_HEADING = re.compile(r"^(#+)(?=\s)", re.M)
_FIELDS = (
    ("video_id", "the clip's file name without its ending"),
    ("hazard_id", "tells the hazards of one video apart"),
    ("label", "a few words that name the hazard; empty where there is none"),
    ("description", "one sentence on what the hazard is and does; empty where there is none"),
    ("track_id", "the hazard's track in the table of boxes; may be empty"),
    ("first_frame, last_frame", "where the hazard is to be seen, 0-based; may be empty"),
)


@dataclass(frozen=True, slots=True)
class Card:
    """All that a card tells.

    `truth` is None when the organiser keeps it back. `annotators` are (name, rows of the truth),
    `parts` are (part, videos). `findings` is None when the data were not checked, or have changed since.
    `attribution` is the organiser's own Markdown.
    """

    name: str
    description: str
    licence: str
    videos: int
    truth: TruthFigures | None
    clips: ClipFigures | None
    videos_with_boxes: int | None
    annotators: Sequence[tuple[str, int]] = ()
    parts: Sequence[tuple[str, int]] = ()
    findings: Sequence[Finding] | None = None
    attribution: str = ""


def escaped(text: str) -> str:
    """Outside text as Markdown that shows it as it is, on one line; also safe in a table's cell."""
    plain = _MARKUP.sub(r"\\\1", " ".join(visible(text).split()))
    return _START.sub(r"\1\\\2", plain)


def make_card(card: Card) -> str:
    """The card; it ends with a line break."""
    parts = [
        _front(card),
        f"# {escaped(card.name)}",
        escaped(card.description),
        "## Figures",
        _figures(card),
        *(_labels(card.truth) if card.truth else ()),
        "## Fields",
        _table(("field", "meaning"), [(f"`{name}`", meaning) for name, meaning in _FIELDS]),
        "Boxes, where there are any, are a Parquet table of `video_id`, `frame_index`, `track_id`, `kind` "
        "(`challenge` for hazards, `traffic` for the rest, `proposed` for what a program found and nobody "
        "annotated) and `x1_px`, `y1_px`, `x2_px`, `y2_px`.",
        "## Splits",
        _splits(card),
        "## Annotations",
        _annotations(card),
        "## Known problems",
        _problems(card),
        "## Licence and attribution",
        _licence(card),
        "## Citation",
        "The task, the truth's form and the two metrics are those of:",
        f"```bibtex\n{PAPER}\n```",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _front(card: Card) -> str:
    size = next((name for limit, name in _SIZES if card.videos < limit), "n>1M")
    lines = [
        f"pretty_name: {_yaml(card.name)}",
        f"license: {_yaml(card.licence or 'unknown')}",
        "language:\n- en",
        "task_categories:\n- video-text-to-text\n- image-to-text",
        f"size_categories:\n- {size}",
        "tags:\n- autonomous-driving\n- dashcam\n- hazard-description",
    ]
    return "\n".join(["---", *lines, "---"])


def _yaml(text: str) -> str:
    """A YAML string: JSON's double-quoted strings are YAML's."""
    return json.dumps(visible(text), ensure_ascii=True)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _figures(card: Card) -> str:
    rows = [("videos", f"{card.videos:,}")]
    if truth := card.truth:
        text = truth.text
        rows += [
            ("hazards", f"{truth.hazards:,}"),
            ("videos without a hazard", f"{truth.no_hazard_videos:,}"),
            ("videos with several hazards", f"{truth.several_hazards:,}"),
            ("hazards with a track", f"{truth.with_track:,}"),
            ("words a description", f"{text.mean_words:.1f} on average, median {text.median_words:g}"),
            ("different words", f"{text.vocabulary:,} of {text.tokens:,}"),
        ]
    if card.videos_with_boxes is not None:
        rows.append(("videos with boxes", f"{card.videos_with_boxes:,}"))
    if clips := card.clips:
        rows += [
            ("clips", f"{clips.clips:,}"),
            ("length together", f"{clips.seconds / 60:.1f} min, {clips.frames:,} frames"),
            ("sizes", ", ".join(f"{name} ({count})" for name, count in clips.sizes[:6])),
            ("frame rates", ", ".join(f"{name} ({count})" for name, count in clips.rates[:6])),
            ("codecs", ", ".join(f"{name} ({count})" for name, count in clips.codecs[:6])),
            ("bytes", f"{clips.bytes / 1e6:.1f} MB"),
        ]
    return _table(("figure", "value"), [(name, escaped(value) or "–") for name, value in rows])


def _labels(truth: TruthFigures) -> list[str]:
    labels = truth.labels
    if not labels.counts:
        return []
    rows = [
        (escaped(shorten(name, 80)), f"{count:,}", f"{count / truth.hazards:.1%}")
        for name, count in labels.counts[:MAX_LABELS]
    ]
    if rest := truth.hazards - sum(count for _, count in labels.counts[:MAX_LABELS]):
        rows.append((f"{len(labels.counts) - MAX_LABELS} others", f"{rest:,}", f"{rest / truth.hazards:.1%}"))
    said = (
        f"{len(labels.counts):,} labels, {labels.singletons:,} of them once; entropy "
        f"{labels.entropy_bits:.2f} bits, {labels.evenness:.1%} of what even labels would have."
    )
    return ["### Labels", said, _table(("label", "hazards", "share"), rows)]


def _splits(card: Card) -> str:
    if not card.parts:
        return "There is one part: all videos are for testing."
    return _table(("part", "videos"), [(escaped(name), f"{count:,}") for name, count in card.parts])


def _annotations(card: Card) -> str:
    if card.truth is None:
        return "The organiser keeps the truth back; systems are scored against it by the organiser."
    said = "A person looked at each clip and described its hazards in free words, one sentence each."
    if not card.annotators:
        return f"{said} The truth does not say who."
    rows = [(escaped(name), f"{count:,}") for name, count in card.annotators]
    return f"{said}\n\n{_table(('annotator', 'rows'), rows)}"


def _problems(card: Card) -> str:
    if card.findings is None:
        return "Not checked in this state (`coooler data check`)."
    if not card.findings:
        return "`coooler data check` found nothing."
    counts = [(kind, sum(one.severity is kind for one in card.findings)) for kind in Severity]
    said = ", ".join(f"{count} {kind}{'s' if count != 1 else ''}" for kind, count in counts)
    lines = [f"- {one.severity}, {escaped(one.kind)}: {escaped(one.message)}" for one in card.findings]
    return f"`coooler data check` found {said}:\n\n" + "\n".join(lines)


def _licence(card: Card) -> str:
    said = f"Licence: {escaped(card.licence)}." if card.licence else "The licence was not stated."
    text = "\n".join(visible(line) for line in card.attribution.splitlines()).strip()
    # The attribution is a document of its own: its headings go below ours.
    return f"{said}\n\n{_HEADING.sub(_deeper, text)}" if text else said


def _deeper(found: "re.Match[str]") -> str:
    return "#" * min(6, len(found[1]) + 2)
