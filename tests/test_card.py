"""Dataset cards: figures that are counted, texts that cannot become markup, the same bytes every time."""

import json
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from pipeline.benchmark import open_benchmark
from pipeline.records import TruthHazard
from sitegen.card import Card, escaped, make_card
from sitegen.card_data import read_card
from sitegen.cli import app
from sitegen.data_figures import truth_figures
from sitegen.data_findings import Finding, Severity
from tests.site_fixtures import EVIL, make_benchmark

TRUTH = [
    TruthHazard("v1", "h1", "Cat", "A cat crosses"),
    TruthHazard("v2", "h1", EVIL, f"A {EVIL} ahead"),
    TruthHazard("v3", "h1", "", ""),
]


def card(**more: object) -> str:
    given = {"truth": truth_figures(TRUTH), "clips": None, "videos_with_boxes": 2, **more}
    return make_card(Card("A # name", "1. A | description", "cc-by-4.0", 3, **given))


def test_the_figures_and_the_parts() -> None:
    text = card(
        annotators=[("Ann|a", 2)],
        parts=[("train", 2), ("test", 1)],
        findings=[Finding(Severity.ERROR, "kind", ("v1",), "<b>bad</b>", "mend")],
        attribution="# Credit\n\nBy *us*.\n\n## More\n\ntext",
    )
    assert "| hazards | 2 |" in text and "| videos without a hazard | 1 |" in text
    assert "| cat | 1 | 50.0% |" in text and "| Ann\\|a | 2 |" in text and "| train | 2 |" in text
    assert "found 1 error, 0 warnings, 0 notes:\n\n- error, kind: \\<b\\>bad\\</b\\>" in text
    assert "### Credit\n\nBy *us*.\n\n#### More" in text and "Licence: cc-by-4.0." in text
    assert "\n# A # name\n\n1\\. A \\| description\n" in text and "arXiv:2504.13399" in text
    headings = [line for line in text.splitlines() if line.startswith("## ")]
    assert headings == [
        *("## Figures", "## Fields", "## Splits", "## Annotations", "## Known problems"),
        *("## Licence and attribution", "## Citation"),
    ]


def test_front_matter_is_yaml_of_one_document() -> None:
    text = make_card(Card('Name: "x"\n---\nevil: yes', "", "", 2_000, None, None, None))
    head = text.split("\n---\n")[0].splitlines()
    assert head[0] == "---" and json.loads(head[1].removeprefix("pretty_name: ")) == 'Name: "x" --- evil: yes'
    assert "- 1K<n<10K" in head and 'license: "unknown"' in head


def test_what_is_hidden_or_not_checked_is_said() -> None:
    text = make_card(Card("n", "d", "", 3, None, None, None))
    assert "keeps the truth back" in text and "### Labels" not in text and "Not checked" in text
    assert "found nothing" in card(findings=[])


def test_hostile_labels_stay_text() -> None:
    text = card()
    assert "\\</script\\>" in text and "\u202e" not in text
    assert not re.search(r"(?<!\\)[<>]", text.split("\n---\n")[1])


@given(st.text(max_size=80))
def test_escaped_text_makes_no_markup(text: str) -> None:
    shown = escaped(text)
    assert "\n" not in shown
    place = 0
    while place < len(shown):
        if shown[place] == "\\":
            place += 2  # whatever comes next is itself
            continue
        assert shown[place] not in "`*_[]<>&|~$@"
        place += 1
    assert not shown.startswith(("#", "- ", "+ ", "=", "1. "))
    assert "http://" not in escaped("see http://evil.example") and "www." not in escaped("www.evil.example")


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = make_benchmark(tmp_path / "b", 2).root
    (root / "truth.csv").write_text(
        "video_id,hazard_id,label,description,author\n"
        "v1,h1,Cat,A cat crosses,Ann\nv2,h1,Dog,A dog runs,Ann\nv3,,,,Bob\n",
        encoding="utf-8",
    )
    settings = (root / "coooler.toml").read_text(encoding="utf-8").replace("truth.parquet", "truth.csv")
    (root / "coooler.toml").write_text(settings, encoding="utf-8")
    monkeypatch.chdir(root)
    runner = CliRunner()
    before = {path.name for path in root.iterdir()}
    done = runner.invoke(app, ["data", "card", "--licence", "mit"])
    assert done.exit_code == 0, done.output
    assert {path.name for path in root.iterdir()} - before == {"DATASET.md"}
    first = (root / "DATASET.md").read_bytes()
    text = first.decode()
    assert "| Ann | 2 |" in text and "| Bob | 1 |" in text and "| clips | 2 |" in text
    assert "320x180 (2)" in text and "Small \\<b\\>benchmark\\</b\\>" in text and "### Credit" in text
    shutil.copytree(root, tmp_path / "other")
    assert make_card(read_card(open_benchmark(tmp_path / "other"), "mit", None)).encode() == first
    assert runner.invoke(app, ["data", "split", "--parts", "a=0.5,b=0.5"]).exit_code == 0
    assert runner.invoke(app, ["data", "card", "--splits", "splits.csv"]).exit_code == 0
    assert "| part | videos |" in (root / "DATASET.md").read_text(encoding="utf-8")
    (root / "splits.csv").write_text("video_id,part\nv1,a\n", encoding="utf-8")
    assert runner.invoke(app, ["data", "card", "--splits", "splits.csv"]).exit_code == 1
    assert runner.invoke(app, ["data", "card", "--splits", "coooler.toml"]).exit_code == 1
    (root / "coooler.toml").write_text(settings + "hide_truth = true\n", encoding="utf-8")
    assert runner.invoke(app, ["data", "card"]).exit_code == 0
    hidden = (root / "DATASET.md").read_text(encoding="utf-8")
    assert not re.search(r"\bcat\b|crosses|\bdog\b|Ann ", hidden, re.I)
