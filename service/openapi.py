"""The interface description in `openapi/openapi.json`: ``python -m service.openapi [--check]``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from service.app import create_app

FILE = Path(__file__).parents[1] / "openapi" / "openapi.json"


def description() -> str:
    """The OpenAPI document of the application, as the file holds it."""
    return json.dumps(create_app().openapi(), indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the file, or with --check fail if it is out of step."""
    if "--check" not in sys.argv:
        FILE.write_text(description(), encoding="utf-8")
    elif FILE.read_text(encoding="utf-8") != description():
        sys.exit(f"{FILE} is out of step with the application: run python -m service.openapi")


if __name__ == "__main__":
    main()
