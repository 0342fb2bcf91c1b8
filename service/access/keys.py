"""API keys: kept as SHA-256 digests. They are long and random, so a plain digest gives nothing away."""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Sequence
from typing import Final

ANYONE: Final = "anyone"
"""The owner of all jobs of a service that asks for no key."""


class KeyRing:
    """The keys in force, each ``sha256:HEX``."""

    def __init__(self, keys: Sequence[str]) -> None:
        self._digests = tuple(bytes.fromhex(key.removeprefix("sha256:")) for key in keys)

    def __bool__(self) -> bool:
        return bool(self._digests)

    def owner(self, key: str) -> str | None:
        """The owner that `key` stands for, None if it is not one of ours. All are compared."""
        digest = hashlib.sha256(key.encode()).digest()
        matches = [known for known in self._digests if hmac.compare_digest(known, digest)]
        return matches[0].hex()[:32] if matches else None
