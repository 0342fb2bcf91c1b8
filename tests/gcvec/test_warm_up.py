"""After the warm-up no photo waits for a compiler, nor do exports and edits."""

from __future__ import annotations

import subprocess
import sys

import pytest

from gcvec.kernels import CONTENTS
from tests.readers import missing

WITHOUT_LIBRARY = """
from gcvec import kernels

kernels.library = dict
"""

VECTORIZE = """
from pathlib import Path

from skimage import data

from gcvec import Options, vectorize
from gcvec.io import read_annotations
from tests.gcvec.crews import Alone

drawn = read_annotations(Path("examples/sample/chelsea.xml").read_bytes(), picture_name="chelsea.png")


def work():
    for regions in (drawn, None):
        for crew in (None, Alone(3)):
            vectorize(data.chelsea(), regions, Options(target_mse=60), None, crew).render(2)
"""

EXPORT = """
from pathlib import Path

from gcvec import VectorImage
from gcvec.edit import Move, Recolor, edit
from gcvec.export.glb import glb
from gcvec.export.pdf import pdf
from gcvec.export.svg import svg


def work():
    for name in ("leaf", "recolored"):
        image = VectorImage.from_bytes(Path(f"tests/data/{name}.gcv").read_bytes())
        edited = edit(image, [Move(3, 1, 0.5, 0.5)], [Recolor(0, (1.0, 0.0, 0.0))])
        for export in (svg, pdf, glb, VectorImage.to_bytes, VectorImage.description):
            export(edited)
"""

COMPARE = """
import gc

from numba.core.dispatcher import Dispatcher

from gcvec.warm_up import SIDE, warm_up


def known():
    kernels = (o for o in gc.get_objects() if isinstance(o, Dispatcher) and o.__module__.startswith("gcvec"))
    return {(k.py_func.__qualname__, str(signature)) for k in kernels for signature in k.signatures}


warm_up(SIDE)
before = known()
assert len(before) > 40, before
work()
print(sorted(known() - before))
"""

LOOK = """
import sys

work()
print([name for name in ("numba", "llvmlite") if name in sys.modules])
"""


def run(script: str) -> None:
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
@pytest.mark.parametrize("work", [VECTORIZE, EXPORT])
def test_no_work_needs_kernels_but_those_of_the_library(work: str) -> None:
    if not CONTENTS.exists():
        missing("no kernel library was made on this machine")
    run(work + LOOK)


@pytest.mark.slow
def test_no_work_needs_kernels_but_those_that_were_compiled_one_by_one() -> None:
    """Exports alone: calls of the library are recorded in this way, so for photos its test tells as much."""
    run(WITHOUT_LIBRARY + EXPORT + COMPARE)
