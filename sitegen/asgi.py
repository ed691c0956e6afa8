"""Runs a web application of ours until a signal stops it (extra `server`)."""

import logging
import os
import signal
import socket
from typing import TYPE_CHECKING

from pipeline.errors import OutsideError

if TYPE_CHECKING:
    from starlette.types import ASGIApp

_MAX_CONNECTIONS = 256
_HEAD_SECONDS = 15.0
_CLOSE_SECONDS = 3


def require(what: str, *modules: str) -> None:
    """Raise OutsideError, with the command that installs it, when a module that `what` needs is missing."""
    for module in modules:
        try:
            __import__(module)
        except ImportError as error:
            raise OutsideError(
                f"{what} needs {module}, which is not installed. Run: pip install 'coooler[server]'"
            ) from error


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens; port 0 takes a free one. Raises OutsideError when it cannot be had."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family, backlog=1_024)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror
        raise OutsideError(
            f"Port {port} of {host} cannot be used ({why}); choose another with --port, 0 for any free one."
        ) from error


def run(app: "ASGIApp", listener: socket.socket) -> None:
    """Serve until SIGINT or SIGTERM, which then count as handled."""
    import uvicorn
    from uvicorn.protocols.http.h11_impl import H11Protocol

    class ImpatientProtocol(H11Protocol):
        """Closes a connection that does not send the whole head of a request in time."""

        def connection_made(self, transport: object) -> None:
            super().connection_made(transport)  # type: ignore[arg-type]
            self.head_timer = self.loop.call_later(_HEAD_SECONDS, self.close_if_idle)

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self.is_idle() and self.head_timer.cancelled():
                self.head_timer = self.loop.call_later(_HEAD_SECONDS, self.close_if_idle)
            elif not self.is_idle():
                self.head_timer.cancel()

        def is_idle(self) -> bool:
            return self.cycle is None or self.cycle.response_complete

        def close_if_idle(self) -> None:
            if self.is_idle() and not self.transport.is_closing():
                self.transport.close()

    config = uvicorn.Config(
        app,
        http=ImpatientProtocol,
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
    signals = [signal.SIGINT, signal.SIGTERM]
    before = {one: signal.signal(one, lambda *_: None) for one in signals}  # uvicorn raises them once more
    try:
        uvicorn.Server(config).run(sockets=[listener])
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
