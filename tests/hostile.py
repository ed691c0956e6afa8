"""The hostile corpus: hundreds of files that try to crash, hang, fill, escape or fool the readers.

Every case is made from fixed seeds. Some link to special files of the system, which are only read.
"""

from tests import hostile_binary, hostile_json, hostile_parquet, hostile_text
from tests.hostile_case import Case


def corpus() -> list[Case]:
    """Every case, by name."""
    parts = (hostile_binary, hostile_json, hostile_parquet, hostile_text)
    return sorted((case for part in parts for case in part.cases()), key=lambda case: case.name)
