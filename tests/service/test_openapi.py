from __future__ import annotations

import subprocess
import sys

from service import openapi


def test_the_description_is_in_step_with_the_application() -> None:
    assert openapi.FILE.read_text(encoding="utf-8") == openapi.description()


def test_the_api_loads_no_solver() -> None:
    program = "import sys, service.app; print([m for m in ('numba', 'scipy', 'skimage') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
