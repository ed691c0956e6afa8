"""A local preview of a built site: this machine only, one folder only, byte ranges for the clips."""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import BinaryIO
from urllib.parse import unquote, urlsplit

from pipeline.errors import InputError, OutsideError

TYPES = {
    ".css": "text/css; charset=utf-8",
    ".csv": "text/csv; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".jpg": "image/jpeg",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".m4v": "video/mp4",
    ".mp4": "video/mp4",
    ".svg": "image/svg+xml",
    ".webm": "video/webm",
    ".webp": "image/webp",
}
_RANGE = re.compile(r"bytes=(\d*)-(\d*)$")
_PIECE = 64 * 1024


class SiteHandler(SimpleHTTPRequestHandler):
    """Serves the files of `folder`; nothing hidden, nothing outside of it, no listings."""

    protocol_version = "HTTP/1.1"

    def __init__(self, *args: object, folder: Path, quiet: bool, **more: object) -> None:
        """`folder` must be resolved."""
        self.folder = folder
        self.quiet = quiet
        super().__init__(*args, directory=str(folder), **more)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Answer with a file, or the part of it that was asked for."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Answer with a file's headers."""
        self._answer(body=False)

    def log_message(self, format: str, *args: object) -> None:
        """Log to stderr unless quiet."""
        if not self.quiet:
            super().log_message(format, *args)

    def _answer(self, body: bool) -> None:
        path = find_file(self.folder, self.path)
        if path is None:
            self.send_error(HTTPStatus.NOT_FOUND, "There is no such page.")
            return
        size = path.stat().st_size
        asked = self.headers.get("Range")
        start, end = 0, size
        if asked is not None:
            found = byte_range(asked, size)
            if found is None:
                self.send_response(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE)
                self.send_header("Content-Range", f"bytes */{size}")
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            start, end = found
        self.send_response(HTTPStatus.OK if asked is None else HTTPStatus.PARTIAL_CONTENT)
        self.send_header("Content-Type", TYPES.get(path.suffix.lower(), "application/octet-stream"))
        self.send_header("Content-Length", str(end - start))
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Cache-Control", "no-cache")
        self.send_header("X-Content-Type-Options", "nosniff")
        if asked is not None:
            self.send_header("Content-Range", f"bytes {start}-{end - 1}/{size}")
        self.end_headers()
        if body:
            with path.open("rb") as source:
                self._send(source, start, end)

    def _send(self, source: BinaryIO, start: int, end: int) -> None:
        source.seek(start)
        left = end - start
        try:
            while left and (piece := source.read(min(_PIECE, left))):
                self.wfile.write(piece)
                left -= len(piece)
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True  # a browser stops a clip like this


def find_file(folder: Path, target: str) -> Path | None:
    """The file that a request target names, or None: outside the folder, hidden, or not there."""
    try:
        parts = [part for part in unquote(urlsplit(target).path, errors="strict").split("/") if part]
    except (UnicodeDecodeError, ValueError):
        return None
    if any(part.startswith(".") or "\0" in part or "\\" in part for part in parts):
        return None
    path = folder.joinpath(*parts)
    if path.is_dir():
        path = path / "index.html"
    path = path.resolve()
    return path if path.is_file() and path.is_relative_to(folder) else None


def byte_range(header: str, size: int) -> tuple[int, int] | None:
    """The half-open range of bytes that a Range header asks for; None when it cannot be met."""
    found = _RANGE.match(header.strip())
    if not found or not size:
        return None
    first, last = found.groups()
    if not first:
        return (max(0, size - int(last)), size) if last and int(last) else None
    start = int(first)
    end = min(int(last), size - 1) if last else size - 1
    return (start, end + 1) if start <= end else None


def make_server(folder: Path, port: int = 0, quiet: bool = False) -> ThreadingHTTPServer:
    """A server of `folder` on 127.0.0.1; port 0 takes a free one. Raises OSError when the port is taken."""
    handler = partial(SiteHandler, folder=folder.resolve(), quiet=quiet)
    return ThreadingHTTPServer(("127.0.0.1", port), handler)


def serve(folder: Path, port: int = 8000) -> None:
    """Serve `folder` until Ctrl-C. Raises InputError when there is no site, OutsideError for a taken port."""
    if not (folder / "index.html").is_file():
        raise InputError(f"{folder}: found no index.html; expected a built site. Run `coooler build` first.")
    try:
        server = make_server(folder, port, quiet=True)
    except OSError as error:
        raise OutsideError(
            f"Port {port} cannot be used ({error.strerror}); choose another: --port."
        ) from error
    with server:
        sys.stderr.write(f"Showing {folder} on http://127.0.0.1:{server.server_address[1]}/ (Ctrl-C stops)\n")
        with suppress(KeyboardInterrupt):
            server.serve_forever()


@contextmanager
def serving(folder: Path) -> Iterator[str]:
    """The address of a quiet server of `folder` that runs while the body does."""
    with make_server(folder, quiet=True) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()
