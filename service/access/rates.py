"""How often an owner may call: a token bucket in Redis, one for all API processes."""

from __future__ import annotations

from typing import Any, Final

import redis.asyncio as redis

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

    async def take(self, owner: str) -> float:
        """Take a request from the owner's allowance: 0, or the seconds after which there is one."""
        if self._rate == 0:
            return 0.0
        cost = 60_000 / self._rate
        depth = max(cost, 1000 * _BURST_SECONDS)
        return float(await self._script(keys=[f"gcvec:rate:{owner}"], args=[cost, depth])) / 1000
