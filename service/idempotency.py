"""`Idempotency-Key`: a request that is sent again is answered again, not done again."""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Final

import redis.asyncio as redis
from fastapi import Header

from service.errors import ProblemError

IdempotencyKey = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=255,
        description="the same key and request within a day get the same answer; another request is refused",
    ),
]

_IN_FLIGHT_SECONDS: Final = 60
_KEPT_SECONDS: Final = 86_400

# A claim that has run out may be another request's by now, and is left to it.
_SETTLE: Final = """
local held = redis.call('GET', KEYS[1])
if held and held ~= ARGV[1] then return 0 end
if ARGV[2] == '' then return redis.call('DEL', KEYS[1]) end
redis.call('SET', KEYS[1], ARGV[2], 'EX', ARGV[3])
return 1
"""


@dataclass
class Once:
    """A request done at most once. `outcome` is set if it was done before; whoever does it sets it."""

    outcome: str | None = None


class Idempotency:
    """The outcomes of requests by their keys."""

    def __init__(self, client: redis.Redis) -> None:
        self._client: Any = client

    @asynccontextmanager
    async def once(self, owner: str, key: str | None, fingerprint: str) -> AsyncIterator[Once]:
        """Claim a key for a request while it is handled; keep the outcome, if one was set.

        Raises ProblemError if another request has the key or the same one is being handled.
        """
        if key is None:
            yield Once()
            return
        name = f"gcvec:once:{owner}:{hashlib.sha256(key.encode()).hexdigest()}"
        claim = json.dumps([fingerprint, None, uuid.uuid4().hex])
        if not await self._client.set(name, claim, nx=True, ex=_IN_FLIGHT_SECONDS):
            yield Once(_outcome(await self._client.get(name) or claim, fingerprint))
            return
        once = Once()
        try:
            yield once
        finally:
            kept = "" if once.outcome is None else json.dumps([fingerprint, once.outcome])
            await self._client.register_script(_SETTLE)(keys=[name], args=[claim, kept, _KEPT_SECONDS])


def _outcome(record: str, fingerprint: str) -> str:
    known, outcome, *_ = json.loads(record)
    if known != fingerprint:
        raise ProblemError("idempotency-mismatch", "the key was used with another request")
    if outcome is None:
        raise ProblemError("in-flight", "the same request is being handled", headers={"Retry-After": "1"})
    return str(outcome)
