"""The Celery application and its settings."""

from __future__ import annotations

import os
import resource
import warnings
from typing import Any, Final

from celery import Celery, signals
from celery.exceptions import SecurityWarning

from worker.process import die_with
from worker.settings import Settings, get_settings

JOBS_QUEUE: Final = "gcvec-jobs"
DERIVE_QUEUE: Final = "gcvec-derive"
VECTORIZE: Final = "gcvec.vectorize"

_HARD_LIMIT_MARGIN: Final = 60.0


def create_celery(settings: Settings) -> Celery:
    """The application on this broker. Records and leases carry all state: no results are kept in Celery."""
    app = Celery("gcvec", broker=settings.broker_url, include=["worker.tasks"])
    hard_limit = settings.job_seconds + _HARD_LIMIT_MARGIN
    app.conf.update(
        task_default_queue=JOBS_QUEUE,
        task_ignore_result=True,
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        task_time_limit=hard_limit,
        worker_prefetch_multiplier=1,
        worker_soft_shutdown_timeout=5.0,
        worker_cancel_long_running_tasks_on_connection_loss=False,
        worker_proc_alive_timeout=120.0,
        worker_hijack_root_logger=False,
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


@signals.worker_init.connect
def _load_engine(**_: Any) -> None:
    """Load the engine before the pool is forked: its processes share it, and one that died is back at once."""
    from worker.warmup import warm_up

    warm_up()


@signals.worker_process_init.connect
def _prepare_process(**_: Any) -> None:
    """Ready a pool process: bound to its worker's life, bounded in memory."""
    die_with(os.getppid())
    memory = get_settings().job_memory_bytes
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))


@signals.worker_ready.connect
def _sweep(**_: Any) -> None:
    from worker import sweeper

    sweeper.start()
