"""Picture-to-picture networks (NAFNet's denoiser and deblurrer) on onnxruntime, in tiles.

NAFNet's channel attention pools over all that the network is given. It was trained on patches of 256 px,
so a tile of that size shows it what it knows; the authors' own remedy for larger pictures, pooling
over windows of about the training size (TLC, Chu et al. 2022), has the same aim. What comes out is
thus not the network's answer for the whole frame at once.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.data.tiles import Picture, Tiling, in_tiles
from pipeline.errors import InputError
from pipeline.files import sha256_of
from pipeline.graphs import open_session, remembered_sha256, require_self_contained
from pipeline.records import RgbImage

MAX_NETWORK_BYTES = (1 << 31) - 1  # one protobuf holds no more
MAX_TILE_PX = 2048
_CHECKS_VERSION = "restore 1"


def network_sha256(path: Path) -> str:
    """SHA-256 of a network that holds all its tensors; checked and hashed once while it stays as it is.

    Raises InputError when it is missing, too large, no ONNX model, or keeps tensors in other files.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected an ONNX network.")
    if not 0 < path.stat().st_size <= MAX_NETWORK_BYTES:
        raise InputError(f"{path}: found {path.stat().st_size:,} bytes; expected 1 to {MAX_NETWORK_BYTES:,}.")

    def check_and_hash() -> str:
        data = path.read_bytes()
        require_self_contained(data, str(path))
        return sha256_of(data)

    return remembered_sha256([path], _CHECKS_VERSION, check_and_hash)


class TiledNetwork:
    """An ONNX network from a picture to a picture, float32 (1, 3, H, W), RGB in [0, 1]."""

    def __init__(self, path: Path, tiling: Tiling | None = None) -> None:
        """Open it on one thread (clips run in parallel, and the sums stay the same), and try it once.

        A network of fixed size gets tiles of that size. Raises InputError when it is none from pictures
        to pictures, OutsideError when onnxruntime refuses it.
        """
        self._path = path
        self._session = open_session(path, threads=1)
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        if len(inputs) != 1 or len(outputs) != 1:
            raise self._wrong(f"{len(inputs)} inputs and {len(outputs)} outputs", "one of each")
        self._takes, self._gives = inputs[0].name, outputs[0].name
        shape: list[Any] = list(inputs[0].shape)
        fixed = [size if type(size) is int else None for size in shape]
        if (
            inputs[0].type != "tensor(float)"
            or outputs[0].type != "tensor(float)"
            or len(fixed) != 4
            or fixed[0] not in (None, 1)
            or fixed[1] not in (None, 3)
        ):
            raise self._wrong(
                f"{inputs[0].type} {shape} to {outputs[0].type}", "tensor(float) (1, 3, H, W) to the same"
            )
        self.tiling = self._fitting(fixed[2], fixed[3], tiling or Tiling())
        self(np.full((16, 16, 3), 128, np.uint8))

    def _fitting(self, height: int | None, width: int | None, tiling: Tiling) -> Tiling:
        """The tiling asked for, with the sides that the graph insists on."""
        if height is None and width is None:
            return tiling
        height_px, width_px = height or tiling.height_px, width or tiling.width_px
        least = tiling.overlap_px + tiling.align_px
        if not all(
            least <= side <= MAX_TILE_PX and side % tiling.align_px == 0 for side in (height_px, width_px)
        ):
            raise self._wrong(
                f"a fixed size of {width_px}x{height_px} px",
                f"any size, or multiples of {tiling.align_px} from {least} to {MAX_TILE_PX}",
            )
        return Tiling(height_px, width_px, tiling.overlap_px, tiling.align_px)

    def _wrong(self, found: str, expected: str) -> InputError:
        return InputError(f"{self._path}: found {found}; expected {expected}. Export the network again.")

    def _tile(self, picture: Picture) -> Picture:
        fed = np.ascontiguousarray(picture.transpose(2, 0, 1)[None])
        try:
            made: Any = self._session.run([self._gives], {self._takes: fed})[0]
        except Exception as error:  # onnxruntime's exceptions share no base but Exception
            raise self._wrong(
                f"that it cannot be run on {picture.shape[1]}x{picture.shape[0]} px ({str(error)[:200]})",
                "a network from pictures to pictures",
            ) from error
        if getattr(made, "shape", None) != fed.shape:
            raise self._wrong(f"an output of shape {getattr(made, 'shape', ())} for {fed.shape}", "the same")
        if not np.isfinite(made).all():
            raise self._wrong("outputs that are not finite", "finite numbers")
        result: Picture = made[0].transpose(1, 2, 0)
        return result

    def __call__(self, rgb: RgbImage) -> RgbImage:
        """A picture (H, W, 3) of any size through the network."""
        found = in_tiles(rgb.astype(np.float32) / np.float32(255), self._tile, self.tiling)
        return np.rint(np.clip(found, 0, 1) * 255).astype(np.uint8)
