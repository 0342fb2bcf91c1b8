"""Memory that arrays leave behind."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

KEPT = """
import sys
from pathlib import Path

import numpy as np

from gcvec.allocation import give_back_large_arrays


def resident():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


if sys.argv[1] == "given back":
    give_back_large_arrays()
del (large := [np.ones(3_900_000)])[:]  # which lets the C library raise its threshold
before = resident()
arrays = [(np.ones(2_000_000), np.ones(3_000)) for _ in range(20)]
small = [pair[1] for pair in arrays]
del arrays
print(resident() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is another one")
@pytest.mark.parametrize(("how", "least", "most"), [("given back", -10, 40), ("by itself", 100, 400)])
def test_large_arrays_are_given_back(how: str, least: float, most: float) -> None:
    """Twenty of 16 MB, each with a small one behind it that stays."""
    done = subprocess.run([sys.executable, "-c", KEPT, how], capture_output=True, text=True, check=True)
    assert least < float(done.stdout) < most
