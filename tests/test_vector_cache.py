"""The cache of vectors: never twice, never wrong, whatever happens to its files."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.errors import OutsideError
from pipeline.files import sha256_of, write_bytes
from pipeline.vector_cache import CachedEmbedder

ROOT = Path(__file__).parent.parent


class Counting:
    """An Embedder whose vectors are made from the text's hash; remembers what it was asked."""

    name = "counting"

    def __init__(self, sha256: str = "ab" * 32) -> None:
        self.sha256 = sha256
        self.asked: list[str] = []

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        self.asked += texts
        if not texts:
            return np.empty((0, 8), np.float32)
        hashes = [bytes.fromhex(sha256_of(text.encode("utf-8", "surrogatepass"))) for text in texts]
        vectors = np.frombuffer(b"".join(hashes), "<u4").reshape(-1, 8).astype(np.float32)
        return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def _segments(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.vec"))


def test_no_text_is_embedded_twice(tmp_path: Path) -> None:
    inner = Counting()
    cached = CachedEmbedder(inner, tmp_path)
    first = cached.embed(["b", "a", "b", ""])
    assert cached.embedded_count == 3 and np.array_equal(first, inner.embed(["b", "a", "b", ""]))
    again = CachedEmbedder(inner, tmp_path)
    assert np.array_equal(again.embed(["b", "a", "b", ""]), first) and again.embedded_count == 0
    assert np.array_equal(again.embed(["a", "new"])[0], first[1]) and again.embedded_count == 1
    cached.embed(["new"])
    assert cached.embedded_count == 3  # another instance wrote it after this one had looked
    assert cached.embed([]).shape == (0, 8)
    other = CachedEmbedder(Counting("cd" * 32), tmp_path)
    other.embed(["a"])
    assert other.embedded_count == 1  # another model's vectors are not taken
    assert (cached.name, cached.sha256) == (inner.name, inner.sha256)


@settings(max_examples=30, deadline=None)
@given(calls=st.lists(st.lists(st.text(max_size=5), max_size=20), max_size=40))
def test_the_cache_is_invisible(calls: list[list[str]], tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("vectors")
    inner = Counting()
    one, other = CachedEmbedder(inner, folder), CachedEmbedder(inner, folder)
    for number, texts in enumerate(calls):
        assert np.array_equal((one, other)[number % 2].embed(texts), Counting().embed(texts))
    distinct = {text for texts in calls for text in texts}
    assert sorted(inner.asked) == sorted(distinct) and one.embedded_count + other.embedded_count == len(
        distinct
    )


def test_many_small_writes_end_in_few_segments(tmp_path: Path) -> None:
    cached = CachedEmbedder(Counting(), tmp_path)
    texts = [f"text {number}" for number in range(300)]
    for text in texts:
        cached.embed([text])
    assert len(_segments(tmp_path)) < 30
    fresh = CachedEmbedder(Counting(), tmp_path)
    assert np.array_equal(fresh.embed(texts), Counting().embed(texts)) and fresh.embedded_count == 0


def test_a_segment_that_another_process_merged_is_not_missed(tmp_path: Path) -> None:
    writer, reader = CachedEmbedder(Counting(), tmp_path), CachedEmbedder(Counting(), tmp_path)
    for number in range(7):
        writer.embed([str(number)])
    reader.embed(["0"])
    for number in range(7, 100):
        writer.embed([str(number)])
    reader.embed([str(number) for number in range(100)])
    assert reader.embedded_count == 0


@pytest.mark.parametrize("damage", ["empty", "cut", "longer", "magic", "sizes", "noise"])
def test_a_damaged_segment_is_made_again(tmp_path: Path, damage: str) -> None:
    texts = [str(number) for number in range(50)]
    wanted = CachedEmbedder(Counting(), tmp_path).embed(texts)
    (path,) = _segments(tmp_path)
    whole = path.read_bytes()
    changed = {
        "empty": b"",
        "cut": whole[:-1],
        "longer": whole + b"\0",
        "magic": b"X" + whole[1:],
        "sizes": whole[:8] + b"\xff" * 8 + whole[16:],
        "noise": b"\x80\x04\x95" * 1000,
    }[damage]
    path.write_bytes(changed)
    cached = CachedEmbedder(Counting(), tmp_path)
    assert np.array_equal(cached.embed(texts), wanted) and cached.embedded_count == 50
    assert CachedEmbedder(Counting(), tmp_path).embed(texts).tobytes() == wanted.tobytes()


def test_a_damaged_row_is_made_again_wherever_the_damage_is(tmp_path: Path) -> None:
    texts = [str(number) for number in range(5)]
    wanted = CachedEmbedder(Counting(), tmp_path / "0").embed(texts)
    (path,) = _segments(tmp_path / "0")
    whole = path.read_bytes()
    for at in range(16, len(whole), 19):
        folder = tmp_path / str(at)
        shutil.copytree(tmp_path / "0", folder)
        _segments(folder)[0].write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        cached = CachedEmbedder(Counting(), folder)
        assert np.array_equal(cached.embed(texts), wanted) and cached.embedded_count >= 1
        mended = CachedEmbedder(Counting(), folder)
        assert np.array_equal(mended.embed(texts), wanted) and mended.embedded_count == 0
        for number in range(100, 120):  # merging leaves the damaged row behind
            mended.embed([str(number)])
        assert np.array_equal(CachedEmbedder(Counting(), folder).embed(texts), wanted)


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutsideError, match="Set COOOLER_CACHE"):
        CachedEmbedder(Counting(), tmp_path / "file").embed(["x"])


def test_a_segment_that_is_merged_away_at_once_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone_at_once(path: Path, data: bytes) -> None:
        write_bytes(path, data)
        path.unlink()

    monkeypatch.setattr("pipeline.vector_cache.write_bytes", gone_at_once)
    cached = CachedEmbedder(Counting(), tmp_path)
    assert np.array_equal(cached.embed(["x"]), Counting().embed(["x"]))
    assert np.array_equal(cached.embed(["x"]), Counting().embed(["x"]))


def test_processes_share_the_cache_without_harm(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; import numpy as np\n"
        "from tests.test_vector_cache import CachedEmbedder, Counting\n"
        "cached = CachedEmbedder(Counting(), Path(sys.argv[1])); start = int(sys.argv[2])\n"
        "for n in range(start, start + 60):\n"
        "    texts = [str(n), str(n * 7 % 50), 'same']\n"
        "    assert np.array_equal(cached.embed(texts), Counting().embed(texts))\n"
    )
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(tmp_path), str(start)], cwd=ROOT, env=dict(os.environ)
        )
        for start in (0, 20, 40)
    ]
    assert [run.wait(120) for run in runs] == [0, 0, 0]
    cached = CachedEmbedder(Counting(), tmp_path)
    cached.embed([*map(str, range(100)), "same"])
    assert cached.embedded_count == 0
    assert not list(tmp_path.rglob("*.tmp"))
