"""The body of an upload to bytes on disk and a few short fields, with bounds on all of it as it streams.

Two shapes are read: multipart forms, and the bare bytes of the file with the fields in the query.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Any

from anyio import to_thread
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.requests import Request

from sitegen.intake import Arriving
from sitegen.intake_limits import RefusalError, ServerLimits
from sitegen.intake_records import FIELDS

TOKEN = "token"  # noqa: S105  (the name of the field)
_FILE = "file"
_MAX_PARTS = 24
_MAX_PART_HEADERS = 4_096
_MAX_FILE_NAME = 255
_MAX_TOKEN_BYTES = 500
_SPARE_BYTES = 2**16  # what a form may hold beside the file


async def chunks(request: Request, limits: ServerLimits) -> AsyncIterator[bytes]:
    """The body piece by piece. Raises RefusalError when it is too long or comes too slowly."""
    stream = request.stream()
    deadline = time.monotonic() + limits.total_seconds
    left = limits.max_bytes + _SPARE_BYTES
    while True:
        try:
            async with asyncio.timeout(min(limits.idle_seconds, max(0.0, deadline - time.monotonic()))):
                piece = await anext(stream)
        except StopAsyncIteration:
            return
        except TimeoutError:
            raise RefusalError(408, "The upload came too slowly and was dropped. Send it again.") from None
        left -= len(piece)
        if left < 0:
            raise too_large(limits)
        yield piece


def too_large(limits: ServerLimits) -> RefusalError:
    """The refusal of a file that is too large."""
    return RefusalError(413, f"The file is too large; at most {limits.max_bytes / 2**20:,.4g} MB are taken.")


async def read_form(
    request: Request, arriving: Arriving, limits: ServerLimits, check: Callable[[str], None]
) -> dict[str, str]:
    """Stream a multipart form: the file to `arriving`, the other fields as texts, with `file_name`.

    `check` is given the token of the fields before the file, and raises when it is wrong. Raises
    RefusalError for a form that is no such form.
    """
    kind, parameters = parse_options_header(request.headers.get("content-type"))
    boundary = parameters.get(b"boundary", b"")
    if kind != b"multipart/form-data" or not boundary:
        raise RefusalError(415, "Send the upload as multipart/form-data.")
    parts = _Parts(arriving, limits, check)
    try:
        parser = MultipartParser(boundary, parts.callbacks())  # type: ignore[arg-type]
        async for piece in chunks(request, limits):
            await to_thread.run_sync(parser.write, piece)
    except FormParserError as error:
        raise RefusalError(400, "The form is damaged; send it again.") from error
    if not parts.is_complete:
        raise RefusalError(400, "The form ends before it is complete; send it again.")
    check(parts.fields.pop(TOKEN, ""))
    if "file_name" not in parts.fields or not (arriving.size or parts.fields["file_name"]):
        raise RefusalError(400, "No file was chosen; choose the predictions file.")
    return parts.fields


async def read_bare(request: Request, arriving: Arriving, limits: ServerLimits) -> dict[str, str]:
    """Stream a bare body to `arriving`; the fields come from the query. Raises RefusalError as above."""
    pairs = request.query_params.multi_items()
    known = [*FIELDS, "file_name"]
    for name, value in pairs:
        if name not in known:
            raise unknown_field(name)
        _check_length(name, len(value))
    if len({name for name, _ in pairs}) < len(pairs):
        raise RefusalError(400, "A field comes twice; send each once.")
    async for piece in chunks(request, limits):
        _take(arriving, piece, limits)
    if not arriving.size:
        raise RefusalError(400, "The body is empty; send the predictions file as the body.")
    return dict(pairs)


def unknown_field(name: str) -> RefusalError:
    """The refusal of a field that nobody asked for."""
    known = ", ".join(["file", *FIELDS, TOKEN])
    return RefusalError(400, f"There is an unknown field {name[:40]!a}; the fields are {known}.")


def _check_length(name: str, length: int) -> None:
    most = FIELDS.get(name, _MAX_FILE_NAME)
    if length > most:
        raise RefusalError(400, f"The field {name} has {length:,} characters; at most {most:,} are taken.")


def _take(arriving: Arriving, data: bytes, limits: ServerLimits) -> None:
    try:
        arriving.write(data)
    except ValueError:
        raise too_large(limits) from None


class _Parts:
    """The parts of a form as a streaming parser finds them."""

    def __init__(self, arriving: Arriving, limits: ServerLimits, check: Callable[[str], None]) -> None:
        self.fields: dict[str, str] = {}
        self.is_complete = False
        self._arriving = arriving
        self._limits = limits
        self._check = check
        self._count = 0
        self._header = (bytearray(), bytearray())
        self._disposition = b""
        self._header_bytes = 0
        self._name = ""
        self._value: bytearray | None = None

    def callbacks(self) -> Mapping[str, Callable[..., Any]]:
        return {
            "on_part_begin": self._begin,
            "on_header_field": lambda data, start, end: self._head(0, data[start:end]),
            "on_header_value": lambda data, start, end: self._head(1, data[start:end]),
            "on_header_end": self._end_of_header,
            "on_headers_finished": self._open,
            "on_part_data": lambda data, start, end: self._data(data[start:end]),
            "on_part_end": self._close,
            "on_end": self._end,
        }

    def _begin(self) -> None:
        self._count += 1
        if self._count > _MAX_PARTS:
            raise RefusalError(400, "The form has too many fields.")
        self._header_bytes = 0
        self._disposition = b""

    def _head(self, place: int, data: bytes) -> None:
        self._header_bytes += len(data)
        if self._header_bytes > _MAX_PART_HEADERS:
            raise RefusalError(400, "A field of the form has headers that are too long.")
        self._header[place].extend(data)

    def _end_of_header(self) -> None:
        name, value = self._header
        if bytes(name).lower() == b"content-disposition":
            self._disposition = bytes(value)
        self._header = (bytearray(), bytearray())

    def _open(self) -> None:
        _, options = parse_options_header(self._disposition)
        self._name = options.get(b"name", b"").decode("utf-8", "replace")
        if self._name not in {_FILE, TOKEN, *FIELDS}:
            raise unknown_field(self._name)
        if ("file_name" if self._name == _FILE else self._name) in self.fields:
            raise RefusalError(400, f"The field {self._name} comes twice; send each once.")
        if self._name == _FILE:
            self._check(self.fields.get(TOKEN, ""))
            name = options.get(b"filename", b"").decode("utf-8", "replace")
            self.fields["file_name"] = name[:_MAX_FILE_NAME]
            self._value = None
        else:
            self._value = bytearray()

    def _data(self, data: bytes) -> None:
        if self._value is None:
            _take(self._arriving, data, self._limits)
            return
        most = _MAX_TOKEN_BYTES if self._name == TOKEN else 4 * FIELDS[self._name]  # UTF-8
        if len(self._value) + len(data) > most:
            raise RefusalError(400, f"The field {self._name} is too long.")
        self._value.extend(data)

    def _close(self) -> None:
        if self._value is None:
            return
        try:
            text = self._value.decode()
        except UnicodeDecodeError:
            raise RefusalError(400, f"The field {self._name} is not UTF-8.") from None
        if self._name != TOKEN:
            _check_length(self._name, len(text))
        self.fields[self._name] = text

    def _end(self) -> None:
        self.is_complete = True
