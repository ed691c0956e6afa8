"""What the pipeline asks of its parts. Implementations are chosen by the command line."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.records import Frame, Reply, RgbImage

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Prompt:
    """A filled prompt of the paper.

    `format_hint` is ours and comes after the paper's words, apart from them; `inputs` are
    the lists that filled the prompt, by placeholder, for agents that do not read English.
    """

    prompt_id: str
    system: str
    user: str
    format_hint: str
    inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class VisionAgent(Protocol):
    """Looks at frames and answers in words (paper: OmniVLM and ViLA)."""

    @property
    def name(self) -> str:
        """What the records and pages call this agent."""

    def look(self, frames: Sequence[Frame], prompt: Prompt, call: int) -> Reply:
        """Answer `prompt` about one frame or a whole clip; `call` counts repeated questions from 0.

        Raises AgentError when no answer came.
        """


class LanguageAgent(Protocol):
    """Reads lists and answers in words (paper: gpt-4o-mini)."""

    @property
    def name(self) -> str:
        """What the records and pages call this agent."""

    def complete(self, prompt: Prompt, call: int) -> Reply:
        """Answer `prompt`. Raises AgentError when no answer came."""


class Embedder(Protocol):
    """Texts to unit vectors."""

    @property
    def name(self) -> str:
        """The model's name."""

    @property
    def sha256(self) -> str:
        """Hash of the weights and tokenizer: two embedders with one hash give the same vectors."""

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Unit vectors, shape (len(texts), D), in the order of the texts."""


class ImageTextMatcher(Protocol):
    """Compares pictures with labels (paper: CLIP)."""

    @property
    def name(self) -> str:
        """What the records and pages call this matcher."""

    def cosines(self, crops: Sequence[RgbImage], labels: Sequence[str]) -> NDArray[np.float32]:
        """Cosines in [-1, 1], shape (len(crops), len(labels))."""


class Executor(Protocol):
    """Runs one function over many items."""

    def run(self, function: Callable[[T], R], items: Iterable[T], lost: Callable[[T, str], R]) -> Iterator[R]:
        """The results, each as soon as it is there, in any order.

        `lost` gives the result of an item whose worker died again and again, with the reason.
        """
