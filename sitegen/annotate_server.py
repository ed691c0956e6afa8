"""The server of `coooler data annotate`: on this computer only, until it is stopped."""

import logging
import os
import secrets
import signal
import socket
import sys
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from pipeline.errors import OutsideError
from sitegen.annotate_clips import Clips
from sitegen.annotate_desk import Desk
from sitegen.annotate_truth import check_ours
from sitegen.data_findings import some

if TYPE_CHECKING:
    from starlette.types import ASGIApp

    from pipeline.records import TruthHazard

FOLDER = "annotations"
HOST = "127.0.0.1"

_TOKEN_FILE = ".token"  # noqa: S105
_MAX_CONNECTIONS = 256
_CLOSE_SECONDS = 3


def annotate(
    name: str,
    videos: Path,
    boxes: Path | None,
    out: Path,
    start: "list[TruthHazard] | None" = None,
    *,
    author: str = "",
    port: int = 0,
    opens: bool = True,
    replace: bool = False,
) -> None:
    """Let people annotate the clips in `videos` until Ctrl-C; the truth goes to `out`.

    The journals are in `annotations/` beside `out`. `start` is a truth to begin with, `port` 0 takes a
    free one. Raises OutsideError when the extra `server` is missing or the port is taken, InputError for
    clips, boxes or an `out` that cannot be used, FaultsError for damaged journals.
    """
    _require_server()
    if not replace:
        check_ours(out)
    folder = out.resolve().parent / FOLDER
    clips = Clips(videos, boxes)
    try:
        try:
            desk = Desk(name, clips.ids, folder, out.resolve(), replace=replace)
            if start is not None:
                desk.take_truth(start)
            desk.write_truth()
            token = _token(folder)
        except OSError as error:
            place = error.filename2 or error.filename or folder
            raise OutsideError(
                f"{place}: not usable ({error.strerror}); choose another place: --out."
            ) from error
        _serve(desk, clips, token, author, port, opens)
    finally:
        clips.close()
    _say(told(desk))


def _serve(desk: Desk, clips: Clips, token: str, author: str, port: int, opens: bool) -> None:
    from sitegen.annotate_app import AnnotateApp

    app = AnnotateApp(desk, clips, token, author).app
    with _listening(port) as listener:
        address = f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"
        count = len(desk.video_ids)
        _say(f"Annotate {count} video{'s' if count != 1 else ''} on {address}")
        _say("Ctrl-C stops; everything is saved as you go.")
        if opens:
            # It listens already; a browser in the terminal would hold up the server.
            Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        _run(app, listener)


def _require_server() -> None:
    for module in ("starlette", "uvicorn"):
        try:
            __import__(module)
        except ImportError as error:
            raise OutsideError(
                f"Annotating needs {module}, which is not installed. Run: pip install 'coooler[server]'"
            ) from error


def _listening(port: int) -> socket.socket:
    try:
        return socket.create_server((HOST, port), backlog=128)
    except OSError as error:
        raise OutsideError(
            f"Port {port} of {HOST} cannot be used ({os.strerror(error.errno or 0)}); "
            "choose another: --port, or 0 for any free one."
        ) from error


def _token(folder: Path) -> str:
    """The token that lets a browser in; kept, so that open pages go on after a restart."""
    path = folder / _TOKEN_FILE
    folder.mkdir(parents=True, exist_ok=True)
    try:
        known = path.read_text("ascii").strip()
    except (OSError, UnicodeDecodeError):
        known = ""
    if len(known) >= 32 and known.replace("-", "").replace("_", "").isalnum():
        return known
    token = secrets.token_urlsafe(32)
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as target:
        target.write(token + "\n")
    (folder / ".gitignore").write_text(
        f"{_TOKEN_FILE}\n"
    )  # the journals are worth a repository, the token is not
    return token


def _run(app: "ASGIApp", listener: socket.socket) -> None:
    import uvicorn

    config = uvicorn.Config(
        app,
        http="h11",
        ws="none",
        loop="asyncio",
        lifespan="off",
        log_config=None,
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=_MAX_CONNECTIONS,
        timeout_graceful_shutdown=_CLOSE_SECONDS,
    )
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    with _signals_kept():
        uvicorn.Server(config).run(sockets=[listener])


@contextmanager
def _signals_kept() -> Iterator[None]:
    """uvicorn raises a signal that stopped it once more; here it has done its work."""
    before = {one: signal.signal(one, lambda *_: None) for one in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def told(desk: Desk) -> str:
    """What the truth file holds, and what is left out of it."""
    lines = [f"{desk.out}: {desk.rows} row{'s' if desk.rows != 1 else ''}."]
    counted = desk.counted()
    for standing, text in (
        ("differ", "Left out, as they await a merge"),
        ("changed", "Changed since the merge"),
    ):
        ids = [one.video_id for one in counted if one.standing == standing]
        if ids:
            lines.append(f"{text} ({len(ids)}): {some(ids)}")
    return "\n".join(lines)


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
