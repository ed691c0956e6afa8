"""What is odd about the descriptions and labels of a truth."""

import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence

from pipeline.records import TruthHazard
from sitegen.data_figures import label_figures, label_key, words_of
from sitegen.data_findings import CheckInput, Finding, Severity, some
from sitegen.words import visible

MIN_WORDS = 3
MAX_WORDS = 90  # about 128 word pieces, what some embedders read at most
ONE_LABEL = 0.5  # share of hazards from which on a label is said to rule
ALIKE = 0.95  # cosine from which on two descriptions say nearly the same


def word_findings(given: CheckInput) -> Iterator[Finding]:
    """Findings about descriptions."""
    hazards = [row for row in given.truth if not row.is_no_hazard]
    counts = {row.description: len(words_of(row.description)) for row in hazards}
    short = [row for row in hazards if counts[row.description] < MIN_WORDS]
    long = [row for row in hazards if counts[row.description] > MAX_WORDS]
    yield from _rows(
        "short description",
        short,
        f"with fewer than {MIN_WORDS} words",
        "Say what the hazard is and what it does, in a sentence.",
    )
    yield from _rows(
        "long description",
        long,
        f"with more than {MAX_WORDS} words, which an embedder may cut off",
        "Shorten them to a sentence.",
    )
    groups: dict[str, list[TruthHazard]] = {}
    for row in hazards:
        groups.setdefault(" ".join(words_of(row.description)), []).append(row)
    for rows in groups.values():
        if len(rows) > 1:
            where = tuple(sorted({row.video_id for row in rows}))
            message = f"{len(rows)} hazards have one description: “{visible(rows[0].description)}”."
            mend = "Say what tells them apart."
            yield Finding(Severity.WARNING, "same description", where, message, mend)
    for first, second, cosine in given.alike:
        message = f"Descriptions in {first} and {second} say nearly the same (cosine {cosine:.2f})."
        where = tuple(sorted({first, second}))
        yield Finding(Severity.NOTE, "similar descriptions", where, message, "Fine if the scenes are alike.")
    yield from _characters(hazards)
    yield from _rows(
        "no sentence", given.verbless, "without a verb", "Say what the hazard does.", Severity.NOTE
    )


def _characters(hazards: Sequence[TruthHazard]) -> Iterator[Finding]:
    unseen = [row for row in hazards if visible(row.description + row.label) != row.description + row.label]
    broken = [row for row in hazards if "\ufffd" in row.description + row.label]
    untidy = [
        row
        for row in hazards
        if not unicodedata.is_normalized("NFC", row.description)
        or row.description != " ".join(row.description.split())
    ]
    yield from _rows("unseen characters", unseen, "with characters that cannot be seen", "Take them out.")
    yield from _rows(
        "broken characters", broken, "with a replacement character", "Read the source with its encoding."
    )
    yield from _rows(
        "untidy text",
        untidy,
        "with double spaces or decomposed letters",
        "Normalise them (NFC, single spaces).",
        Severity.NOTE,
    )
    scripts = {row: _script(row.description) for row in hazards}
    counts = Counter(script for script in scripts.values() if script)
    if len(counts) > 1:
        usual = min(counts, key=lambda name: (-counts[name], name))
        other = [row for row in hazards if scripts[row] not in {"", usual}]
        yield from _rows(
            "mixed scripts",
            other,
            f"not, or not all, in {usual.title()} letters",
            "Use one language, and no letters that only look alike.",
        )


def _script(text: str) -> str:
    """The script of a text's letters, `mixed` when there are several, empty without letters."""
    found = {unicodedata.name(char, "?").split()[0] for char in text if char.isalpha()}
    return "" if not found else found.pop() if len(found) == 1 else "mixed"


def label_findings(given: CheckInput) -> Iterator[Finding]:
    """Findings about labels and their balance."""
    hazards = [row for row in given.truth if not row.is_no_hazard]
    figures = label_figures([row.label for row in hazards])
    unlabelled = [row for row in hazards if not row.label]
    yield from _rows(
        "no label",
        unlabelled,
        "of a hazard without a label",
        "Name them, for charts and splits.",
        Severity.NOTE,
    )
    if hazards and figures.counts[0][1] > ONE_LABEL * len(hazards) and len(hazards) > 1:
        name, count = figures.counts[0]
        where = tuple(sorted({row.video_id for row in hazards if label_key(row.label) == name}))
        message = f"{count} of {len(hazards)} hazards are “{visible(name)}”: always saying so scores well."
        yield Finding(Severity.WARNING, "one label rules", where, message, "Add other hazards.")
    if figures.singletons:
        single = [name for name, count in figures.counts if count == 1]
        where = tuple(sorted({row.video_id for row in hazards if label_key(row.label) in single}))
        message = f"{len(single)} labels occur once: {some([visible(name) for name in sorted(single)])}."
        mend = "They cannot be in two parts of a split."
        yield Finding(Severity.NOTE, "labels that occur once", where, message, mend)
    spelled: dict[str, set[str]] = {}
    for row in hazards:
        if row.label:
            spelled.setdefault(_singular(label_key(row.label)), set()).add(row.label)
    for names in (sorted(found) for _, found in sorted(spelled.items()) if len(found) > 1):
        where = tuple(sorted({row.video_id for row in hazards if row.label in names}))
        message = f"One label in {len(names)} spellings: {some([visible(name) for name in names])}."
        yield Finding(Severity.WARNING, "label spellings", where, message, "Choose one.")


def _singular(label: str) -> str:
    for ending, instead in (("ies", "y"), ("sses", "ss"), ("ches", "ch"), ("xes", "x"), ("s", "")):
        if label.endswith(ending) and not label.endswith("ss") and len(label) > len(ending) + 2:
            return label.removesuffix(ending) + instead
    return label


def _rows(
    kind: str,
    rows: Sequence[TruthHazard],
    message: str,
    mend: str,
    severity: Severity = Severity.WARNING,
) -> Iterator[Finding]:
    if rows:
        where = tuple(sorted({row.video_id for row in rows}))
        count = f"{len(rows)} descriptions" if len(rows) != 1 else "1 description"
        yield Finding(severity, kind, where, f"{count} {message}: {some(where)}.", mend)
