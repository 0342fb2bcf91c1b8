"""Short tasks that somebody waits for: the API asks, a worker answers, Redis holds both for a moment.

gcvec:question:KEY   "" while the answer is awaited, then the answer
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Final

import redis

from worker.fields import known_fields
from worker.problems import Problem
from worker.steps import CHANGES

PENDING: Final = ""
PENDING_SECONDS: Final = 120
"""A question that nobody answered is forgotten after this time and may be asked again."""
ANSWERED_SECONDS: Final = 30


def question_key(key: str) -> str:
    return f"gcvec:question:{key}"


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


def give(client: redis.Redis, key: str, answer: Answer) -> None:
    """Answer a question and wake those who wait for it."""
    with client.pipeline(transaction=True) as pipeline:
        pipeline.set(question_key(key), answer.to_json(), ex=ANSWERED_SECONDS)
        pipeline.publish(CHANGES, f"answer {key}")
        pipeline.execute()
