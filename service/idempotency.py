"""`Idempotency-Key`: a request that is sent again is answered again, not done again."""

from __future__ import annotations

import hashlib
import json
import logging
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Annotated, Any, Final

import redis.asyncio as redis
from fastapi import Header
from redis.exceptions import RedisError

from service.errors import ProblemError
from worker.steps import Settlement

logger = logging.getLogger(__name__)

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
if held and held ~= ARGV[1] and held ~= ARGV[4] then return 0 end
if ARGV[2] == '' then return redis.call('DEL', KEYS[1]) end
redis.call('SET', KEYS[1], ARGV[2], 'EX', ARGV[3])
return 1
"""


@dataclass
class Once:
    """A request done at most once. `outcome` is set if it was done before; whoever does it sets it.

    `identity` is the same for every try at the request, or None where it has no key. Where there are several
    tries, what the request makes had better bear it.
    """

    outcome: str | None = None
    identity: str | None = None
    _key: str = ""
    _claim: str = ""
    _fingerprint: str = ""
    _promised: str = ""

    def settlement(self, outcome: str) -> Settlement | None:
        """What to have settled in the very step that does it: no answer that is lost can part the two."""
        if not self._key:
            return None
        self._promised = _kept(self._fingerprint, outcome)
        return Settlement(self._key, self._claim, self._promised, _KEPT_SECONDS)


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
        if (held := await self._claim(name, claim)) != claim:
            yield Once(_outcome(held, fingerprint))
            return
        identity = hashlib.sha256(f"{name} {fingerprint}".encode()).hexdigest()[:32]
        once = Once(None, identity, name, claim, fingerprint)
        try:
            yield once
        finally:
            kept = "" if once.outcome is None else _kept(fingerprint, once.outcome)
            try:
                await self._settle(name, claim, kept, once._promised)
            except RedisError as error:  # what was done is done, and is told
                logger.warning("an outcome was not kept: %s", type(error).__name__)

    async def _claim(self, name: str, claim: str) -> str:
        """What the key holds: the claim, unless it was another's before.

        The client library sends a command again whose answer was lost: it may find the claim it has made.
        """
        try:
            if await self._client.set(name, claim, nx=True, ex=_IN_FLIGHT_SECONDS):
                return claim
            return str(await self._client.get(name) or claim)
        except RedisError:
            with suppress(RedisError):  # it may have been set all the same, and would be in the way
                await self._settle(name, claim, "", "")
            raise

    async def _settle(self, name: str, claim: str, kept: str, promised: str) -> None:
        args = [claim, kept, _KEPT_SECONDS, promised]
        await self._client.register_script(_SETTLE)(keys=[name], args=args)


def _kept(fingerprint: str, outcome: str) -> str:
    return json.dumps([fingerprint, outcome])


def _outcome(record: str, fingerprint: str) -> str:
    known, outcome, *_ = json.loads(record)
    if known != fingerprint:
        raise ProblemError("idempotency-mismatch", "the key was used with another request")
    if outcome is None:
        raise ProblemError("in-flight", "the same request is being handled", headers={"Retry-After": "1"})
    return str(outcome)
