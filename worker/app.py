"""The Celery application and its settings."""

from __future__ import annotations

import os
import resource
import threading
import warnings
from importlib import import_module
from typing import Any, Final

from celery import Celery, signals
from celery.exceptions import SecurityWarning
from kombu import Exchange, Queue

from gcvec.allocation import give_back_large_arrays
from gcvec.parallel import use_workers
from worker import logs, tracing
from worker.artifacts import EXPORTS
from worker.process import die_with, give_way
from worker.queues import JOBS_QUEUE, QUEUES, ROUTES, SHORT_QUEUE, TAKEN_ALONG
from worker.settings import Settings, get_settings

_HARD_LIMIT_MARGIN: Final = 60.0


def create_celery(settings: Settings) -> Celery:
    """The application on this broker. Records and leases carry all state: no results are kept in Celery."""
    app = Celery(
        "gcvec",
        broker=settings.broker_url,
        include=["worker.tasks", "worker.assist", "worker.short_tasks", "worker.delivery"],
    )
    hard_limit = settings.job_seconds + _HARD_LIMIT_MARGIN
    app.conf.update(
        task_queues=[Queue(name, Exchange(name), routing_key=name) for name in QUEUES],
        task_default_queue=JOBS_QUEUE,
        task_routes={task: {"queue": queue} for task, queue in ROUTES.items()},
        task_ignore_result=True,
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        task_time_limit=hard_limit,
        worker_prefetch_multiplier=1,
        worker_soft_shutdown_timeout=5.0,
        worker_cancel_long_running_tasks_on_connection_loss=False,
        worker_proc_alive_timeout=120.0,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            "visibility_timeout": 2 * hard_limit,
            "unacked_restore_interval": 5,
            "unacked_restore_throttle": 1,
            "socket_connect_timeout": 2,
            "socket_keepalive": True,
            "health_check_interval": 10,
        },
    )
    return app


# Celery warns of running as root because of messages that execute code; ours are JSON.
warnings.filterwarnings("ignore", category=SecurityWarning)

app = create_celery(get_settings())


@signals.setup_logging.connect
def _log(loglevel: int, **_: Any) -> None:
    """Celery leaves the records of a worker to whoever hears this."""
    logs.start(get_settings(), loglevel)


@signals.worker_init.connect
def _begin(sender: Any, **_: Any) -> None:
    """Load the engine before the pool is forked: its processes share it, and one that died is soon back.

    Only the workers that run jobs do so: on a new machine kernels are compiled here, best by one at a time.
    """
    tracing.start("gcvec-worker")
    queues = sender.app.amqp.queues
    for own, besides in TAKEN_ALONG.items():
        if own in queues.consume_from:
            for queue in besides:
                queues.select_add(queues[queue])
    if JOBS_QUEUE in queues.consume_from:
        from gcvec.warm_up import warm_up

        warm_up()


@signals.worker_process_init.connect
def _prepare_process(**_: Any) -> None:
    """Ready a pool process: bound to its worker's life, with its share of memory and threads, and behind the
    API."""
    settings = get_settings()
    die_with(os.getppid())
    give_way()
    give_back_large_arrays()
    resource.setrlimit(resource.RLIMIT_DATA, (settings.job_memory_bytes, settings.job_memory_bytes))
    use_workers(settings.job_threads)
    if SHORT_QUEUE in app.amqp.queues.consume_from:
        threading.Thread(target=_load_exports, name="load", daemon=True).start()


def _load_exports() -> None:
    """Load what exports and edits need before the first of them comes, which may come meanwhile."""
    for module in ("worker.export", "worker.edit", *(f"gcvec.export.{kind}" for kind in EXPORTS)):
        import_module(module)


@signals.worker_ready.connect
def _sweep(**_: Any) -> None:
    """Sweep from now on. The store must not be opened here: its threads do not survive the pool's forks."""
    from worker import sweeper

    sweeper.start()
