"""PDF as two readers draw it."""

import re
import subprocess
import zlib
from io import BytesIO

import numpy as np
import pypdfium2
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from gcvec import VectorImage
from gcvec.edit import Move, edit
from gcvec.export import pdf as module
from gcvec.export.pdf import pdf
from gcvec.export.triangles import drawn_triangles
from tests.gcvec.export.fidelity import SCALE, assert_faithful, averaged
from tests.pictures import drawing
from tests.readers import require

FINER = 4
"""Readers sample pixels at their corners: they draw this much larger, and the result is averaged."""


def test_poppler(image: VectorImage) -> None:
    command = require("poppler", "pdftoppm")
    drawn = subprocess.run(
        [command, "-r", str(72 * SCALE * FINER), "-png", "-"], input=pdf(image), capture_output=True
    )
    assert drawn.stderr == b""
    pixels = np.asarray(Image.open(BytesIO(drawn.stdout)).convert("RGB"))
    assert_faithful(averaged(pixels, FINER), image)


def test_pdfium(image: VectorImage) -> None:
    document = pypdfium2.PdfDocument(pdf(image))
    assert len(document) == 1
    assert document[0].get_size() == (image.width, image.height)
    pixels = document[0].render(scale=SCALE * FINER).to_numpy()[..., ::-1]
    assert_faithful(averaged(np.ascontiguousarray(pixels), FINER), image)
    document.close()


def test_what_an_edit_moves_beyond_the_frame_keeps_its_place() -> None:
    made = drawing()
    outer = max(range(len(made.curves)), key=lambda c: made.curves[c].closed * made.curves[c].segments)
    leftmost = int(made.curves[outer].control_points[:, 0].argmin())
    edited = edit(made, [Move(outer, leftmost, -90, 0)])
    least = drawn_triangles(edited).positions.min()
    assert least < -10
    decode = re.search(rb"/Decode \[(\S+)", pdf(edited))
    assert decode is not None
    assert float(decode[1]) == pytest.approx(least)


def test_the_frame_bleeds() -> None:
    positions = np.array([[-30, 5], [0, 5], [60, 40], [120, 80], [121, 200]], float)
    bleeding = [[-30, 5], [-module.BLEED, 5], [60, 40], [120 + module.BLEED, 80 + module.BLEED], [121, 200]]
    np.testing.assert_array_equal(module._bleeding(positions, 120, 80), bleeding)


def test_no_gap_shows_the_paper(image: VectorImage) -> None:
    """At a scale at which many vertices might fall on scan lines, the paper's colour makes no difference."""
    document = pypdfium2.PdfDocument(pdf(image))
    on_white, on_green = (
        document[0].render(scale=4, fill_color=paper).to_numpy().astype(int)
        for paper in ((255, 255, 255, 255), (0, 255, 0, 255))
    )
    document.close()
    assert (on_white != on_green).any(axis=2).mean() < 1e-4


def test_size(image: VectorImage) -> None:
    assert len(pdf(image)) < 2000 + 9 * len(drawn_triangles(image).corners)


@given(st.lists(st.permutations(range(6)).map(lambda p: p[:3]), min_size=1, max_size=30))
def test_the_chain_holds_every_triangle_once(corners: list[list[int]]) -> None:
    flags, order = module._chain(np.array(corners))
    found, at = [], 0
    while at < len(order):
        if flags[at] == 0:
            a, b, c = order[at : at + 3]
            at += 3
        else:
            a, b, c = (b if flags[at] == 1 else a), c, order[at]
            at += 1
        found.append(sorted((a, b, c)))
    assert sorted(found) == sorted(map(sorted, corners))


def test_cross_references(image: VectorImage) -> None:
    data = pdf(image)
    start = int(re.search(rb"startxref\n(\d+)\n", data)[1])
    table = data[start:].splitlines()
    assert table[0] == b"xref"
    for number, line in enumerate(table[3:9], 1):
        assert data[int(line[:10]) :].startswith(b"%d 0 obj" % number)
    shading = re.search(rb"/ShadingType 4 .*?/Length (\d+) >>\nstream\n", data)
    content = zlib.decompress(data[shading.end() : shading.end() + int(shading[1])])
    assert len(content) % 9 == 0
