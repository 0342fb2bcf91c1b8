"""The result JSON: it keeps to its schema, and is all that drawing needs."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage, vectorize
from tests.gcvec.areas import shoelace
from tests.gcvec.scenes import Scene

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "examples" / "draw_from_json.py"


@pytest.fixture
def schema() -> dict:
    return json.loads((ROOT / "openapi" / "result.schema.json").read_text())


def test_schema(image: VectorImage, schema: dict) -> None:
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    result = json.loads(json.dumps(image.description(), allow_nan=False))
    assert [error.message for error in validator.iter_errors(result)] == []
    result["patches"][0]["loops"] = None
    assert list(validator.iter_errors(result))


def test_the_outer_border_comes_first() -> None:
    """A disc in two halves has no border of its own: its surroundings' inner border is open curves."""

    def halves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.hypot(x - 36, y - 30) < 20, 1 + (x > 33), 0)

    scene = Scene(60, 70, halves)
    image = vectorize(scene.picture(), scene.annotations())
    for patch in image.description()["patches"]:
        turned = [shoelace(np.array(polygon)) for polygon in patch["domain"]]
        assert turned[0] > 0
        assert all(area < 0 for area in turned[1:])
        for loop, polygon in zip(patch["loops"], patch["domain"], strict=True):
            assert len(loop) == len(polygon)
    assert max(len(patch["loops"]) for patch in image.description()["patches"]) == 2


@pytest.mark.parametrize("scale", ["1", "2"])
def test_a_standalone_script_draws_the_picture(image: VectorImage, tmp_path: Path, scale: str) -> None:
    source, target = tmp_path / "result.json", tmp_path / "picture.png"
    source.write_text(json.dumps(image.description()))
    subprocess.run([sys.executable, SCRIPT, source, target, scale], check=True, cwd=tmp_path)
    off = np.abs(np.asarray(Image.open(target)).astype(int) - image.render(float(scale)))
    assert off.mean() < 0.5


def test_the_script_is_short_and_needs_only_numpy_and_pillow() -> None:
    text = SCRIPT.read_text()
    assert len(text.splitlines()) <= 60
    imports = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {alias.name for node in imports for alias in node.names}
    assert names == {"json", "sys", "numpy", "Image"}


def test_loops_run_along_the_curves(image: VectorImage) -> None:
    """Spans follow on one another along the curves; polygons have a corner for each."""
    description = image.description()
    for patch in description["patches"]:
        for loop, polygon in zip(patch["loops"], patch["domain"], strict=True):
            assert len(polygon) == len(loop)
            for span, following in zip(loop, loop[1:] + loop[:1], strict=True):
                end, start = place(description, span, "to"), place(description, following, "from")
                assert end == pytest.approx(start, abs=1e-3)


def place(description: dict, span: dict, which: str) -> np.ndarray:
    from gcvec.curves import bspline

    curve = description["curves"][span["curve"]]
    control = np.array(curve["control_points"])
    return bspline.evaluate(control, np.array([span[which]], float), curve["closed"])[0]
