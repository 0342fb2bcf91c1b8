"""The direction of imports: service -> worker -> gcvec, and no solver in the API process."""

import ast
import subprocess
import sys
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
