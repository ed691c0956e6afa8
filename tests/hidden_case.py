"""A benchmark whose truth is made of words, labels and tracks that no other text holds."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.benchmark import Benchmark, open_benchmark
from pipeline.files import slug
from pipeline.records import (
    Box,
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
)
from pipeline.scores import Submission
from pipeline.tables import BOXES, MATCHES, SNIPPETS, STAGES, TRUTH
from sitegen.evaluate import embed_all, evaluate, texts_of
from sitegen.probes import probe_board
from sitegen.standings import Standing
from sitegen.submissions import StoredSubmission
from tests.clips import write_clip
from tests.site_fixtures import Board, WordEmbedder

VIDEOS = 7
FRAMES = 30
COSINE = 0.31415  # of the verification
SIZE = (160, 90)
TRACK, OTHER_TRACK = "trk-okapi-41", "trk-okapi-42"
SHARED = "on the asphalt ahead"  # what truth and captions have in common, so that cosines are not all low
TRUTH_WORDS = [
    *("Zebraphant", "Quokkamole", "Wombatroid", "Platypunk", "Axolotline", "Narwhalish", "Capybarista"),
    *("Ocelotron", "Tapirific", "Numbatten", "Pangolesque", "Dugongle", "Kakapoise", "Fossalike"),
]
CAPTION_WORDS = ["car", "truck", "bike", "dog", "post", "cone", "van", "bus", "cat", "deer", "bag", "tyre"]


def truth_rows() -> list[TruthHazard]:
    """Hazards in five videos, two in the second; none in the sixth and the seventh."""
    words = iter(TRUTH_WORDS)
    rows = []
    for number in range(1, 6):
        for hazard in range(2 if number == 2 else 1):
            label, noun = next(words), next(words)
            track = TRACK if hazard == 0 else OTHER_TRACK
            text = f"{noun} {SHARED} of {CAPTION_WORDS[number]}"
            rows.append(TruthHazard(f"v{number}", f"hz-ibex-{hazard}", label, text, track, 47_119, 48_131))
    return [*rows, TruthHazard("v6", "hz-ibex-0", "", ""), TruthHazard("v7", "hz-ibex-0", "", "")]


def make(root: Path, rows: Sequence[TruthHazard], track: str = TRACK, left_px: float = 20.0) -> Benchmark:
    """A benchmark with a clip a video; the hazard's box begins at `left_px`, and grows."""
    (root / "videos").mkdir(parents=True)
    (root / "coooler.toml").write_text('name = "Hidden"\ntruth = "truth.parquet"\n', encoding="utf-8")
    boxes = []
    for number in range(1, VIDEOS + 1):
        write_clip(root / "videos" / f"v{number}.mp4", FRAMES, SIZE, faststart=True)
        for frame in range(FRAMES):
            hazard = Box(left_px, 20.0, left_px + 20 + frame, 60.0)
            boxes.append(TrackBox(f"v{number}", frame, track, Kind.CHALLENGE, hazard))
            traffic = Box(100.0, 20.0, 150.0, 60.0)
            boxes.append(TrackBox(f"v{number}", frame, "5", Kind.TRAFFIC, traffic))
    BOXES.write(root / "boxes.parquet", boxes)
    TRUTH.write(root / "truth.parquet", rows)
    return open_benchmark(root)


def captions(kind: int) -> list[Prediction]:
    """One or two captions in every video but the last, which say nothing of the truth's own words."""
    made = []
    for number in range(1, VIDEOS):
        for rank in range(1, 2 + (number + kind) % 2):
            noun = CAPTION_WORDS[(number + rank * kind) % len(CAPTION_WORDS)]
            text = f"a {noun} {SHARED if (number + kind + rank) % 3 else 'in sight'}"
            made.append(Prediction(f"v{number}", rank, text, noun, (TRACK,), (3,)))
    return made


def make_board(benchmark: Benchmark, rows: Sequence[TruthHazard], track: str = TRACK) -> Board:
    """Three submissions, with probes, and warnings and records that name the hazards."""
    submissions = [
        Submission(
            f"System {kind}", "Ann", "", "2026-01-02", "csv", tuple(captions(kind)), (f"{track} is missing",)
        )
        for kind in range(3)
    ]
    vectors = embed_all(texts_of(submissions, rows), WordEmbedder())
    found = probe_board(submissions, rows, vectors, 0.8)
    board = []
    for submission, probes in zip(submissions, found, strict=True):
        folder = benchmark.submissions / slug(submission.name)
        folder.mkdir(parents=True)
        _write_records(folder, track)
        stored = StoredSubmission(
            folder.name, folder, submission, "none", "a" * 64, "b" * 64, "", ("stages",)
        )
        evaluation = evaluate(submission, rows, WordEmbedder(), 0.8, "0" * 64, vectors=vectors)
        board.append(Standing(stored, evaluation, probes))
    return board


def _write_records(folder: Path, track: str) -> None:
    said = StageOutput("v1", Stage.SCENE, 0, "T1-VLM", "0" * 64, Reply("A car.", "agent"), (), Parse.JSON, 0)
    STAGES.write(folder / "stages.parquet", [said])
    box = TrackBox("v1", 2, track, Kind.CHALLENGE, Box(20.0, 20.0, 60.0, 60.0))
    SNIPPETS.write(folder / "snippets.parquet", [Snippet(box, None)])
    MATCHES.write(folder / "matches.parquet", [Match("v1", 2, track, "car", COSINE, True, True)])


def hiding(benchmark: Benchmark) -> Benchmark:
    """The same benchmark, whose organiser keeps the truth back."""
    return Benchmark(benchmark.root, benchmark.settings.model_copy(update={"hide_truth": True}))


def changed(rows: Sequence[TruthHazard]) -> list[TruthHazard]:
    """The same descriptions under other labels, hazard ids, tracks and frames."""
    return [
        row
        if row.is_no_hazard
        else replace(
            row,
            hazard_id=f"other-{row.hazard_id}",
            label=f"Other {number}",
            track_id=f"{row.track_id}-b",
            first_frame=1,
            last_frame=2,
        )
        for number, row in enumerate(rows)
    ]
