"""The site's folder: only what changed is written, and a killed build harms neither site nor work done."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.files import write_bytes
from sitegen.manifest import MANIFEST
from sitegen.output import BLANK, STAGED, Output, open_output, stamped, tree_sha256

Made = dict[str, bytes]
NOTHING: Callable[[], bytes] = dict  # type: ignore[assignment]  # calling it gives no page


def page(text: str) -> bytes:
    """A page with an empty place for the hash."""
    return f"<p>{text}</p><code ".encode() + BLANK


def put(folder: Path, files: Made, inputs: str = "") -> Output:
    """A whole build of plain files and, by their ending, pages."""
    output = open_output(folder)
    for path, data in files.items():
        if path.endswith(".html"):
            output.add_page(path, "", lambda data=data: data)  # type: ignore[misc]
        else:
            output.add(path, data)
    output.finish(output.stamp(), {}, inputs, {})
    return output


def contents(folder: Path) -> Made:
    """Path -> content of all but the manifest."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != MANIFEST)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


BEFORE = {"a.css": b"1", "data/b.js": b"2", "data/old/c.js": b"3", "p.html": page("p"), "q.html": page("q")}
AFTER = {"a.css": b"1", "data/b.js": b"22", "new/d.js": b"4", "p.html": page("p"), "r.html": page("r")}


def test_a_build_by_hand(tmp_path: Path) -> None:
    made = put(tmp_path, BEFORE)
    digest = tree_sha256(made.files)
    plain = {path: data for path, data in BEFORE.items() if not path.endswith(".html")}
    pages = {path: stamped(data, digest) for path, data in BEFORE.items() if path.endswith(".html")}
    assert contents(tmp_path) == plain | pages
    assert (made.written, made.unchanged, made.removed) == (5, 0, 0)
    again = put(tmp_path, BEFORE)
    assert (again.written, again.unchanged, again.removed) == (0, 5, 0)
    other = put(tmp_path, AFTER)
    # p.html says the same, but holds the new hash of the tree
    assert (other.written, other.unchanged, other.removed) == (4, 1, 2)
    assert not (tmp_path / "data" / "old").exists() and not (tmp_path / STAGED).exists()


def test_a_page_of_the_same_key_is_not_made_again(tmp_path: Path) -> None:
    output = open_output(tmp_path)
    output.add_page("p.html", "key", lambda: page("p"))
    output.finish(output.stamp(), {}, "", {})
    for extra in (b"1", b"2"):  # another hash of the tree each time
        output = open_output(tmp_path)
        output.add("a.css", extra)
        output.add_page("p.html", "key", NOTHING)
        digest = output.stamp()
        output.finish(digest, {}, "", {})
        assert (tmp_path / "p.html").read_bytes() == stamped(page("p"), digest)
    (tmp_path / "p.html").write_bytes(b"edited")
    output = open_output(tmp_path)
    output.add_page("p.html", "key", lambda: page("p"))
    output.finish(output.stamp(), {}, "", {})
    assert b"<p>p</p>" in (tmp_path / "p.html").read_bytes()


def test_all_is_kept_only_while_inputs_and_files_are_the_same(tmp_path: Path) -> None:
    put(tmp_path, BEFORE, "i")
    output = open_output(tmp_path)
    assert not output.keep_all("j") and not output.keep_all("") and output.keep_all("i")
    assert set(output.files) == set(BEFORE)
    for path in ("a.css", "p.html"):
        (tmp_path / path).write_bytes((tmp_path / path).read_bytes()[:-1] + b"?")
        assert not open_output(tmp_path).keep_all("i"), "an edit of the same size"
        put(tmp_path, BEFORE, "i")
        assert open_output(tmp_path).keep_all("i")
        (tmp_path / path).unlink()
        assert not open_output(tmp_path).keep_all("i")
        put(tmp_path, BEFORE, "i")


def test_a_copied_site_is_looked_into_once(tmp_path: Path) -> None:
    put(tmp_path, BEFORE, "i")
    for path in BEFORE:
        os.utime(tmp_path / path)
    time.sleep(0.02)  # a file system's clock ticks a few times in this
    assert put(tmp_path, BEFORE, "i").written == 0
    output = open_output(tmp_path)
    before, there = output.before, output.there
    assert all(before.is_untouched(there[path], size) for path, (_, size) in before.files.items())


def test_a_build_that_fails_leaves_the_site(tmp_path: Path) -> None:
    put(tmp_path, BEFORE)
    before = contents(tmp_path)
    output = open_output(tmp_path)
    output.add("data/b.js", b"other")
    output.add_page("p.html", "", lambda: page("other"))
    output.stamp()
    left = contents(tmp_path)
    assert {path: data for path, data in left.items() if not path.startswith(STAGED)} == before
    put(tmp_path, BEFORE)
    assert contents(tmp_path) == before


def test_pictures_of_a_killed_build_are_taken_over(tmp_path: Path) -> None:
    output = open_output(tmp_path)
    output.add_all([("media/v/1.webp", b"1"), ("media/v/2.webp", b"2")])
    output.note("v", {"files": dict(output.files)})
    next_build = open_output(tmp_path)
    noted = next_build.noted("v")
    assert next_build.kept(noted["files"]) and next_build.noted("w") is None
    next_build.finish(next_build.stamp(), {}, "", {})
    assert contents(tmp_path) == {"media/v/1.webp": b"1", "media/v/2.webp": b"2"}
    damaged = open_output(tmp_path / "other")
    damaged.add("media/v/1.webp", b"1")
    damaged.note("v", {"files": dict(damaged.files)})
    (tmp_path / "other" / STAGED / "site" / "media" / "v" / "1.webp").write_bytes(b"?")
    assert not open_output(tmp_path / "other").kept(damaged.files)


@pytest.mark.parametrize("moves", range(7))
def test_a_build_killed_while_it_moves_files_is_carried_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moves: int
) -> None:
    put(tmp_path / "fresh", AFTER)
    site = tmp_path / "site"
    put(site, BEFORE)
    done = 0

    class Killed(BaseException):
        pass

    def counted(real: Callable[..., None]) -> Callable[..., None]:
        def act(*arguments: object, **more: object) -> None:
            nonlocal done
            if done == moves:
                raise Killed
            done += 1
            real(*arguments, **more)

        return act

    with monkeypatch.context() as patched:
        # What changes the site, once the list is written: moves, removals and, last, the manifest.
        patched.setattr(Path, "unlink", counted(Path.unlink))

        def write(path: Path, data: bytes) -> None:
            write_bytes(path, data)
            patched.setattr(Path, "replace", counted(Path.replace))

        patched.setattr("sitegen.output.write_bytes", write)
        with pytest.raises(Killed):
            put(site, AFTER)
    open_output(site)
    assert contents(site) == contents(tmp_path / "fresh")
    assert put(site, AFTER).written == 0


ENDLESS = """
import sys
from pathlib import Path
from tests.test_output import put, page
for turn in range(1000):
    files = {f"f{n}.js": str(turn).encode() for n in range(12)}
    put(Path(sys.argv[1]), files | {f"p{n}.html": page(str(turn)) for n in range(12)})
    print(turn, flush=True)
"""


@pytest.mark.parametrize("delay_s", [0.002, 0.011, 0.03, 0.07])
def test_a_kill_at_any_time_leaves_one_build_whole(tmp_path: Path, delay_s: float) -> None:
    root = Path(__file__).parent.parent
    with subprocess.Popen(
        [sys.executable, "-c", ENDLESS, str(tmp_path)], cwd=root, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout and process.stdout.readline() == "0\n"
        time.sleep(delay_s)
        process.send_signal(signal.SIGKILL)
    open_output(tmp_path)
    found = {data for path, data in contents(tmp_path).items() if path.startswith("f")}
    assert len(found) == 1, "files of two builds"


def test_a_page_is_kept_or_put(tmp_path: Path) -> None:
    first = open_output(tmp_path)
    assert not first.keep_page("a.html", "key")
    first.put_page("a.html", "key", page("a"))
    first.finish(first.stamp(), {}, "", {})
    time.sleep(0.01)
    again = open_output(tmp_path)
    assert not again.keep_page("a.html", "other") and not again.keep_page("a.html", "") and not again.files
    assert again.keep_page("a.html", "key") and again.pages == {"a.html": "key"}
    with pytest.raises(ValueError, match="twice"):
        again.put_page("a.html", "key", page("a"))
    (tmp_path / "a.html").write_bytes(b"<p>changed</p>")
    assert not open_output(tmp_path).keep_page("a.html", "key")
