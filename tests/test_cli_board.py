"""The commands around a leaderboard as a user meets them: rehearse, submit, compare, verify, as of a day."""

import json
from pathlib import Path

import pytest

from pipeline.records import Prediction
from pipeline.tables import PREDICTIONS
from tests.test_cli import coooler

TRUTH = "video_id,hazard_id,label,description\n" + "".join(
    f"v{number},1,{label},{text}\n"
    for number, (label, text) in enumerate(
        [
            ("Cat", "A cat crossing the road"),
            ("Ladder", "A ladder lies in our lane"),
            ("Deer", "A deer stands beside the road"),
            ("Ball", "A ball rolls onto the street"),
            ("Door", "The door of a parked car opens"),
            ("Child", "A child runs between parked cars"),
        ]
    )
)
RIGHT = [line.split(",")[3] for line in TRUTH.splitlines()[1:]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A benchmark folder with six videos and no submission."""
    (tmp_path / "coooler.toml").write_text('name = "Tests"\n')
    (tmp_path / "truth.csv").write_text(TRUTH)
    (tmp_path / "videos").mkdir()
    _write(tmp_path / "right.csv", RIGHT)
    _write(tmp_path / "poor.csv", ["Blue sky"] * 6)
    return tmp_path


def _write(path: Path, captions: list[str]) -> None:
    rows = [f"v{number},1,{caption}\n" for number, caption in enumerate(captions)]
    path.write_text("video_id,rank,description\n" + "".join(rows))


def _tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_from_rehearsal_to_a_verified_board(folder: Path) -> None:
    before = _tree(folder)
    run = coooler(
        folder, "submit", "right.csv", "--name", "Right", "--rehearse", "--markdown", "report.md", "--json"
    )
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    assert (told["band"], told["of"], told["metrics"]["besm"]["value"]) == (1, 1, 1.0)
    assert [probe["kind"] for probe in told["probes"] if probe["flagged"]] == ["truth-copy"]
    assert "Rehearsal" in (folder / told["preview"]).read_text(encoding="utf-8")
    assert "| BESM | 1.0000 |" in (folder / "report.md").read_text(encoding="utf-8")
    left = {
        name: data for name, data in _tree(folder).items() if not name.startswith(("rehearsal/", "report.md"))
    }
    assert left == before

    about = 'name = "Right"\nauthors = "Ann"\nlicence = "CC-BY-4.0"\nnotes = "Copied on purpose."\n'
    (folder / "about.toml").write_text(about)
    assert coooler(folder, "build").returncode == 0
    run = coooler(folder, "submit", "right.csv", "--about", "about.toml", "--why", "a test")
    assert run.returncode == 0, run.stderr
    page = folder / "site" / "submissions" / "right.html"
    assert "CC-BY-4.0" in page.read_text(encoding="utf-8"), "submitting rebuilds the site"
    run = coooler(folder, "submit", "poor.csv", "--name", "Poor", "--no-build", "--json")
    assert json.loads(run.stdout)["slug"] == "poor"
    assert not (folder / "site" / "submissions" / "poor.html").exists()

    run = coooler(folder, "verify")
    assert run.returncode == 1
    assert "submissions/poor.html: is missing" in run.stdout
    assert coooler(folder, "build").returncode == 0
    run = coooler(folder, "verify", "--json")
    assert run.returncode == 0, run.stdout
    assert [check["name"] for check in json.loads(run.stdout)["checks"]] == [
        "ledger",
        "content",
        "scores",
        "site",
        "rebuild",
    ]

    run = coooler(folder, "compare", "Right", "poor.csv", "--json")
    assert run.returncode == 0, run.stderr
    besm = json.loads(run.stdout)["besm"]
    assert (besm["wins"], besm["losses"], besm["ties"]) == (6, 0, 0)
    assert besm["a"] == 1.0 and besm["difference"] > 0.5
    assert coooler(folder, "compare", "right", "nobody").returncode == 1

    assert coooler(folder, "build", "--as-of", "soon").returncode == 2
    run = coooler(folder, "build", "--as-of", "2001-01-01", "--out", "then")
    assert run.returncode == 0, run.stderr
    assert "no submissions yet" in run.stdout


def test_check_tells_a_workflow_where(folder: Path) -> None:
    (folder / "bad.csv").write_text('video_id,rank,description\nv1,1,"two\nlines"\nv9,0,x\n')
    run = coooler(folder, "check", "bad.csv", "--github")
    assert run.returncode == 1
    lines = [line for line in run.stdout.splitlines() if line.startswith("::error ")]
    assert len(lines) == 2
    assert all("file=bad.csv" in line and "line=4" in line for line in lines)
    (folder / "odd.csv").write_text("Video ID,Rank,Description\n v9 ,1,  A cat \n")
    run = coooler(folder, "check", "odd.csv", "--github", "--fix")
    (line,) = [line for line in run.stdout.splitlines() if line.startswith("::error ")]
    assert "file=odd.fixed.csv" in line, "its lines are those of the corrected copy"


def test_check_fixes_what_is_safe_and_leaves_the_file_alone(folder: Path) -> None:
    text = "Video ID,Rank,Description\n v1 ,1,  A cat \nv1,1,A cat\n"
    (folder / "odd.csv").write_text(text)
    assert coooler(folder, "check", "odd.csv").returncode == 1
    run = coooler(folder, "check", "odd.csv", "--fix")
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("fixed: ") >= 2
    assert (folder / "odd.csv").read_text() == text
    assert coooler(folder, "check", "odd.fixed.csv").returncode == 0


def test_wrong_options_say_what_is_right(folder: Path) -> None:
    run = coooler(folder, "check", "right.csv", "--format", "xml")
    assert run.returncode == 2
    assert "coool" in run.stderr
    run = coooler(folder, "submit", "right.csv")
    assert run.returncode == 1
    assert "--name NAME" in run.stderr
    run = coooler(folder, "submit", "videos", "--name", "A folder without predictions")
    assert run.returncode == 1
    assert "videos: found no Parquet file in it" in run.stderr
    (folder / "about.toml").write_text('name = "x"\nbesm = 0.99\n')
    run = coooler(folder, "submit", "right.csv", "--about", "about.toml")
    assert run.returncode == 1
    assert "besm" in run.stderr
    assert not (folder / "submissions").exists()


def test_a_folder_of_shards_is_checked_scored_and_stored_as_one_file(folder: Path) -> None:
    shards = folder / "shards"
    for number, caption in enumerate(RIGHT):
        PREDICTIONS.write(shards / f"part-{number}.parquet", [Prediction(f"v{number}", 1, caption)])
    (shards / "_SUCCESS").touch()
    checked = json.loads(coooler(folder, "check", "shards", "--json").stdout)
    assert (checked["format"], checked["predictions"], checked["faults"]) == ("parquet", 6, [])
    assert json.loads(coooler(folder, "score", "shards", "--json").stdout)["besm"] == 1.0
    for _ in range(2):  # the same again changes nothing
        run = coooler(folder, "submit", "shards", "--name", "Right", "--json")
        assert run.returncode == 0, run.stderr
    assert len((folder / "submissions" / "ledger.jsonl").read_text().splitlines()) == 1
    (shards / "part-6.parquet").write_text("video_id,rank,description\n")
    run = coooler(folder, "check", "shards")
    assert run.returncode == 1 and "part-6.parquet" in run.stderr
