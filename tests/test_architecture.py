"""The house: imports go down only, files stay short, and --help is light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# Lower floors know nothing of higher ones; modules of one floor do not import each other.
FLOORS = [
    ["pipeline.__init__", "pipeline.errors", "sitegen.__init__"],
    ["pipeline.files", "pipeline.records", "pipeline.console"],
    ["pipeline.tables", "pipeline.interfaces", "pipeline.config"],
    ["pipeline.prompts", "pipeline.benchmark", "pipeline.graphs", "pipeline.weights"],
    ["pipeline.video", "pipeline.parsing", "pipeline.chunks", "pipeline.execute", "pipeline.vector_cache"],
    ["pipeline.minilm"],
    ["pipeline.classifier"],
    ["pipeline.models", "pipeline.embedded_vision", "pipeline.embedded_language"],
    ["pipeline.stages", "pipeline.verify"],
    ["pipeline.run"],
    ["pipeline.cli"],
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
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 345


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom sitegen.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'onnxruntime', 'spacy', 'plotly', 'cv2', 'pandas', 'av', 'onnx', 'numpy', 'pyarrow'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.splitlines()[-1] == "[]"
