"""The agents that ask model servers over HTTP, in the paper's roles (paper, section 2).

    role     prompt   asks                         with
    scene    T1-VLM   one frame                    the configuration's seed
    video    T2-VLM   all frames, repeatedly       seed + number of the call
    rhs      T1-LLM   the descriptions             "
    aes      T2-LLM   the lists                    "
    cos      X-LLM    RHS and AES                  "
    aos      A-LLM    COS                          "

Each role may have its own server, model and sampling. A request whose answer is in the recording
is not sent; in a replay none is.
"""

import base64
import os
import random
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.config import RoleSettings, RunConfig
from pipeline.desk import Desk
from pipeline.endpoint import Endpoint, Picture, Question
from pipeline.errors import AgentError, ConfigError
from pipeline.files import sha256_of
from pipeline.interfaces import Prompt
from pipeline.metering import Ledger, Usage
from pipeline.prompts import fill
from pipeline.recording import Answer, AnswerSchema, Recording
from pipeline.records import Frame, Reply, RgbImage

VISION_ROLES = {"T1-VLM": "scene", "T2-VLM": "video"}
LANGUAGE_ROLES = {"T1-LLM": "rhs", "T2-LLM": "aes", "X-LLM": "cos", "A-LLM": "aos"}
# Track 2's list is of names (paper); the other answers have a description for each label.
ANSWER_SCHEMAS: dict[str, AnswerSchema] = {
    "rhs": "items-1",
    "aes": "names-1",
    "cos": "items-1",
    "aos": "items-1",
}
TRACK2_ROLES = frozenset({"video", "aes", "cos"})
MAX_SHORTENINGS = 4


class HttpVisionAgent:
    """Shows frames to a vision model: one for a scene, all of them for a video."""

    def __init__(self, desk: Desk) -> None:
        """`desk` answers in the roles `scene` and `video`."""
        self._desk = desk
        self._pictures = _Pictures()

    @property
    def name(self) -> str:
        """The models with their roles."""
        return _name(self._desk.config, VISION_ROLES)

    def look(self, frames: Sequence[Frame], prompt: Prompt, call: int) -> Reply:
        """Answer `prompt` about the frames, with every other frame while they are too many.

        Raises AgentError when no answer came or the model refused.
        """
        role = VISION_ROLES[prompt.prompt_id]
        settings = self._desk.settings(role)
        seed = self._desk.config.seed + (call if role == "video" else 0)
        shown = list(frames)
        while True:
            pictures = [self._pictures.of(frame, settings) for frame in shown]
            answer = self._desk.ask(_question(role, settings, seed, prompt, pictures))
            if answer.outcome != "too long" or len(shown) == 1:
                break
            shown = shown[::2]
        left_out = f"{len(shown)} of {len(frames)} frames" if len(shown) < len(frames) else ""
        return _reply(role, settings, answer, left_out)


class HttpLanguageAgent:
    """Gives lists to a language model, and asks for a JSON schema where the server knows them."""

    def __init__(self, desk: Desk) -> None:
        """`desk` answers in the roles `rhs`, `aes`, `cos` and `aos`."""
        self._desk = desk

    @property
    def name(self) -> str:
        """The models with their roles."""
        return _name(self._desk.config, LANGUAGE_ROLES)

    def complete(self, prompt: Prompt, call: int) -> Reply:
        """Answer `prompt`, with every other entry of its longest list while it is too long.

        Raises AgentError when no answer came or the model refused.
        """
        role = LANGUAGE_ROLES[prompt.prompt_id]
        settings = self._desk.settings(role)
        left_out = ""
        asked = prompt
        for turn in range(MAX_SHORTENINGS + 1):
            answer = self._desk.ask(_question(role, settings, self._desk.config.seed + call, asked, []))
            shorter = shortened(asked) if answer.outcome == "too long" and turn < MAX_SHORTENINGS else None
            if shorter is None:
                break
            asked = shorter
            kept = {name: (len(asked.inputs[name]), len(prompt.inputs[name])) for name in asked.inputs}
            left_out = ", ".join(f"{now} of {was} {name}" for name, (now, was) in kept.items() if now < was)
        return _reply(role, settings, answer, left_out)


@dataclass(frozen=True, slots=True)
class HttpAgents:
    """The agents of a run that are asked over HTTP; None where the configuration names others."""

    vision: HttpVisionAgent | None
    language: HttpLanguageAgent | None
    endpoints: tuple[Endpoint, ...]
    ledger: Ledger

    def usage(self) -> dict[str, Usage]:
        """What each role has cost so far in this process."""
        return self.ledger.snapshot()

    def close(self) -> None:
        """Close all connections."""
        for endpoint in self.endpoints:
            endpoint.close()


def open_agents(
    config: RunConfig,
    recording: Recording | None = None,
    replay: bool = False,
    *,
    sleep: Callable[[float], None] = time.sleep,
    rng: random.Random | None = None,
) -> HttpAgents:
    """The HTTP agents of a configuration, for any number of threads. Nothing is sent yet.

    A replay needs a recording, and neither servers nor keys. `sleep` takes seconds. Raises
    ConfigError with every role and endpoint that cannot be used.
    """
    if replay and recording is None:
        raise ConfigError("A replay was asked for, but no recording given; expected the folder of one.")
    roles = roles_in_use(config)
    faults = [
        f"roles.{role}.model: found none; expected the name of a model."
        for role in roles
        if not getattr(config.roles, role).model
    ]
    servers: dict[str, Endpoint] = {}
    if not replay:
        faults += _endpoint_faults(config, roles)
    if faults:
        lines = [f"The models of the run cannot be asked: {len(faults)} wrong setting(s).", *faults]
        raise ConfigError("\n  ".join(lines))
    if not replay:
        for name in dict.fromkeys(getattr(config.roles, role).endpoint for role in roles):
            settings = config.endpoints[name]
            key = os.environ[settings.api_key_env].strip() if settings.api_key_env else ""
            servers[name] = Endpoint(name, settings, key, sleep=sleep, rng=rng)
    by_role = {role: servers[getattr(config.roles, role).endpoint] for role in roles if not replay}
    desk = Desk(config, by_role, recording, replay=replay)
    return HttpAgents(
        HttpVisionAgent(desk) if config.vision == "http" else None,
        HttpLanguageAgent(desk) if config.language == "http" else None,
        tuple(servers.values()),
        desk.ledger,
    )


def roles_in_use(config: RunConfig) -> list[str]:
    """The roles that a run asks over HTTP, in the order of the paper."""
    vision = VISION_ROLES.values() if config.vision == "http" else ()
    language = LANGUAGE_ROLES.values() if config.language == "http" else ()
    return [role for role in (*vision, *language) if config.track2.enabled or role not in TRACK2_ROLES]


def _endpoint_faults(config: RunConfig, roles: Sequence[str]) -> list[str]:
    faults = []
    known = ", ".join(sorted(config.endpoints)) or "none"
    used: dict[str, None] = {}
    for role in roles:
        name = getattr(config.roles, role).endpoint
        if not name:
            faults.append(f"roles.{role}.endpoint: found none; expected the name of an endpoint.")
        elif name not in config.endpoints:
            faults.append(f"roles.{role}.endpoint: found {name!r}; expected one of the endpoints: {known}.")
        else:
            used[name] = None
    for name in used:
        variable = config.endpoints[name].api_key_env
        key = os.environ.get(variable, "").strip()
        place = f"endpoints.{name}.api_key_env: the environment variable {variable}"
        if variable and not key:
            faults.append(f"{place} is not set; expected the key. Set it: export {variable}=...")
        elif not (key.isascii() and key.isprintable()) or " " in key:
            faults.append(f"{place} holds characters that no key has; expected visible ASCII.")
    return faults


def shortened(prompt: Prompt) -> Prompt | None:
    """`prompt` with every other entry of its longest list (in characters); None when none has two.

    Words that were put around the paper's prompt, such as a request to repair, stay.
    """
    lengths = {name: sum(map(len, entries)) for name, entries in prompt.inputs.items() if len(entries) > 1}
    if not lengths:
        return None
    longest = max(lengths, key=lambda name: lengths[name])
    try:
        whole = fill(prompt.prompt_id, prompt.inputs).user
        part = fill(prompt.prompt_id, {**prompt.inputs, longest: prompt.inputs[longest][::2]})
    except (KeyError, ValueError):
        return None
    if whole not in prompt.user:
        return None
    return replace(prompt, user=prompt.user.replace(whole, part.user, 1), inputs=part.inputs)


def _question(
    role: str, settings: RoleSettings, seed: int, prompt: Prompt, pictures: Sequence[Picture]
) -> Question:
    words = [prompt.user, prompt.format_hint] if prompt.format_hint else [prompt.user]
    return Question(
        role,
        settings.model,
        settings.temperature,
        settings.max_tokens,
        seed,
        prompt.system,
        (*words, *pictures),
        ANSWER_SCHEMAS.get(role, ""),
    )


def _reply(role: str, settings: RoleSettings, answer: Answer, left_out: str) -> Reply:
    if answer.outcome != "answered":
        what = (
            "the model refuses"
            if answer.outcome == "refused"
            else "the request is too long for it, even shortened"
        )
        said = answer.text if len(answer.text) <= 300 else answer.text[:300] + "..."
        raise AgentError(f"role {role}, model {settings.model}: {what}: {said}")
    notes = [f"{left_out}: context too long" if left_out else "", answer.note]
    note = "; ".join(filter(None, notes))
    model = f"{settings.model} ({note})" if note else settings.model
    return Reply(answer.text, model, answer.latency_s, answer.input_tokens, answer.output_tokens)


def _name(config: RunConfig, by_prompt: Mapping[str, str]) -> str:
    """Which model answers over HTTP in which role."""
    used = set(roles_in_use(config))
    roles: dict[str, list[str]] = {}
    for role in by_prompt.values():
        if role in used:
            roles.setdefault(getattr(config.roles, role).model, []).append(role)
    return "; ".join(
        f"{model} over HTTP (role{'s' if len(names) > 1 else ''} {', '.join(names)})"
        for model, names in roles.items()
    )


class _Pictures:
    """JPEGs of frames, kept while the frame is: a clip is shown twenty times (paper, Track 2)."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int, int], tuple[weakref.ref[RgbImage], Picture]] = {}

    def of(self, frame: Frame, settings: RoleSettings) -> Picture:
        """The frame as it is sent."""
        key = (id(frame.rgb), settings.image_width_px, settings.jpeg_quality)
        found = self._kept.get(key)
        if found is not None and found[0]() is frame.rgb:
            return found[1]
        picture = picture_of(frame.rgb, settings.image_width_px, settings.jpeg_quality)
        # When the pixels go, their number may be given to others: forget it.
        gone = weakref.ref(frame.rgb, lambda _: self._kept.pop(key, None))
        self._kept[key] = (gone, picture)
        return picture


def picture_of(rgb: RgbImage, width_px: int, quality: int) -> Picture:
    """Pixels (H, W, 3) as a JPEG at most `width_px` wide; smaller pictures keep their size."""
    height, width = rgb.shape[:2]
    if width > width_px:
        size = (width_px, max(1, round(height * width_px / width)))
        rgb = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
    ok, encoded = cv2.imencode(
        ".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    if not ok:
        raise AgentError("a frame could not be encoded as JPEG")
    jpeg = encoded.tobytes()
    return Picture(sha256_of(jpeg), "data:image/jpeg;base64," + base64.b64encode(jpeg).decode())
