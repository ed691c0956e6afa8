"""Fuzzing of the readers: what one input is, and what must hold of it.

Hypothesis runs it in the tests. With atheris installed, coverage leads the way, for as long as you like:

    python -m tests.fuzz_readers -max_total_time=60 [folder of inputs]
"""

import sys
import tempfile
from pathlib import Path

from pipeline.errors import FaultsError
from sitegen.readers import FORMATS, ReadOptions, read_predictions, read_truth, read_video_map
from tests.hostile_case import TRUTH, is_one_line

_KNOWN = {hazard.video_id for hazard in TRUTH}
_WAYS = ("", *FORMATS)
LONGEST_FAULT = 2_500


def read_or_refuse(path: Path, options: ReadOptions | None = None) -> None:
    """Read predictions, which keep to their contract, or are refused with faults that can be printed."""
    try:
        read = read_predictions(path, TRUTH, options)
    except FaultsError as error:
        hold(error)
        return
    keys = [(prediction.video_id, prediction.rank) for prediction in read.predictions]
    assert keys == sorted(set(keys))
    for prediction in read.predictions:
        assert prediction.video_id in _KNOWN
        assert 1 <= prediction.rank < 2**31
        assert 0 < len(prediction.description) <= 2_000
        prediction.description.encode()
        assert "\0" not in prediction.description
        assert all(0 <= frame < 2**31 for frame in prediction.frame_indices)
    assert read.source_format in FORMATS


def hold(error: FaultsError) -> None:
    """Every fault is one line that can be printed, bounded, and says how to mend it."""
    assert error.faults
    for fault in error.faults:
        assert is_one_line(str(fault))
        assert len(str(fault)) <= LONGEST_FAULT
        assert fault.expected and fault.mend


def one_input(data: bytes, folder: Path) -> None:
    """The first byte says how the rest is read: as predictions in a format, as truth, or as a map of ids."""
    if not data:
        return
    path = folder / "p"
    path.write_bytes(data[1:])
    way = data[0] % (len(_WAYS) + 2)
    if way < len(_WAYS):
        read_or_refuse(path, ReadOptions(source_format=_WAYS[way]))
        return
    try:
        (read_truth if way == len(_WAYS) else read_video_map)(path)
    except FaultsError as error:
        hold(error)


def main() -> None:
    """Run atheris with the arguments of the command line."""
    import atheris  # type: ignore[import-untyped]

    with tempfile.TemporaryDirectory() as folder:
        atheris.instrument_all()
        atheris.Setup(sys.argv, lambda data: one_input(data, Path(folder)))
        atheris.Fuzz()


if __name__ == "__main__":
    main()
