"""The agents over HTTP: what they send in each role, what they shorten, and how they are set up."""

import base64
import gc
import json
from typing import Any

import cv2
import numpy as np
import pytest

from pipeline.agents import _Pictures, open_agents, picture_of, shortened
from pipeline.config import RoleSettings, RunConfig
from pipeline.errors import AgentError, ConfigError
from pipeline.interfaces import Prompt
from pipeline.prompts import fill, templates
from pipeline.recording import Recording
from pipeline.records import Frame
from tests.chat_server import ROLES, Act, Body, asking, http_config, say, status

PROMPTS = {
    "rhs": fill("T1-LLM", {"descriptions": ["a cat", "a dog"]}),
    "aes": fill("T2-LLM", {"lists": ["cat, dog", "dog"]}),
    "cos": fill("X-LLM", {"rhs": ["cat: runs"], "aes": ["cat"]}),
    "aos": fill("A-LLM", {"cos": ["cat: runs"]}),
}


def frames(count: int, width: int = 64, height: int = 36) -> list[Frame]:
    y, x = np.mgrid[0:height, 0:width]
    return [
        Frame(
            "v",
            12 * i,
            0.4 * i,
            np.stack([x % 256, y % 256, np.full_like(x, 9 * i % 256)], 2).astype(np.uint8),
        )
        for i in range(count)
    ]


def pictures(body: Body) -> list[np.ndarray]:
    """The pictures in a request, decoded, RGB."""
    urls = [
        part["image_url"]["url"] for part in body["messages"][-1]["content"] if part["type"] == "image_url"
    ]
    assert all(url.startswith("data:image/jpeg;base64,") for url in urls)
    jpegs = [base64.b64decode(url.partition(",")[2]) for url in urls]
    return [cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1] for jpeg in jpegs]


def test_every_role_asks_its_own_model_with_its_own_settings() -> None:
    roles = {
        name: {"endpoint": "near", "model": f"m-{name}", "temperature": 0.1 * place, "max_tokens": 50 + place}
        for place, name in enumerate(ROLES)
    }
    with asking(lambda *_: say("cat"), roles=roles, seed=40) as asked:
        asked.vision.look(frames(1), fill("T1-VLM"), 6)
        asked.vision.look(frames(3), fill("T2-VLM"), 6)
        for prompt in PROMPTS.values():
            asked.language.complete(prompt, 0)
        asked.language.complete(PROMPTS["aos"], 1)
    sent = [(b["model"], b["temperature"], b["max_tokens"], b["seed"]) for b in asked.server.requests]
    assert sent == [
        ("m-scene", 0.0, 50, 40),  # the same whichever frame it is: an equal frame is not paid twice
        ("m-video", 0.1, 51, 46),
        ("m-rhs", 0.2, 52, 40),
        ("m-aes", pytest.approx(0.3), 53, 40),
        ("m-cos", 0.4, 54, 40),
        ("m-aos", 0.5, 55, 40),
        ("m-aos", 0.5, 55, 41),
    ]


@pytest.mark.parametrize(("role", "prompt"), PROMPTS.items())
def test_the_papers_words_are_sent_as_they_are(role: str, prompt: Prompt) -> None:
    with asking(lambda *_: say("[]")) as asked:
        reply = asked.language.complete(prompt, 0)
    system, user = asked.server.requests[0]["messages"]
    assert system == {"role": "system", "content": templates()[prompt.prompt_id]["system"]}
    assert user == {"role": "user", "content": f"{prompt.user}\n\n{prompt.format_hint}"}
    assert (reply.text, reply.model, reply.input_tokens, reply.output_tokens) == ("[]", "tiny", 100, 20)


def test_frames_are_sent_as_small_jpegs_after_the_prompt() -> None:
    with asking(lambda *_: say("a cat"), role={"image_width_px": 32}) as asked:
        asked.vision.look(frames(1), fill("T1-VLM"), 0)
        asked.vision.look(frames(25), fill("T2-VLM"), 0)
    one, many = asked.server.requests
    assert [message["role"] for message in one["messages"]] == ["user"]  # the paper gives no system prompt
    assert one["messages"][0]["content"][0] == {"type": "text", "text": templates()["T1-VLM"]["user"]}
    assert [picture.shape for picture in pictures(one)] == [(18, 32, 3)]
    assert len(pictures(many)) == 25
    assert "response_format" not in one


def test_a_format_hint_for_pictures_is_a_part_of_its_own() -> None:
    prompt = Prompt("T1-VLM", "Be brief.", "What is there?", "Answer in a list.")
    with asking(lambda *_: say("a cat")) as asked:
        asked.vision.look(frames(1), prompt, 0)
    system, user = asked.server.requests[0]["messages"]
    assert system == {"role": "system", "content": "Be brief."}
    assert [part.get("text") for part in user["content"]] == ["What is there?", "Answer in a list.", None]


def test_a_picture_keeps_its_colours_and_is_never_enlarged() -> None:
    rgb = np.zeros((40, 60, 3), np.uint8)
    rgb[:, :30] = (200, 30, 10)
    jpeg = base64.b64decode(picture_of(rgb, 640, 95).data_url.partition(",")[2])
    back = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    assert back.shape == rgb.shape
    assert np.abs(back[20, 10].astype(int) - (200, 30, 10)).max() < 12
    assert len(picture_of(rgb, 640, 5).data_url) < len(picture_of(rgb, 640, 95).data_url)
    assert picture_of(np.zeros((1, 9_000, 3), np.uint8), 16, 85).data_url


def test_a_picture_is_encoded_once_while_its_frame_lives() -> None:
    kept = _Pictures()
    clip = frames(2)
    settings = RoleSettings()
    assert kept.of(clip[0], settings) is kept.of(clip[0], settings)
    assert kept.of(clip[0], settings) is not kept.of(clip[1], settings)
    assert kept.of(clip[0], RoleSettings(image_width_px=16)) != kept.of(clip[0], settings)
    clip.clear()
    gc.collect()
    assert kept._kept == {}


TOO_LONG = {
    "OpenAI": (
        400,
        "This model's maximum context length is 8192 tokens.",
        {"code": "context_length_exceeded"},
    ),
    "llama.cpp": (400, "the request exceeds the available context size, try increasing it", {}),
    "vLLM": (400, "'max_tokens' is too large: 200. This model's maximum context length is 512 tokens", {}),
    "proxy": (413, "payload too large", {}),
}


@pytest.mark.parametrize(("code", "message", "error"), TOO_LONG.values(), ids=TOO_LONG)
def test_a_context_that_is_too_long_takes_every_other_description(
    code: int, message: str, error: Any
) -> None:
    def script(body: Body, _: int) -> Act:
        words = body["messages"][-1]["content"]
        return say("[]") if words.count("a car waits") < 8 else status(code, message, **error)

    descriptions = [f"{i}: a car waits" for i in range(25)]
    with asking(script) as asked:
        reply = asked.language.complete(fill("T1-LLM", {"descriptions": descriptions}), 0)
    assert reply.model == "tiny (7 of 25 descriptions: context too long)"
    assert len(asked.server.requests) == 3
    last = asked.server.requests[-1]["messages"][-1]["content"]
    assert last.startswith(fill("T1-LLM", {"descriptions": descriptions[::4]}).user)
    assert "response_format" in asked.server.requests[-1]
    assert asked.waits_s == []


def test_shortening_ends() -> None:
    act = status(400, "maximum context length is 1", code="context_length_exceeded")
    with asking(lambda *_: act) as asked:
        with pytest.raises(
            AgentError, match=r"role rhs, model tiny: .* too long .*maximum context length is 1"
        ):
            asked.language.complete(fill("T1-LLM", {"descriptions": ["a car"] * 1_000}), 0)
        assert len(asked.server.requests) == 5
        with pytest.raises(AgentError, match="too long"):
            asked.language.complete(PROMPTS["aos"], 0)  # nothing to leave out
        assert len(asked.server.requests) == 6
        with pytest.raises(AgentError, match=r"role video, model tiny: .* too long"):
            asked.vision.look(frames(25), fill("T2-VLM"), 0)
        assert len(asked.server.requests) == 12  # 25, 13, 7, 4, 2, 1


def test_too_many_frames_are_halved() -> None:
    def script(body: Body, _: int) -> Act:
        return say("cat") if len(pictures(body)) <= 8 else status(400, "At most 8 image(s) may be provided")

    clip = frames(25)
    with asking(script) as asked:
        reply = asked.vision.look(clip, fill("T2-VLM"), 0)
    assert reply.model == "tiny (7 of 25 frames: context too long)"
    blue = [round(float(picture[..., 2].mean())) for picture in pictures(asked.server.requests[-1])]
    assert np.abs(np.array(blue) - [9 * i % 256 for i in range(0, 25, 4)]).max() < 8


def test_shortened_keeps_what_was_put_around_the_prompt() -> None:
    prompt = fill("X-LLM", {"rhs": ["a", "b"], "aes": ["a long element", "c", "d"]})
    repair = Prompt(prompt.prompt_id, "s", f"{prompt.user} Repair it.", "hint", prompt.inputs)
    shorter = shortened(repair)
    assert shorter is not None
    assert shorter.inputs == {"rhs": ("a", "b"), "aes": ("a long element", "d")}
    expected = fill("X-LLM", {"rhs": ["a", "b"], "aes": ["a long element", "d"]}).user
    assert (shorter.user, shorter.system, shorter.format_hint) == (f"{expected} Repair it.", "s", "hint")
    assert shortened(Prompt("X-LLM", "", "Other words", "", prompt.inputs)) is None
    assert shortened(Prompt("X-LLM", "", prompt.user, "", {"rhs": ("a", "b")})) is None
    assert shortened(Prompt("X-LLM", "", "Repair it.", "")) is None


def test_names_hold_models_and_roles_and_no_more() -> None:
    config = http_config("http://secret-host:1/v1", endpoint={"api_key_env": "NEAR_KEY"})
    agents = open_agents(config, Recording("unused"), replay=True)  # type: ignore[arg-type]
    assert agents.language is not None
    assert agents.vision is not None
    assert agents.language.name == "tiny over HTTP (roles rhs, aes, cos, aos)"
    assert agents.vision.name == "tiny over HTTP (roles scene, video)"
    roles = {**config.model_dump()["roles"], "aes": {"endpoint": "near", "model": "big"}}
    mixed = open_agents(http_config("http://h/v1", roles=roles))
    assert mixed.language is not None
    assert mixed.language.name == "tiny over HTTP (roles rhs, cos, aos); big over HTTP (role aes)"


def test_all_wrong_settings_are_listed_at_once(monkeypatch) -> None:
    monkeypatch.delenv("FAR_KEY", raising=False)
    monkeypatch.setenv("ODD_KEY", "two words")
    endpoints = {
        "far": {"base_url": "http://127.0.0.1/v1", "api_key_env": "FAR_KEY"},
        "odd": {"base_url": "http://127.0.0.1/v1", "api_key_env": "ODD_KEY"},
    }
    roles = {
        "scene": {"endpoint": "far", "model": "m"},
        "video": {"endpoint": "fra", "model": "m"},
        "rhs": {"endpoint": "odd"},
        "aes": {"model": "m"},
        "cos": {"endpoint": "far", "model": "m"},
        "aos": {"endpoint": "far", "model": "m"},
    }
    whole = {"vision": "http", "language": "http", "roles": roles, "endpoints": endpoints}
    with pytest.raises(ConfigError) as caught:
        open_agents(RunConfig.model_validate(whole))
    lines = str(caught.value).splitlines()
    assert len(lines) == 6
    assert "roles.video.endpoint: found 'fra'; expected one of the endpoints: far, odd." in lines[2]
    for part in (
        "roles.rhs.model",
        "roles.aes.endpoint",
        "variable FAR_KEY is not set",
        "ODD_KEY holds char",
    ):
        assert sum(part in line for line in lines) == 1
    assert "two words" not in str(caught.value)


def test_roles_that_are_not_used_need_no_settings() -> None:
    role = {"endpoint": "a", "model": "m"}
    whole = {
        "language": "http",
        "track2": {"enabled": False},
        "roles": {"rhs": role, "aos": role},
        "endpoints": {
            "a": {"base_url": "http://127.0.0.1/v1"},
            "b": {"base_url": "http://h/", "api_key_env": "NO"},
        },
    }
    agents = open_agents(RunConfig.model_validate(whole))
    assert agents.vision is None
    assert agents.language is not None
    embedded = open_agents(RunConfig())
    assert (embedded.vision, embedded.language, embedded.endpoints) == (None, None, ())
    with pytest.raises(ConfigError, match="replay"):
        open_agents(RunConfig(), replay=True)


def test_keys_go_to_their_own_server_only(monkeypatch) -> None:
    for name in ("OPENAI_API_KEY", "OPENAI_ORG_ID", "OPENAI_PROJECT_ID", "OPENAI_ADMIN_KEY"):
        monkeypatch.setenv(name, "private-to-openai")
    with asking(lambda *_: say("[]")) as asked:
        asked.language.complete(PROMPTS["aos"], 0)
    assert "private-to-openai" not in json.dumps(asked.server.headers)
