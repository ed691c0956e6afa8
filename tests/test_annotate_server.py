"""The annotation server over real HTTP, as a process of its own: who is let in, and what a crash loses."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from sitegen.readers import read_truth
from tests.annotating import FRAMES, Serving, make_folder, post, serving, state

SPOKEN = {"label": "Car", "description": "A car cuts in"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(make_folder(tmp_path_factory.mktemp("annotate") / "roads")) as started:
        yield started
        started.stop()


@pytest.fixture(scope="module")
def cookie(server: Serving) -> str:
    return server.cookie()


def get(server: Serving, cookie: str, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    return server.ask("GET", path, headers={"Cookie": cookie, **headers})


def get_json(server: Serving, cookie: str, path: str) -> Any:
    status, _, body = get(server, cookie, path)
    assert status == 200, body
    return json.loads(body)


def test_the_token_becomes_a_cookie_that_scripts_cannot_read(server: Serving) -> None:
    for path in ("/agreement", "//agreement"):
        status, headers, _ = server.ask("GET", f"{path}?token={server.token}")
        assert (status, headers["location"]) == (303, "/agreement")
    assert {"HttpOnly", "SameSite=strict"} <= set(headers["set-cookie"].split("; "))


@pytest.mark.parametrize(
    "path", ["/", "/?token=wrong", "/video/road_1", "/api/video/road_1?author=ada", "/clip/road_1"]
)
def test_nobody_without_the_token_is_let_in(server: Serving, path: str) -> None:
    for headers in ({}, {"Cookie": "author=ada; annotate-0=x"}):
        status, answered, body = server.ask("GET", path, headers=headers)
        assert status == 403
        assert b"Open the address" in body
        assert "default-src 'none'" in answered["content-security-policy"]


def test_another_name_of_this_computer_is_not_answered(server: Serving, cookie: str) -> None:
    for host in ("evil.example", f"evil.example:{server.port}", "", "127.0.0.1.evil.example"):
        assert get(server, cookie, "/", Host=host)[0] == 403
    assert get(server, cookie, "/", Host=f"localhost:{server.port}")[0] == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_another_sites_page_cannot_write(server: Serving, cookie: str, headers: dict[str, str]) -> None:
    body = json.dumps(state(SPOKEN)).encode()
    headers = {"Cookie": cookie, "Content-Type": "application/json", **headers}
    status, _, answer = server.ask("POST", "/api/video/road_3?author=eve", body, headers)
    assert (status, "error" in json.loads(answer)) == (403, True)
    assert server.ask("POST", "/author", b"author=eve", headers)[0] == 403
    assert not (server.folder / "annotations" / "eve.jsonl").exists()


@pytest.mark.parametrize(
    "path",
    [
        "/clip/..%2fcoooler.toml",
        "/clip/%2e%2e/coooler.toml",
        "/keyframe/road_1/..%2f0.webp",
        "/keyframe/road_1/30.webp",
        "/keyframe/..%2froad_1/0.webp",
        "/static/..%2fbase.html",
        "/static/base.html",
        "/static/%2fetc%2fpasswd",
        "/static/.token",
        "/annotations/ada.jsonl",
        "/video/none",
        "/merge/none",
        "/api/clip/none",
        "/api/video/none?author=ada",
        "/api/none",
        "/video/%00",
        "/%ff",
    ],
)
def test_nothing_else_is_served(server: Serving, cookie: str, path: str) -> None:
    status, headers, body = get(server, cookie, path)
    assert status == 404
    assert headers["content-type"].startswith("application/json" if path.startswith("/api/") else "text/html")
    assert b"name =" not in body


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/api/video/road_1?author=ada", b"{", 400),
        ("/api/video/road_1?author=ada", b"[" * 100_000, 400),
        ("/api/video/road_1?author=ada", b"9" * 5_000, 400),
        ("/api/video/road_1?author=ada", b"null", 400),
        ("/api/video/road_1?author=ada", json.dumps({**state(SPOKEN), "base": -1}).encode(), 400),
        ("/api/video/road_1?author=ada", json.dumps({**state(SPOKEN), "session": 1}).encode(), 400),
        ("/api/video/road_1?author=../ada", json.dumps(state(SPOKEN)).encode(), 400),
        ("/api/video/road_1?author=merged", json.dumps(state(SPOKEN)).encode(), 400),
        ("/api/video/road_1", json.dumps(state(SPOKEN)).encode(), 400),
        ("/api/video/road_9?author=ada", json.dumps(state(SPOKEN)).encode(), 404),
        ("/api/video/road_1?author=ada", b" " * (2**21 + 1), 413),
        ("/author", b"a" * 5_000, 413),
        ("/author", b"author=%00", 400),
        ("/author", b"author=merged", 400),
    ],
)
def test_what_cannot_be_stored_is_refused(
    server: Serving, cookie: str, path: str, body: bytes, status: int
) -> None:
    headers = {"Cookie": cookie, "Content-Type": "application/json"}
    found, _, answer = server.ask("POST", path, body, headers)
    assert found == status
    assert b"Traceback" not in answer
    assert path == "/author" or json.loads(answer)["error"]


def test_a_form_cannot_pass_for_json(server: Serving, cookie: str) -> None:
    body, headers = json.dumps(state(SPOKEN)).encode(), {"Cookie": cookie, "Content-Type": "text/plain"}
    assert server.ask("POST", "/api/video/road_1?author=ada", body, headers)[0] == 400


def test_the_author_is_asked_for_and_kept(server: Serving, cookie: str) -> None:
    assert b'name="author"' in get(server, cookie, "/video/road_1")[2]
    status, headers, _ = server.ask("POST", "/author", b"author=Ada+Lovelace", {"Cookie": cookie})
    assert (status, headers["location"]) == (303, "/")
    kept = headers["set-cookie"].partition(";")[0]
    assert kept == "author=ada-lovelace"
    page = get(server, f"{cookie}; {kept}", "/video/road_1")[2]
    assert b'data-author="ada-lovelace"' in page
    asked = server.ask("POST", "/author", b"author=", {"Cookie": f"{cookie}; {kept}"})
    assert 'author=""' in asked[1]["set-cookie"]


def test_clips_come_in_ranges_and_keyframes_as_pictures(server: Serving, cookie: str) -> None:
    facts = get_json(server, cookie, "/api/clip/road_1")
    assert (facts["frame_count"], facts["width_px"], facts["height_px"], facts["fps_hz"]) == (
        FRAMES,
        160,
        96,
        25,
    )
    assert [track["track_id"] for track in facts["tracks"]] == ["1", "2"]
    assert facts["tracks"][0]["boxes"][2] == [2, 8, 20, 28, 40]
    assert len(facts["keyframes"]) == 25
    status, headers, picture = get(server, cookie, facts["keyframes"][12]["src"])
    assert (status, headers["content-type"]) == (200, "image/webp")
    decoded = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (96, 160, 3)
    clip = (server.folder / "videos" / "road_1.mp4").read_bytes()
    status, headers, part = get(server, cookie, facts["clip"], Range="bytes=10-19")
    assert (status, part, headers["content-range"]) == (206, clip[10:20], f"bytes 10-19/{len(clip)}")
    assert get(server, cookie, facts["clip"])[2] == clip
    assert get_json(server, cookie, "/api/clip/road_3")["tracks"] == []


def test_two_annotators_disagree_and_a_merge_settles_it(server: Serving, cookie: str) -> None:
    assert post(server, cookie, "road_2", "ada", state(SPOKEN))[0] == 200
    assert post(server, cookie, "road_2", "bob", state(no_hazard=True))[0] == 200
    status, answer = post(server, cookie, "road_2", "bob", state(SPOKEN, session="other"))
    assert (status, answer["current"]["revision"], answer["current"]["no_hazard"]) == (409, 1, True)
    assert "road_2" not in {row.video_id for row in read_truth_of(server)}
    both = get_json(server, cookie, "/api/video/road_2?author=ada&merge=1")["others"]
    assert [one["author"] for one in both] == ["ada", "bob"]
    merged = {**state(SPOKEN), "seen": {"ada": 1, "bob": 1}}
    assert post(server, cookie, "road_2", "ada", merged, merge=True)[1]["finished"] is True
    rows = [row for row in read_truth_of(server) if row.video_id == "road_2"]
    assert [row.description for row in rows] == ["A car cuts in"]
    assert b"ada" in get(server, f"{cookie}; author=ada", "/agreement")[2]


def read_truth_of(server: Serving) -> list[Any]:
    path = server.folder / "truth.parquet"
    return read_truth(path) if path.exists() and pq.read_table(path).num_rows else []


def test_a_crash_loses_nothing_that_was_confirmed(tmp_path: Path) -> None:
    folder = make_folder(tmp_path / "roads")
    confirmed: dict[str, int] = {}
    with serving(folder) as server:
        cookie = server.cookie()

        def write(author: str) -> None:
            for sequence in range(1, 10_000):
                said = state({**SPOKEN, "label": str(sequence)}, sequence=sequence)
                try:
                    status, _ = post(server, cookie, "road_1", author, said)
                except OSError:
                    return
                assert status == 200
                confirmed[author] = sequence
                if author == "ada" and sequence >= 12 and "bob" in confirmed:
                    server.process.send_signal(signal.SIGKILL)

        writers = [Thread(target=write, args=(author,)) for author in ("ada", "bob")]
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join(60)
        server.process.wait()
    assert set(confirmed) == {"ada", "bob"}
    with (folder / "annotations" / "ada.jsonl").open("ab") as torn:
        torn.write(b'{"video_id":"road_1","haz')
    with serving(folder, server.port) as again:
        assert again.token == server.token  # open pages go on
        for author, sequence in sorted(confirmed.items()):  # bob last: he goes on below
            stored = get_json(again, cookie, f"/api/video/road_1?author={author}")
            # One more may be on the disk whose confirmation never arrived.
            assert stored["revision"] - sequence in {0, 1}
            assert stored["hazards"][0]["label"] == str(stored["revision"])
        revision = stored["revision"]
        status, told = post(again, cookie, "road_1", "bob", state(no_hazard=True, base=revision, session="t"))
        assert (status, told["revision"]) == (200, revision + 1)
        assert "cut off" in again.log()
        again.stop()
    assert "await a merge (1): road_1" in again.log()


def run(folder: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "sitegen.cli", "data", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def test_wrong_input_is_said_and_nothing_is_written(tmp_path: Path) -> None:
    folder = make_folder(tmp_path / "roads")
    (folder / "truth.parquet").write_bytes(b"mine")
    found = run(folder, "annotate", "--no-open")
    assert (found.returncode, "--replace" in found.stderr) == (1, True)
    assert (folder / "truth.parquet").read_bytes() == b"mine"
    (folder / "truth.parquet").unlink()
    (folder / "annotations").mkdir()
    (folder / "annotations" / "ada.jsonl").write_text("{}\n")
    found = run(folder, "annotate", "--no-open")
    assert (found.returncode, "ada.jsonl, row 1" in found.stderr) == (1, True)
    assert "Traceback" not in found.stderr
    assert not (folder / "truth.parquet").exists()


def test_the_agreement_as_json(server: Serving, cookie: str) -> None:
    for author, description in (("cy", "A car cuts in"), ("di", "A dog")):
        post(server, cookie, "road_1", author, state({"label": "Car", "description": description}))
    found = run(server.folder, "agreement", "--json")
    assert found.returncode == 0, found.stderr
    pairs = {(pair["first"], pair["second"]): pair for pair in json.loads(found.stdout)["pairs"]}
    pair = pairs["cy", "di"]
    assert (pair["n_videos"], pair["verdict"], pair["label"]) == (1, 1.0, 1.0)
    assert -1 <= pair["cosine"] < 0.9
