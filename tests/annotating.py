"""A small benchmark to annotate, and the annotation server as a process of its own."""

import http.client
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from pipeline.records import Box, Kind, TrackBox
from pipeline.tables import BOXES
from tests.clips import write_clip

VIDEOS = ("road_1", "road_2", "road_3")
FRAMES = 30
SIZE = (160, 96)


def make_folder(path: Path) -> Path:
    """A benchmark with three clips of 30 frames (160x96): two tracks in road_1, one in road_2, none in
    road_3. It has no truth."""
    (path / "videos").mkdir(parents=True)
    (path / "coooler.toml").write_text('name = "Roads"\ntruth = "truth.parquet"\n')
    boxes = []
    for number, video_id in enumerate(VIDEOS):
        pictures = []
        for frame in range(FRAMES):
            picture = np.full((SIZE[1], SIZE[0], 3), 90 + 40 * number, np.uint8)
            for track in range(2 - number):
                x, y = 4 * frame, 20 + 40 * track
                picture[y : y + 20, x : x + 20] = (220, 60 * track, 30)
                box = Box(x, y, x + 20, y + 20)
                kind = Kind.CHALLENGE if track == 0 else Kind.TRAFFIC
                boxes.append(TrackBox(video_id, frame, str(track + 1), kind, box))
            pictures.append(picture)
        write_clip(path / "videos" / f"{video_id}.mp4", FRAMES, SIZE, pictures=pictures, faststart=True)
    BOXES.write(path / "boxes.parquet", boxes)
    return path


@dataclass(frozen=True, slots=True)
class Serving:
    """A running server: `address` carries the token, `base` (no slash at its end) does not."""

    process: "subprocess.Popen[bytes]"
    address: str
    folder: Path

    @property
    def base(self) -> str:
        return self.address.partition("/?")[0]

    @property
    def port(self) -> int:
        port = urlsplit(self.address).port
        assert port
        return port

    @property
    def token(self) -> str:
        return self.address.partition("token=")[2]

    def log(self) -> str:
        return (self.folder / "log").read_text()

    def kill(self) -> None:
        """A crash: the process ends at once, whatever it does."""
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """As Ctrl-C does it; the exit is clean and comes soon."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(30) == 0, self.log()

    def ask(
        self, method: str, path: str, body: bytes = b"", headers: Mapping[str, str] | None = None
    ) -> tuple[int, dict[str, str], bytes]:
        """A request with nothing but what is given."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            connection.request(method, path, body or None, dict(headers or {}))
            response = connection.getresponse()
            return response.status, {k.lower(): v for k, v in response.getheaders()}, response.read()
        finally:
            connection.close()

    def cookie(self) -> str:
        """The Cookie header that the token is exchanged for."""
        status, headers, _ = self.ask("GET", f"/?token={self.token}")
        assert status == 303
        return headers["set-cookie"].partition(";")[0]


@contextmanager
def serving(folder: Path, port: int = 0, *more: str) -> Iterator[Serving]:
    """`coooler data annotate` in `folder`; `port` 0 takes a free one, `more` are further options.

    Whatever still runs at the end is stopped.
    """
    command = [
        sys.executable,
        "-m",
        "sitegen.cli",
        "data",
        "annotate",
        "--no-open",
        "--port",
        str(port),
        *more,
    ]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(command, cwd=folder, stdout=log, stderr=log)
    try:
        until = monotonic() + 60
        while not (
            found := re.search(r"http://127\.0\.0\.1:\d+/\?token=[\w-]+", (folder / "log").read_text())
        ):
            assert process.poll() is None and monotonic() < until, (folder / "log").read_text()
            sleep(0.03)
        yield Serving(process, found[0], folder)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def state(
    *hazards: Mapping[str, Any], no_hazard: bool = False, base: int = 0, session: str = "s", sequence: int = 1
) -> dict[str, Any]:
    """What a page sends to be saved."""
    return {
        "hazards": [
            {
                "hazard_id": f"h{number}",
                "label": "",
                "description": "",
                "track_id": None,
                "first_frame": None,
                "last_frame": None,
                **hazard,
            }
            for number, hazard in enumerate(hazards, 1)
        ],
        "no_hazard": no_hazard,
        "base": base,
        "session": session,
        "sequence": sequence,
        "seen": {},
    }


def post(
    server: Serving, cookie: str, video_id: str, author: str, data: Any, merge: bool = False
) -> tuple[int, Any]:
    """Save as a page does; gives the status and the answer."""
    path = f"/api/video/{video_id}?author={author}{'&merge=1' if merge else ''}"
    headers = {"Cookie": cookie, "Content-Type": "application/json", "Origin": server.base}
    status, _, body = server.ask("POST", path, json.dumps(data).encode(), headers)
    return status, json.loads(body)
