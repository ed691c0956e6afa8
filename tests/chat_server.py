"""A small server on 127.0.0.1 that speaks the OpenAI chat API, and misbehaves when told to.

A script is a function of the request's body and its number (from 0) that says what to do: `say`,
`status`, `raw`, `cut`, `reset` or `hang`.
"""

import json
import os
import random
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from unittest.mock import patch

from pipeline.agents import HttpAgents, HttpLanguageAgent, HttpVisionAgent, open_agents
from pipeline.config import RunConfig
from pipeline.recording import Recording

Body = dict[str, Any]


@dataclass(frozen=True)
class Act:
    """What the server does with one request; `cut_at` bytes of the body are sent, then it hangs up."""

    status: int = 200
    body: bytes = b""
    content_type: str = "application/json"
    headers: Mapping[str, str] = field(default_factory=dict)
    cut_at: int | None = None
    reset: bool = False
    wait_s: float = 0.0


Script = Callable[[Body, int], Act]


def completion(
    content: Any, finish: str = "stop", tokens: tuple[int, int] | None = (100, 20), **message: Any
) -> Body:
    """The body of an answer."""
    usage = {"usage": {"prompt_tokens": tokens[0], "completion_tokens": tokens[1]}} if tokens else {}
    choice = {
        "index": 0,
        "finish_reason": finish,
        "message": {"role": "assistant", "content": content, **message},
    }
    return {"id": "x", "object": "chat.completion", "model": "served", "choices": [choice], **usage}


def say(
    content: Any, finish: str = "stop", tokens: tuple[int, int] | None = (100, 20), **message: Any
) -> Act:
    """Answer well."""
    return Act(body=json.dumps(completion(content, finish, tokens, **message)).encode())


def status(number: int, message: str = "", headers: Mapping[str, str] | None = None, **error: Any) -> Act:
    """An error as OpenAI sends it."""
    body = json.dumps({"error": {"message": message, **error}}).encode()
    return Act(status=number, body=body, headers=headers or {})


def raw(body: str, content_type: str = "application/json", code: int = 200) -> Act:
    """Any body."""
    return Act(status=code, body=body.encode(), content_type=content_type)


def cut(at: int = 40) -> Act:
    """Hang up in the middle of the body."""
    return Act(body=json.dumps(completion("never all of it")).encode(), cut_at=at)


def reset() -> Act:
    """Reset the connection before anything is said."""
    return Act(reset=True)


def hang(seconds: float) -> Act:
    """Say nothing for a while."""
    return Act(body=json.dumps(completion("too late")).encode(), wait_s=seconds)


GOOD = say("[]")


def after(*acts: Act) -> Script:
    """Do these first, then answer well."""
    return lambda body, number: acts[number] if number < len(acts) else GOOD


@dataclass
class Server:
    """A running server, and what it was asked."""

    base_url: str
    requests: list[Body] = field(default_factory=list)
    headers: list[dict[str, str]] = field(default_factory=list)
    in_flight: int = 0
    most_in_flight: int = 0


@contextmanager
def serving(script: Script) -> Iterator[Server]:
    """A server that follows `script`, while the block runs."""
    guard = threading.Lock()
    stop = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1  # one packet an answer, else Nagle and delayed acknowledgements cost 40 ms
        disable_nagle_algorithm = True

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            with guard:
                number = len(server.requests)
                server.requests.append(body)
                server.headers.append({name.lower(): value for name, value in self.headers.items()})
                server.in_flight += 1
                server.most_in_flight = max(server.most_in_flight, server.in_flight)
            try:
                act = script(body, number)
                stop.wait(act.wait_s)
            finally:
                with guard:
                    server.in_flight -= 1
            try:
                self._do(act)
            except OSError:
                self.close_connection = True  # the client did not wait

        def _do(self, act: Act) -> None:
            if act.reset:
                linger = struct.pack("ii", 1, 0)  # close with a reset instead of a goodbye
                self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                self.close_connection = True
                self.connection.close()
                return
            self.send_response(act.status)
            self.send_header("Content-Type", act.content_type)
            self.send_header("Content-Length", str(len(act.body)))
            for name, value in act.headers.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(act.body[: act.cut_at])
            self.wfile.flush()
            if act.cut_at is not None:
                self.close_connection = True

        def log_message(self, format: str, *args: object) -> None:
            pass

    class Quiet(ThreadingHTTPServer):
        request_queue_size = 128

        def handle_error(self, request: Any, client_address: Any) -> None:
            pass  # the connections that were reset on purpose

    http = Quiet(("127.0.0.1", 0), Handler)
    server = Server(f"http://127.0.0.1:{http.server_address[1]}/v1")
    thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        stop.set()
        http.shutdown()
        http.server_close()
        thread.join(5)


ROLES = ("scene", "video", "rhs", "aes", "cos", "aos")


def http_config(
    base_url: str, role: Body | None = None, endpoint: Body | None = None, **settings: Any
) -> RunConfig:
    """A configuration that asks one server, named `near`, for everything."""
    roles = {name: {"endpoint": "near", "model": "tiny", **(role or {})} for name in ROLES}
    endpoints = {"near": {"base_url": base_url, **(endpoint or {})}}
    whole = {"vision": "http", "language": "http", "roles": roles, "endpoints": endpoints, **settings}
    return RunConfig.model_validate(whole)


@dataclass
class Asking:
    """Agents that ask a server of ours; `waits_s` are the waits that they would have made."""

    server: Server
    agents: HttpAgents
    waits_s: list[float]

    @property
    def language(self) -> HttpLanguageAgent:
        assert self.agents.language is not None
        return self.agents.language

    @property
    def vision(self) -> HttpVisionAgent:
        assert self.agents.vision is not None
        return self.agents.vision


@contextmanager
def asking(
    script: Script, recording: Recording | None = None, *, replay: bool = False, **settings: Any
) -> Iterator[Asking]:
    """Agents whose every request goes to a server that follows `script`; no wait takes time."""
    waits_s: list[float] = []
    with patch.dict(os.environ, {"NO_PROXY": "127.0.0.1"}), serving(script) as server:
        config = http_config(server.base_url, **settings)
        agents = open_agents(config, recording, replay, sleep=waits_s.append, rng=random.Random(7))
        try:
            yield Asking(server, agents, waits_s)
        finally:
            agents.close()
