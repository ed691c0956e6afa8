"""A small benchmark that is complete: clips, boxes, truth, three submissions, one of them hostile."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.files import sha256_file, slug
from pipeline.records import (
    Box,
    Exclusion,
    Item,
    Kind,
    Match,
    Parse,
    Prediction,
    Reply,
    Snippet,
    Stage,
    StageOutput,
    TrackBox,
    TruthHazard,
    UsageRow,
    VideoOutcome,
)
from pipeline.scores import Submission
from pipeline.tables import BOXES, MATCHES, OUTCOMES, PREDICTIONS, SNIPPETS, STAGES, TRUTH, USAGE
from sitegen import ledger
from sitegen.evaluate import evaluate, truth_sha256
from sitegen.ledger import Entry
from sitegen.probes import Probe
from sitegen.readers import read_truth
from sitegen.standings import Standing
from sitegen.submissions import StoredSubmission
from tests.clips import write_clip

SIZE = (320, 180)
FRAMES = 30
BIDI = "\u202e"
EVIL = (
    f"</script><script>alert(1)</script> <img src=x onerror=alert(2)> {BIDI}evil &amp; \u2028 {{{{ 7*7 }}}}"
)
FORMULA = '=HYPERLINK("http://evil.example/","x")'
LONG = "w" * 2000

Board = list[Standing]


class WordEmbedder:
    """Sums a fixed random direction a word: texts that share words are close."""

    name = "words"
    sha256 = hashlib.sha256(b"words").hexdigest()

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Unit vectors of shape (len(texts), 64)."""
        rows = []
        for text in texts:
            total = np.zeros(64)
            for word in text.lower().split() or [""]:
                seed = int.from_bytes(hashlib.sha256(word.encode(errors="replace")).digest()[:4], "big")
                total += np.random.default_rng(seed).normal(size=64)
            rows.append(total / np.linalg.norm(total))
        return np.array(rows, dtype=np.float32)


def make_benchmark(root: Path, clips: int = 3) -> Benchmark:
    """A benchmark folder with `clips` videos that have files, and one more that has none."""
    (root / "videos").mkdir(parents=True)
    (root / "coooler.toml").write_text(
        'name = "Small <b>benchmark</b>"\ndescription = "Made for tests & nothing else."\n'
        'truth = "truth.parquet"\nattribution = "CREDIT.md"\n',
        encoding="utf-8",
    )
    (root / "CREDIT.md").write_text(
        "# Credit\n\nThe clips were `drawn` by **the tests**.\n\n- one <i>item</i>\n\n"
        "| a | b |\n|---|---|\n| 1 | 2 |\n",
        encoding="utf-8",
    )
    boxes: list[TrackBox] = []
    for number in range(clips):
        video_id = f"v{number + 1}"
        pictures = [_picture(number, frame) for frame in range(FRAMES)]
        write_clip(root / "videos" / f"{video_id}.mp4", FRAMES, SIZE, pictures=pictures, faststart=True)
        for frame in range(FRAMES):
            boxes.append(TrackBox(video_id, frame, "7", Kind.CHALLENGE, _hazard_box(frame)))
            boxes.append(TrackBox(video_id, frame, "<i>8</i>", Kind.TRAFFIC, Box(-20.0, 10.0, 60.5, 70.0)))
    BOXES.write(root / "boxes.parquet", boxes)
    TRUTH.write(root / "truth.parquet", truth_rows(clips))
    return open_benchmark(root)


def truth_rows(clips: int) -> list[TruthHazard]:
    """One hazard, then two, then none, then one hazard each; the last video has no clip."""
    rows = [TruthHazard("v1", "h1", "Cat", "A cat crossing the road", "7", 2, 20)]
    if clips > 1:
        rows += [
            TruthHazard("v2", "h1", "Deer", "A deer stands on the road"),
            TruthHazard("v2", "h2", "Debris", "A tyre lies in our lane"),
        ]
    if clips > 2:
        rows.append(TruthHazard("v3", "h1", "", ""))
    rows += [
        TruthHazard(f"v{number}", "h1", "Dog", "A dog runs along the road") for number in range(4, clips + 1)
    ]
    return [*rows, TruthHazard("zz-gone", "h1", EVIL, f"A {EVIL} ahead")]


def make_board(benchmark: Benchmark) -> Board:
    """Three submissions with their scores: one with records, one hostile, one that says nothing.

    The ledger holds them, and one that is not on the board any more.
    """
    root = benchmark.root
    good = [
        Prediction("v1", 1, "A cat crossing the road", "cat", ("7",), (3, 4)),
        Prediction("v2", 1, "A deer stands on the road"),
        Prediction("v2", 2, "A tyre lies in our lane"),
        Prediction("v2", 3, "A parked car"),
        Prediction("v3", 1, "A cat"),
    ]
    evil = [Prediction("v1", 1, EVIL, EVIL), Prediction("v2", 1, LONG), Prediction("v2", 2, FORMULA)]
    good_folder = root / "submissions" / "good-system"
    evil_folder = root / "submissions" / "evil"
    for folder in (good_folder, evil_folder):
        folder.mkdir(parents=True, exist_ok=True)
        _write_records(folder)
    USAGE.write(
        good_folder / "usage.parquet",
        [
            UsageRow("v1", "scene", "eyes", 25, 1_000, 200, 12.25, 0.5),
            UsageRow("v1", "rhs", "words", 1, None, None, None, None),
        ],
    )
    truth = read_truth(benchmark.truth)
    board = [
        _entry(benchmark, truth, "Good system", good, "An embedded baseline", good_folder),
        _entry(benchmark, truth, FORMULA, evil, EVIL, evil_folder),
        _entry(benchmark, truth, "Silent", [], "", root / "submissions" / "silent"),
    ]
    _write_ledger(root / "submissions", board)
    entries = ledger.read(root / "submissions")
    return [
        one._replace(probes=probes(place), history=tuple(e for e in entries if e.slug == one.stored.slug))
        for place, one in enumerate(board)
    ]


def probes(speaking: int) -> tuple[Probe, ...]:
    """Six probes, of which the first few speak, and the last cannot be said."""
    kinds = ("constant", "word-bag", "shuffled", "stuffing", "near-copy", "truth-copy")
    return tuple(
        Probe(
            kind,
            f"Probe {kind}",
            None if place == 5 else 0.5,
            "–" if place == 5 else "50\u202f%",
            0.4,
            "from 40\u202f%",
            place < speaking,
            f"A sentence <b>on</b> {kind}.",
        )
        for place, kind in enumerate(kinds)
    )


def _write_ledger(folder: Path, board: Board) -> None:
    (folder / ledger.FILE_NAME).unlink(missing_ok=True)
    entries = [
        Entry(
            event="add",
            slug=one.stored.slug,
            name=one.evaluation.submission.name,
            date="2026-01-02",
            predictions_sha256=one.stored.predictions_sha256,
            original_sha256=one.stored.original_sha256,
            signature=str(one.evaluation.card.signature),
            besm=one.evaluation.card.besm,
            sam=one.evaluation.card.sam,
            detection_rate=one.evaluation.card.detection_rate,
            hazard_recall=one.evaluation.card.hazard_recall,
        )
        for one in board
    ]
    gone = entries[0].model_copy(update={"slug": "gone", "name": "Gone", "date": "2026-01-03"})
    why = {"event": "withdraw", "reason": f"It was {EVIL}", "date": "2026-01-04"}
    ledger.append(folder, [*entries, gone, gone.model_copy(update=why)])


def _entry(
    benchmark: Benchmark,
    truth: list[TruthHazard],
    name: str,
    predictions: list[Prediction],
    agents: str,
    folder: Path,
) -> Standing:
    folder.mkdir(parents=True, exist_ok=True)
    PREDICTIONS.write(folder / "predictions.parquet", predictions)
    digest = sha256_file(folder / "predictions.parquet")
    warnings = ("2 videos have no prediction",) if predictions else ()
    submission = Submission(
        name, "Some <authors>", "https://example.org/", "2026-01-02", "csv", tuple(predictions), warnings
    )
    stored = StoredSubmission(
        slug(name), folder, submission, agents, digest, digest, "", (), "MIT", f"A note, {EVIL}"
    )
    evaluation = evaluate(
        submission, truth, WordEmbedder(), benchmark.settings.threshold, truth_sha256(truth)
    )
    return Standing(stored, evaluation)


def _write_records(folder: Path) -> None:
    def said(
        stage: Stage, call: int, text: str, items: tuple[Item, ...], frame: int | None = None
    ) -> StageOutput:
        return StageOutput(
            "v1", stage, call, "T1-VLM", "0" * 64, Reply(text, "agent"), items, Parse.JSON, frame
        )

    item = Item(1, "cat", f"crosses {EVIL}")
    stages = [said(Stage.SCENE, call, "A cat is ahead.", (), call * 3) for call in range(5)]
    stages += [said(Stage.RHS, 0, '[{"label": "cat"}]', (item,)), said(Stage.AOS, 0, EVIL, (item,))]
    STAGES.write(folder / "stages.parquet", stages)
    snippets = [
        Snippet(TrackBox("v1", frame, "7", Kind.CHALLENGE, _hazard_box(frame)), reason)
        for frame, reason in ((3, None), (4, Exclusion.TOO_NARROW), (5, Exclusion.TOO_LOW))
    ]
    SNIPPETS.write(folder / "snippets.parquet", snippets)
    MATCHES.write(folder / "matches.parquet", [Match("v1", 3, "7", "cat", 0.31, True, True)])
    OUTCOMES.write(
        folder / "outcomes.parquet",
        [
            VideoOutcome("v1", "v1.mp4", FRAMES, 25.0, *SIZE, ""),
            VideoOutcome("v2", "v2.mp4", 0, 0.0, 0, 0, "broken"),
        ],
    )


def _hazard_box(frame: int) -> Box:
    return Box(100.0 + frame, 80.0, 160.0 + 2 * frame, 140.0)


def _picture(number: int, frame: int) -> NDArray[np.uint8]:
    """A road of sorts with something on it, different in every video and frame."""
    rows = np.linspace(60, 200, SIZE[1])[:, None, None]
    picture = np.broadcast_to(rows, (SIZE[1], SIZE[0], 3)).astype(np.uint8).copy()
    picture[:, :, number % 3] //= 2
    box = _hazard_box(frame)
    picture[80:140, int(box.x1_px) : int(box.x2_px)] = (200, 90, 40)
    return picture
