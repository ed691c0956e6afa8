"""The plain methods of restoring, and the boxes that a person gives."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.data.denoise import BLURRED, SHARP, NonLocalMeans, UnsharpMask, noise_sigma, sharpness
from pipeline.data.restore_boxes import read_watermark_boxes
from pipeline.errors import FaultsError, InputError

HEADER = "video_id,x1_px,y1_px,x2_px,y2_px\n"


@pytest.mark.parametrize("sigma", [3.0, 8.0, 20.0])
def test_noise_is_estimated(sigma: float) -> None:
    chance = np.random.default_rng(0)
    grey = 128 + np.repeat(chance.normal(0, sigma, (120, 160, 1)), 3, axis=2)
    picture = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    assert noise_sigma([picture]) == pytest.approx(sigma, rel=0.1)


def test_pictures_without_noise_are_quiet() -> None:
    assert noise_sigma([np.full((9, 9, 3), 77, np.uint8)]) == 0
    assert noise_sigma([]) == noise_sigma([np.zeros((1, 1, 3), np.uint8)]) == 0


def test_a_quiet_clip_is_not_denoised_and_a_noisy_one_gets_quieter() -> None:
    chance = np.random.default_rng(1)
    noisy = np.clip(np.rint(128 + chance.normal(0, 10, (60, 80, 3))), 0, 255).astype(np.uint8)
    assert NonLocalMeans(0.5)(noisy) is noisy
    assert NonLocalMeans(0.5).settings["h"] == 0 and "left as it is" in NonLocalMeans(0.5).name
    assert noise_sigma([NonLocalMeans(10.0)(noisy)]) < noise_sigma([noisy]) / 2


def test_the_unsharp_mask_leaves_flat_pictures_and_brings_blurred_edges_nearer() -> None:
    flat = np.full((40, 50, 3), 99, np.uint8)
    np.testing.assert_array_equal(UnsharpMask(BLURRED)(flat), flat)
    edge = flat.copy()
    edge[:, 25:] = 150
    blurred = np.asarray(cv2.GaussianBlur(edge, (0, 0), 1.0), np.uint8)
    assert (
        np.square(UnsharpMask(BLURRED)(blurred) - edge.astype(float)).mean()
        < np.square(blurred - edge.astype(float)).mean()
    )


def test_a_sharp_clip_is_left_as_it_is_and_a_blurred_one_sharpened() -> None:
    """Rectangles of many greys: the edges tell the blur, and the more of it, the stronger the mask."""
    chance = np.random.default_rng(2)
    small = chance.integers(0, 256, (12, 16, 1), np.uint8).repeat(3, axis=2)
    sharp = np.ascontiguousarray(small.repeat(10, axis=0).repeat(10, axis=1))
    found = [sharpness([np.asarray(cv2.GaussianBlur(sharp, (0, 0), px), np.uint8)]) for px in (0.5, 1, 2)]
    assert sharpness([sharp]) > found[0] > found[1] > found[2]
    assert sharpness([sharp]) > SHARP > BLURRED > found[1]
    left = UnsharpMask(sharpness([sharp]))
    assert left(sharp) is sharp and left.settings["amount"] == 0 and "left as it is" in left.name
    amounts = [UnsharpMask(at).amount for at in (SHARP, (SHARP + BLURRED) / 2, BLURRED, 0.0)]
    assert amounts == pytest.approx([0, 0.25, 0.5, 0.5])


def test_pictures_without_edges_are_not_sharpened() -> None:
    assert sharpness([np.full((9, 9, 3), 77, np.uint8)]) == sharpness([]) == 1
    assert sharpness([np.zeros((1, 1, 3), np.uint8)]) == 1


def test_boxes_are_rounded_outwards_and_kept_in_order(tmp_path: Path) -> None:
    path = tmp_path / "boxes.csv"
    path.write_text(f"\ufeff{HEADER}a,1.2,2.0,3.1,4\r\nb,0,0,9,9\r\na,5,5,6,6\r\n", encoding="utf-8")
    assert read_watermark_boxes(path, ["a", "b", "c"]) == {
        "a": ((1, 2, 4, 4), (5, 5, 6, 6)),
        "b": ((0, 0, 9, 9),),
    }


def test_every_wrong_row_is_named(tmp_path: Path) -> None:
    path = tmp_path / "boxes.csv"
    rows = ["a,1,1,2,2", "z,1,1,2,2", "a,3,1,2,2", "a,x,1,2,2", "a,nan,1,2,2", "a,1,1,inf,2", "a,-1,1,2,2"]
    rows += ["a,1,1,2", "a,1,1,2,2,3", "../a,1,1,2,2", "a,1,1,99999,2"]
    path.write_text(HEADER + "\n".join(rows) + "\n")
    with pytest.raises(FaultsError) as raised:
        read_watermark_boxes(path, ["a"])
    assert [fault.row for fault in raised.value.faults] == list(range(2, 12))


@pytest.mark.parametrize(
    "data", [b"", b"video_id,x1\n", b"\xff\xfe\x00", b'video_id,"x1', HEADER.encode() + b'a,"1']
)
def test_files_that_are_no_table_of_boxes(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "boxes.csv"
    path.write_bytes(data)
    with pytest.raises(InputError, match="expected"):
        read_watermark_boxes(path, ["a"])
    with pytest.raises(InputError, match="expected"):
        read_watermark_boxes(tmp_path / "none.csv", ["a"])
