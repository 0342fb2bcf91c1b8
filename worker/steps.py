"""Job records in Redis, and the few atomic steps by which they change.

A record is a hash. Every step that could race with another one is a Lua script, so that a job has exactly one
terminal state and an attempt that has been superseded can change nothing any more. The same scripts serve
the workers (`worker.records`) and the API's event loop (`service.jobs.repository`).

    gcvec:job:ID      the record             gcvec:jobs:OWNER  an owner's job ids by time of creation
    gcvec:events:ID   stream of its events   gcvec:active      ids of unfinished jobs by time of queueing
    gcvec:lease:ID    attempt now running    gcvec:expiry      ids of finished jobs by time of expiry
    gcvec:unfinished:OWNER  ids of an owner's unfinished jobs
    gcvec:stored      bytes stored by owner
    gcvec:changes     channel: "state ID" or "progress ID" of a job that has changed, "answer KEY"
    gcvec:totals      counted since the beginning: jobs by end, failures by cause, seconds by stage, points
"""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from worker.job import Job, Status
from worker.problems import Problem

ACTIVE: Final = "gcvec:active"
EXPIRY: Final = "gcvec:expiry"
TOTALS: Final = "gcvec:totals"
CHANGES: Final = "gcvec:changes"
STORED: Final = "gcvec:stored"

LEASE_SECONDS: Final = 8.0
EVENTS_KEPT: Final = 10_000
TOMBSTONE_SECONDS: Final = 30 * 86_400
TOO_MANY_JOBS: Final = -1
TOO_MANY_BYTES: Final = -2
NOT_AWAITED: Final = -1


def record_key(job_id: str) -> str:
    return f"gcvec:job:{job_id}"


def events_key(job_id: str) -> str:
    return f"gcvec:events:{job_id}"


def lease_key(job_id: str) -> str:
    return f"gcvec:lease:{job_id}"


def owner_key(owner: str) -> str:
    return f"gcvec:jobs:{owner}"


@dataclass(frozen=True)
class Call:
    """One run of a Lua script."""

    script: str
    keys: tuple[str, ...]
    args: tuple[str | float, ...]


@dataclass(frozen=True)
class Settlement:
    """What a key is set to, for so many seconds, if it holds the claim of who made it."""

    key: str
    claim: str
    outcome: str
    seconds: int


# Steps whose answers are lost are run again: the second time these count nothing.
_CREATE = """
if redis.call('EXISTS', KEYS[1]) == 1 then return 1 end
local owner = ARGV[2]
local unfinished = 'gcvec:unfinished:' .. owner
local most_jobs, most_bytes = tonumber(ARGV[5]), tonumber(ARGV[6])
if most_jobs > 0 and redis.call('SCARD', unfinished) >= most_jobs then return -1 end
local stored = tonumber(redis.call('HGET', 'gcvec:stored', owner) or '0') + ARGV[4]
if most_bytes > 0 and stored > most_bytes then return -2 end
redis.call('HSET', KEYS[1], unpack(ARGV, 10))
redis.call('HINCRBY', 'gcvec:stored', owner, ARGV[4])
redis.call('SADD', unfinished, ARGV[1])
redis.call('ZADD', 'gcvec:active', ARGV[3], ARGV[1])
redis.call('ZADD', 'gcvec:jobs:' .. owner, ARGV[3], ARGV[1])
if KEYS[4] and redis.call('GET', KEYS[4]) == ARGV[7] then
    redis.call('SET', KEYS[4], ARGV[8], 'EX', ARGV[9])
end
return 1
"""

_CLAIM = """
local status = redis.call('HGET', KEYS[1], 'status')
if status ~= 'queued' and status ~= 'running' then return 0 end
if redis.call('EXISTS', KEYS[2]) == 1 then
    if redis.call('HGET', KEYS[1], 'claim') == ARGV[4] then return redis.call('HGET', KEYS[1], 'attempt') end
    return 0
end
local attempt = redis.call('HINCRBY', KEYS[1], 'attempt', 1)
redis.call('HSETNX', KEYS[1], 'started_at', ARGV[2])
redis.call('HSET', KEYS[1], 'status', 'running', 'claim', ARGV[4], 'reported', 0)
redis.call('HINCRBY', 'gcvec:totals', 'attempts', 1)
if attempt == 1 and redis.call('HEXISTS', KEYS[1], 'webhook') == 1 then
    redis.call('ZADD', 'gcvec:deliveries', ARGV[2], ARGV[1] .. ' running')
end
redis.call('SET', KEYS[2], attempt, 'PX', ARGV[3])
redis.call('PUBLISH', 'gcvec:changes', 'state ' .. ARGV[1])
return attempt
"""

_REPORT = """
if redis.call('HGET', KEYS[1], 'status') ~= 'running' then return 0 end
if redis.call('HGET', KEYS[1], 'attempt') ~= ARGV[2] then return 0 end
redis.call('SET', KEYS[2], ARGV[2], 'PX', ARGV[3])
local before = ARGV[5] - 1
local fresh = 6 + math.max(0, (redis.call('HGET', KEYS[1], 'reported') or 0) - before)
if fresh > #ARGV then return 1 end
for i = fresh, #ARGV do
    local number = redis.call('HINCRBY', KEYS[1], 'last_event', 1)
    redis.call('XADD', KEYS[3], 'MAXLEN', '~', ARGV[4], number .. '-0', 'type', 'progress', 'data', ARGV[i])
end
redis.call('HSET', KEYS[1], 'progress', ARGV[#ARGV], 'reported', before + #ARGV - 5)
redis.call('PUBLISH', 'gcvec:changes', 'progress ' .. ARGV[1])
return 1
"""

# The lease goes first: a Redis that is full lets a script write that has begun by removing something, so that
# jobs can end, be cancelled and be forgotten there.
_FINISH = """
local status = redis.call('HGET', KEYS[1], 'status')
if status ~= 'queued' and status ~= 'running' then
    return redis.call('HGET', KEYS[1], ARGV[6]) == ARGV[7] and 1 or 0
end
if ARGV[2] ~= '' and redis.call('HGET', KEYS[1], 'attempt') ~= ARGV[2] then return 0 end
local owner = redis.call('HGET', KEYS[1], 'owner')
local before = redis.call('HGET', KEYS[1], 'bytes')
redis.call('DEL', KEYS[2])
local number = redis.call('HINCRBY', KEYS[1], 'last_event', 1)
redis.call('HSET', KEYS[1], 'status', ARGV[3], 'finished_at', ARGV[4], 'expires_at', ARGV[5])
for i = 6, #ARGV, 2 do
    local total = string.match(ARGV[i], '^total:(.*)')
    if total then redis.call('HINCRBYFLOAT', 'gcvec:totals', total, ARGV[i + 1])
    else redis.call('HSET', KEYS[1], ARGV[i], ARGV[i + 1]) end
end
redis.call('HINCRBY', 'gcvec:stored', owner, redis.call('HGET', KEYS[1], 'bytes') - before)
redis.call('SREM', 'gcvec:unfinished:' .. owner, ARGV[1])
redis.call('HINCRBYFLOAT', 'gcvec:totals', 'finished:' .. ARGV[3], 1)
redis.call('XADD', KEYS[3], number .. '-0', 'type', 'state', 'data', ARGV[3])
if redis.call('HEXISTS', KEYS[1], 'webhook') == 1 then
    redis.call('ZADD', 'gcvec:deliveries', ARGV[4], ARGV[1] .. ' ' .. ARGV[3])
end
redis.call('ZREM', 'gcvec:active', ARGV[1])
redis.call('ZADD', 'gcvec:expiry', ARGV[5], ARGV[1])
redis.call('PUBLISH', 'gcvec:changes', 'state ' .. ARGV[1])
return 1
"""

_REQUEUE = """
local status = redis.call('HGET', KEYS[1], 'status')
if status ~= 'queued' and status ~= 'running' then
    redis.call('ZREM', 'gcvec:active', ARGV[1])
    return 0
end
if redis.call('EXISTS', KEYS[2]) == 1 then return 0 end
redis.call('HSET', KEYS[1], 'status', 'queued')
redis.call('ZADD', 'gcvec:active', ARGV[2], ARGV[1])
redis.call('PUBLISH', 'gcvec:changes', 'state ' .. ARGV[1])
return 1
"""

_GROW = """
if redis.call('HGET', KEYS[1], 'status') ~= 'succeeded' then return 0 end
if redis.call('HSETNX', KEYS[1], 'stored:' .. ARGV[2], ARGV[1]) == 0 then return 1 end
redis.call('HINCRBY', KEYS[1], 'bytes', ARGV[1])
redis.call('HINCRBY', 'gcvec:stored', redis.call('HGET', KEYS[1], 'owner'), ARGV[1])
return 1
"""

_REVISE = """
if redis.call('HGET', KEYS[1], 'status') ~= 'succeeded' then return 0 end
local made = redis.call('HGET', KEYS[1], ARGV[1])
if made then return tonumber(made) end
if redis.call('EXISTS', KEYS[2]) == 0 then return -1 end
made = redis.call('HINCRBY', KEYS[1], 'revisions', 1)
redis.call('HSET', KEYS[1], ARGV[1], made)
return made
"""

_RETIRE = """
local owner = redis.call('HGET', KEYS[1], 'owner')
local bytes = redis.call('HGET', KEYS[1], 'bytes')
if not bytes then return 0 end
redis.call('DEL', KEYS[1], KEYS[2], KEYS[3])
if ARGV[2] ~= '0' then
    redis.call('HSET', KEYS[1], 'owner', owner)
    redis.call('EXPIRE', KEYS[1], ARGV[2])
end
redis.call('HINCRBY', 'gcvec:stored', owner, 0 - bytes)
redis.call('SREM', 'gcvec:unfinished:' .. owner, ARGV[1])
redis.call('ZREM', 'gcvec:active', ARGV[1])
redis.call('ZREM', 'gcvec:expiry', ARGV[1])
redis.call('ZREM', 'gcvec:jobs:' .. owner, ARGV[1])
redis.call('PUBLISH', 'gcvec:changes', 'state ' .. ARGV[1])
return 1
"""


def _keys(job_id: str) -> tuple[str, str, str]:
    return record_key(job_id), lease_key(job_id), events_key(job_id)


def create(job: Job, *, most_jobs: int, most_bytes: int, settled: Settlement | None = None) -> Call:
    """Write the record of a new job, and at the same time what is `settled` by it.

    Returns `TOO_MANY_JOBS` or `TOO_MANY_BYTES` if the owner would have more unfinished jobs or more stored
    than so much (0: no limit).
    """
    fields = [part for field in job.to_fields().items() for part in field]
    start = (job.id, job.owner, job.created_at, job.bytes, most_jobs, most_bytes)
    keys = _keys(job.id)
    if settled is None:
        return Call(_CREATE, keys, (*start, "", "", 0, *fields))
    settling = (settled.claim, settled.outcome, settled.seconds)
    return Call(_CREATE, (*keys, settled.key), (*start, *settling, *fields))


def claim(job_id: str) -> Call:
    """Begin an attempt and return its number; 0 if the job is unknown, has finished or runs elsewhere.

    The number stands for the claim in all that follows, and a token where its answer is lost.
    """
    lease = int(LEASE_SECONDS * 1000)
    return Call(_CLAIM, _keys(job_id), (job_id, time.time(), lease, uuid.uuid4().hex))


def report(job_id: str, attempt: int, events: Iterable[Mapping[str, Any]], first: int) -> Call:
    """Renew the lease and append progress events; returns 0 if the attempt is no longer the job's.

    `first` is the number of the first of them among the attempt's, from 1: those that a report whose answer
    was lost has appended are passed over.
    """
    texts = (json.dumps(event) for event in events)
    lease = int(LEASE_SECONDS * 1000)
    return Call(_REPORT, _keys(job_id), (job_id, attempt, lease, EVENTS_KEPT, first, *texts))


def finish(
    job_id: str,
    status: Status,
    *,
    retention: float,
    attempt: int | None = None,
    error: Problem | None = None,
    warnings: Sequence[str] = (),
    bytes_stored: int | None = None,
    totals: Mapping[str, float] = MappingProxyType({}),
) -> Call:
    """Give the job its terminal state; returns 0 if it has one, or if `attempt` is no longer the job's.

    `totals` are added to the counts since the beginning, once a job. A token says who ended it where the
    answer is lost.
    """
    now = time.time()
    extra: list[str] = ["ending", uuid.uuid4().hex, "warnings", json.dumps(list(warnings))]
    if error is not None:
        extra += ["error", json.dumps(error.as_dict()), f"total:failed:{error.code}", "1"]
    if bytes_stored is not None:
        extra += ["bytes", str(bytes_stored)]
    for name, value in totals.items():
        extra += [f"total:{name}", str(value)]
    fence = "" if attempt is None else attempt
    return Call(_FINISH, _keys(job_id), (job_id, fence, status, now, now + retention, *extra))


def requeue(job_id: str) -> Call:
    """Have a job that nobody works on wait again; returns 0 if it has finished or runs."""
    return Call(_REQUEUE, _keys(job_id), (job_id, time.time()))


def grow(job_id: str, size: int, name: str) -> Call:
    """Count `size` more bytes that are stored for a job, once for every `name`; returns 0 if it has no result
    or is gone."""
    return Call(_GROW, (record_key(job_id),), (size, name))


def revision_field(question: str) -> str:
    """The field of a record that holds the number of the revision for which a question has asked."""
    return f"revision:{question}"


def revise(job_id: str, question: str) -> Call:
    """The number of a new revision, always the same for a question; 0 if the job has no result or is gone.

    `NOT_AWAITED` if the key of the `question` that asks for it is gone: nobody waits for the edit any more,
    and who still wants it has asked again.
    """
    return Call(_REVISE, (record_key(job_id), question), (revision_field(question),))


def retire(job_id: str) -> Call:
    """Forget a job but for the fact that its owner had it."""
    return Call(_RETIRE, _keys(job_id), (job_id, TOMBSTONE_SECONDS))


def discard(job_id: str) -> Call:
    """Forget a job that could not be submitted."""
    return Call(_RETIRE, _keys(job_id), (job_id, 0))
