"""Where questions go: first to the recording, then to the server of their role."""

from collections.abc import Mapping

from pipeline.config import RoleSettings, RunConfig
from pipeline.endpoint import Endpoint, Question
from pipeline.errors import AgentError
from pipeline.metering import Ledger
from pipeline.recording import Answer, Recording, Request


class Desk:
    """Takes questions: answers them from the recording, else asks the question's server."""

    def __init__(
        self,
        config: RunConfig,
        endpoints: Mapping[str, Endpoint],
        recording: Recording | None,
        *,
        replay: bool,
    ) -> None:
        """`endpoints` by role; none are needed when `replay`, but a recording is."""
        self.config = config
        self.ledger = Ledger(config.prices)
        self._endpoints = endpoints
        self._recording = recording
        self._replay = replay

    def settings(self, role: str) -> RoleSettings:
        """How a role is asked."""
        found: RoleSettings = getattr(self.config.roles, role)
        return found

    def ask(self, question: Question) -> Answer:
        """The answer, whatever its outcome. Raises AgentError when there is none."""
        if self._recording is None:
            return self._sent(question)[1]
        requests = self._requests(question)
        with self._recording.alone(requests[-1]):
            for request in requests:
                answer = self._recording.find(request, strict=self._replay)
                # A refusal may not come again, so it is asked anew; a replay must meet it again.
                if answer and (self._replay or answer.outcome != "refused"):
                    self.ledger.add(question.role, question.model, answer, recorded=True)
                    return answer
            if self._replay:
                raise AgentError(
                    f"role {question.role}, model {question.model}: the recording lacks the request "
                    f"{requests[0].sha256}. It was made with other settings, clips or prompts, or cut short."
                )
            with_schema, answer = self._sent(question)
            self._recording.keep(question.request(with_schema=with_schema), answer)
            return answer

    def _sent(self, question: Question) -> tuple[bool, Answer]:
        """Whether the server was asked for a schema, and its answer."""
        with_schema, answer, wasted = self._endpoints[question.role].ask(question)
        for paid in (*wasted, answer):
            self.ledger.add(question.role, question.model, paid)
        return with_schema, answer

    def _requests(self, question: Question) -> list[Request]:
        """What the question may be called in a recording: with a schema, and without."""
        plain = question.request(with_schema=False)
        known = self._endpoints.get(question.role)
        # A replay does not know what the server of the recording knew: it looks for both.
        if not question.answer_schema or (known and known.settings.json_schema == "never"):
            return [plain]
        return [question.request(with_schema=True), plain]
