"""The interface descriptions in `openapi/`: ``python -m service.openapi [--check]``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from service.app import create_app
from service.artifacts.description import Description

FOLDER = Path(__file__).parents[1] / "openapi"


def files() -> dict[Path, str]:
    """The OpenAPI document of the application and the JSON schema of a result, as `openapi/` holds them."""
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return {
        FOLDER / "openapi.json": _text(create_app().openapi()),
        FOLDER / "result.schema.json": _text(dialect | Description.model_json_schema()),
    }


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the files, or with --check fail if one is out of step."""
    for path, text in files().items():
        if "--check" not in sys.argv:
            path.write_text(text, encoding="utf-8")
        elif not path.exists() or path.read_text(encoding="utf-8") != text:
            sys.exit(f"{path} is out of step with the application: run python -m service.openapi")


if __name__ == "__main__":
    main()
