"""The queues of messages, the tasks that go through them, and which worker serves what."""

from __future__ import annotations

from typing import Final

JOBS_QUEUE: Final = "gcvec-jobs"
"""Jobs: they run for seconds to minutes."""
PARTS_QUEUE: Final = "gcvec-parts"
"""Invitations to take part in a job: for the workers of jobs, which take none while jobs wait."""
SHORT_QUEUE: Final = "gcvec-short"
"""Edits and removals: somebody waits for them, so they do not wait behind jobs."""
EXPORTS_QUEUE: Final = "gcvec-exports"
"""Exports: somebody waits for them too, but they take seconds, so edits do not wait behind all of them."""
HOOKS_QUEUE: Final = "gcvec-webhooks"
"""Calls to webhooks: they wait for strangers, so nothing of ours waits behind them."""

TAKEN_ALONG: Final = {JOBS_QUEUE: (PARTS_QUEUE,), SHORT_QUEUE: (EXPORTS_QUEUE,), HOOKS_QUEUE: ()}
"""The queues that workers are told to serve, and those that each serves besides, in turn with its own."""

QUEUES: Final = tuple(queue for own, besides in TAKEN_ALONG.items() for queue in (own, *besides))

VECTORIZE: Final = "gcvec.vectorize"
ASSIST: Final = "gcvec.assist"
EXPORT: Final = "gcvec.export"
EDIT: Final = "gcvec.edit"
REMOVE: Final = "gcvec.remove"
TIDY: Final = "gcvec.tidy"
DELIVER: Final = "gcvec.deliver"

ROUTES: Final = {
    VECTORIZE: JOBS_QUEUE,
    ASSIST: PARTS_QUEUE,
    EXPORT: EXPORTS_QUEUE,
    EDIT: SHORT_QUEUE,
    REMOVE: SHORT_QUEUE,
    TIDY: SHORT_QUEUE,
    DELIVER: HOOKS_QUEUE,
}
