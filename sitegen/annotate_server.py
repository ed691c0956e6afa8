"""The server of `coooler data annotate`: on this computer only, until it is stopped."""

import os
import secrets
import sys
import webbrowser
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from pipeline.errors import OutsideError
from sitegen.annotate_clips import Clips
from sitegen.annotate_desk import Desk
from sitegen.annotate_truth import check_ours
from sitegen.asgi import listening, require, run
from sitegen.data_findings import some

if TYPE_CHECKING:
    from pipeline.records import TruthHazard

FOLDER = "annotations"
HOST = "127.0.0.1"

_TOKEN_FILE = ".token"  # noqa: S105


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
    require("Annotating", "starlette", "uvicorn")
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
    with listening(HOST, port) as listener:
        address = f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"
        count = len(desk.video_ids)
        _say(f"Annotate {count} video{'s' if count != 1 else ''} on {address}")
        _say("Ctrl-C stops; everything is saved as you go.")
        if opens:
            # It listens already; a browser in the terminal would hold up the server.
            Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        run(app, listener)


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
    # The journals are worth a repository, the token is not.
    (folder / ".gitignore").write_text(f"{_TOKEN_FILE}\n")
    return token


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
