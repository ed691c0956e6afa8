"""A site whose data hold no Latin letter, in a language that is marked: what is unmarked was forgotten."""

import re
from collections.abc import Iterator
from gettext import NullTranslations
from html.parser import HTMLParser
from pathlib import Path
from string import ascii_letters

from pipeline.benchmark import Benchmark, open_benchmark
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
)
from pipeline.scores import Submission
from pipeline.tables import BOXES, MATCHES, SNIPPETS, STAGES, TRUTH, USAGE
from sitegen import ledger
from sitegen.evaluate import embed_all, evaluate, texts_of, truth_sha256
from sitegen.language import Language
from sitegen.ledger import Entry
from sitegen.probes import probe_board
from sitegen.standings import Standing
from sitegen.submissions import StoredSubmission
from tests.clips import write_clip
from tests.site_fixtures import Board, WordEmbedder

FRAMES, SIZE = 12, (160, 96)
CATS = ["μια γάτα στον δρόμο", "μια γάτα", "ένα ελάφι", "ένα λάστιχο", "κάτι άλλο"]


class Marked(NullTranslations):
    """Says everything in English, in letters of another width; placeholders and elements stay."""

    def gettext(self, message: str) -> str:
        """The message in wide letters."""
        return wide(message)

    def ngettext(self, msgid1: str, msgid2: str, n: int) -> str:
        """The English form in wide letters."""
        return wide(msgid1 if n == 1 else msgid2)


_KEPT = re.compile(r"%\(\w+\)s|\{\w+\}|&\w+;|<[^>]*>")
_SPOKEN_IN = re.compile(r'(?<=\s)(alt|title|aria-label|placeholder)="([^"{%]*)"')
_WIDE = {ord(char): ord(char) + 0xFEE0 for char in ascii_letters}


def wide(message: str) -> str:
    """The text with wide letters, in the spoken attributes of its elements too."""
    shown = _KEPT.split(message)
    kept = [
        _SPOKEN_IN.sub(lambda found: f'{found[1]}="{found[2].translate(_WIDE)}"', part)
        for part in _KEPT.findall(message)
    ]
    return "".join(text.translate(_WIDE) + part for text, part in zip(shown, [*kept, ""], strict=True))


MARKED = Language("en", Marked())


def make_benchmark(root: Path, videos: int = 5) -> Benchmark:
    """Videos with one, two and no hazards; the last has no clip."""
    (root / "videos").mkdir(parents=True)
    (root / "coooler.toml").write_text(
        'name = "Δοκιμή"\ndescription = "Μια μικρή."\ntruth = "truth.parquet"\nattribution = "credit.md"\n',
        encoding="utf-8",
    )
    (root / "credit.md").write_text("# Πηγές\n\nΑπό εδώ.\n\nΚαι από εκεί.\n", encoding="utf-8")
    boxes = []
    for number in range(1, videos):
        write_clip(root / "videos" / f"{number}.mp4", FRAMES, SIZE, faststart=True)
        for frame in range(FRAMES):
            box = Box(40.0, 20.0, 60.0 + frame, 60.0)
            boxes.append(TrackBox(f"{number}", frame, "7", Kind.CHALLENGE, box))
            boxes.append(TrackBox(f"{number}", frame, "8", Kind.TRAFFIC, Box(100.0, 20.0, 150.0, 60.0)))
    BOXES.write(root / "boxes.parquet", boxes)
    rows = [TruthHazard("1", "1", "γάτα", CATS[0], "7", 2, 8), TruthHazard("2", "1", "", "")]
    rows += [TruthHazard("3", "1", "ελάφι", CATS[2]), TruthHazard("3", "2", "λάστιχο", CATS[3], "7")]
    rows += [TruthHazard(f"{number}", "1", "σκύλος", "ένας σκύλος τρέχει") for number in range(4, videos + 1)]
    TRUTH.write(root / "truth.parquet", rows)
    return open_benchmark(root)


def make_board(benchmark: Benchmark) -> Board:
    """A baseline with records, one that says the same everywhere, one that is silent; probes and a ledger."""
    truth = TRUTH.read(benchmark.truth)
    ids = sorted({row.video_id for row in truth})
    everywhere = [Prediction(video_id, 1, CATS[1]) for video_id in ids]
    several = [Prediction("1", rank, text, "γάτα", ("7",)) for rank, text in enumerate(CATS, start=1)]
    several += [Prediction("1", 6, "έξι"), Prediction("3", 1, CATS[2]), Prediction("4", 1, CATS[4])]
    said = {"Πρώτο": several, "Δεύτερο": everywhere, "Τρίτο": []}
    submissions = [
        Submission(name, "Άννα", "", "2026-01-02", "–", tuple(rows)) for name, rows in said.items()
    ]
    vectors = embed_all(texts_of(submissions, truth), WordEmbedder())
    found = probe_board(submissions, truth, vectors, 0.8)
    board = []
    for place, (submission, probes) in enumerate(zip(submissions, found, strict=True)):
        folder = benchmark.submissions / f"{place}"
        folder.mkdir(parents=True)
        if not place:
            _write_records(folder)
        agents = "baseline, Ένας" if not place else "Άλλος"
        stored = StoredSubmission(f"{place}", folder, submission, agents, f"{place}" * 64, "9" * 64, "", ())
        evaluation = evaluate(submission, truth, WordEmbedder(), 0.8, truth_sha256(truth), vectors=vectors)
        board.append(Standing(stored, evaluation, probes))
    _write_ledger(benchmark, board)
    entries = ledger.read(benchmark.submissions)
    return [one._replace(history=tuple(e for e in entries if e.slug == one.stored.slug)) for one in board]


def _write_records(folder: Path) -> None:
    items = tuple(Item(rank, f"{rank}", text) for rank, text in enumerate(CATS, start=1))
    said = [
        StageOutput("1", stage, call, "", "0" * 64, Reply("γάτα.", "Ένας"), items, Parse.JSON, frame)
        for stage, call, frame in (
            *((Stage.SCENE, call, call * 3) for call in range(3)),
            *((Stage.ANSWER, call, None) for call in range(2)),
            *((stage, 0, None) for stage in (Stage.RHS, Stage.AES, Stage.COS, Stage.AOS)),
        )
    ]
    STAGES.write(folder / "stages.parquet", said)
    boxes = [TrackBox("1", frame, "7", Kind.CHALLENGE, Box(40.0, 20.0, 60.0, 60.0)) for frame in range(4)]
    reasons = (None, *list(Exclusion)[:3])
    SNIPPETS.write(folder / "snippets.parquet", list(map(Snippet, boxes, reasons)))
    MATCHES.write(folder / "matches.parquet", [Match("1", 0, "7", "1", 0.31, True, True)])
    usage = UsageRow("1", "scene", "Ένας", 25, 1_000, 200, 12.25, None)
    USAGE.write(folder / "usage.parquet", [usage, UsageRow("1", "rhs", "Ένας", 1, None, None, None, 0.5)])


def _write_ledger(benchmark: Benchmark, board: Board) -> None:
    entries = [
        Entry(
            event="add",
            slug=one.stored.slug,
            name=one.evaluation.submission.name,
            date=f"2026-01-0{day}",
            predictions_sha256=one.stored.predictions_sha256,
            original_sha256=one.stored.original_sha256,
            signature="–",
            besm=one.evaluation.card.besm,
            sam=one.evaluation.card.sam,
            detection_rate=one.evaluation.card.detection_rate,
            hazard_recall=one.evaluation.card.hazard_recall,
        )
        for day, one in enumerate(board, start=2)
    ]
    gone = entries[0].model_copy(update={"slug": "9", "name": "Έφυγε", "date": "2026-01-05"})
    ledger.append(
        benchmark.submissions,
        [*entries, gone, gone.model_copy(update={"event": "withdraw", "reason": "λάθος"})],
    )


_SPOKEN = ("alt", "title", "aria-label", "placeholder", "aria-valuetext", "label", "data-label")
_AS_IS = {"code", "kbd", "pre", "samp", "script", "style"}
_VOID = {"br", "hr", "img", "input", "link", "meta", "source", "rect", "line", "path", "image", "use"}
_NAMES = re.compile(
    r"\b(?:BESM|SAM|AOS|RHS|COS|AES|JSON Lines|JSON|CSV|Parquet|LaTeX|Markdown|BibTeX|SVG|PNG|SHA-256"
    r"|px|MB|s|p|S|A|B|C|OOO|LER|baseline)\b"
)
"""Metrics, lists, formats, units, the two sides of a comparison, the wordmark, and a word of the data."""


class Unmarked(HTMLParser):
    """`left` holds what a page says to its reader in plain letters, with the elements around it."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.left: list[str] = []
        self._open: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Notes its spoken attributes."""
        given = {name: value or "" for name, value in attrs}
        about = given["content"] if given.get("name") == "description" else ""
        for text in (about, *(given.get(name, "") for name in _SPOKEN)):
            self._note(text, f"{tag}, attribute")
        if tag not in _VOID:
            self._open.append(f"{tag}.{given.get('class', '')}")

    def handle_endtag(self, tag: str) -> None:
        """Leaves the element."""
        while self._open and self._open.pop().split(".")[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        """Notes a text, unless it stands in code, or in a prompt, which is quoted from the paper."""
        if not any(one.split(".")[0] in _AS_IS or one == "article.prompt" for one in self._open):
            self._note(data, " ".join(self._open[-3:]))

    def _note(self, text: str, where: str) -> None:
        if re.search(r"[A-Za-z]", _NAMES.sub("", text)):
            self.left.append(f"{where}: {' '.join(text.split())}")


def unmarked(site: Path) -> Iterator[str]:
    """Every forgotten text of every page."""
    for path in sorted(site.rglob("*.html")):
        name = path.relative_to(site).as_posix()
        yield from (f"{name}: {text}" for text in Unmarked(path.read_text(encoding="utf-8")).left)
