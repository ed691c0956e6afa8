"""Numbers as the pages print them."""

from dataclasses import dataclass

from sitegen.language import fixed, ngettext, whole


@dataclass(frozen=True, slots=True)
class Score:
    """A number as text, with its share of the full scale and a verdict.

    `share` is in whole percent and `level` in 0 to 10, both of the value clipped to [0, 1];
    `verdict` is `pass`, `fail`, or empty where no threshold applies.
    """

    value: float
    text: str
    share: int
    level: int
    verdict: str = ""


def score(value: float, passed: bool | None = None, digits: int = 4) -> Score:
    """A similarity or mean; `passed` is None where no threshold applies."""
    return _score(value, fixed(value, digits), passed)


def rate(value: float, passed: bool | None = None) -> Score:
    """A share in [0, 1], printed in percent."""
    return _score(value, percent(value), passed)


def _score(value: float, text: str, passed: bool | None) -> Score:
    clipped = min(max(value, 0.0), 1.0)
    verdict = "" if passed is None else "pass" if passed else "fail"
    return Score(value, text, round(clipped * 100), int(clipped * 10 + 1e-9), verdict)


def percent(value: float) -> str:
    """A share in [0, 1] as percent with one digit."""
    return f"{fixed(value * 100, 1)}\u202f%"


def plural(count: int, one: str, many: str) -> str:
    """`3 videos` of `{n} video` and `{n} videos`, in the page's language."""
    return ngettext(one, many, count).format(n=whole(count))


def seconds(value: float) -> str:
    """A time in a clip, to a tenth of a second."""
    return f"{fixed(value, 1)}\u202fs"


def number(value: float) -> str:
    """A coordinate for an SVG attribute: at most one digit after the point."""
    return f"{value:.1f}".removesuffix(".0")
