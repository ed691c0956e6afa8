"""The upload server against requests that are wrong, hostile, too large, too slow or too many."""

import json
import socket
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from pipeline.benchmark import open_benchmark
from sitegen import intake_server
from sitegen.intake_pages import upload_page
from sitegen.rendering import find_templates
from tests.intake_process import CSV, TOKEN, Answer, Server, multipart, running, small_benchmark

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="stops by signals")


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with running(small_benchmark(tmp_path_factory.mktemp("strict") / "b"), "strict") as server:
        yield server


def test_the_site_is_served_and_nothing_else(strict: Server) -> None:
    assert strict.get("/") == "<h1>Board</h1>"
    status, headers, body = strict.ask("GET", "/clip.mp4", headers={"Range": "bytes=10-19"})
    assert status == 206 and body == bytes(range(10, 20))
    assert headers["content-range"] == "bytes 10-19/256" and headers["content-type"] == "video/mp4"
    status, headers, body = strict.ask("HEAD", "/clip.mp4")
    assert (status, headers["content-length"], body) == (200, "256", b"")
    status, _, body = strict.ask("GET", "/clip.mp4", headers={"If-None-Match": headers["etag"]})
    assert (status, body) == (304, b"")
    assert strict.ask("GET", "/clip.mp4", headers={"Range": "bytes=900-"})[0] == 416
    for path in (
        "/.hidden.json",
        "/../truth.csv",
        "/%2e%2e/truth.csv",
        "/..%2ftruth.csv",
        "/..%5ctruth.csv",
        "//etc/passwd",
        "/%00",
        "/%ff",
        "/upload/../../truth.csv",
        "/upload/..%2f..%2ftruth.csv",
        "/api/uploads/..%2f..%2fcoooler.toml",
        "/nothing.html",
        f"/upload/{'x' * 22}",
    ):
        assert strict.ask("GET", path)[0] == 404, path
    assert strict.ask("DELETE", "/index.html")[0] == 405
    assert json.loads(strict.get("/api/health"))["status"] == "ok"


def test_the_form_has_its_looks_before_a_site_is_built(strict: Server) -> None:
    for name, kind in (("site.css", "text/css"), ("theme.js", "text/javascript")):
        status, headers, body = strict.ask("GET", f"/assets/{name}")
        assert status == 200 and headers["content-type"].startswith(kind)
        assert body == (find_templates() / "assets" / name).read_bytes()
    for path in (
        "/assets/../base.html",
        "/assets/%2e%2e/base.html",
        "/base.html",
        "/assets",
        "/assets/none.css",
    ):
        assert strict.ask("GET", path)[0] == 404, path


def test_with_a_hidden_truth_the_menu_leads_to_no_page_that_is_not_made(tmp_path: Path) -> None:
    folder = small_benchmark(tmp_path / "b")
    for hidden in (False, True):
        (folder / "coooler.toml").write_text(f'name = "Small"\nhide_truth = {str(hidden).lower()}\n')
        page = upload_page(open_benchmark(folder), folder / "site", {}, "", False, 1_000).decode()
        assert ("failures.html" in page, "compare.html" in page) == (not hidden, not hidden)
        assert "videos.html" in page


def from_(number: int, **more: str) -> dict[str, str]:
    """Headers of a visitor whose address a proxy wrote down, with the token."""
    return {"X-Forwarded-For": f"198.51.100.{number}", "Authorization": f"Bearer {TOKEN}", **more}


def test_a_token_is_asked_for(strict: Server) -> None:
    wrong = {"X-Forwarded-For": "198.51.100.1", "Authorization": "Bearer guess"}
    assert strict.post(headers=wrong, file=b"x")[0] == 401
    assert strict.ask("POST", "/api/uploads", b"x", wrong)[0] == 401
    assert strict.post("/upload", {"X-Forwarded-For": "198.51.100.2"}, file=b"x")[0] == 401
    visitor = {"X-Forwarded-For": "198.51.100.3"}
    assert strict.post("/upload", visitor, token="guess", file=b"x")[0] == 401
    assert strict.post("/upload", visitor, file=b"x", token=TOKEN)[0] == 401  # too late
    status, _, body = strict.post("/upload", visitor, token=TOKEN, file=CSV.encode())
    assert status == 303 and TOKEN.encode() not in body
    assert b'name="token"' in strict.ask("GET", "/upload")[2]


def test_sizes_are_bounded_whatever_the_head_says(strict: Server) -> None:
    status, headers, body = strict.post(headers=from_(10), file=b"x" * 10_001)
    assert status == 413 and "at most" in json.loads(body)["error"] and headers["connection"] == "close"
    assert strict.post(headers=from_(10), file=b"x" * 200_000)[0] == 413
    chunks = b"".join(b"4000\r\n" + b"x" * 0x4000 + b"\r\n" for _ in range(8)) + b"0\r\n\r\n"
    head = "POST /api/uploads HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n"
    assert talk(strict, head, from_(11), chunks).startswith(b"HTTP/1.1 413 ")
    head = "POST /api/uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n"
    assert talk(strict, head + "Expect: 100-continue\r\n", from_(11), b"").startswith(b"HTTP/1.1 413 ")
    assert strict.post(headers=from_(12), name="n" * 81, file=b"x")[0] == 400


def talk(server: Server, head: str, headers: Mapping[str, str], body: bytes, wait: float = 10.0) -> bytes:
    """The answer to bytes as they are."""
    lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    with socket.create_connection(("127.0.0.1", server.port), timeout=wait) as connection:
        connection.sendall(f"{head}{lines}\r\n".encode() + body)
        answer = b""
        while piece := connection.recv(65_536):
            answer += piece
        return answer


def test_slow_senders_are_dropped(strict: Server) -> None:
    head = "POST /api/uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n"
    assert talk(strict, head, from_(20), b"half").startswith(b"HTTP/1.1 408 ")
    with socket.create_connection(("127.0.0.1", strict.port), timeout=10) as connection:
        connection.sendall(b"POST /api/uploads HTTP/1.1\r\nHost:")
        assert connection.recv(100) == b""  # closed, long before a head is complete
    assert not list((strict.folder / intake_server.QUEUE).glob(".new-*"))


def test_rates_are_bounded(strict: Server) -> None:
    answers = [strict.post(headers=from_(30), kind="check", file=b"x") for _ in range(5)]
    assert [status for status, _, _ in answers] == [202, 202, 202, 429, 429]
    assert 0 < int(answers[-1][1]["retry-after"]) <= 60
    assert strict.post(headers=from_(31), kind="check", file=b"x")[0] == 202


@pytest.mark.parametrize(
    ("number", "body", "kind"),
    [
        (40, b"", "multipart/form-data; boundary=edge"),
        (41, b"no form at all", "multipart/form-data; boundary=edge"),
        (42, b'--edge\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\nhalf', "x=edge"),
        (43, b"--edge\r\n\r\nno name\r\n--edge--\r\n", "boundary=edge"),
        (
            44,
            b'--edge\r\nContent-Disposition: form-data; name="evil"\r\n\r\nx\r\n--edge--\r\n',
            "boundary=edge",
        ),
        (
            45,
            b'--edge\r\nContent-Disposition: form-data; name="name"\r\n\r\n\xff\r\n--edge--\r\n',
            "boundary=edge",
        ),
        (46, b"--edge\r\nX: " + b"y" * 5_000 + b"\r\n\r\nx\r\n--edge--\r\n", "boundary=edge"),
        (47, multipart({"name": "a", "file": b""})[1].replace(b"given.csv", b""), "boundary=edge"),
        (
            48,
            multipart({"file": b"x"})[1].replace(b"--edge--", b"") + multipart({"file": b"y"})[1],
            "boundary=edge",
        ),
        (49, multipart({"kind": "delete", "file": b"x"})[1], "boundary=edge"),
        (50, multipart({"format": "exe", "file": b"x"})[1], "boundary=edge"),
    ],
)
def test_bad_forms_are_refused(strict: Server, number: int, body: bytes, kind: str) -> None:
    kind = kind if kind.startswith("multipart") else f"multipart/form-data; {kind}"
    status, _, answer = strict.ask("POST", "/api/uploads", body, from_(number, **{"Content-Type": kind}))
    assert status in {400, 415} and json.loads(answer)["error"]


def test_a_bare_body_has_its_fields_in_the_query(strict: Server) -> None:
    path = "/api/uploads?kind=submit&name=Bare&file_name=a%2Fb.csv"
    status, _, body = strict.ask("POST", path, CSV.encode(), from_(60))
    assert status == 202
    told = strict.done(json.loads(body)["id"])
    assert (told["state"], told["name"], told["file_name"]) == ("accepted", "Bare", "a/b.csv")
    for query in ("token=x", "name=a&name=b", f"name={'n' * 81}"):
        assert strict.ask("POST", f"/api/uploads?{query}", b"x", from_(61))[0] == 400


def test_a_key_makes_a_retry_harmless(strict: Server) -> None:
    def sent(content: bytes) -> Answer:
        return strict.post(headers=from_(62, **{"Idempotency-Key": "one"}), kind="check", file=content)

    first, again, other = sent(b"x"), sent(b"x"), sent(b"y")
    assert json.loads(first[2]) == json.loads(again[2]) and first[0] == 202
    assert other[0] == 400 and "Idempotency-Key" in json.loads(other[2])["error"]


@pytest.mark.parametrize("headers", [{"Origin": "https://evil.example"}, {"Sec-Fetch-Site": "cross-site"}])
@pytest.mark.parametrize("path", ["/upload", "/api/uploads"])
def test_other_sites_cannot_post(strict: Server, path: str, headers: dict[str, str]) -> None:
    assert strict.post(path, from_(63, **headers), file=b"x")[0] == 403
