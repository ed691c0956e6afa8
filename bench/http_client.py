"""What our client adds to the time that a model server takes: 400 calls, 16 in flight, 50 ms each.

The server is a process of its own, so that it does not share our interpreter's lock. The ideal is
400 / 16 * 50 ms; the bare calls are those of the `openai` client with as many threads.
"""

import asyncio
import contextlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import openai

from bench.timing import Measure, interleaved
from pipeline.agents import open_agents
from pipeline.config import RunConfig
from pipeline.prompts import fill

CALLS = 400
IN_FLIGHT = 16
ANSWER_AFTER_S = 0.05
GOAL = 1.15


async def _serve() -> None:
    """Answer every request after 50 ms, over kept connections; print the port first."""
    answer = json.dumps([{"label": f"object {i}", "description": "moves across the road"} for i in range(6)])
    choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": answer}}
    usage = {"prompt_tokens": 600, "completion_tokens": 80, "total_tokens": 680}
    body = json.dumps({"id": "b", "object": "chat.completion", "choices": [choice], "usage": usage}).encode()
    head = (
        f"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n".encode()
    )

    async def client(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                header = await reader.readuntil(b"\r\n\r\n")
                length = next(
                    line for line in header.lower().splitlines() if line.startswith(b"content-length:")
                )
                await reader.readexactly(int(length.split(b":")[1]))
                await asyncio.sleep(ANSWER_AFTER_S)
                writer.write(head + body)
                await writer.drain()
        writer.close()

    server = await asyncio.start_server(client, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    async with server:
        await server.serve_forever()


@contextlib.contextmanager
def _server() -> Iterator[str]:
    """The base URL of a server in a child process."""
    command = [sys.executable, "-m", "bench.http_client"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent.parent
    ) as child:
        try:
            assert child.stdout is not None
            yield f"http://127.0.0.1:{int(child.stdout.readline())}/v1"
        finally:
            child.terminate()


def measure() -> list[Measure]:
    """Our calls against the ideal and against bare calls; medians of interleaved rounds, in seconds."""
    prompt = fill("T1-LLM", {"descriptions": [f"A car is {i} metres ahead, a dog runs." for i in range(25)]})
    with _server() as base_url:
        role = {"endpoint": "bench", "model": "bench"}
        config = RunConfig.model_validate(
            {
                "language": "http",
                "roles": dict.fromkeys(("rhs", "aes", "cos", "aos"), role),
                "endpoints": {"bench": {"base_url": base_url, "max_in_flight": IN_FLIGHT}},
            }
        )
        agents = open_agents(config)
        bare = openai.OpenAI(base_url=base_url, api_key="none", max_retries=0)
        assert agents.language is not None
        language = agents.language

        def ask_bare(_: int) -> str | None:
            words = [{"type": "text", "text": text} for text in (prompt.user, prompt.format_hint)]
            messages = [{"role": "system", "content": prompt.system}, {"role": "user", "content": words}]
            reply = bare.chat.completions.create(
                model="bench",
                messages=messages,  # type: ignore[arg-type]
                temperature=0.5,
                max_tokens=200,
                seed=0,
            )
            return reply.choices[0].message.content

        def run(ask: Callable[[int], object]) -> None:
            with ThreadPoolExecutor(IN_FLIGHT) as pool:
                for answer in pool.map(ask, range(CALLS)):
                    assert answer

        times = interleaved(
            {
                "ours": lambda: run(lambda call: language.complete(prompt, call).text),
                "bare": lambda: run(ask_bare),
            },
            rounds=5,
        )
        agents.close()
        bare.close()
    ideal_s = CALLS / IN_FLIGHT * ANSWER_AFTER_S
    what = f"{CALLS} calls over HTTP, {IN_FLIGHT} in flight, {ANSWER_AFTER_S * 1e3:.0f} ms each"
    note = "schema, retries, limit and usage included; no recording"
    return [
        Measure(what, times["ours"], "ideal", ideal_s, f"at most {GOAL}", note),
        Measure(what, times["ours"], "bare openai calls", times["bare"], "", note),
    ]


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve())
