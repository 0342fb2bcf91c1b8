"""The task that calls webhooks. A receiver that fails is called again, with growing pauses."""

from __future__ import annotations

import logging
import time
from typing import Any
from urllib.parse import urlsplit

from worker import logs
from worker.app import app
from worker.job import Job
from worker.queues import DELIVER
from worker.webhooks import (
    DELIVERIES,
    UnsafeTargetError,
    begin_try,
    event_name,
    message,
    post,
    signed_headers,
    token_key,
    tries_key,
)
from worker.workshop import Workshop, workshop

logger = logging.getLogger(__name__)

_GONE = 410


@app.task(name=DELIVER)
def deliver(entry: str, tries: int) -> None:
    """Tell of one change of a job, or have it told later.

    `entry` is "ID STATUS"; `tries` is how often that had been tried when the message was sent.
    """
    shop = workshop()
    job_id, status = entry.split()
    with logs.about(job_id):
        if shop.records.run(begin_try(entry, tries)):
            _deliver(shop, entry, job_id, status, tries)


def _deliver(shop: Workshop, entry: str, job_id: str, status: str, tries: int) -> None:
    job = shop.records.get(job_id)
    if job is None or job.webhook is None or event_name(status) not in job.webhook["events"]:
        _settle(shop, entry)
        return
    try:
        done = _call(shop, job, status)
    except UnsafeTargetError as error:
        logger.warning("job %s: webhook refused: %s", job_id, error)
        done = True
    except Exception as error:  # whatever the server or the name of a stranger does to us
        logger.warning("job %s: webhook not reached: %s", job_id, type(error).__name__)
        done = False
    pauses = shop.settings.webhook_pauses
    if done or tries >= len(pauses):
        _settle(shop, entry)
    else:
        shop.client.zadd(DELIVERIES, {entry: time.time() + pauses[tries]}, xx=True)


def _call(shop: Workshop, job: Job, status: str) -> bool:
    """Whether the receiver has taken the message, or wants none."""
    hook: Any = job.webhook
    body = message(job, status)
    headers = signed_headers(hook["secret"], f"msg_{job.id}_{status}", int(time.time()), body)
    answer = post(hook["url"], headers, body, private=shop.settings.webhook_private)
    logger.info("job %s: webhook at %s answered %d", job.id, urlsplit(hook["url"]).hostname, answer)
    return 200 <= answer < 300 or answer == _GONE


def _settle(shop: Workshop, entry: str) -> None:
    shop.client.zrem(DELIVERIES, entry)
    shop.client.delete(tries_key(entry), token_key(entry))
