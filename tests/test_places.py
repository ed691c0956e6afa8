"""Files behind paths and URLs behave alike."""

import uuid
from pathlib import Path

import pytest

from pipeline.errors import OutsideError
from pipeline.places import Place, is_url


@pytest.fixture(params=["path", "memory", "file"])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Place:
    """An empty folder of each kind."""
    kinds = {"path": str(tmp_path), "memory": f"memory://{uuid.uuid4()}", "file": f"file://{tmp_path}"}
    return Place(kinds[request.param])


def test_write_read_list_remove(folder: Place) -> None:
    for name in ("b.txt", "a.txt"):
        (folder / name).write(name.encode())
    (folder / "deep" / "c.txt").write(b"c")
    assert folder.is_folder()
    assert [place.name for place in folder.files()] == ["a.txt", "b.txt"]
    assert (folder / "deep" / "c.txt").read() == b"c"
    first = (folder / "a.txt").identity()
    assert first == (folder / "a.txt").identity() != (folder / "b.txt").identity()
    with (folder / "a.txt").as_path() as path:
        assert path.read_bytes() == b"a.txt"
        assert path.name == "a.txt"
    (folder / "a.txt").write(b"longer than before")
    assert (folder / "a.txt").identity() != first
    (folder / "a.txt").remove()
    (folder / "a.txt").remove()
    assert not (folder / "a.txt").is_file()
    with pytest.raises(FileNotFoundError):
        (folder / "a.txt").read()


def test_what_is_a_url() -> None:
    assert is_url("s3://bucket/key")
    assert is_url("memory://x")
    assert not is_url("/plain/path")
    assert not is_url("C://windows")
    assert not is_url("plain")


def test_an_unknown_store_is_an_error_outside() -> None:
    with pytest.raises(OutsideError, match="nonsense://x"):
        Place("nonsense://x").is_file()
