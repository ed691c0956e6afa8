"""`coooler serve --accept`: a built site with an upload form and a JSON API, on one address."""

import ipaddress
import logging
import os
import sys
from pathlib import Path

from pipeline.benchmark import Benchmark
from pipeline.errors import ConfigError
from sitegen.asgi import listening, require, run
from sitegen.intake import Intake
from sitegen.intake_limits import ServerLimits
from sitegen.intake_worker import Worker, make_worker

QUEUE = "incoming"

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
    require("Taking uploads", "starlette", "uvicorn", "python_multipart")
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
    with listening(host, port) as listener:
        shown = f"[{host}]" if ":" in host else host
        address = f"http://{shown}:{listener.getsockname()[1]}/"
        sys.stderr.write(f"Showing {site} and taking uploads on {address}upload (Ctrl-C stops)\n")
        sys.stderr.flush()
        worker.start()
        logging.getLogger("python_multipart").setLevel(logging.CRITICAL)  # it quotes what visitors send
        run(app, listener)
    if not worker.stop(_WORK_SECONDS):
        # The upload in work is on disk, and begins anew at the next start; a thread cannot be ended alone.
        sys.stderr.write("Stopped in the middle of an upload; it begins anew at the next start.\n")
        sys.stderr.flush()
        os._exit(0)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
