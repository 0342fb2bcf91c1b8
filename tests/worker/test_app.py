"""What a worker's processes have at hand when they start."""

from __future__ import annotations

import subprocess
import sys

import pytest

from worker.queues import HOOKS_QUEUE, SHORT_QUEUE

START = """
import sys
import threading

from celery import signals

from worker.app import app

app.amqp.queues.select([sys.argv[1]])
before = threading.enumerate()
signals.worker_process_init.send(None)
for thread in set(threading.enumerate()) - set(before):
    thread.join()
print(*[name for name in ("worker.edit", "gcvec.edit", "gcvec.export.svg") if name in sys.modules])
"""


@pytest.mark.parametrize(
    ("queue", "loaded"), [(SHORT_QUEUE, "worker.edit gcvec.edit gcvec.export.svg"), (HOOKS_QUEUE, "")]
)
def test_the_first_export_or_edit_finds_the_engine_loaded(queue: str, loaded: str) -> None:
    done = subprocess.run([sys.executable, "-c", START, queue], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == loaded
