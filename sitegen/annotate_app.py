"""`coooler data annotate` as an ASGI application: pages, the API of the editor, clips and pictures."""

import hmac
import json
import re
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar
from urllib.parse import parse_qs, quote, urlsplit

from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from pipeline.errors import InputError
from pipeline.files import sha256_of
from sitegen.annotate_clips import Clips
from sitegen.annotate_desk import Desk, StaleError, UnknownVideoError
from sitegen.annotate_records import author_of
from sitegen.rendering import find_templates
from sitegen.serve import TYPES

Handler: TypeAlias = Callable[[Request], Awaitable[Response]]
T = TypeVar("T")

MAX_STATE_BYTES = 2**21
MAX_FORM_BYTES = 2**12

_LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})
_SHARED = frozenset({"site.css", "theme.js"})
_FILE_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*\.(?:css|js|svg|webp)")
_YEAR_S = 365 * 24 * 3600
_TOKEN_CHARS = 200
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "same-origin",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; media-src 'self'; "
        "connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
}
_FILE = {**_HEADERS, "Cache-Control": "private, no-cache"}
_CLOSED = "Open the address that the server printed when it started; it lets this browser in."


class _RefusalError(Exception):
    """A request that is not answered as asked: an HTTP status and a plain sentence."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status
        self.message = message


class AnnotateApp:
    """The answers of the server; `app` is the ASGI application.

    It answers to this computer's own names only, and to browsers that were opened with the token.
    """

    def __init__(self, desk: Desk, clips: Clips, token: str, author: str = "") -> None:
        """`author` is who annotates in a browser that said no other name; empty: it is asked."""
        self.desk = desk
        self.clips = clips
        self.author = author
        self._token = token
        # Cookies do not know ports: two servers beside each other need two names.
        self._cookie = f"annotate-{sha256_of(token.encode())[:8]}"
        guarded = self._guarded
        self.app = Starlette(
            routes=[
                Route("/", guarded(self.list_page), methods=["GET"]),
                Route("/author", guarded(self.take_author), methods=["POST"]),
                Route("/video/{video_id}", guarded(self.video_page), methods=["GET"]),
                Route("/merge/{video_id}", guarded(self.video_page), methods=["GET"]),
                Route("/agreement", guarded(self.agreement_page), methods=["GET"]),
                Route("/api/video/{video_id}", guarded(self.state), methods=["GET"]),
                Route("/api/video/{video_id}", guarded(self.save), methods=["POST"]),
                Route("/api/clip/{video_id}", guarded(self.clip_facts), methods=["GET"]),
                Route("/clip/{video_id}", guarded(self.clip), methods=["GET"]),
                Route("/keyframe/{video_id}/{index:int}.webp", guarded(self.keyframe), methods=["GET"]),
                Route("/static/{name}", guarded(self.static, is_open=True), methods=["GET"]),
                Route("/{path:path}", guarded(self.nothing), methods=["GET", "POST"]),
            ]
        )

    def _guarded(self, handler: Handler, *, is_open: bool = False) -> Handler:
        """The handler behind the checks of Host, Origin and token, its refusals as answers."""

        async def answer(request: Request) -> Response:
            try:
                _check_sender(request)
                given = request.query_params.get("token", "")
                if request.method == "GET" and given and self._is_token(given):
                    return self._let_in(request)
                if not is_open and not self._is_token(request.cookies.get(self._cookie, "")):
                    raise _RefusalError(403, _CLOSED)
                return await handler(request)
            except ClientDisconnect:
                return Response(status_code=400)
            except (_RefusalError, InputError) as error:
                return await self._refuse(request, error)

        return answer

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given[:_TOKEN_CHARS].encode("utf-8", "replace"), self._token.encode())

    def _let_in(self, request: Request) -> Response:
        """The token becomes a cookie, and leaves the address; who started the server annotates here."""
        response = RedirectResponse("/" + quote(request.scope["path"].lstrip("/")), 303, _HEADERS)
        if self.author:
            self._keep_author(response, self.author)
        response.set_cookie(self._cookie, self._token, _YEAR_S, httponly=True, samesite="strict")
        return response

    async def _refuse(self, request: Request, error: Exception) -> Response:
        refusal = _refusal(error)
        if request.url.path.startswith("/api/"):
            return JSONResponse({"error": refusal.message}, refusal.status, _HEADERS)
        from sitegen.annotate_pages import error_page

        page = await _aside(error_page, refusal.status, refusal.message)
        return Response(page, refusal.status, _HEADERS, "text/html")

    def _author(self, request: Request) -> str:
        """Who annotates in this browser; empty when nobody said a name."""
        try:
            return author_of(request.cookies.get("author", "") or self.author)
        except InputError:
            return ""

    async def list_page(self, request: Request) -> Response:
        """All videos."""
        from sitegen.annotate_pages import list_page

        author = self._author(request)
        return _page(await _aside(list_page, self.desk, author)) if author else await self._ask("", "")

    async def video_page(self, request: Request) -> Response:
        """The editor of a video, or its merge."""
        from sitegen.annotate_pages import video_page

        video_id, author = request.path_params["video_id"], self._author(request)
        if video_id not in self.desk.video_ids:
            raise UnknownVideoError("There is no such video.")
        if not author:
            return await self._ask("", "")
        is_merge = request.url.path.startswith("/merge/")
        return _page(await _aside(video_page, self.desk, video_id, author, is_merge))

    async def agreement_page(self, request: Request) -> Response:
        """How far the annotators agree."""
        from sitegen.annotate_pages import agreement_page

        author = self._author(request)
        return _page(await _aside(agreement_page, self.desk, author)) if author else await self._ask("", "")

    async def take_author(self, request: Request) -> Response:
        """Keep a name in the browser; without a name, forget it and ask."""
        form = parse_qs((await _body(request, MAX_FORM_BYTES)).decode("utf-8", "replace"))
        name = form.get("author", [""])[0].strip()
        if not name:
            asked = await self._ask("", "")
            asked.delete_cookie("author")
            return asked
        try:
            author = author_of(name)
        except InputError as error:
            return await self._ask(name, str(error), 400)
        response = RedirectResponse("/", 303, _HEADERS)
        self._keep_author(response, author)
        return response

    def _keep_author(self, response: Response, author: str) -> None:
        response.set_cookie("author", author, _YEAR_S, httponly=True, samesite="strict")

    async def _ask(self, name: str, problem: str, status: int = 200) -> Response:
        from sitegen.annotate_pages import ask_page

        return _page(await _aside(ask_page, self.desk, name, problem), status)

    async def state(self, request: Request) -> Response:
        """What an author or the merge says of a video."""
        told = await _aside(self.desk.state, *_asked(request))
        return JSONResponse(told, headers=_HEADERS)

    async def save(self, request: Request) -> Response:
        """Store a state; the answer comes when it is on the disk."""
        if not request.headers.get("content-type", "").startswith("application/json"):
            raise _RefusalError(400, "The content type is not application/json.")
        data = _json(await _body(request, MAX_STATE_BYTES))
        try:
            told = await _aside(self.desk.save, *_asked(request), data)
        except StaleError as error:
            return JSONResponse({"error": str(error), "current": error.current}, 409, _HEADERS)
        except OSError as error:
            why = f"The disk did not take it ({error.strerror}); make room, it is tried again."
            raise _RefusalError(503, why) from error
        return JSONResponse(told, headers=_HEADERS)

    async def clip_facts(self, request: Request) -> Response:
        """The frames, keyframes and tracks of a video."""
        video_id = request.path_params["video_id"]
        if video_id not in self.desk.video_ids:
            raise UnknownVideoError("There is no such video.")
        return JSONResponse(await _aside(self.clips.facts, video_id), headers=_HEADERS)

    async def clip(self, request: Request) -> Response:
        """A clip, or the part of it that was asked for."""
        path = self.clips.path(request.path_params["video_id"])
        if path is None or not path.is_file():
            raise _RefusalError(404, "There is no clip of this video.")
        return _file(path)

    async def keyframe(self, request: Request) -> Response:
        """A keyframe's picture."""
        wanted = request.path_params
        path = await _aside(self.clips.keyframe, wanted["video_id"], wanted["index"])
        if path is None:
            raise _RefusalError(404, "There is no such picture.")
        return _file(path)

    async def static(self, request: Request) -> Response:
        """A style, script or icon of the pages."""
        name = request.path_params["name"]
        folder = find_templates() / ("assets" if name in _SHARED else "annotate")
        if not _FILE_NAME.fullmatch(name) or not (folder / name).is_file():
            raise _RefusalError(404, "There is no such file.")
        return _file(folder / name)

    async def nothing(self, request: Request) -> Response:
        """Every other address."""
        raise _RefusalError(404, "There is no such page.")


def _refusal(error: Exception) -> _RefusalError:
    """How an error is answered."""
    if isinstance(error, _RefusalError):
        return error
    return _RefusalError(404 if isinstance(error, UnknownVideoError) else 400, str(error))


def _check_sender(request: Request) -> None:
    """Raise _RefusalError for another name of this computer, or for what another site's page sends.

    Programs that are no browsers send neither header.
    """
    headers = request.headers
    host = headers.get("host", "")
    if _host_name(host) not in _LOOPBACK:
        raise _RefusalError(403, "This server answers to this computer's own names only.")
    if request.method not in {"GET", "HEAD"}:
        origin, site = headers.get("origin"), headers.get("sec-fetch-site", "same-origin")
        if site not in {"same-origin", "none"} or (origin and origin.lower() != f"http://{host.lower()}"):
            raise _RefusalError(403, "This came from another site's page.")


def _host_name(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


async def _aside(call: Callable[..., T], *arguments: Any) -> T:
    """Run in a thread: it waits for the disk, a decoder or a lock."""
    return await to_thread.run_sync(partial(call, *arguments))


def _asked(request: Request) -> tuple[str, str, bool]:
    asked = request.query_params
    return request.path_params["video_id"], asked.get("author", ""), asked.get("merge", "") == "1"


async def _body(request: Request, most: int) -> bytes:
    """The whole body. Raises _RefusalError when it is larger than `most` bytes."""
    body = bytearray()
    async for piece in request.stream():
        body += piece
        if len(body) > most:
            raise _RefusalError(413, f"More than {most:,} bytes were sent.")
    return bytes(body)


def _json(body: bytes) -> Any:
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        raise _RefusalError(400, "Found no JSON.") from None


def _page(html: bytes, status: int = 200) -> Response:
    return Response(html, status, _HEADERS, "text/html")


def _file(path: Path) -> Response:
    kind = TYPES.get(path.suffix.lower(), "application/octet-stream")
    return FileResponse(path, headers=_FILE, media_type=kind)
