"""Two owners of API keys."""

from __future__ import annotations

ALICE, BOB = "alice-0123456789abcdef", "bob-0123456789abcdefgh"


def key(name: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {name}"}
