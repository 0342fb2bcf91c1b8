"""SVG as resvg and Chromium draw it, and as an editor reads it."""

import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import resvg_py
from defusedxml import ElementTree
from PIL import Image

from gcvec import Annotations, Options, Shape, VectorImage, vectorize
from gcvec.curves import bspline
from gcvec.edit import Move, edit
from gcvec.export import patch_rasters as module
from gcvec.export.patch_rasters import patch_rasters
from gcvec.export.svg import svg
from tests.browser import Browser
from tests.gcvec.export.fidelity import SCALE, assert_faithful
from tests.pictures import drawing

SVG = "{http://www.w3.org/2000/svg}"


def test_resvg(image: VectorImage) -> None:
    size = {"width": SCALE * image.width, "height": SCALE * image.height}
    png = bytes(resvg_py.svg_to_bytes(svg_string=svg(image).decode(), **size))
    assert_faithful(np.asarray(Image.open(BytesIO(png)).convert("RGB")), image)


@pytest.mark.browser
def test_chromium(image: VectorImage, browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "picture.svg"
    file.write_bytes(svg(image))
    with browser.page(image.width, image.height, SCALE) as page:
        page.open(file.as_uri())
        assert_faithful(page.screenshot(), image)
        assert page.errors == []


def test_one_path_a_patch_with_its_label(image: VectorImage) -> None:
    root = ElementTree.fromstring(svg(image))
    paths = root.findall(f".//{SVG}path")
    assert tuple(path.get("data-label") for path in paths) == image.labels
    patterns = {pattern.get("id") for pattern in root.findall(f".//{SVG}pattern")}
    assert {path.get("fill") for path in paths} == {f"url(#{name})" for name in patterns}
    assert root.find(f"{SVG}title").text
    assert "sampled" in root.find(f"{SVG}desc").text


def test_labels_may_be_anything(image: VectorImage) -> None:
    named = replace(image, labels=("a\x01b", *image.labels[1:-1], "\ud800"))
    root = ElementTree.fromstring(svg(named))
    labels = [path.get("data-label") for path in root.findall(f".//{SVG}path")]
    assert (labels[0], labels[-1]) == ("a\ufffdb", "\ufffd")


def test_a_patch_that_an_edit_has_turned_over() -> None:
    """It covers nothing, and takes one colour."""
    made = drawing()
    inner = min(range(len(made.curves)), key=lambda c: (not made.curves[c].closed, made.curves[c].segments))
    x = made.curves[inner].control_points[:, 0]
    edited = edit(made, [Move(inner, i, 2 * (x.mean() - x[i]), 0) for i in range(len(x))])
    assert edited.foldovers > 0
    rasters = list(patch_rasters(edited))
    assert [len(np.unique(each.samples.reshape(-1, 3), axis=0)) > 1 for each in rasters].count(False) == 1


def test_a_patch_that_fills_no_half_of_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples of large pictures are large."""
    pixels = np.full((60, 90, 3), 40, np.uint8)
    pixels[:, 40:42] = 220
    line = Shape("line", (np.array([[40, 0], [42, 0], [42, 60], [40, 60]], float),))
    made = vectorize(pixels, Annotations((line,)), Options(snap=0))
    monkeypatch.setattr(module, "MOST_SAMPLES", 50)
    thin = list(patch_rasters(made))[made.labels.index("line")]
    np.testing.assert_allclose(thin.samples.mean(axis=(0, 1)), 220, atol=3)


def test_outlines_are_the_curves(image: VectorImage) -> None:
    root = ElementTree.fromstring(svg(image))
    for patch, path in enumerate(root.findall(f".//{SVG}path")):
        loops = [points(subpath) for subpath in re.findall("M[^M]*z", path.get("d"))]
        assert len(loops) == len(image.network.loops[patch])
        for loop, outline in zip(image.network.loops[patch], loops, strict=True):
            truth = np.concatenate([along(image, *span) for span in loop])
            assert np.abs(outline - truth).max() < 0.011


def along(image: VectorImage, curve: int, forward: bool) -> np.ndarray:
    """Five points on every segment of a curve, in walking order."""
    spline = image.network.curves[curve]
    u = np.arange(spline.segments)[:, None] + np.linspace(0, 1, 5)
    places = bspline.evaluate(spline.control_points, u.ravel(), spline.closed)
    return places if forward else places[::-1]


def points(subpath: str) -> np.ndarray:
    """Five points on every segment of a subpath of lines and cubics in relative coordinates."""
    tokens = re.findall(r"[MlczL]|-?(?:\d*\.\d+|\d+)", subpath)
    at, command, found = np.array([float(tokens[1]), float(tokens[2])]), "", []
    t = np.linspace(0, 1, 5)[:, None]
    rest = tokens[3:]
    while rest[0] != "z":
        if rest[0].isalpha():
            command, rest = rest[0], rest[1:]
        count = {"l": 2, "c": 6}[command]
        steps = np.array(rest[:count], float).reshape(-1, 2)
        rest = rest[count:]
        end = at + steps[-1]
        b, c = (at + steps[:2]) if command == "c" else (at + steps[0] / 3, at + steps[0] * 2 / 3)
        found.append((1 - t) ** 3 * at + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * end)
        at = end
    return np.concatenate(found)
