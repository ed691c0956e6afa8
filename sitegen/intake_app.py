"""The upload server as an ASGI application: the built site, the upload pages, the JSON API."""

import asyncio
import sys
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any

from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.staticfiles import StaticFiles

from pipeline.benchmark import Benchmark
from pipeline.errors import InputError
from sitegen import about as about_file
from sitegen.intake import Intake, QueueFullError
from sitegen.intake_form import read_bare, read_form, too_large
from sitegen.intake_limits import (
    RateLimit,
    RefusalError,
    ServerLimits,
    bearer,
    check_origin,
    check_token,
    client_address,
)
from sitegen.intake_pages import as_json, status_page, upload_page, visible_lines
from sitegen.intake_records import Details, Report, Upload
from sitegen.intake_worker import Worker, sender_of
from sitegen.readers import FORMATS
from sitegen.rendering import find_templates
from sitegen.serve import TYPES, find_file

_STATIC = {
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": "frame-ancestors 'none'",
}
_PAGE = {
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "same-origin",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'none'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
}
_DRAIN_BYTES = 2**20
_DRAIN_SECONDS = 10.0
_MAX_KEY_CHARS = 200
_NOT_FOUND = RefusalError(404, "There is no such upload; what was done long ago is forgotten.")


class _Body:
    """The messages of a request's body, and whether they are over."""

    def __init__(self, receive: Callable[[], Awaitable[MutableMapping[str, Any]]]) -> None:
        self.is_over = False
        self.is_begun = False
        self._receive = receive

    async def __call__(self) -> MutableMapping[str, Any]:
        self.is_begun = True
        message = await self._receive()
        self.is_over = message["type"] != "http.request" or not message.get("more_body", False)
        return message

    async def drain(self, most: int) -> None:
        """Read on after a refusal, within bounds: a browser shows an answer only once it has sent all."""
        try:
            async with asyncio.timeout(_DRAIN_SECONDS):
                while not self.is_over and most > 0:
                    most -= len((await self()).get("body", b""))
        except TimeoutError:
            return


class IntakeApp:
    """The answers of the server; `app` is the ASGI application."""

    def __init__(
        self, benchmark: Benchmark, site: Path, intake: Intake, worker: Worker, limits: ServerLimits
    ) -> None:
        """`site` is where the site is built; it need not be there yet."""
        self.benchmark = benchmark
        self.site = site.resolve()
        self.intake = intake
        self.worker = worker
        self.limits = limits
        self._rate = RateLimit(limits.per_minute, limits.burst)
        self._files = StaticFiles(directory=self.site, check_dir=False)
        self.app = Starlette(
            routes=[
                Route("/upload", self.form, methods=["GET"]),
                Route("/upload", self.send, methods=["POST"]),
                Route("/upload/upload.css", self.styles, methods=["GET"]),
                Route("/upload/{upload_id}", self.status, methods=["GET"]),
                Route("/api/health", self.health, methods=["GET"]),
                Route("/api/uploads", self.api_send, methods=["POST"]),
                Route("/api/uploads/{upload_id}", self.api_status, methods=["GET"]),
                Route("/{path:path}", self.static, methods=["GET"]),
            ]
        )

    async def form(self, request: Request) -> Response:
        """The empty form."""
        return await self._form_page(200, {}, "")

    async def send(self, request: Request) -> Response:
        """Take the form; lead to the upload's page, or show the form again with what is wrong."""
        fields: dict[str, str] = {}
        try:
            upload = await self._receive(request, fields, is_api=False)
        except RefusalError as refusal:
            page = await self._form_page(refusal.status, fields, refusal.message)
            page.headers.update({**refusal.headers, "Connection": "close"})
            return page
        return RedirectResponse(f"upload/{upload.upload_id}", 303, _PAGE)

    async def styles(self, request: Request) -> Response:
        """The style sheet of the two pages."""
        path = find_templates() / "upload.css"
        return Response(await to_thread.run_sync(path.read_bytes), headers=_STATIC, media_type="text/css")

    async def status(self, request: Request) -> Response:
        """The page of an upload."""
        upload, report, before = await self._find(request)
        if upload is None:
            return PlainTextResponse(_NOT_FOUND.message, 404, _PAGE)
        page = await to_thread.run_sync(
            status_page, self.benchmark, self.site, upload, report, before, self.worker.is_behind
        )
        return Response(page, headers=_PAGE, media_type="text/html")

    async def health(self, request: Request) -> Response:
        """How the server fares."""
        is_well = self.worker.is_alive
        told = {"status": "ok" if is_well else "the queue stands still", "waiting": self.intake.waiting()}
        return JSONResponse(told, 200 if is_well else 503, _PAGE)

    async def api_send(self, request: Request) -> Response:
        """Take an upload from a program."""
        try:
            upload = await self._receive(request, {}, is_api=True)
        except RefusalError as refusal:
            headers = {**_PAGE, **refusal.headers, "Connection": "close"}
            return JSONResponse({"error": refusal.message}, refusal.status, headers)
        told = {"id": upload.upload_id, "status_url": f"/api/uploads/{upload.upload_id}"}
        return JSONResponse(told, 202, _PAGE)

    async def api_status(self, request: Request) -> Response:
        """An upload for a program."""
        upload, report, before = await self._find(request)
        if upload is None:
            return JSONResponse({"error": _NOT_FOUND.message}, 404, _PAGE)
        return JSONResponse(as_json(upload, report, before), 200, _PAGE)

    async def static(self, request: Request) -> Response:
        """A file of the site, or the part of it that was asked for."""
        target = request.scope["raw_path"].decode("ascii", "replace")
        path = await to_thread.run_sync(find_file, self.site, target)
        if path is None and target.startswith("/assets/"):  # the first site is still being built
            path = await to_thread.run_sync(find_file, find_templates(), target)
        if path is None:
            return PlainTextResponse("There is no such page.", 404, _STATIC)
        response = self._files.file_response(path, path.stat(), request.scope)
        response.headers.update(_STATIC)
        if response.status_code == 200:
            response.headers["Content-Type"] = TYPES.get(path.suffix.lower(), "application/octet-stream")
        return response

    async def _find(self, request: Request) -> tuple[Upload | None, Report, int]:
        upload = self.intake.find(request.path_params["upload_id"])
        if upload is None:
            return None, Report(), 0
        report = await to_thread.run_sync(self.intake.report, upload)
        return upload, report or Report(), self.intake.place(upload)

    async def _form_page(self, status: int, values: dict[str, str], message: str) -> Response:
        limits = self.limits
        page = await to_thread.run_sync(
            upload_page, self.benchmark, self.site, values, message, bool(limits.token), limits.max_bytes
        )
        return Response(page, status, _PAGE, "text/html")

    async def _receive(self, request: Request, fields: dict[str, str], *, is_api: bool) -> Upload:
        """The upload that a request brings, in the queue; its fields go to `fields` once they are known.

        Raises RefusalError.
        """
        body = _Body(request.receive)
        try:
            return await self._take(Request(request.scope, body), fields, is_api)
        except ClientDisconnect:
            raise RefusalError(400, "The connection was cut.") from None
        except QueueFullError as error:
            refusal = RefusalError(503, str(error), {"Retry-After": "60"})
        except InputError as error:
            refusal = RefusalError(400, visible_lines(str(error)))
        except RefusalError as error:
            refusal = error
        except OSError as error:
            sys.stderr.write(f"{self.intake.folder}: {error.strerror}\n")
            refusal = RefusalError(503, "The server cannot store uploads now. Please try again later.")
        if refusal.status != 408 and (body.is_begun or "expect" not in request.headers):
            await body.drain(2 * self.limits.max_bytes if refusal.status == 413 else _DRAIN_BYTES)
        raise refusal

    async def _take(self, request: Request, fields: dict[str, str], is_api: bool) -> Upload:
        limits = self.limits
        check_origin(request.headers, limits.only_local)
        peer = request.client.host if request.client else ""
        wait = self._rate.wait(client_address(peer, request.headers, limits.trust_proxy))
        if wait:
            message = f"Too many uploads from this address; try again in {wait} seconds."
            raise RefusalError(429, message, {"Retry-After": str(wait)})
        is_form = not is_api or request.headers.get("content-type", "").startswith("multipart/")
        token = bearer(request.headers)
        if token or not is_form:
            check_token(token, limits.token)
        with self.intake.arriving(_room(request, limits)) as arriving:
            if is_form:
                wanted = "" if token else limits.token
                given = await read_form(request, arriving, limits, lambda found: check_token(found, wanted))
            else:
                given = await read_bare(request, arriving, limits)
            fields.update(given)
            key = request.headers.get("idempotency-key", "")
            if len(key) > _MAX_KEY_CHARS:
                raise RefusalError(400, f"The Idempotency-Key is longer than {_MAX_KEY_CHARS} characters.")
            return await to_thread.run_sync(self.intake.add, arriving, _details(given), key)


def _room(request: Request, limits: ServerLimits) -> int:
    """How many bytes the file may have: what the request says, unless it says nothing or too much."""
    said = request.headers.get("content-length", "")
    if not said.isdigit():
        return limits.max_bytes
    if int(said[:20]) > limits.max_bytes + 2**16:
        raise too_large(limits)
    return min(int(said), limits.max_bytes)


def _details(fields: dict[str, str]) -> Details:
    """The fields, checked as far as that needs no file. Raises InputError with every wrong one."""
    kind = fields.get("kind") or "check"
    source_format = fields.get("format", "")
    wrong = []
    if kind not in {"check", "submit"}:
        wrong.append(f"  kind: found {kind!a}; expected check or submit.")
    if source_format and source_format not in FORMATS:
        wrong.append(f"  format: found {source_format!a}; expected one of {', '.join(FORMATS)}.")
    if kind == "submit" and not fields.get("name", "").strip():
        wrong.append("  name: nothing; to submit, give it a name for the leaderboard.")
    if wrong:
        raise InputError("\n".join(["Some fields are wrong.", *wrong]))
    details = Details(
        kind="submit" if kind == "submit" else "check",
        source_format=source_format,
        file_name=fields.get("file_name") or "file",
        notes=" ".join(fields.get("notes", "").split()),
        **{
            name: fields.get(name, "").strip()
            for name in ("name", "authors", "url", "agents", "licence", "caption_column")
        },
    )
    nothing = "0" * 64
    about_file.validated(
        {
            **sender_of(details),
            "source_format": "csv",
            "original_sha256": nothing,
            "predictions_sha256": nothing,
        },
        "The form",
    )
    return details
