"""Fills the paper's prompts, which are kept word for word in `prompts.toml`."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files

from pipeline.interfaces import Prompt

PLACEHOLDERS = {
    "T1-VLM": (),
    "T1-LLM": ("descriptions",),
    "T2-VLM": (),
    "T2-LLM": ("lists",),
    "X-LLM": ("rhs", "aes"),
    "A-LLM": ("cos",),
}


@cache
def templates() -> dict[str, dict[str, str]]:
    """Prompt id -> `section`, `system`, `user`, `format_hint`."""
    return tomllib.loads(files("pipeline").joinpath("prompts.toml").read_text(encoding="utf-8"))


def fill(prompt_id: str, lists: Mapping[str, Sequence[str]] | None = None) -> Prompt:
    """The prompt with its lists put in, each as a JSON list, whatever the lists hold.

    Raises ValueError when the lists are not exactly those the prompt has places for.
    """
    template = templates()[prompt_id]
    inputs = {name: tuple(values) for name, values in (lists or {}).items()}
    if set(inputs) != set(PLACEHOLDERS[prompt_id]):
        raise ValueError(f"{prompt_id}: found lists {sorted(inputs)}, expected {PLACEHOLDERS[prompt_id]}")
    user = template["user"]
    # Split, never replace in turn: a list that holds "{aes}" must stay what it is.
    parts: list[str] = []
    for name in PLACEHOLDERS[prompt_id]:
        head, user = user.split("{" + name + "}", 1)
        parts += [head, json.dumps(inputs[name], ensure_ascii=False)]
    return Prompt(prompt_id, template["system"], "".join([*parts, user]), template["format_hint"], inputs)
