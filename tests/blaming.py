"""Records, captions and scores of one video made by hand, to ask who is to blame."""

from collections.abc import Mapping, Sequence

from pipeline.minilm import open_embedder
from pipeline.records import (
    Box,
    Exclusion,
    Item,
    Kind,
    Parse,
    Prediction,
    Reply,
    Snippet,
    Stage,
    StageOutput,
    TrackBox,
    TruthHazard,
)
from pipeline.scores import Evaluation, PairScore, Scorecard, Signature, Submission
from sitegen.blame import BlameInput, blame_board
from sitegen.failures import Blame, Failure
from sitegen.gathered import Records

EMBEDDER = open_embedder()
CARD = Scorecard(0.0, 0.0, 0.0, None, 1, Signature("1", "fake", "0" * 64, "1" * 64, 1, 0.8))
DEER = TruthHazard("v", "h1", "Deer", "A deer runs across the road", "7")
FUNNEL = ("truth", "seen", "ranked", "merged", "anomalous", "matched")


def output(stage: Stage, call: int, text: str = "", items: Sequence[str] = ()) -> StageOutput:
    """One call of a stage; `items` are the labels of its list."""
    listed = tuple(Item(rank, label, "") for rank, label in enumerate(items, start=1))
    frame = call * 12 if stage is Stage.SCENE else None
    return StageOutput("v", stage, call, "", "", Reply(text, "model"), listed, Parse.JSON, frame)


def stages(**said: Sequence[str] | None) -> tuple[StageOutput, ...]:
    """Stage name -> texts of its calls (scene, answer) or labels of its list; None: not recorded."""
    default: dict[str, Sequence[str] | None] = {
        "scene": ["The road is clear."],
        "answer": ["trees, houses"],
        "rhs": [],
        "aes": [],
        "cos": [],
        "aos": [],
    }
    outputs: list[StageOutput] = []
    for name, texts in {**default, **said}.items():
        stage = Stage(name)
        if texts is None:
            continue
        if stage in {Stage.SCENE, Stage.ANSWER}:
            outputs += [output(stage, call, text) for call, text in enumerate(texts)]
        else:
            outputs.append(output(stage, 0, items=texts))
    return tuple(outputs)


def system(
    captions: Sequence[str],
    similarities: Sequence[Mapping[str, float]],
    records: Records | None = None,
    video_id: str = "v",
) -> BlameInput:
    """One video: its captions, and for each the similarity to each hazard."""
    predictions = tuple(Prediction(video_id, rank, text) for rank, text in enumerate(captions, start=1))
    pairs = tuple(
        PairScore(video_id, rank, hazard_id, value, value)
        for rank, values in enumerate(similarities, start=1)
        for hazard_id, value in values.items()
    )
    evaluation = Evaluation(Submission("a", "", "", "", "csv", predictions), pairs, (), CARD)
    return BlameInput(evaluation, {video_id: records} if records else {})


def blame_of(one: BlameInput, *truth: TruthHazard) -> Blame:
    """The blame of a board of one; the truth is a deer unless it is given."""
    (blame,) = blame_board([one], truth or (DEER,), EMBEDDER, 0.8)
    return blame


def only(blame: Blame) -> Failure:
    """The only failure of a hazard."""
    (failure,) = [failure for failure in blame.failures if failure.hazard_id]
    return failure


def alive_of(blame: Blame) -> list[int | None]:
    """The numbers of the funnel."""
    assert tuple(step.stage for step in blame.funnel) == FUNNEL
    return [step.alive for step in blame.funnel]


def snippets(track: str, *reasons: Exclusion | None, kind: Kind = Kind.CHALLENGE) -> tuple[Snippet, ...]:
    """Snippets of a track, a frame each, with why each was left out."""
    box = Box(0, 0, 10, 10)
    return tuple(
        Snippet(TrackBox("v", frame, track, kind, box), reason) for frame, reason in enumerate(reasons)
    )
