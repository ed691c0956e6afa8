"""The upload form and the status of an upload: what their templates are given, and the same as JSON."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.benchmark import Benchmark
from sitegen.catalogues import read_language
from sitegen.contexts import Fact, Shell
from sitegen.intake_records import FIELDS, Report, Upload
from sitegen.language import N_, fixed, marked, speaking, whole
from sitegen.language import gettext as _
from sitegen.numerals import percent, plural
from sitegen.output import BLANK, stamped
from sitegen.readers import FORMATS
from sitegen.rehearsal import METRICS, rank_words
from sitegen.rendering import environment, find_locale
from sitegen.words import visible

REFRESH_S = 3

_TREE = re.compile(rb'id="tree-sha256">([0-9a-f]{64})<')
_HEADINGS = {
    "queued": N_("Waiting"),
    "working": N_("Being read and scored"),
    "good": N_("The file is right"),
    "accepted": N_("On the leaderboard"),
    "refused": N_("Not accepted"),
    "failed": N_("Put aside"),
}


@dataclass(frozen=True, slots=True)
class UploadPage:
    """The form, with what was filled in before and the message why it comes again."""

    message: str
    values: Mapping[str, str]
    lengths: Mapping[str, int]
    formats: tuple[str, ...]
    asks_token: bool
    max_mb: str
    checker: str


@dataclass(frozen=True, slots=True)
class FaultLine:
    """A fault as a row of a table; `row` is empty when it is of the whole file."""

    row: str
    column: str
    found: str
    expected: str
    mend: str


@dataclass(frozen=True, slots=True)
class StatusPage:
    """One upload; `refresh` is in seconds, 0 when nothing will change.

    `href` leads to its page on the board and is empty when there is none.
    """

    state: str
    heading: str
    lede: str
    refresh: int
    faults: tuple[FaultLine, ...]
    cards: tuple[Fact, ...]
    sentences: tuple[str, ...]
    warnings: tuple[str, ...]
    facts: tuple[Fact, ...]
    href: str
    is_check: bool


def upload_page(
    benchmark: Benchmark,
    site: Path,
    values: Mapping[str, str],
    message: str,
    asks_token: bool,
    max_bytes: int,
) -> bytes:
    """The page of the form."""
    with speaking(read_language(benchmark.settings.language, find_locale())):
        page = UploadPage(
            message=message,
            values={name: values.get(name, "") for name in FIELDS},
            lengths=FIELDS,
            formats=FORMATS,
            asks_token=asks_token,
            max_mb=marked(f"{max_bytes / 2**20:,.4g} MB"),
            checker="submit.html" if (site / "submit.html").is_file() else "",
        )
        about = _("Check or submit a predictions file.")
        return _render("upload.html", page, _shell(benchmark, _("Upload predictions"), about, ""), site)


def status_page(
    benchmark: Benchmark, site: Path, upload: Upload, report: Report, before: int, is_behind: bool
) -> bytes:
    """The page of an upload; `before` uploads go first, `is_behind` says that the site is not up to date."""
    with speaking(read_language(benchmark.settings.language, find_locale())):
        page = _status(site, upload, report, before, is_behind)
        shell = _shell(benchmark, page.heading, _("What became of an upload."), "../")
        return _render("upload_status.html", page, shell, site)


def _status(site: Path, upload: Upload, report: Report, before: int, is_behind: bool) -> StatusPage:
    told = upload.details
    href = f"submissions/{report.slug}.html" if report.slug else ""
    is_published = bool(href) and (site / href).is_file()
    is_changing = upload.is_waiting or (upload.state == "accepted" and is_behind and not is_published)
    return StatusPage(
        state=upload.state,
        heading=_heading(upload, report),
        lede=_lede(upload, report, before, is_published, is_behind),
        refresh=REFRESH_S if is_changing else 0,
        faults=tuple(map(_fault_line, report.faults)),
        cards=_cards(report.scores),
        sentences=_sentences(report.scores),
        warnings=tuple(map(visible, report.warnings)),
        facts=(
            Fact(_("File"), visible(told.file_name)),
            Fact(_("Size"), plural(upload.size, "{n} byte", "{n} bytes")),
            Fact("SHA-256", upload.sha256, code=True),
            *([Fact(_("Name"), visible(told.name))] if told.name else []),
            Fact(_("Sent to be"), _("checked only") if told.kind == "check" else _("put on the leaderboard")),
            *([Fact(_("Read as"), report.source_format)] if report.source_format else []),
            *([Fact(_("Signature"), report.scores["signature"], code=True)] if report.scores else []),
        ),
        href=href if is_published else "",
        is_check=told.kind == "check",
    )


def as_json(upload: Upload, report: Report | None, before: int) -> dict[str, Any]:
    """An upload for programs: its state and place, and the report once there is one."""
    report = report or Report()
    return {
        "id": upload.upload_id,
        "state": upload.state,
        "kind": upload.details.kind,
        "before": before if upload.is_waiting else 0,
        "name": upload.details.name,
        "file_name": upload.details.file_name,
        "size": upload.size,
        "sha256": upload.sha256,
        "message": report.message,
        "faults": [fault.as_dict() for fault in report.faults],
        "warnings": list(report.warnings),
        "format": report.source_format,
        "scores": report.scores,
        "page": f"/submissions/{report.slug}.html" if report.slug else "",
    }


def _heading(upload: Upload, report: Report) -> str:
    if report.faults:
        return plural(len(report.faults), "{n} fault found", "{n} faults found")
    return _(_HEADINGS[upload.state])


def _lede(upload: Upload, report: Report, before: int, is_published: bool, is_behind: bool) -> str:
    queued = _("This one is next.")
    if before:
        queued = plural(before, "{n} upload goes before this one.", "{n} uploads go before this one.")
    accepted = _("It was stored and scored, but is no longer on the board.")
    if is_published:
        accepted = _("It is stored, scored and on the board.")
    elif is_behind:
        accepted = _("It is stored and scored; its page is there in a moment.")
    said = {
        "queued": queued,
        "working": _("This takes some seconds."),
        "good": _("Nothing was stored. These are the scores that it would have."),
        "accepted": accepted,
    }
    return said.get(upload.state) or visible_lines(report.message)


def visible_lines(text: str) -> str:
    """Outside text with its line breaks kept."""
    return "\n".join(visible(line) for line in text.splitlines())


def _fault_line(fault: Any) -> FaultLine:
    row = "" if fault.row is None else whole(fault.row)
    if fault.line is not None:
        row += " " + _("(line {n})").format(n=whole(fault.line))
    texts = (fault.column or "", fault.found, fault.expected, fault.mend)
    return FaultLine(row.strip(), *map(visible, texts))


def _cards(scores: Mapping[str, Any]) -> tuple[Fact, ...]:
    cards = []
    for name, title in METRICS.items():
        metric = scores.get("metrics", {}).get(name)
        if metric:
            is_mean = name in {"besm", "sam"}
            words = (lambda value: fixed(value, 4)) if is_mean else percent
            ends = [words(metric[end]) for end in ("low", "high") if end in metric]
            note = _("{low} to {high}").format(low=ends[0], high=ends[1]) if ends else ""
            cards.append(Fact(_(title), words(metric["value"]), note=note))
    return tuple(cards)


def _sentences(scores: Mapping[str, Any]) -> tuple[str, ...]:
    """Where it would stand, what it covers, and what the probes say."""
    said = [rank_words(scores)] if "band" in scores else []
    if "predictions" in scores:
        text = _("{predictions} for {videos}.")
        captions = plural(scores["predictions"], "{n} prediction", "{n} predictions")
        videos = plural(scores["videos_with_predictions"], "{n} video", "{n} videos")
        said.append(text.format(predictions=captions, videos=videos))
    said += [probe["sentence"] for probe in scores.get("probes", ()) if probe["flagged"]]
    return tuple(map(visible, said))


def _shell(benchmark: Benchmark, title: str, about: str, root: str) -> Shell:
    settings = benchmark.settings
    name, language = visible(settings.name), settings.language
    return Shell(title, about, root, "submit", name, __version__, settings.hide_truth, language)


def _render(template: str, page: UploadPage | StatusPage, shell: Shell, site: Path) -> bytes:
    """A page; its footer prints the hash of the site that is served."""
    made = environment().get_template(template).render(page=page, shell=shell).encode()
    try:
        found = _TREE.search((site / "index.html").read_bytes())
    except OSError:
        found = None
    return stamped(made, found[1].decode()) if found and made.count(BLANK) == 1 else made
