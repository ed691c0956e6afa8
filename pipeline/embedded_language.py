"""The embedded language agent: a named baseline, deterministic, from spaCy and the embedder.

It answers each of the paper's prompts by rules over the lists that filled it, in the JSON that
the format hint asks for, and goes through the same parser as any model's answer. Source: ours.
"""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.chunks import noun_chunks, without_article
from pipeline.interfaces import Embedder, Prompt
from pipeline.parsing import parse
from pipeline.records import Item, Reply

# The words by which the paper's own prompts say what a hazard is.
HAZARDS = ("animal", "bird", "person", "pedestrian", "debris", "anything that is blocking the road")
ORDINARY = ("car", "truck", "bus", "traffic sign", "barrier", "road", "traffic")
# How the vision baseline words a conflict with the path of the vehicle.
CONFLICT = ("coming closer", "crossing", "blocking", "blinds")

SAME_LABEL = 0.70  # cosine from which two labels name one thing
MIN_LIST_SHARE = 0.25  # of the lists of Track 2 that must name an element
CONFLICT_BONUS = 0.5
SHARE_BONUS = 0.2


@dataclass(frozen=True, slots=True)
class _Mention:
    label: str
    sentence: str


class EmbeddedLanguageAgent:
    """Lists in, a JSON list out."""

    name = "Embedded language baseline (rules over spaCy and all-MiniLM-L6-v2)"

    def __init__(self, embedder: Embedder) -> None:
        """`embedder` gives unit vectors of labels and sentences."""
        self._embedder = embedder

    def complete(self, prompt: Prompt, call: int) -> Reply:
        """Answer one of the paper's four language prompts. Raises KeyError for any other."""
        answers: dict[str, Callable[..., list[dict[str, str]] | list[str]]] = {
            "T1-LLM": self._rank_hazards,
            "T2-LLM": self._all_elements,
            "X-LLM": self._cross_reference,
            "A-LLM": self._anomalies,
        }
        answer = answers[prompt.prompt_id](**prompt.inputs)
        return Reply(json.dumps(answer, ensure_ascii=False), self.name)

    def _rank_hazards(self, descriptions: Sequence[str]) -> list[dict[str, str]]:
        """Track 1: sentences that name one thing become one element, most hazardous first."""
        mentions: list[_Mention] = []
        for description in descriptions:
            for item in parse(description)[0]:
                sentence = item.description or item.label
                chunks = noun_chunks(sentence)
                if chunks:
                    mentions.append(_Mention(without_article(chunks[0]).lower(), sentence))
        groups = self._grouped(mentions)
        scored = []
        for label, members in groups:
            sentences = Counter(member.sentence for member in members)
            hazard = self._hazard(list(sentences))
            # The most hazardous wording stands for the group, the more frequent on a tie.
            best = max(sentences, key=lambda s: (round(hazard[s], 6), sentences[s], s))
            score = hazard[best] + SHARE_BONUS * len(members) / max(len(descriptions), 1)
            scored.append((round(score, 6), label, best))
        scored.sort(key=lambda entry: (-entry[0], entry[1]))
        return [{"label": label, "description": sentence} for _, label, sentence in scored]

    def _all_elements(self, lists: Sequence[str]) -> list[str]:
        """Track 2: what enough of the lists name, near-duplicates merged, most frequent first."""
        counts: Counter[str] = Counter()
        for answer in lists:
            counts.update({without_article(item.label or item.description) for item in parse(answer)[0]})
        mentions = [_Mention(label.lower(), "") for label in counts.elements()]
        kept = [
            (len(members), label)
            for label, members in self._grouped(mentions)
            if len(members) >= MIN_LIST_SHARE * len(lists)
        ]
        return [label for _, label in sorted(kept, key=lambda entry: (-entry[0], entry[1]))]

    def _cross_reference(self, rhs: Sequence[str], aes: Sequence[str]) -> list[dict[str, str]]:
        """What both lists hold, ranked as the first and named as the second."""
        ranked, elements = _items(rhs), [item.label for item in _items(aes)]
        if not ranked or not elements:
            return []
        cosines = self._vectors([item.label for item in ranked]) @ self._vectors(elements).T
        return [
            {"label": elements[int(row.argmax())], "description": item.description}
            for item, row in zip(ranked, cosines, strict=True)
            if row.max() >= SAME_LABEL
        ]

    def _anomalies(self, cos: Sequence[str]) -> list[dict[str, str]]:
        """What is nearer to the prompt's anomalies than to traffic, or is in conflict with us."""
        items = _items(cos)
        if not items:
            return []
        labels = self._vectors([item.label for item in items])
        odd = (labels @ self._vectors(HAZARDS).T).max(axis=1)
        usual = (labels @ self._vectors(ORDINARY).T).max(axis=1)
        return [
            {"label": item.label, "description": item.description or item.label}
            for item, odd_by, usual_by in zip(items, odd.tolist(), usual.tolist(), strict=True)
            if odd_by > usual_by or _in_conflict(item.description)
        ]

    def _hazard(self, sentences: Sequence[str]) -> dict[str, float]:
        cosines = (self._vectors(sentences) @ self._vectors(HAZARDS).T).max(axis=1)
        return {
            sentence: cosine + CONFLICT_BONUS * _in_conflict(sentence)
            for sentence, cosine in zip(sentences, cosines.tolist(), strict=True)
        }

    def _grouped(self, mentions: Sequence[_Mention]) -> list[tuple[str, list[_Mention]]]:
        """Mentions whose labels name one thing, under the most frequent of their labels."""
        counts = Counter(mention.label for mention in mentions)
        order = sorted(counts, key=lambda label: (-counts[label], label))
        if not order:
            return []
        cosines = self._vectors(order) @ self._vectors(order).T
        head: dict[str, str] = {}
        for place, label in enumerate(order):
            heads = [other for other in range(place) if head[order[other]] == order[other]]
            near = max(heads, key=lambda other: (cosines[place, other], -other), default=None)
            same = near is not None and cosines[place, near] >= SAME_LABEL
            head[label] = order[near] if near is not None and same else label
        groups: dict[str, list[_Mention]] = {}
        for mention in mentions:
            groups.setdefault(head[mention.label], []).append(mention)
        return [(label, groups[label]) for label in order if label in groups]

    def _vectors(self, texts: Sequence[str]) -> NDArray[np.float32]:
        return self._embedder.embed(texts)


def _items(entries: Sequence[str]) -> tuple[Item, ...]:
    """Entries of the form "label: description", as `stages.entry` writes them."""
    parts = (entry.partition(": ") for entry in entries)
    return tuple(Item(rank, label, rest) for rank, (label, _, rest) in enumerate(parts, start=1))


def _in_conflict(sentence: str) -> bool:
    return any(words in sentence for words in CONFLICT)
