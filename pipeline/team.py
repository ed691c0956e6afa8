"""Who answers in a run: the agents and the matcher that a configuration names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import Lock

from pipeline.agents import HttpAgents, open_agents
from pipeline.classifier import ConseMatcher, CropClassifier, open_classifier
from pipeline.clip import ClipMatcher
from pipeline.config import RunConfig
from pipeline.embedded_language import EmbeddedLanguageAgent
from pipeline.embedded_vision import EmbeddedVisionAgent
from pipeline.files import sha256_of
from pipeline.graphs import cache_folder
from pipeline.interfaces import Embedder, ImageTextMatcher, LanguageAgent, VisionAgent
from pipeline.minilm import open_embedder
from pipeline.recording import Recording
from pipeline.records import TrackBox
from pipeline.stages import Agents


@dataclass(frozen=True, slots=True)
class Services:
    """What a run may use beside its configuration: a recording (a folder, or ""), and only that."""

    recording: str = ""
    replay: bool = False


NO_SERVICES = Services()


class Team:
    """The agents and models of a run, opened once a process, each when it is first needed."""

    def __init__(self, config: RunConfig, services: Services) -> None:
        """Raises ConfigError with every setting that names an agent which cannot be asked."""
        self._config = config
        recording = Recording(Path(services.recording)) if services.recording else None
        uses_http = "http" in (config.vision, config.language)
        self._http: HttpAgents | None = open_agents(config, recording, services.replay) if uses_http else None

    @property
    def waits_for_servers(self) -> bool:
        """Whether threads are the way to run many videos at once, and calls within one."""
        return self._http is not None

    def close(self) -> None:
        """Close all connections to servers."""
        if self._http:
            self._http.close()

    @cached_property
    def matcher(self) -> ImageTextMatcher:
        """Who compares snippets with labels."""
        return (
            self._clip if self._config.matcher == "clip" else ConseMatcher(self._classifier, self._embedder)
        )

    def agents(self, boxes: Mapping[str, Sequence[TrackBox]]) -> Agents:
        """The agents for videos with these boxes (by video id)."""
        vision: VisionAgent | None = self._http.vision if self._http else None
        if vision is None:
            vision = EmbeddedVisionAgent(self._classifier, boxes, self._config.seed)
        language: LanguageAgent | None = self._http.language if self._http else None
        if language is None:
            language = EmbeddedLanguageAgent(self._embedder)
        # As many as a server may be sent at once: the endpoint itself holds back what is too much.
        in_flight = [endpoint.max_in_flight for endpoint in self._config.endpoints.values()]
        return Agents(vision, vision, language, max(in_flight, default=1) if self._http else 1)

    @property
    def names(self) -> str:
        """One line that says who answered; goes into files and onto pages."""
        config = self._config
        vision = self._http.vision.name if self._http and self._http.vision else EmbeddedVisionAgent.name
        language = (
            self._http.language.name if self._http and self._http.language else EmbeddedLanguageAgent.name
        )
        matcher = self._clip.name if config.matcher == "clip" else "ConSE baseline in place of CLIP"
        track2 = () if config.track2.enabled else ("without Track 2",)
        return "; ".join([vision, language, matcher, *track2])

    @property
    def sha256(self) -> str:
        """Hash of the local models that take part; models behind HTTP are named in the configuration."""
        config = self._config
        parts = [self._clip.sha256] if config.matcher == "clip" else []
        if "embedded" in (config.vision, config.language) or config.matcher == "conse":
            parts += [self._classifier.sha256, self._embedder.sha256]
        return sha256_of(" ".join(parts).encode())

    @cached_property
    def _classifier(self) -> CropClassifier:
        return open_classifier(threads=1)  # one thread each: videos run in parallel

    @cached_property
    def _embedder(self) -> Embedder:
        return open_embedder(threads=1)

    @cached_property
    def _clip(self) -> ClipMatcher:
        return ClipMatcher(Path(self._config.clip_folder), cache_folder() / "vectors", threads=1)


_TEAMS: dict[tuple[str, Services], Team] = {}
_OPENING = Lock()


def open_team(config: RunConfig, services: Services) -> Team:
    """The team of a configuration, one a process, so that models are loaded and limits kept once."""
    key = (config.model_dump_json(), services)
    with _OPENING:
        if key not in _TEAMS:
            _TEAMS[key] = Team(config, services)
        return _TEAMS[key]


def close_connections() -> None:
    """Let go of the teams that hold connections to servers; models stay loaded."""
    with _OPENING:
        for key in [key for key, team in _TEAMS.items() if team.waits_for_servers]:
            _TEAMS.pop(key).close()
