"""The house: imports go down only, files stay short, and --help is light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.floors import FLOORS

ROOT = Path(__file__).parent.parent


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
