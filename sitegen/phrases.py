"""What a text speaks of: its noun phrases, without what it says is not there (spaCy; ours)."""

import re
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from pipeline.chunks import language

if TYPE_CHECKING:
    from spacy.tokens import Doc, Span, Token

MAX_TEXT_CHARS = 4_000
MAX_SENTENCE_CHARS = 400
_MAX_LIST_WORDS = 4
_BATCH = 256

_SENTENCE_END = re.compile(r"[.!?;\n\r]+(?=\s|$)|[\n\r;]+")
_SLASH = re.compile(r"(?<=[^\W\d_])/(?=[^\W\d_])")  # "cars/trucks"
_WORD = re.compile(r"[^\W\d_]+")
_VOWEL = re.compile("[aeouy]")


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_NOT = _set("no not neither nor none without never n't nt zero cannot")
_NOTHING = _set("none no not nothing absent zero 0 n/a na")
_FREE = _set("free clear devoid empty bare absence lack absent")
_THROUGH = _set("of like as including from")  # "no hazards such as dogs" has no dogs
_VISIBLE = _set("visible present seen there detected observed apparent identified noticed")
_DEFINITE = _set("the this that these those his her its their")
_SINGLE = _set("a an one two three four five several some many") | _DEFINITE
_SUBJECTS = _set("nsubj nsubjpass expl compound")
_NOUN_ROLES = _set("compound nsubj nsubjpass dobj pobj attr")
_NEVER_NOUNS = _set("PRON DET NUM ADP PUNCT SPACE SYM")
_OBJECTS = _set("attr dobj oprd")
_COLOURS = _set("red white black blue green orange yellow grey gray brown silver dark")
_OURS = _set("our my ego own camera")
_OWN = _set("car vehicle driver camera truck viewer")
_AHEAD_OF = _set("front ahead")
_ING_NOUNS = _set("building railing clothing parking morning evening ceiling awning")
_PARTS = _set(
    "group piece flock herd pair couple bit lot number kind type sort part set row pile stack bunch base "
    "top half majority swarm pack crowd variety amount section"
)


class Phrase(NamedTuple):
    """A noun phrase in small letters: `head` is its head as a lemma, `nouns` its nouns alone.

    "two orange traffic cones" has the head "cone" and the nouns "traffic cone"; `words` is all of it.
    """

    head: str
    nouns: str
    words: str


@lru_cache(maxsize=1 << 16)
def sentences(text: str) -> tuple[str, ...]:
    """The sentences of a text in small letters, in order, each once; a plain list in its elements.

    Only the first 4,000 characters are read, and sentences of over 400 are cut into pieces.
    """
    lines = text[:MAX_TEXT_CHARS].lower().replace("\t", " ").splitlines()
    readable = "\n".join(map(_printable, lines))
    found: dict[str, None] = {}
    for sentence in _SENTENCE_END.split(_SLASH.sub(", ", readable)):
        for part in _elements(sentence):
            short = " ".join(part.split())
            pieces = textwrap.wrap(short, MAX_SENTENCE_CHARS) if len(short) > MAX_SENTENCE_CHARS else [short]
            found.update(dict.fromkeys(piece for piece in pieces if _WORD.search(piece)))
    return tuple(found)


def _printable(line: str) -> str:
    """A line without what cannot be seen; lone surrogates, which spaCy could not read, are such."""
    return line if line.isprintable() else "".join(filter(str.isprintable, line))


def _elements(sentence: str) -> Sequence[str]:
    """The elements of "car, traffic light, dog"; a sentence that is no such list as it is."""
    parts = sentence.split(",")
    is_list = all(len(part.split()) <= _MAX_LIST_WORDS for part in parts)
    return parts if is_list and _NOT.isdisjoint(_WORD.findall(sentence)) else [sentence]


@lru_cache(maxsize=1 << 18)
def lemmas(sentence: str) -> frozenset[str]:
    """The words of a sentence, each as the lemma that it would have as a noun."""
    return frozenset(map(noun_lemma, _WORD.findall(sentence)))


def _table(name: str) -> Any:
    """A table of the lemmatizer, part of speech -> its entries; empty when the model has none."""
    lemmatizer: Any = language().get_pipe("lemmatizer")
    return lemmatizer.lookups.get_table(name, {})


@cache
def nouns() -> frozenset[str]:
    """English nouns that spaCy's lemmatizer knows, without the words that are mostly something else."""
    known = frozenset(_table("lemma_index").get("noun", ()))
    return frozenset(known - language().Defaults.stop_words)


@cache
def _noun_rules() -> tuple[dict[str, str], tuple[tuple[str, str], ...]]:
    exceptions, rules = _table("lemma_exc").get("noun", {}), _table("lemma_rules").get("noun", ())
    return {word: forms[0] for word, forms in exceptions.items()}, tuple((old, new) for old, new in rules)


@lru_cache(maxsize=1 << 16)
def noun_lemma(word: str) -> str:
    """A word in small letters as the singular noun that it may be; whatever its role in a sentence."""
    exceptions, rules = _noun_rules()
    if word in exceptions:
        return exceptions[word]
    for old, new in rules:
        form = word.removesuffix(old) + new
        if word.endswith(old) and form in nouns():
            return form
    return word


def phrases(texts: Iterable[str]) -> dict[str, tuple[Phrase, ...]]:
    """Sentence -> its noun phrases in order; those it denies and the own vehicle are left out."""
    given = list(dict.fromkeys(texts))
    found = {}
    for text, doc in zip(given, language().pipe(given, batch_size=_BATCH), strict=True):
        said = (chunk for chunk in _chunks(doc) if not (_denied(chunk) or _own(chunk)))
        found[text] = tuple(phrase for chunk in said for phrase in _parts(chunk))
    return found


@lru_cache(maxsize=4096)
def topics(text: str) -> tuple[Phrase, ...]:
    """What a label or a description is about: its subject, or what there is; nothing for empty text.

    A group or a piece of something is that something. Without a noun it is the last word.
    """
    for sentence in sentences(text):
        doc = language()(sentence)
        chunks = _chunks(doc)
        if chunks:
            main = _main(doc, {chunk.root.i for chunk in chunks})
            wanted = {main.i, *(token.i for token in main.conjuncts)}
            return tuple(
                phrase for chunk in chunks if chunk.root.i in wanted for phrase in list(_parts(chunk))[:1]
            )
    words = _WORD.findall(text[:MAX_TEXT_CHARS].lower())
    return (Phrase(noun_lemma(words[-1]), words[-1], words[-1]),) if words else ()


def _chunks(doc: "Doc") -> "list[Span]":
    """The noun chunks with a noun, and nouns that spaCy takes for something else ("smoke ahead", a verb)."""
    chunks = [chunk for chunk in doc.noun_chunks if any(map(_is_noun, chunk))]
    covered = {token.i for chunk in chunks for token in chunk}
    start = 0
    for token in doc:
        start = token.i if token.dep_ != "compound" or doc[token.i - 1].dep_ != "compound" else start
        inside = token.dep_ == "compound" and token.i + 1 < len(doc) and token.nbor().dep_ == "compound"
        role = token.dep_ in _NOUN_ROLES and token.pos_ not in {"PRON", "NUM"} and not inside
        if token.i in covered or noun_lemma(token.text) not in nouns():
            continue
        if role or (_is_headline(token) and not covered & set(range(token.i))):
            chunks.append(doc[start : token.i + 1])
    return sorted(chunks, key=lambda chunk: chunk.start)


def _is_headline(token: "Token") -> bool:
    """Whether a word taken for the verb has nothing that does it: "smoke ahead"."""
    is_verb = token.dep_ == "ROOT" and token.pos_ in {"VERB", "ADJ", "ADV", "INTJ"}
    return is_verb and not any(child.dep_ in _SUBJECTS for child in token.children)


def _main(doc: "Doc", heads: Collection[int]) -> "Token":
    """The noun that a sentence is about, of those at these places."""
    root = next(token for token in doc if token.dep_ == "ROOT")
    children = {child.dep_: child for child in reversed(list(root.children)) if child.i in heads}
    by_role = [children[role] for role in ("nsubj", "nsubjpass", "attr", "dobj") if role in children]
    main = root if root.i in heads else by_role[0] if by_role else doc[min(heads)]
    while noun_lemma(main.text) in _PARTS:
        of = (prep for prep in main.children if prep.text == "of")
        inner = next((child for prep in of for child in prep.children if child.i in heads), None)
        if inner is None:
            break
        main = inner
    return main


def _parts(chunk: "Span") -> Iterator[Phrase]:
    """The phrases of a noun chunk: one, or in headlines ("deer crossing road") one on each side of a verb."""
    tokens = [token for token in chunk if token.pos_ not in {"PUNCT", "SPACE"}]
    articles = {token.text for token in tokens if token.pos_ == "DET"}
    if len(tokens) > 2 and articles & {"a", "an"} and _is_many(tokens[-1].text):
        # "A pony runs": after "a" there cannot be many, so it is a verb.
        yield from _phrase(tokens[:-1], tokens[-2])
        return
    part: list[Token] = []
    for place, token in enumerate(tokens):
        a_place = token.text == "crossing" and articles and place == len(tokens) - 1
        if any(map(_is_noun, part)) and _is_gerund(token.text) and not a_place:
            yield from _phrase(part)
            part = []
        else:
            part.append(token)
    yield from _phrase(part)


def _phrase(tokens: Sequence["Token"], last: "Token | None" = None) -> Iterator[Phrase]:
    named = [token.text for token in tokens if token == last or _is_noun(token)]
    named = [word for word in named[:-1] if word not in _COLOURS] + named[-1:]
    words = _WORD.findall(named[-1]) if named else []
    if words:
        head = noun_lemma(words[-1])
        yield Phrase(head, " ".join([*named[:-1], head]), " ".join(token.text for token in tokens))


def _is_noun(token: "Token") -> bool:
    by_role = token.dep_ == "ROOT" or token.dep_ in _NOUN_ROLES
    return token.pos_ in {"NOUN", "PROPN", "X"} or (by_role and token.pos_ not in _NEVER_NOUNS)


def _is_many(word: str) -> bool:
    return word.endswith("s") and (noun_lemma(word) != word or word not in nouns())


def _is_gerund(word: str) -> bool:
    stem = word.removesuffix("ing")
    return stem != word and bool(_VOWEL.search(stem)) and word not in _ING_NOUNS


def _own(chunk: "Span") -> bool:
    """Whether a chunk is the vehicle that carries the camera: "our car", "in front of the vehicle"."""
    head = chunk.root
    if noun_lemma(head.text) not in _OWN:
        return False
    if not _OURS.isdisjoint(token.text for token in chunk):
        return True
    of = head.head
    plain = len(chunk) == 2 and chunk[0].text == "the"
    return plain and of.text == "of" and (of.head.text in _AHEAD_OF or of.nbor(-1).text in _AHEAD_OF)


def _denied(chunk: "Span") -> bool:
    """Whether the sentence says that there is no such thing."""
    doc, end = chunk.doc, chunk.end
    if end + 1 < len(doc) and doc[end].text in {":", "-", "="} and doc[end + 1].text in _NOTHING:
        return True
    if chunk.start and doc[chunk.start - 1].text in {"not", "without", "minus"}:
        return True
    token = chunk.root
    for _ in range(len(doc)):
        before = (child for child in token.children if child.i < token.i)
        if any(child.dep_ in {"det", "preconj", "neg"} and child.text in _NOT for child in before):
            return True
        over = token.head
        if token.dep_ in {"conj", "appos"}:
            if any(child.text in {"but", "except", "only"} for child in over.children) or _is_single(token):
                return False
            token = over
        elif token.dep_ in {"pobj", "pcomp"}:
            if over.text not in _THROUGH or over.head.text in _FREE:
                return over.text in {"without", "minus"} or over.text in _THROUGH
            token = over.head
        else:
            break
    return _denied_by_verb(token)


def _denied_by_verb(token: "Token") -> bool:
    """Whether a noun is what is not there by the verb over it: "I do not see any deer"."""
    over = token.head
    if not any(child.dep_ == "neg" for child in over.children):
        return False
    if token.dep_ in _OBJECTS:
        return not any(child.text in _DEFINITE for child in token.children)
    seen = over.text in _VISIBLE or any(child.text in _VISIBLE for child in over.children)
    return token.dep_ in {"nsubj", "nsubjpass"} and seen


def _is_single(token: "Token") -> bool:
    """Whether a noun has its own article or number: "no cars, a deer" has a deer."""
    return any(child.dep_ in {"det", "nummod", "poss"} and child.text in _SINGLE for child in token.children)
