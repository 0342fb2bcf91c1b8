"""The connection to the broker that tests share."""

from __future__ import annotations

from functools import cache

import redis

from worker.records import connect


@cache
def client_of(broker_url: str) -> redis.Redis:
    """The one connection of all tests to their broker; `broker_url` closes it."""
    return connect(broker_url, patient=False)
