"""The upload server as a process of its own, and what tests ask of it over real HTTP.

    python -m tests.intake_process FOLDER fast|real|strict

runs one: `fast` stores without scoring, `real` is what the command line runs, `strict` has narrow limits.
"""

import http.client
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any, TypeAlias

from pipeline.benchmark import open_benchmark
from sitegen import asgi, intake_server
from sitegen.about import Sender
from sitegen.intake import Intake
from sitegen.intake_limits import ServerLimits
from sitegen.intake_records import Report, Upload
from sitegen.intake_worker import Worker, make_worker
from sitegen.readers import ReadPredictions, read_predictions
from sitegen.sandbox import Limits
from sitegen.submissions import store

ROOT = Path(__file__).parent.parent
CSV = "video_id,rank,description\nv1,1,A cat crossing the road\n"
TOKEN = "let-me-in"
Answer: TypeAlias = tuple[int, dict[str, str], bytes]


def main(folder: Path, mode: str) -> None:
    """Run a server until a signal."""
    benchmark = open_benchmark(folder)
    site = folder / "site"
    limits = ServerLimits(per_minute=6_000, burst=1_000)
    if mode == "strict":
        asgi._HEAD_SECONDS = 1.5
        limits = ServerLimits(
            max_bytes=10_000, per_minute=1, burst=3, token=TOKEN, trust_proxy=True, idle_seconds=1.5
        )
    with Intake(folder / intake_server.QUEUE) as intake:
        if mode == "real":
            worker = make_worker(benchmark, site, intake, Limits(memory_bytes=900 * 2**20, seconds=30.0))
        else:
            worker = fast_worker(folder / "submissions", intake)
        intake_server.serve_intake(benchmark, site, intake, worker, limits, "127.0.0.1", 0)


def fast_worker(submissions: Path, intake: Intake) -> Worker:
    """It stores and notes in the ledger as the real one does, but scores and builds nothing."""

    def accept(upload: Upload, path: Path, read: ReadPredictions) -> Report:
        place = store(submissions, Sender(upload.details.name, date="2026-01-02"), read, path)
        return Report(slug=place.name)

    return Worker(
        intake,
        read=lambda upload, path: read_predictions(path),
        check=lambda upload, path, read: Report(),
        accept=accept,
        rebuild=lambda: None,
    )


class Server:
    """A running server and what one may ask of it."""

    def __init__(self, folder: Path, mode: str) -> None:
        with (folder / "log").open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.intake_process", str(folder), mode], cwd=ROOT, stderr=log
            )
        self.folder = folder
        until = monotonic() + 60
        while not (found := re.search(r"127\.0\.0\.1:(\d+)/", self.log())):
            assert self.process.poll() is None and monotonic() < until, self.log()
            sleep(0.05)
        self.port = int(found[1])

    def log(self) -> str:
        return (self.folder / "log").read_text()

    def ask(
        self, method: str, path: str, body: bytes = b"", headers: Mapping[str, str] | None = None
    ) -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            connection.request(method, path, body or None, dict(headers or {}))
            response = connection.getresponse()
            return response.status, {k.lower(): v for k, v in response.getheaders()}, response.read()
        finally:
            connection.close()

    def get(self, path: str) -> str:
        status, _, body = self.ask("GET", path)
        assert status == 200, body
        return body.decode()

    def post(
        self, path: str = "/api/uploads", headers: Mapping[str, str] | None = None, **parts: Any
    ) -> Answer:
        kind, body = multipart(parts)
        return self.ask("POST", path, body, {"Content-Type": kind, **(headers or {})})

    def send(self, **parts: Any) -> str:
        status, _, body = self.post(**parts)
        assert status == 202, body
        return str(json.loads(body)["id"])

    def done(self, upload_id: str, seconds: float = 90.0) -> dict[str, Any]:
        until = monotonic() + seconds
        while monotonic() < until:
            told: dict[str, Any] = json.loads(self.get(f"/api/uploads/{upload_id}"))
            if told["state"] not in {"queued", "working"}:
                return told
            sleep(0.05)
        raise AssertionError(f"{upload_id} is not done in time")

    def stop(self) -> None:
        """As a service manager does it; the exit is clean and comes soon."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            assert self.process.wait(30) == 0, self.log()


def multipart(parts: Mapping[str, Any]) -> tuple[str, bytes]:
    """A form: `file` is bytes or (file name, bytes), the rest is text, in the order given."""
    body = b""
    for name, value in parts.items():
        data, more = (value, "") if isinstance(value, str) else (value, '; filename="given.csv"')
        if isinstance(value, tuple):
            data, more = value[1], f'; filename="{value[0]}"'
        content = data.encode() if isinstance(data, str) else data
        head = f'--edge\r\nContent-Disposition: form-data; name="{name}"{more}\r\n\r\n'
        body += head.encode() + content + b"\r\n"
    return "multipart/form-data; boundary=edge", body + b"--edge--\r\n"


@contextmanager
def running(folder: Path, mode: str) -> Iterator[Server]:
    server = Server(folder, mode)
    try:
        yield server
        server.stop()
    finally:
        if server.process.poll() is None:
            server.process.kill()
        server.process.wait()


def small_benchmark(folder: Path) -> Path:
    """A benchmark with a truth, and a site of two files."""
    (folder / "site").mkdir(parents=True)
    (folder / "coooler.toml").write_text('name = "Small"\n')
    (folder / "truth.csv").write_text("video_id,hazard_id,label,description\nv1,1,Cat,A cat runs\n")
    (folder / "site" / "index.html").write_text("<h1>Board</h1>")
    (folder / "site" / "clip.mp4").write_bytes(bytes(range(256)))
    (folder / "site" / ".hidden.json").write_text("{}")
    return folder


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
