"""Stored submissions that came from outside or were changed by hand: checked like new ones."""

import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import FaultsError, InputError
from pipeline.files import sha256_file
from pipeline.records import Prediction, TruthHazard
from pipeline.tables import PREDICTIONS
from sitegen import about as about_file
from sitegen.submissions import load_all
from tests.submitting import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """An empty one."""
    return Bench(tmp_path)


def test_predictions_changed_by_hand(bench: Bench) -> None:
    folder = bench.submit()
    PREDICTIONS.write(folder / "predictions.parquet", [Prediction("v1", 1, "Better.")])
    with pytest.raises(InputError, match="changed by hand"):
        load_all(bench.folder)


def test_predictions_and_their_hash_changed_by_hand(bench: Bench) -> None:
    folder = bench.submit()
    before = sha256_file(folder / "predictions.parquet")
    PREDICTIONS.write(folder / "predictions.parquet", [Prediction("v1", 1, "Better.")])
    after = sha256_file(folder / "predictions.parquet")
    about = folder / "submission.toml"
    about.write_text(about.read_text().replace(before, after))
    with pytest.raises(InputError, match=f"{after[:12]}, the ledger says {before[:12]}"):
        load_all(bench.folder)


def test_stored_predictions_are_checked_like_new_ones(bench: Bench) -> None:
    bench.submit()
    hazards = [TruthHazard("v1", "1", "cat", "A cat.")]
    with pytest.raises(FaultsError, match="v2"):
        load_all(bench.folder, hazards)


def test_a_submission_with_stored_scores_is_refused(bench: Bench) -> None:
    path = bench.submit() / "submission.toml"
    path.write_text(path.read_text() + "besm = 0.99\n")
    with pytest.raises(InputError, match="besm"):
        load_all(bench.folder)


def test_every_wrong_folder_is_told_of(bench: Bench) -> None:
    bench.submit("A").rename(bench.folder / "z")
    (bench.submit("B") / "submission.toml").write_text("name = ")
    (bench.folder / "c").mkdir()
    (bench.submit("D") / "stages.parquet").symlink_to("/etc/passwd")
    renamed = bench.submit("E") / "submission.toml"
    renamed.write_text(renamed.read_text().replace('"E"', '"F"'))
    with pytest.raises(InputError) as caught:
        load_all(bench.folder)
    message = str(caught.value)
    for part in (
        "submissions/a: found nothing; the ledger says",
        "b/submission.toml: not readable",
        "c: is not in the ledger",
        "symbolic link",
        "e: is named 'F'; the ledger says that 'e' lies there",
        "z: is not in the ledger",
    ):
        assert part in message


def test_damaged_stored_predictions_can_be_replaced(bench: Bench) -> None:
    folder = bench.submit()
    (folder / "predictions.parquet").write_bytes(b"PAR1")
    bench.submit(replace=True)
    assert len(load_all(bench.folder)) == 1


LINE = st.text(st.characters(exclude_categories=["Cc", "Cf", "Cs", "Co", "Zl", "Zp"]), max_size=40)


@settings(deadline=None)
@given(LINE, LINE)
def test_about_round_trips(authors: str, agents: str) -> None:
    values = {
        "name": 'Ab "c" \\ é',
        "authors": authors,
        "url": "",
        "date": "2026-01-02",
        "agents": agents,
        "source_format": "csv",
        "original_sha256": "0" * 64,
        "predictions_sha256": "1" * 64,
    }
    about = about_file.validated(values, "test")
    with tempfile.TemporaryDirectory() as name:
        about_file.write(Path(name), about)
        assert about_file.read(Path(name)) == about


def test_a_copied_benchmark_loads_the_same(bench: Bench, tmp_path: Path) -> None:
    bench.submit()
    shutil.copytree(bench.folder, tmp_path / "copy")
    one, other = load_all(bench.folder), load_all(tmp_path / "copy")
    assert [stored.submission for stored in one] == [stored.submission for stored in other]
