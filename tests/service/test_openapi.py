from __future__ import annotations

from service import openapi


def test_the_descriptions_are_in_step_with_the_application() -> None:
    for path, text in openapi.files().items():
        assert path.read_text(encoding="utf-8") == text
