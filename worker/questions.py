"""Short tasks that somebody waits for: the API asks, a worker answers, Redis holds both for a moment.

gcvec:question:KEY   "" while it waits for a worker, "taken" while one works on it, then the answer
gcvec:asked:KEY      a token of who has asked it, then of who has taken it

A question that waits is kept up by those who ask, one that is taken by the worker: without them it is gone
within seconds, so nothing is made that nobody waits for, and what a worker has not survived is asked again.
"""

from __future__ import annotations

import json
import uuid
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import redis

from worker.fields import known_fields
from worker.keeper import Keeper
from worker.problems import Problem
from worker.records import JobRecords
from worker.steps import CHANGES, Call

PENDING: Final = ""
TAKEN: Final = "taken"
KEPT_SECONDS: Final = 10.0
"""A question is gone so long after the last one who kept it up."""
RENEW_SECONDS: Final = 3.0
ANSWERED_SECONDS: Final = 30
FAILED_SECONDS: Final = 4
"""All who wait get to know a failure; who comes back after its Retry-After has it tried again."""

# The client library runs a step again whose answer is lost: by its token it is known.
_POSE = """
if redis.call('SET', KEYS[1], '', 'NX', 'PX', ARGV[2]) then
    redis.call('SET', KEYS[2], ARGV[1], 'PX', ARGV[2])
    return 1
end
return redis.call('GET', KEYS[2]) == ARGV[1] and 1 or 0
"""

_TAKE = """
local text = redis.call('GET', KEYS[1])
if text == 'taken' and redis.call('GET', KEYS[2]) == ARGV[1] then return 1 end
if text ~= '' then return 0 end
redis.call('SET', KEYS[1], 'taken', 'PX', ARGV[2])
redis.call('SET', KEYS[2], ARGV[1], 'PX', ARGV[2])
return 1
"""

_HOLD = """
if redis.call('GET', KEYS[2]) ~= ARGV[1] then return 0 end
redis.call('PEXPIRE', KEYS[2], ARGV[2])
return redis.call('PEXPIRE', KEYS[1], ARGV[2])
"""

_GIVE = """
local holder = redis.call('GET', KEYS[2])
if holder and holder ~= ARGV[1] then return 0 end
redis.call('SET', KEYS[1], ARGV[2], 'EX', ARGV[3])
redis.call('PUBLISH', ARGV[4], ARGV[5])
return 1
"""

_WITHDRAW = """
local text = redis.call('GET', KEYS[1])
if text ~= '' and text ~= 'taken' then return 0 end
return redis.call('DEL', KEYS[1])
"""


def question_key(key: str) -> str:
    return f"gcvec:question:{key}"


def _keys(key: str) -> tuple[str, str]:
    return question_key(key), f"gcvec:asked:{key}"


@dataclass(frozen=True)
class Answer:
    """How a short task ended: with a value, or with a problem."""

    value: Any = None
    problem: Problem | None = None

    def to_json(self) -> str:
        return json.dumps({"value": self.value, "problem": self.problem and self.problem.as_dict()})

    @classmethod
    def from_json(cls, text: str) -> Answer:
        fields = json.loads(text)
        return cls(fields["value"], fields["problem"] and Problem(**known_fields(Problem, fields["problem"])))


def pose(key: str, milliseconds: int) -> Call:
    """Ask a question; returns 0 if others ask it already."""
    return Call(_POSE, _keys(key), (uuid.uuid4().hex, milliseconds))


def take(key: str, token: str) -> Call:
    """Begin to work on a question; returns 0 if nobody waits for the answer, or another worker is at it.

    Who takes it bears a token from then on: one whose hold is lost has no say in what the next one takes.
    """
    return Call(_TAKE, _keys(key), (token, int(1000 * KEPT_SECONDS)))


def hold(key: str, token: str) -> Call:
    """Keep up a question that has been taken; returns 0 if it is another's by now, or gone."""
    return Call(_HOLD, _keys(key), (token, int(1000 * KEPT_SECONDS)))


def give(key: str, token: str, answer: Answer) -> Call:
    """Answer a question and wake those who wait for it; returns 0 if it is another's by now."""
    seconds = ANSWERED_SECONDS if answer.problem is None else FAILED_SECONDS
    return Call(_GIVE, _keys(key), (token, answer.to_json(), seconds, CHANGES, f"answer {key}"))


def withdraw(key: str) -> Call:
    """Take a question back that has not been answered; returns 0 if it has."""
    return Call(_WITHDRAW, (question_key(key),), ())


class Hold(Keeper):
    """Keeps up a question that has been taken."""

    def __init__(self, records: JobRecords, key: str, token: str) -> None:
        super().__init__("question")
        self._records = records
        self._call = hold(key, token)

    def _keep(self) -> None:
        while not self._done.wait(RENEW_SECONDS):
            with suppress(redis.RedisError):
                self._records.run(self._call)
