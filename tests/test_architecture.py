"""The direction of imports: service -> worker -> gcvec, and no solver in the API process."""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOLVERS = {"numba", "scipy", "skimage"}
SLOW_TO_LOAD = SOLVERS | {"numpy", "fastapi", "celery", "pydantic", "rich"}
FORBIDDEN = {"gcvec": {"worker", "service"}, "worker": {"service"}}


def imported(file: Path) -> set[str]:
    """The top-level packages a file imports, anywhere in it."""
    nodes = list(ast.walk(ast.parse(file.read_text())))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    return {name.partition(".")[0] for name in names}


@pytest.mark.parametrize("package", FORBIDDEN)
def test_imports_point_one_way(package: str) -> None:
    files = list((ROOT / package).rglob("*.py"))
    assert files
    assert {str(f): bad for f in files if (bad := imported(f) & FORBIDDEN[package])} == {}


def imports_when_loaded(file: Path) -> set[str]:
    """The modules of the engine that a file imports as soon as it is loaded itself."""
    nodes = ast.parse(file.read_text()).body
    names = {
        f"{node.module}.{alias.name}"
        for node in nodes
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    return {name for name in names if name.startswith("gcvec.")}


def test_packages_of_the_engine_build_on_each_other() -> None:
    """None needs itself, however far around: each can be read, and tested, with those below it."""
    engine = ROOT / "gcvec"
    packages = {folder.name for folder in engine.iterdir() if (folder / "__init__.py").exists()}
    modules = packages | {file.stem for file in engine.glob("*.py")} - {"__init__"}
    below: dict[str, set[str]] = {module: set() for module in modules}
    for file in engine.rglob("*.py"):
        own = file.relative_to(engine).parts[0].removesuffix(".py")
        if own in modules:
            below[own] |= {name.split(".")[1] for name in imports_when_loaded(file)} & modules - {own}
    assert len(packages) > 10
    assert sum(map(len, below.values())) > 50
    TopologicalSorter(below).prepare()  # raises CycleError


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("service.app", SOLVERS),
        ("gcvec.cli._app", SLOW_TO_LOAD),
        ("gcvec.cli.vectorize", SLOW_TO_LOAD),
        ("service.cli.serve", SOLVERS),
        ("service.cli.submit", SOLVERS),
    ],
)
def test_stays_light(module: str, absent: set[str]) -> None:
    loaded = subprocess.run(
        [sys.executable, "-c", f"import sys, {module}; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    assert absent & set(loaded) == set()
