"""Hundreds of hostile files: each is read or refused in seconds, and nothing else happens.

Two children read them all, half each; the slowest take seconds. A child that dies is a finding, unless
it was Parquet: pyarrow can abort its process, which is why outside files are read apart.
"""

import hashlib
import os
import stat
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pipeline.benchmark import open_benchmark
from pipeline.errors import FaultsError
from pipeline.tables import TRUTH as TRUTH_TABLE
from sitegen.about import Sender
from sitegen.board import build_board, submit_file
from sitegen.readers import read_predictions
from sitegen.sandbox import read_apart
from tests.hostile import corpus
from tests.hostile_case import ALERT, MARKER, RIGHT, TRUTH, Case, csv_bytes
from tests.hostile_child import Child, Outcome
from tests.hostile_text import GOOD_TEXTS

SECONDS = 20.0  # of processor time, on a slow machine; most files take a hundredth of one
LONGEST_FAULT = 2_500
LONGEST_LIST = 4 * 2**20

CASES = corpus()


@dataclass(frozen=True, slots=True)
class Reading:
    """What came of the whole corpus, and the state of the scratch folder before and after."""

    outcomes: dict[str, Outcome]
    before: dict[str, str]
    after: dict[str, str]


def state_of(folder: Path) -> dict[str, str]:
    """Path -> kind, size, time and content of everything under a folder; no link is followed."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = path.lstat()
        content = hashlib.sha256(path.read_bytes()).hexdigest() if stat.S_ISREG(status.st_mode) else ""
        name = path.relative_to(folder).as_posix()
        found[name] = f"{status.st_mode:o} {status.st_size} {status.st_mtime_ns} {content}"
    return found


def make_benchmark(root: Path) -> Path:
    """A benchmark folder with the corpus' truth."""
    root.mkdir()
    (root / "coooler.toml").write_text('name = "Scratch"\ntruth = "truth.parquet"\n', encoding="utf-8")
    TRUTH_TABLE.write(root / "truth.parquet", TRUTH)
    return root


@pytest.fixture(scope="module")
def reading(tmp_path_factory: pytest.TempPathFactory) -> Reading:
    files, scratch = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("scratch")
    folders = {name: scratch / name for name in ("here", "home", "temporary")}
    for folder in folders.values():
        folder.mkdir()
    benchmark = make_benchmark(scratch / "benchmark")
    (benchmark / "submissions").mkdir()
    environment = {**os.environ, "HOME": str(folders["home"]), "TMPDIR": str(folders["temporary"])}
    before = state_of(scratch)

    def ask(cases: list[Case]) -> Iterator[tuple[str, Outcome]]:
        child = Child(folders["here"], environment)
        try:
            for case in cases:
                path = case.write(files)
                # What must be refused is submitted: that reads it, too, and would store it if it could.
                yield case.name, child.ask(path, benchmark if case.verdict == "refused" else None)
                if not path.is_dir():
                    path.unlink()
        finally:
            child.close()

    with ThreadPoolExecutor(2) as pool:
        halves = pool.map(lambda cases: list(ask(cases)), (CASES[::2], CASES[1::2]))
    outcomes = dict(pair for half in halves for pair in half)
    return Reading(outcomes, before, state_of(scratch))


def test_the_corpus_is_large_and_always_the_same() -> None:
    assert len(CASES) >= 200
    assert len({case.name for case in CASES}) == len(CASES)
    again = corpus()
    assert [case.name for case in again] == [case.name for case in CASES]
    contents = [(one.content, two.content) for one, two in zip(CASES, again, strict=True)]
    assert all(one == two for one, two in contents if isinstance(one, bytes))


@pytest.mark.parametrize("name", RIGHT)
def test_the_right_files_that_hostile_ones_are_made_of_are_read(name: str, tmp_path: Path) -> None:
    file, data = RIGHT[name]
    (tmp_path / file).write_bytes(data)
    assert read_predictions(tmp_path / file, TRUTH).source_format == name


def test_nothing_crashes_hangs_or_dies(reading: Reading) -> None:
    wrong = {
        name: outcome.detail
        for name, outcome in reading.outcomes.items()
        if outcome.verdict == "crashed" or (outcome.verdict == "died" and not name.startswith("parquet"))
    }
    assert wrong == {}


def test_each_takes_seconds_at_most(reading: Reading) -> None:
    slow = {name: outcome.seconds for name, outcome in reading.outcomes.items() if outcome.seconds > SECONDS}
    assert slow == {}


def test_the_worst_are_refused_when_they_are_read_apart(reading: Reading, tmp_path: Path) -> None:
    died = {name for name, outcome in reading.outcomes.items() if outcome.verdict == "died"}
    assert len(died) <= 8
    worst = {"parquet-list-of-billions", "parquet-schema-10000-deep", "pickle-2-parquet", "file-pipe"}
    for case in [case for case in CASES if case.name in died | worst]:
        with pytest.raises(FaultsError):
            read_apart(case.write(tmp_path), TRUTH)


def test_each_is_read_or_refused_as_it_must_be(reading: Reading) -> None:
    wrong = {
        case.name: (reading.outcomes[case.name].verdict, reading.outcomes[case.name].detail)
        for case in CASES
        if case.verdict != "either" and reading.outcomes[case.name].verdict not in (case.verdict, "died")
    }
    assert wrong == {}


def test_faults_are_short_and_printable(reading: Reading) -> None:
    wrong = {
        name: (outcome.longest, outcome.total, outcome.detail)
        for name, outcome in reading.outcomes.items()
        if outcome.longest > LONGEST_FAULT or outcome.total > LONGEST_LIST or not outcome.printable
    }
    assert wrong == {}


def test_captions_stay_what_they_are(reading: Reading) -> None:
    for name, text in GOOD_TEXTS.items():
        assert reading.outcomes[f"text-csv-{name}"].texts == (text.strip(),)
        assert reading.outcomes[f"text-jsonl-{name}"].texts == (text.strip(),)


def test_nothing_was_added_or_changed_anywhere(reading: Reading) -> None:
    assert reading.after == reading.before
    assert not [name for name in reading.after if MARKER in name]


class _Live(HTMLParser):
    """Collects what a browser would run in a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Scripts without a file, handlers, addresses with code, and tags that pages never hold."""
        values = dict(attrs)
        if (tag == "script" and "src" not in values) or tag in {"iframe", "object", "embed", "base"}:
            self.found.append(self.get_starttag_text() or tag)
        for key, value in values.items():
            if key.startswith("on") or (value or "").strip().lower().startswith(("javascript:", "data:text")):
                self.found.append(f"{key}={value}")


def live_code(page: str) -> list[str]:
    """What a browser would run in a page, apart from the site's own files."""
    parser = _Live()
    parser.feed(page)
    return parser.found


def test_the_search_for_live_code_finds_some() -> None:
    for page in (
        f"<p><script>{ALERT}</script>",
        f'<img src=x onerror="{ALERT}">',
        f'<a href=" javascript:{ALERT}">x</a>',
    ):
        assert live_code(page)


def test_hostile_captions_are_stored_and_shown_as_text(tmp_path: Path) -> None:
    benchmark = open_benchmark(make_benchmark(tmp_path / "benchmark"))
    rows = [["v1", rank, text] for rank, text in enumerate(GOOD_TEXTS.values(), start=1)]
    (tmp_path / "all.csv").write_bytes(csv_bytes([["video_id", "rank", "description"], *rows]))
    evil = GOOD_TEXTS["script"]
    submit_file(
        benchmark, tmp_path / "all.csv", Sender(evil[:80], evil, agents=evil, notes=evil), today="2026-01-02"
    )
    by_name = {case.name: case for case in CASES}
    for name in (
        "text-coco-script",
        "text-scripts-formula",
        "text-2coool-script",
        "text-parquet-script",
    ):
        path = by_name[name].write(tmp_path / "files")
        submit_file(benchmark, path, Sender(name, notes=evil), today="2026-01-02")
    board, report = build_board(benchmark, tmp_path / "site")
    assert len(board) == 5
    texts = {one.description for standing in board for one in standing.stored.submission.predictions}
    assert texts >= {text.strip() for text in GOOD_TEXTS.values()}
    pages = sorted(report.folder.rglob("*.html"))
    assert len(pages) > len(TRUTH)
    assert {path.name: code for path in pages if (code := live_code(path.read_text(encoding="utf-8")))} == {}
    assert any("&lt;script&gt;" in path.read_text(encoding="utf-8") for path in pages)
    for script in (report.folder / "data").rglob("*.js"):
        assert "</script" not in script.read_text(encoding="utf-8")
    assert not list(tmp_path.rglob(f"*{MARKER}*"))
