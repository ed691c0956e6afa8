"""`coooler serve --accept`: a built site with an upload form and a JSON API, on one address."""

import ipaddress
import logging
import os
import signal
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.benchmark import Benchmark
from pipeline.errors import ConfigError, OutsideError
from sitegen.intake import Intake
from sitegen.intake_limits import ServerLimits
from sitegen.intake_worker import Worker, make_worker

if TYPE_CHECKING:
    from starlette.types import ASGIApp

QUEUE = "incoming"

_MAX_CONNECTIONS = 256
_HEAD_SECONDS = 15.0
_CLOSE_SECONDS = 3
_WORK_SECONDS = 8.0


def accept(
    benchmark: Benchmark,
    site: Path,
    *,
    host: str = "127.0.0.1",
    port: int = 8000,
    token_env: str = "",
    max_mb: int = 64,
    per_minute: int = 30,
    trust_proxy: bool = False,
) -> None:
    """Serve `site`, take uploads into the benchmark's `incoming/`, work them, and build, until stopped.

    SIGINT and SIGTERM stop it within seconds; what is queued waits for the next start. Raises OutsideError
    when the extra `server` is missing or the port is taken, ConfigError for an empty token, InputError
    when another server holds the queue.
    """
    for module in ("starlette", "uvicorn", "python_multipart"):
        try:
            __import__(module)
        except ImportError as error:
            raise OutsideError(
                f"Taking uploads needs {module}, which is not installed. Run: pip install 'coooler[server]'"
            ) from error
    token = os.environ.get(token_env, "").strip() if token_env else ""
    if token_env and not token:
        raise ConfigError(f"The environment variable {token_env} is empty; put the token for uploads in it.")
    limits = ServerLimits(
        max_bytes=max_mb * 2**20,
        per_minute=per_minute,
        burst=2 * per_minute,
        token=token,
        trust_proxy=trust_proxy,
        only_local=_is_loopback(host) and not trust_proxy,
    )
    with Intake(benchmark.root / QUEUE) as intake:
        serve_intake(benchmark, site, intake, make_worker(benchmark, site, intake), limits, host, port)


def serve_intake(
    benchmark: Benchmark,
    site: Path,
    intake: Intake,
    worker: Worker,
    limits: ServerLimits,
    host: str,
    port: int,
) -> None:
    """Run the server and the worker until a signal; port 0 takes a free one. Raises OutsideError."""
    from sitegen.intake_app import IntakeApp

    app = IntakeApp(benchmark, site, intake, worker, limits).app
    with _listening(host, port) as listener:
        shown = f"[{host}]" if ":" in host else host
        address = f"http://{shown}:{listener.getsockname()[1]}/"
        sys.stderr.write(f"Showing {site} and taking uploads on {address}upload (Ctrl-C stops)\n")
        sys.stderr.flush()
        worker.start()
        _run(app, listener)
    if not worker.stop(_WORK_SECONDS):
        # The upload in work is on disk, and begins anew at the next start; a thread cannot be ended alone.
        sys.stderr.write("Stopped in the middle of an upload; it begins anew at the next start.\n")
        sys.stderr.flush()
        os._exit(0)


def _run(app: "ASGIApp", listener: socket.socket) -> None:
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

    logging.getLogger("python_multipart").setLevel(logging.CRITICAL)  # it quotes what visitors send
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
    signals = [signal.SIGINT, signal.SIGTERM]
    before = {one: signal.signal(one, lambda *_: None) for one in signals}  # uvicorn raises them once more
    try:
        uvicorn.Server(config).run(sockets=[listener])
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def _listening(host: str, port: int) -> socket.socket:
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family, backlog=1_024)
    except OSError as error:
        raise OutsideError(
            f"Port {port} of {host} cannot be used ({error.strerror}); choose another: --port, --host."
        ) from error


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
