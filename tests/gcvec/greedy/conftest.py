"""One strip each, unless a test asks for more."""

from __future__ import annotations

import pytest

from gcvec.greedy import begin


@pytest.fixture(autouse=True)
def one_strip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(begin, "TRIANGLES_A_STRIP", 10**9)
