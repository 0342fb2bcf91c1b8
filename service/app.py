"""The HTTP application."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version

from fastapi import FastAPI

from service import errors
from service.access import browsers
from service.access.gate import Gate
from service.access.rates import Rates
from service.artifacts import endpoints as artifacts
from service.deps import Services
from service.health import endpoints as health
from service.health import metrics
from service.idempotency import Idempotency
from service.jobs import endpoints as jobs
from service.jobs.repository import Changes, JobRepository, connect
from service.jobs.uploads import LimitBody
from service.pages import endpoints as pages
from service.questions import Questions
from service.revisions import endpoints as revisions
from worker import storage, tracing
from worker.app import create_celery
from worker.settings import Settings, get_settings


def create_app(settings: Settings | None = None) -> FastAPI:
    """The application with these settings, those of the environment by default."""
    settings = settings or get_settings()
    app = FastAPI(
        title="gcvec",
        version=version("gcvec"),
        summary="Photos into vector images made of generalized Coons patches",
        lifespan=_lifespan,
        docs_url=None,  # the framework's own pages load scripts from elsewhere; ours is in `pages`
        redoc_url=None,
        redirect_slashes=False,
        generate_unique_id_function=lambda route: route.name,
    )
    app.state.settings = settings
    app.add_middleware(LimitBody, settings=settings)
    app.add_middleware(Gate, settings=settings, state_of=app)
    browsers.install(app, settings)
    errors.install(app)
    app.include_router(jobs.router)
    app.include_router(artifacts.router)
    app.include_router(revisions.router)
    app.include_router(health.router)
    app.include_router(metrics.router)
    app.include_router(pages.router)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    settings: Settings = app.state.settings
    tracing.start("gcvec-api")
    client = connect(settings.broker_url)
    changes = Changes(client)
    queue = create_celery(settings)
    app.state.services = Services(
        settings=settings,
        jobs=JobRepository(client),
        changes=changes,
        questions=Questions(client, changes, queue),
        idempotency=Idempotency(client),
        rates=Rates(client, settings.requests_per_minute),
        store=storage.open_store(settings.storage),
        queue=queue,
    )
    listening = asyncio.create_task(changes.listen())
    try:
        yield
    finally:
        listening.cancel()
        with suppress(asyncio.CancelledError):
            await listening
        await client.aclose()
        queue.close()
