from __future__ import annotations

from service import openapi


def test_the_description_is_in_step_with_the_application() -> None:
    assert openapi.FILE.read_text(encoding="utf-8") == openapi.description()
