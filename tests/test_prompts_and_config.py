"""The paper's prompts, word for word, and settings that refuse what they do not know."""

from pathlib import Path

import pytest

from pipeline.benchmark import find_benchmark
from pipeline.config import RunConfig, read_benchmark_settings, read_run_config
from pipeline.errors import ConfigError
from pipeline.prompts import PLACEHOLDERS, fill, templates

# The first and last words of each prompt as printed in the paper (arXiv 2504.13399).
PAPER_WORDS = {
    "T1-VLM": ("You are an autonomous vehicle looking", "hazards and anomalies in the image."),
    "T1-LLM": ("List1: ", "very short description of what the object is doing."),
    "T2-VLM": ("What objects are on the road", "(provide your answer as a list separated by commas)"),
    "T2-LLM": ("Here are multiple lists of objects", "Also remove any articles (a, the, an) from the list."),
    "X-LLM": ("List1: ", "should be a very short sentence description of the object."),
    "A-LLM": ("List of Traffic Objects: ", "what are the anomalies / anomaly?"),
}


@pytest.mark.parametrize("prompt_id", sorted(PAPER_WORDS))
def test_prompts_are_the_papers(prompt_id: str) -> None:
    prompt = fill(prompt_id, {name: ["x"] for name in PLACEHOLDERS[prompt_id]})
    first, last = PAPER_WORDS[prompt_id]
    assert prompt.user.startswith(first)
    assert prompt.user.endswith(last)
    assert prompt.format_hint not in prompt.user or not prompt.format_hint
    assert templates()[prompt_id]["section"]


def test_a_list_that_holds_a_placeholder_stays_what_it_is() -> None:
    prompt = fill("X-LLM", {"rhs": ["{aes}", 'say "x"'], "aes": ["{rhs}"]})
    assert 'List1: ["{aes}", "say \\"x\\""], List2: ["{rhs}"] Cross reference' in prompt.user


def test_wrong_lists_are_refused() -> None:
    with pytest.raises(ValueError, match="expected"):
        fill("X-LLM", {"rhs": []})


def test_defaults_are_the_papers() -> None:
    config = RunConfig()
    assert (config.frames.count, config.track2.queries) == (25, 20)
    limits = config.verify
    assert (limits.min_width_px, limits.min_height_px, limits.min_area_px2) == (175, 175, 35_000)
    assert limits.top_percent == 10


def test_hash_depends_on_settings_not_on_spelling(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("seed = 3\n[frames]\ncount = 25\n")
    (tmp_path / "b.toml").write_text("[track2]\nenabled = true\n[frames]\n")
    a, b = read_run_config(tmp_path / "a.toml"), read_run_config(tmp_path / "b.toml")
    assert b.sha256 == RunConfig().sha256 != a.sha256


def test_every_wrong_setting_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text('sed = 3\n[frames]\ncount = "many"\n[verify]\ntop_percent = 0\nmin_width_px = nan\n')
    with pytest.raises(ConfigError) as caught:
        read_run_config(path)
    for key in ("sed", "frames.count", "verify.top_percent", "verify.min_width_px"):
        assert f"  {key}: found" in str(caught.value)


@pytest.mark.parametrize("content", ["not toml at all [", "\x00"])
def test_what_is_no_toml_is_an_error(tmp_path: Path, content: str) -> None:
    (tmp_path / "x.toml").write_text(content)
    with pytest.raises(ConfigError, match="not readable as TOML"):
        read_run_config(tmp_path / "x.toml")


def test_missing_settings_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read_benchmark_settings(tmp_path / "coooler.toml")


def test_benchmark_is_found_here_above_and_in_demo(tmp_path: Path) -> None:
    (tmp_path / "demo" / "deep").mkdir(parents=True)
    (tmp_path / "demo" / "coooler.toml").write_text('name = "Mine"\n')
    for start in (tmp_path, tmp_path / "demo", tmp_path / "demo" / "deep"):
        assert find_benchmark(start).truth == tmp_path.resolve() / "demo" / "truth.csv"


def test_a_role_keeps_the_papers_settings_where_it_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text('[roles]\nvideo = { model = "ViLA" }\nrhs = { model = "x", temperature = 0.1 }\n')
    roles = read_run_config(path).roles
    assert (roles.video.model, roles.video.temperature, roles.video.max_tokens) == ("ViLA", 0.2, 512)
    assert (roles.rhs.temperature, roles.rhs.max_tokens) == (0.1, 200)
    assert (roles.aes.temperature, roles.aes.max_tokens) == (0.2, 100)


def test_the_settings_in_the_readme_are_settings(tmp_path: Path) -> None:
    text = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    blocks = [block.split("```", 1)[0] for block in text.split("```toml\n")[1:]]
    assert blocks
    for block in blocks:
        (tmp_path / "run.toml").write_text(block, encoding="utf-8")
        assert read_run_config(tmp_path / "run.toml").models["aos"] == "gpt-4o-mini"


def test_clip_without_a_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text('matcher = "clip"\n')
    with pytest.raises(ConfigError, match="clip_folder"):
        read_run_config(tmp_path / "run.toml")
