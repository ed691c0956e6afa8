"""Results in JSON from elsewhere: the paper's scripts, and captions in COCO's form (PAPER, section 4)."""

import ast
import json
import re
import warnings
from typing import Any

from pipeline.parsing import MAX_ANSWER_CHARS, MAX_ITEMS, parse
from pipeline.records import Parse, Prediction
from sitegen import checks
from sitegen.captions import Captions, checked, counted, some
from sitegen.checks import MAX_LIST_ITEMS, Faults, Wrong, show, visible
from sitegen.texts import RepeatedKeys, json_object, json_value, limit_rows

_QUOTED = r"""(?:"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')"""
_FLAT_LIST = re.compile(rf"\[\s*(?:{_QUOTED}\s*(?:,\s*|(?=\])))*\]", re.DOTALL)
_MAX_LITERAL_CHARS = 2**20
_AOS_MEND = 'Write AOS as a list: ["a cat crosses the road", ...].'
_AOS = "AOS, a list of captions"
_ONCE = "each key once"
_SURE = {Parse.JSON, Parse.LITERAL, Parse.LINES}

Item = tuple[str, str]  # label (may be empty), caption


def scripts(data: bytes, faults: Faults) -> Captions:
    """The captions of `{"video_0173": [COS, AOS]}`: the items of AOS, ranked as they stand.

    AOS is a list of texts, or a text that holds one as JSON or Python writes it. Other texts of lists
    (numbered lines, objects, a list cut short) are read as a model's answer would be, with a warning.
    """
    captions = Captions(None)
    value, odd = json_value(data, faults)
    if not isinstance(value, dict):
        expected = 'a JSON object {"video": [COS, AOS], ...}'
        faults.stop(f"a JSON {type(value).__name__}", expected, "Use {...}.")
    pairs = value.pairs if isinstance(value, RepeatedKeys) else value.items()
    loose: list[str] = []
    for row, (key, pair) in enumerate(pairs, start=1):
        limit_rows(max(row, len(captions.predictions)), faults)
        shown = f"'{visible(key)}'"
        video = checked(checks.identifier, key, faults, row, None)
        if video is not None and captions.rows.setdefault(video, row) != row:
            again = f"the key {shown} again (first in row {captions.rows[video]})"
            faults.add(row, None, again, "each video once", "Remove one of the two.")
            continue
        if not isinstance(pair, list) or len(pair) != 2:
            size = f"a list of {len(pair):,}" if isinstance(pair, list) else show(pair)
            faults.add(row, None, f"{size} for {shown}", "a list of two, [COS, AOS]", "Give both texts.")
            continue
        try:
            items, is_loose = _items(pair[1])
        except Wrong as wrong:
            faults.add(row, "AOS", f"{wrong.found} for {shown}", wrong.expected, wrong.mend)
            continue
        if is_loose:
            loose.append(shown)
        for rank, (label, text) in enumerate(items, start=1):
            caption = checked(checks.description, text, faults, row, "AOS")
            if caption is not None:
                captions.predictions.append(Prediction(video or "", rank, caption, label or None))
    _refuse_numbers(odd, faults)
    if loose:
        said = counted(
            len(loose), "AOS is no plain list of texts and was", "AOS are no plain lists of texts and were"
        )
        captions.warnings.append(f"{said} read as a model's answer: {some(loose)}.")
    return captions


def _items(aos: Any) -> tuple[list[Item], bool]:
    """The items of an AOS, and whether it was no plain list. Raises `Wrong`."""
    if isinstance(aos, str):
        plain = _plain_list(aos)
        answer = aos
    elif isinstance(aos, list):
        plain = aos
        answer = json.dumps(aos)
    else:
        raise Wrong(show(aos), _AOS, _AOS_MEND)
    if plain is not None and all(isinstance(item, str) for item in plain):
        if len(plain) > MAX_LIST_ITEMS:
            raise Wrong(f"{len(plain):,} items", f"at most {MAX_LIST_ITEMS:,}", "Shorten the list.")
        kept = [item for item in plain if item.strip()]
        nothing = len(kept) == 1 and parse(answer[:MAX_ANSWER_CHARS])[1] is Parse.EMPTY
        return ([], True) if nothing else ([("", item) for item in kept], False)
    if isinstance(aos, list) and any(isinstance(item, RepeatedKeys) for item in aos):
        raise Wrong("an object that gives a key twice", _ONCE, "Remove one of the two.")
    if len(answer) > MAX_ANSWER_CHARS:
        found = f"no plain list of texts, but {len(answer):,} characters"
        raise Wrong(found, _AOS, _AOS_MEND)
    items, how = parse(answer)
    if how is Parse.EMPTY:
        return [], True
    if how not in _SURE or len(items) == MAX_ITEMS:
        raise Wrong(f"no list in {show(aos)}", _AOS, _AOS_MEND)
    return [(item.label, item.description or item.label) for item in items], True


def _plain_list(text: str) -> list[Any] | None:
    """A list that a text holds as JSON, or as Python writes a flat list of texts; None for anything else."""
    try:
        value = json.loads(text, object_pairs_hook=json_object)
        return value if isinstance(value, list) else None
    except (ValueError, RecursionError):
        pass
    stripped = text.strip()
    if len(stripped) > _MAX_LITERAL_CHARS or not _FLAT_LIST.fullmatch(stripped):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "invalid escape sequence" in what a model wrote
            value = ast.literal_eval(stripped)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return None
    return value if isinstance(value, list) else None


def coco(data: bytes, faults: Faults) -> Captions:
    """The captions of `[{"image_id": ..., "caption": ...}]`; those of one id are ranked as they stand."""
    captions = Captions("image_id")
    expected = 'a JSON list [{"image_id": ..., "caption": ...}, ...]'
    value, odd = json_value(data, faults)
    if not isinstance(value, list):
        kind = dict if isinstance(value, dict) else type(value)
        faults.stop(f"a JSON {kind.__name__}", expected, "Use [...].")
    limit_rows(len(value), faults)
    ranks: dict[str, int] = {}
    others: dict[str, None] = {}
    for row, item in enumerate(value, start=1):
        if not isinstance(item, dict):
            faults.add(
                row, None, f"a JSON {type(item).__name__}", 'an object {"image_id": ...}', "Use {...}."
            )
            continue
        if isinstance(item, RepeatedKeys):
            faults.add(row, None, item.words, _ONCE, "Remove one of the two.")
            continue
        others.update(dict.fromkeys(item.keys() - {"image_id", "caption"}))
        video = checked(_image_id, item.get("image_id"), faults, row, "image_id")
        caption = checked(checks.description, item.get("caption"), faults, row, "caption")
        if video is None:
            continue
        captions.rows.setdefault(video, row)
        if caption is not None:
            ranks[video] = ranks.get(video, 0) + 1
            captions.predictions.append(Prediction(video, ranks[video], caption))
    _refuse_numbers(odd, faults)
    if others:
        captions.warnings.append(
            f"Ignored unknown columns: {some([visible(name) for name in sorted(others)])}."
        )
    return captions


def _image_id(value: object) -> str:
    return checks.identifier(value, "an image id, the video's")


def _refuse_numbers(odd: tuple[str, ...], faults: Faults) -> None:
    """A fault for `NaN` and the like where no cell has told it already."""
    if odd and not faults.kept:
        found = f"{', '.join(sorted(set(odd)))}, which is no JSON"
        faults.add(None, None, found, "numbers that JSON knows", "Leave the value out, or write null.")
