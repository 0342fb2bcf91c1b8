"""How often an owner may call: a token bucket in Redis, one for all API processes."""

from __future__ import annotations

import logging
from typing import Any, Final

import redis.asyncio as redis
from redis.exceptions import ResponseError

from worker import logs

logger = logging.getLogger(__name__)

_BURST_SECONDS: Final = 10.0
"""So much of its allowance an owner may use at once."""

# The bucket is kept as the time at which it will be full again.
_TAKE: Final = """
local time = redis.call('TIME')
local now = time[1] * 1000 + time[2] / 1000
local cost, depth = tonumber(ARGV[1]), tonumber(ARGV[2])
local full = math.max(now, tonumber(redis.call('GET', KEYS[1]) or '0')) + cost
if full - now > depth then return math.ceil(full - now - depth) end
redis.call('SET', KEYS[1], string.format('%.3f', full), 'PX', math.ceil(full - now) + 1)
return 0
"""


class Rates:
    """The buckets of all owners. A rate of 0 means no limit."""

    def __init__(self, client: redis.Redis, requests_per_minute: int) -> None:
        self._script: Any = client.register_script(_TAKE)
        self._rate = requests_per_minute
        self._outage = logs.Outage(logger, "requests are not counted", "requests are counted again")

    async def take(self, owner: str) -> float:
        """Take a request from the owner's allowance: 0, or the seconds after which there is one.

        A Redis that is full, or cannot write its log, counts nothing: what it holds can still be looked at,
        and jobs deleted to make room.
        """
        if self._rate == 0:
            return 0.0
        cost = 60_000 / self._rate
        depth = max(cost, 1000 * _BURST_SECONDS)
        try:
            milliseconds = await self._script(keys=[f"gcvec:rate:{owner}"], args=[cost, depth])
        except ResponseError as error:
            self._outage.goes_on(error)
            return 0.0
        self._outage.is_over()
        return float(milliseconds) / 1000
