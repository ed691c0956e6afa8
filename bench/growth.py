"""What a board of 20,000 videos costs against ten of 2,000: `python -m bench.growth`, about 20 minutes.

Ten systems with a caption a video; the videos have no clips, since what a clip costs does not depend on
how many there are. Writes bench/growth.md.
"""

from collections.abc import Mapping
from pathlib import Path

from bench.rebuild import MANY, SYSTEMS, board_of, rows_of, scratch
from bench.timing import Measure, report
from pipeline.files import write_text

HERE = Path(__file__).parent
MOST = 20_000
LINEAR = 1.1
STEPS = {
    "score": "scores, vectors cached",
    "full": "full build",
    "nothing": "nothing changed",
    "truth": "one truth row changed",
    "submission": "a submission more",
}
MADE_BY = """Made by `python -m bench.growth`: both sizes in one run, each step measured once."""


def rows_of_growth(many: Mapping[str, float], most: Mapping[str, float]) -> list[Measure]:
    """What ten times the videos cost, in tenths: a row for each step."""
    return [
        Measure(
            f"{MOST:,} videos x {SYSTEMS} systems, no clips: {name}",
            most[what],
            f"{MOST // MANY} times that of {MANY:,}",
            MOST // MANY * many[what],
            f"at most {LINEAR}",
        )
        for what, name in STEPS.items()
    ]


def main() -> None:
    """Measure, print the table and keep it."""
    with scratch() as root:
        many = board_of(root / "many", [], MANY, 1)
        most = board_of(root / "most", [], MOST, 1)
    rows = rows_of(MANY, False, 1, many) + rows_of(MOST, False, 1, most) + rows_of_growth(many, most)
    text = report("Growth", MADE_BY, rows)
    write_text(HERE / "growth.md", text)
    print(text)


if __name__ == "__main__":
    main()
