"""Whether the service lives, and whether it can work."""

from __future__ import annotations

import logging

from fastapi import APIRouter
from obstore.exceptions import BaseError
from redis.exceptions import RedisError

from service.deps import ServicesDep
from service.errors import documented, unavailable
from worker import storage

logger = logging.getLogger(__name__)
router = APIRouter(tags=["health"])


@router.head("/livez", include_in_schema=False)
@router.get("/livez", summary="Is the process alive?")
async def live() -> dict[str, str]:
    return {"status": "ok"}


@router.head("/readyz", include_in_schema=False)
@router.get("/readyz", summary="Can it take jobs?", responses=documented(503))
async def ready(services: ServicesDep) -> dict[str, str]:
    """Reaches for the broker and the store."""
    try:
        await services.jobs.ping()
    except RedisError as error:
        raise unavailable("the broker cannot be reached") from error
    try:
        await storage.reach(services.store)
    except (BaseError, OSError) as error:
        logger.warning("storage: %s", type(error).__name__)
        raise unavailable("the storage cannot be reached") from error
    return {"status": "ok"}
