"""The house: imports go down only, files stay short, and --help is light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# Lower floors know nothing of higher ones; modules of one floor do not import each other.
FLOORS = [
    [
        "pipeline.__init__",
        "pipeline.console",
        "pipeline.data.__init__",
        "pipeline.data.clip_hash",
        "pipeline.data.plain_numpy",
        "pipeline.data.tiles",
        "pipeline.errors",
        "pipeline.files",
        "pipeline.records",
    ],
    [
        "pipeline.chunks",
        "pipeline.clip_preprocess",
        "pipeline.config",
        "pipeline.data.coool_pickle",
        "pipeline.data.encode",
        "pipeline.data.hazard_tracks",
        "pipeline.data.keyboxes",
        "pipeline.data.linking",
        "pipeline.data.unpickle",
        "pipeline.data.watermark_find",
        "pipeline.execute",
        "pipeline.graphs",
        "pipeline.interfaces",
        "pipeline.places",
        "pipeline.recording",
        "pipeline.scores",
        "pipeline.structured",
        "pipeline.table",
        "pipeline.video",
        "pipeline.weights",
    ],
    [
        "pipeline.benchmark",
        "pipeline.bert",
        "pipeline.classifier",
        "pipeline.clip_networks",
        "pipeline.data.clip_facts",
        "pipeline.data.coool_checks",
        "pipeline.data.decode",
        "pipeline.data.detector",
        "pipeline.data.motion",
        "pipeline.data.nafnet",
        "pipeline.data.nafnet_graph",
        "pipeline.data.picture_files",
        "pipeline.data.plan",
        "pipeline.data.restore_boxes",
        "pipeline.data.restored_pictures",
        "pipeline.data.watermark",
        "pipeline.local_llm",
        "pipeline.metering",
        "pipeline.parsing",
        "pipeline.prompts",
        "pipeline.recording_zip",
        "pipeline.replies",
        "pipeline.tables",
        "pipeline.usage",
        "pipeline.vector_cache",
        "pipeline.verify",
    ],
    [
        "pipeline.clip",
        "pipeline.data.cut",
        "pipeline.data.denoise",
        "pipeline.data.ego_motion",
        "pipeline.data.export_nafnet",
        "pipeline.data.frames",
        "pipeline.data.overlay",
        "pipeline.data.propose",
        "pipeline.embedded_language",
        "pipeline.embedded_vision",
        "pipeline.endpoint",
        "pipeline.minilm",
        "pipeline.stages",
    ],
    [
        "pipeline.data.driver_reaction",
        "pipeline.data.rebuild",
        "pipeline.data.restore",
        "pipeline.desk",
        "pipeline.models",
    ],
    [
        "pipeline.agents",
        "pipeline.data.restore_record",
    ],
    [
        "pipeline.data.restore_all",
        "pipeline.team",
    ],
    [
        "pipeline.run",
    ],
    [
        "pipeline.cli",
        "pipeline.data.coool_import",
    ],
    [
        "sitegen.__init__",
        "sitegen.agreement",
        "sitegen.blocks",
        "sitegen.intake_limits",
        "sitegen.language",
        "sitegen.words",
    ],
    [
        "sitegen.annotations",
        "sitegen.catalogues",
        "sitegen.charts",
        "sitegen.checks",
        "sitegen.data_figures",
        "sitegen.failures",
        "sitegen.intake_records",
        "sitegen.ledger",
        "sitegen.manifest",
        "sitegen.numerals",
        "sitegen.serve",
    ],
    [
        "sitegen.about",
        "sitegen.annotate_records",
        "sitegen.board_history",
        "sitegen.captions",
        "sitegen.figure2",
        "sitegen.formats",
        "sitegen.intake",
        "sitegen.output",
        "sitegen.phrases",
        "sitegen.probe_words",
        "sitegen.restoration",
        "sitegen.score",
        "sitegen.shelf",
        "sitegen.split",
    ],
    [
        "sitegen.annotate_answers",
        "sitegen.annotate_journal",
        "sitegen.annotate_truth",
        "sitegen.data_findings",
        "sitegen.evaluate",
        "sitegen.intake_form",
        "sitegen.phrase_cache",
        "sitegen.texts",
        "sitegen.uncertainty",
        "sitegen.unpack",
    ],
    [
        "sitegen.annotate_desk",
        "sitegen.card",
        "sitegen.compare",
        "sitegen.coool",
        "sitegen.coool_write",
        "sitegen.copies",
        "sitegen.data_check_clips",
        "sitegen.data_check_leaks",
        "sitegen.data_check_words",
        "sitegen.judgements",
        "sitegen.leaderboard",
        "sitegen.mentions",
        "sitegen.outside",
        "sitegen.sheets",
        "sitegen.video_ids",
    ],
    [
        "sitegen.contexts",
        "sitegen.coool_results",
        "sitegen.data_check",
        "sitegen.driver_states",
        "sitegen.paired",
        "sitegen.probes",
        "sitegen.readers",
        "sitegen.rewrite",
    ],
    [
        "sitegen.coool_score",
        "sitegen.data_check_run",
        "sitegen.fixes",
        "sitegen.gathered",
        "sitegen.packing",
        "sitegen.sandbox_child",
        "sitegen.submission_contexts",
        "sitegen.video_contexts",
        "sitegen.votes",
    ],
    [
        "sitegen.board_files",
        "sitegen.failure_files",
        "sitegen.hiding",
        "sitegen.media",
        "sitegen.narrowed",
        "sitegen.page_data",
        "sitegen.page_method",
        "sitegen.page_submit",
        "sitegen.page_vote",
        "sitegen.sandbox",
        "sitegen.sayings",
        "sitegen.submissions",
        "sitegen.thumbnails",
        "sitegen.verdicts",
        "sitegen.video_film",
    ],
    [
        "sitegen.annotate_clips",
        "sitegen.blame",
        "sitegen.compare_files",
        "sitegen.exports",
        "sitegen.page_failures",
        "sitegen.page_submission",
        "sitegen.spreads",
        "sitegen.standings",
        "sitegen.transcript",
    ],
    [
        "sitegen.cli_data_import",
        "sitegen.gather",
        "sitegen.page_board",
        "sitegen.page_compare",
        "sitegen.rehearsal",
    ],
    [
        "sitegen.card_data",
        "sitegen.page_restoration",
    ],
    [
        "sitegen.page_video",
    ],
    [
        "sitegen.pages",
    ],
    [
        "sitegen.rendering",
    ],
    [
        "sitegen.annotate_pages",
        "sitegen.build",
        "sitegen.intake_pages",
        "sitegen.scaffold",
        "sitegen.strict",
    ],
    [
        "sitegen.annotate_app",
        "sitegen.board",
    ],
    [
        "sitegen.annotate_server",
        "sitegen.cli_common",
        "sitegen.demo",
        "sitegen.intake_worker",
        "sitegen.verify",
    ],
    [
        "sitegen.cli_board",
        "sitegen.cli_data_annotate",
        "sitegen.cli_data_check",
        "sitegen.cli_data_frames",
        "sitegen.cli_data_restore",
        "sitegen.cli_data_split",
        "sitegen.cli_score_coool",
        "sitegen.intake_app",
    ],
    [
        "sitegen.cli_data_propose",
        "sitegen.cli_data_rebuild",
        "sitegen.cli_export",
        "sitegen.cli_files",
        "sitegen.intake_server",
    ],
    [
        "sitegen.cli_data",
        "sitegen.cli_site",
    ],
    [
        "sitegen.cli",
    ],
]


def _floors() -> dict[str, int]:
    return {name: floor for floor, names in enumerate(FLOORS) for name in names}


def _modules() -> list[tuple[str, Path]]:
    paths = [path for package in ("pipeline", "sitegen") for path in sorted((ROOT / package).rglob("*.py"))]
    return [(".".join(path.relative_to(ROOT).with_suffix("").parts), path) for path in paths]


def _imports(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    names = set(_floors())
    return {name if name in names else f"{name}.__init__" for name in found} & names


def test_every_module_has_a_floor() -> None:
    assert sorted(name for name, _ in _modules()) == sorted(_floors())


@pytest.mark.parametrize(("name", "path"), _modules(), ids=[name for name, _ in _modules()])
def test_imports_go_down(name: str, path: Path) -> None:
    floors = _floors()
    wrong = {other for other in _imports(path) - {name} if floors[other] >= floors[name]}
    assert not wrong, f"{name} on floor {floors[name]} imports {sorted(wrong)}"
    if name.startswith("pipeline."):
        assert not {other for other in _imports(path) if other.startswith("sitegen")}


@pytest.mark.parametrize(("name", "path"), _modules(), ids=[name for name, _ in _modules()])
def test_files_stay_short(name: str, path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 320


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom sitegen.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'onnxruntime', 'spacy', 'plotly', 'cv2', 'pandas', 'av', 'onnx', 'numpy', 'pyarrow'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("name", ["stages", "run", "verify"])
def test_the_flow_does_not_know_who_answers(name: str) -> None:
    parts = ("agents", "embedded_vision", "embedded_language", "classifier", "clip", "minilm", "endpoint")
    assert not _imports(ROOT / "pipeline" / f"{name}.py") & {f"pipeline.{part}" for part in parts}
