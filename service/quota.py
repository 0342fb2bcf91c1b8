"""How much the files of one key may come to."""

from __future__ import annotations

from service.deps import Services
from service.errors import ProblemError
from worker.settings import Settings


def no_room(settings: Settings) -> ProblemError:
    """What is told to a key that stores as much as it may."""
    detail = f"this key may store {settings.max_stored_bytes / 1e6:g} MB: delete jobs or let them expire"
    return ProblemError("quota-exceeded", detail, headers={"Retry-After": "3600"})


async def require_room(services: Services, owner: str) -> None:
    """Raise ProblemError if nothing more may be made for the owner out of results that are there."""
    most = services.settings.max_stored_bytes
    if most and await services.jobs.stored(owner) >= most:
        raise no_room(services.settings)
