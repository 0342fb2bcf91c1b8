"""Who works on which part of a picture that is shared out over workers.

    gcvec:parts:ID:ATTEMPT:ROUND   parts that are not done, by the time at which they may be claimed
    gcvec:holders:ID:ATTEMPT:ROUND   by part, the token of who has claimed it last

A claim is a lease: it puts that time off, and whoever works on the part renews it. One that has run out and
is another's by now cannot be renewed; what was made under it is as good as any. Every step is one of the
attempt that runs; those of another change nothing.
"""

from __future__ import annotations

import time
from typing import Final

import redis

from worker.steps import LEASE_SECONDS, Call, record_key

NOTHING: Final = -1
"""No part is to be claimed."""

_FENCE = """
if redis.call('HGET', KEYS[1], 'status') ~= 'running' then return FENCED end
if redis.call('HGET', KEYS[1], 'attempt') ~= ARGV[1] then return FENCED end
"""

_CLAIM_PART = (
    _FENCE.replace("FENCED", str(NOTHING))
    + """
local parts = redis.call('ZRANGE', KEYS[2], '-inf', ARGV[2], 'BYSCORE', 'LIMIT', 0, 1)
if #parts == 0 then return -1 end
redis.call('ZADD', KEYS[2], ARGV[3], parts[1])
redis.call('HSET', KEYS[3], parts[1], ARGV[4])
redis.call('PEXPIRE', KEYS[3], math.max(redis.call('PTTL', KEYS[2]), 1))
return tonumber(parts[1])
"""
)

_RENEW_PART = (
    _FENCE.replace("FENCED", "0")
    + """
if not redis.call('ZSCORE', KEYS[2], ARGV[2]) then return 0 end
if redis.call('HGET', KEYS[3], ARGV[2]) ~= ARGV[4] then return 0 end
redis.call('ZADD', KEYS[2], ARGV[3], ARGV[2])
return 1
"""
)

_END_PART = (
    _FENCE.replace("FENCED", "0")
    + """
return redis.call('ZREM', KEYS[2], ARGV[2])
"""
)


def parts_key(job_id: str, attempt: int, number: int) -> str:
    return f"gcvec:parts:{job_id}:{attempt}:{number}"


def holders_key(job_id: str, attempt: int, number: int) -> str:
    return f"gcvec:holders:{job_id}:{attempt}:{number}"


def claim_part(job_id: str, attempt: int, number: int, token: str, seconds: float = LEASE_SECONDS) -> Call:
    """Claim a part of this round for so long and return its number; `NOTHING` if there is none."""
    now = time.time()
    return Call(_CLAIM_PART, _keys(job_id, attempt, number), (attempt, now, now + seconds, token))


def renew_part(job_id: str, attempt: int, number: int, part: int, token: str) -> Call:
    """Renew a claim; returns 0 if the part is another's by now, is done or no longer wanted."""
    until = time.time() + LEASE_SECONDS
    return Call(_RENEW_PART, _keys(job_id, attempt, number), (attempt, part, until, token))


def end_part(job_id: str, attempt: int, number: int, part: int) -> Call:
    """Note that a part is done; returns 0 if it had been done before or is no longer wanted."""
    return Call(_END_PART, _keys(job_id, attempt, number), (attempt, part))


def open_round(
    client: redis.Redis, job_id: str, attempt: int, number: int, parts: int, seconds: float
) -> None:
    """Let the parts 0, 1, … of a round be claimed, for `seconds` at most."""
    key = parts_key(job_id, attempt, number)
    with client.pipeline(transaction=True) as pipeline:
        pipeline.delete(key)
        pipeline.zadd(key, dict.fromkeys(map(str, range(parts)), 0))
        pipeline.expire(key, int(seconds) + 1)
        pipeline.execute()


def _keys(job_id: str, attempt: int, number: int) -> tuple[str, str, str]:
    round_ = job_id, attempt, number
    return record_key(job_id), parts_key(*round_), holders_key(*round_)
