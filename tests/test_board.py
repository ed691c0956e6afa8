"""The board as a whole: submitted, rehearsed, rescored, as it was on a day, and worked out again."""

import json
import re
from pathlib import Path

import pytest

from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.errors import FaultsError, InputError
from sitegen import board as board_module
from sitegen import ledger
from sitegen.about import Sender
from sitegen.board import build_board, evaluate_board, rehearse, submit_file
from sitegen.readers import read_predictions, read_truth
from sitegen.rehearsal import faults_markdown, markdown, rank_words, report
from sitegen.submissions import withdraw
from sitegen.verify import verify
from tests.site_fixtures import WordEmbedder

TRUTH = "video_id,hazard_id,label,description\n"
ROWS = "".join(f"v{n},1,Cat,A cat number {n} crosses the road\n" for n in range(8))
GOOD = "video_id,rank,description\n" + "".join(
    f"v{n},1,A cat number {n} crosses the road\n" for n in range(8)
)
POOR = "video_id,rank,description\n" + "".join(f"v{n},1,Nothing to see here\n" for n in range(8))


@pytest.fixture
def benchmark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Benchmark:
    """Eight videos without clips, and no submission."""
    monkeypatch.setattr(board_module, "open_embedder", WordEmbedder)
    (tmp_path / "coooler.toml").write_text('name = "Test"\n')
    (tmp_path / "videos").mkdir()
    (tmp_path / "truth.csv").write_text(TRUTH + ROWS)
    return open_benchmark(tmp_path)


def _file(benchmark: Benchmark, content: str, name: str = "given.csv") -> Path:
    path = benchmark.root / name
    path.write_text(content)
    return path


def _submit(benchmark: Benchmark, name: str, content: str, day: str, **more: bool) -> None:
    submit_file(benchmark, _file(benchmark, content), Sender(name, date="2026-01-01"), today=day, **more)


def _faults(benchmark: Benchmark, site: Path | None = None) -> dict[str, list[str]]:
    return {check.name: list(check.faults) for check in verify(benchmark, site) if check.faults}


def test_the_ledger_notes_the_scores(benchmark: Benchmark) -> None:
    _submit(benchmark, "Good", GOOD, "2026-02-01")
    (entry,) = ledger.read(benchmark.submissions)
    assert (entry.event, entry.date, entry.besm, entry.hazard_recall) == ("add", "2026-02-01", 1.0, 1.0)
    (standing,) = evaluate_board(benchmark)
    assert entry.signature == str(standing.evaluation.card.signature)
    assert standing.history == (entry,)
    assert len(standing.probes) == 6


def test_a_faulty_file_adds_nothing(benchmark: Benchmark) -> None:
    with pytest.raises(FaultsError) as caught:
        _submit(benchmark, "Bad", GOOD + "v99,1,x\nv1,1,again\n", "2026-02-01")
    assert not benchmark.submissions.exists()
    text = faults_markdown("a`b|c", caught.value.faults)
    assert "2 faults" in text and "`a'b\\|c`" in text and "`'v99'`" in text


def test_a_rehearsal_stores_nothing_and_says_where_it_would_stand(benchmark: Benchmark) -> None:
    _submit(benchmark, "Poor", POOR, "2026-02-01")
    before = {path: path.read_bytes() for path in benchmark.root.rglob("*") if path.is_file()}
    path = benchmark.root / "given.csv"
    path.write_text(GOOD)
    read = read_predictions(path, read_truth(benchmark.truth))
    board = rehearse(benchmark, read, path, Sender("@someone #1", date="2026-01-01"))
    assert [(one.stored.slug, one.rehearsed) for one in board] == [("poor", False), ("someone-1", True)]
    told = report(board, 1)
    assert (told["band"], told["of"], told["band_with"]) == (1, 2, [])
    assert told["metrics"]["besm"] == {"value": 1.0, "low": 1.0, "high": 1.0}
    assert rank_words(told) == "Rank 1 of 2; in 95 % of resamples rank 1."
    assert report(board, 0)["band"] == 2
    text = markdown(told)
    assert "### `@someone #1`" in text and "| BESM | 1.0000 | 1.0000 to 1.0000 |" in text
    path.write_bytes(before[path])
    assert {p: p.read_bytes() for p in benchmark.root.rglob("*") if p.is_file()} == before
    again = rehearse(benchmark, read, path, Sender("Poor", date="2026-01-01"))
    assert [one.rehearsed for one in again] == [True]
    with pytest.raises(InputError, match="date"):
        rehearse(benchmark, read, path, Sender("Poor", date="soon"))


def test_a_changed_truth_rescores_every_submission_with_the_reason(
    benchmark: Benchmark, tmp_path: Path
) -> None:
    _submit(benchmark, "Good", GOOD, "2026-02-01")
    _submit(benchmark, "Poor", POOR, "2026-02-02")
    site = benchmark.root / "site"
    build_board(benchmark, site, today="2026-02-03")
    assert [entry.event for entry in ledger.read(benchmark.submissions)] == ["add", "add"]
    benchmark.truth.write_text(TRUTH + ROWS.replace("A cat number 0", "Two dogs"))
    assert list(_faults(benchmark, site)) == ["scores", "rebuild"]
    build_board(benchmark, site, today="2026-02-04")
    entries = ledger.read(benchmark.submissions)
    assert [(e.event, e.slug, e.date) for e in entries[2:]] == [
        ("rescore", "good", "2026-02-04"),
        ("rescore", "poor", "2026-02-04"),
    ]
    assert re.fullmatch(r"truth [0-9a-f]{12} -> [0-9a-f]{12}", entries[2].reason)
    assert entries[0].besm == 1.0
    assert entries[2].besm is not None and entries[2].besm < 1.0
    build_board(benchmark, site, today="2026-02-05")
    assert len(ledger.read(benchmark.submissions)) == 4
    assert _faults(benchmark, site) == {}


def test_the_board_of_a_day_has_its_submissions_and_its_truth(benchmark: Benchmark, tmp_path: Path) -> None:
    _submit(benchmark, "Good", GOOD, "2026-02-01")
    build_board(benchmark, tmp_path / "first", today="2026-02-01")
    _submit(benchmark, "Good", POOR, "2026-02-03", replace=True)
    _submit(benchmark, "Poor", POOR, "2026-02-03")
    benchmark.truth.write_text(TRUTH + ROWS.replace("A cat number 0", "Two dogs"))
    build_board(benchmark, tmp_path / "now", today="2026-02-04")
    withdraw(benchmark.submissions, "poor", "by mistake", "2026-02-06")
    before = (benchmark.submissions / "ledger.jsonl").read_bytes()
    board, _ = build_board(benchmark, tmp_path / "then", as_of="2026-02-02")
    assert [(one.stored.slug, one.evaluation.card.besm) for one in board] == [("good", 1.0)]
    assert (benchmark.submissions / "ledger.jsonl").read_bytes() == before
    first = json.loads((tmp_path / "first" / "data" / "leaderboard.json").read_text())
    then = json.loads((tmp_path / "then" / "data" / "leaderboard.json").read_text())
    assert then["benchmark"] == "Test, as of 2026-02-02"
    assert {**then, "benchmark": "Test"} == first
    assert [one.stored.slug for one in evaluate_board(benchmark, "2026-02-05")] == ["good", "poor"]
    assert [one.stored.slug for one in evaluate_board(benchmark)] == ["good"]
    assert evaluate_board(benchmark, "2026-01-01") == []
    for kept in benchmark.root.glob("truth-history/*"):
        kept.unlink()
    with pytest.raises(InputError, match="the board of 2026-02-02 was scored by the truth of this hash"):
        evaluate_board(benchmark, "2026-02-02")


def test_verify_finds_what_was_changed_by_hand(benchmark: Benchmark) -> None:
    _submit(benchmark, "Good", POOR, "2026-02-01")
    _submit(benchmark, "Good", GOOD, "2026-02-02", replace=True)
    site = benchmark.root / "site"
    build_board(benchmark, site, today="2026-02-02")
    assert _faults(benchmark, site) == {}

    page = site / "submissions" / "good.html"
    kept = page.read_bytes()
    page.write_bytes(kept.replace(b"1.0000", b"2.0000"))
    found = _faults(benchmark, site)
    assert set(found) == {"site", "rebuild"}
    assert found["rebuild"] == ["submissions/good.html: differs from what its inputs give now"]
    page.write_bytes(kept)

    original = benchmark.submissions / "_earlier" / "good-1" / "original.csv"
    original.write_text(GOOD)
    (benchmark.submissions / "stranger").mkdir()
    found = _faults(benchmark)
    assert any("original.csv: found hash" in fault for fault in found["content"])
    assert any("stranger: is not in the ledger" in fault for fault in found["content"])
    original.write_text(POOR)
    (benchmark.submissions / "stranger").rmdir()

    path = benchmark.submissions / "ledger.jsonl"
    lines = path.read_bytes()
    last = lines.splitlines(keepends=True)[-1]
    path.write_bytes(lines.replace(last, last.replace(b'"besm":1.0', b'"besm":0.5')))
    assert _faults(benchmark) == {"scores": ["good: besm is 1.0, the ledger says 0.5"]}
    path.write_bytes(lines.replace(b'"besm":0', b'"besm":1', 1))
    assert list(_faults(benchmark)) == ["ledger", "content", "scores"]
