"""What a run's questions cost: calls, tokens, seconds and money, by role and video."""

from collections.abc import Iterable, Mapping

from pipeline.config import Price
from pipeline.records import Stage, StageOutput, UsageRow

ROLES = {
    Stage.SCENE: "scene",
    Stage.ANSWER: "video",
    Stage.RHS: "rhs",
    Stage.AES: "aes",
    Stage.COS: "cos",
    Stage.AOS: "aos",
}


def usage_of(
    outputs: Iterable[StageOutput], models: Mapping[str, str], prices: Mapping[str, Price]
) -> list[UsageRow]:
    """A row for each (video, role) that asked an agent; sums are None where nothing was counted.

    `models` names each role's model, for its price; `cost` is None without a price or tokens. A
    replayed answer counts as it did when it was paid for.
    """
    groups: dict[tuple[str, str], list[StageOutput]] = {}
    for output in outputs:
        if output.stage in ROLES:
            groups.setdefault((output.video_id, ROLES[output.stage]), []).append(output)
    rows = []
    for (video_id, role), said in sorted(groups.items()):
        input_tokens = _sum(output.reply.input_tokens for output in said)
        output_tokens = _sum(output.reply.output_tokens for output in said)
        price = prices.get(models.get(role, ""))
        cost = None
        if price and input_tokens is not None and output_tokens is not None:
            cost = (
                input_tokens * price.input_per_million + output_tokens * price.output_per_million
            ) / 1_000_000
        seconds = [output.reply.latency_s for output in said if output.reply.latency_s is not None]
        rows.append(
            UsageRow(
                video_id,
                role,
                models.get(role, ""),
                len(said),
                input_tokens,
                output_tokens,
                sum(seconds) if seconds else None,
                cost,
            )
        )
    return rows


def _sum(counts: Iterable[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if known else None
