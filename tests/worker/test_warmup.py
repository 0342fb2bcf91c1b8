"""After the warm-up no photo waits for a compiler."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import gc
from pathlib import Path

from numba.core.dispatcher import Dispatcher
from skimage import data

from gcvec import Options, vectorize
from gcvec.io import read_annotations
from gcvec.parts.crew import Alone
from worker.warmup import warm_up


def known():
    kernels = (o for o in gc.get_objects() if isinstance(o, Dispatcher) and o.__module__.startswith("gcvec"))
    return {(k.py_func.__qualname__, str(signature)) for k in kernels for signature in k.signatures}


warm_up()
before = known()
assert len(before) > 40, before
drawn = read_annotations(Path("examples/sample/chelsea.xml").read_bytes(), picture_name="chelsea.png")
for regions in (drawn, None):
    for crew in (None, Alone(3)):
        vectorize(data.chelsea(), regions, Options(target_mse=60), None, crew).render(2)
print(sorted(known() - before))
"""


@pytest.mark.slow
def test_a_photo_needs_no_other_kernels() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
