"""An official NAFNet checkpoint (.pth) to an ONNX file for `coooler data restore`; needs PyTorch.

python -m pipeline.data.export_nafnet CHECKPOINT.pth OUT.onnx
"""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.nafnet import TiledNetwork
from pipeline.data.nafnet_graph import nafnet_onnx
from pipeline.errors import CooolerError, InputError, ModelMissingError
from pipeline.files import replacing, sha256_of


def checkpoint_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """The weights in a checkpoint, by name: a state dict, or one under `params`, as BasicSR saves it.

    Read without running what a pickle may hold. Raises ModelMissingError without PyTorch and InputError
    when the file is no such checkpoint.
    """
    try:
        torch: Any = import_module("torch")
    except ImportError as error:
        raise ModelMissingError(
            "found no PyTorch; expected the package `torch`: pip install torch"
        ) from error
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a NAFNet checkpoint.")
    try:
        loaded: Any = torch.load(str(path), map_location="cpu", weights_only=True)
    except Exception as error:  # whatever the unpickler meets
        raise InputError(
            f"{path}: found a file that does not load as weights alone ({type(error).__name__}); expected a "
            "checkpoint of tensors. Nothing else in it is run."
        ) from error
    for key in ("params_ema", "params", "state_dict"):
        if isinstance(loaded, dict) and isinstance(loaded.get(key), dict):
            loaded = loaded[key]
            break
    if not isinstance(loaded, dict) or not all(isinstance(value, torch.Tensor) for value in loaded.values()):
        raise InputError(f"{path}: found no table of weights; expected a NAFNet checkpoint.")
    return {
        str(name).removeprefix("module."): value.float().numpy().astype(np.float32)
        for name, value in sorted(loaded.items())
    }


def _try(network: Path, checkpoint: str) -> None:
    try:
        TiledNetwork(network)
    except CooolerError as error:
        raise InputError(
            f"{checkpoint}: found weights that do not fit together; expected NAFNet's."
        ) from error


def main(arguments: list[str]) -> int:
    """Run the export; exit codes as the commands have them."""
    if len(arguments) != 2:
        sys.stderr.write("usage: python -m pipeline.data.export_nafnet CHECKPOINT.pth OUT.onnx\n")
        return 2
    try:
        data = nafnet_onnx(checkpoint_weights(Path(arguments[0])), arguments[0])
        with replacing(Path(arguments[1])) as temporary:
            temporary.write_bytes(data)
            _try(temporary, arguments[0])
    except CooolerError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    sys.stdout.write(f"{arguments[1]} {len(data):,} bytes, sha256 {sha256_of(data)}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
