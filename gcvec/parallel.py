"""Threads for kernels that release the interpreter lock.

Work is always cut into the same shares, whatever the number of threads, so results do not depend on it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")

SHARES = 4

_pool: ThreadPoolExecutor | None = None
_workers = 0
"""Threads in use; 0: nobody has said yet."""


def cores() -> int:
    """How many processors this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def use_workers(workers: int) -> None:
    """Use this many threads from now on; 0 is one for every core, as it is where nobody says."""
    global _workers
    wanted = workers or cores()
    if wanted != _workers:
        _workers = wanted
        _forget_pool()


@contextmanager
def workers(number: int) -> Iterator[None]:
    """Use this many threads meanwhile, as `use_workers` does."""
    global _workers
    before = _workers
    use_workers(number)
    try:
        yield
    finally:
        if before != _workers:
            _workers = before
            _forget_pool()


def in_shares(work: Callable[[int, int], T], n: int) -> list[T]:
    """`work(first, last)` for consecutive shares of `range(n)`; the results in order."""
    cuts = [n * k // SHARES for k in range(SHARES + 1)]
    return in_turn(lambda span: work(*span), list(zip(cuts[:-1], cuts[1:], strict=True)))


def in_turn(work: Callable[[S], T], items: Sequence[S]) -> list[T]:
    """`work(item)` for every one of some items; the results in order."""
    global _pool
    if not _workers:
        use_workers(0)
    if _workers < 2 or len(items) < 2:
        return [work(item) for item in items]
    if _pool is None:
        _pool = ThreadPoolExecutor(_workers, thread_name_prefix="gcvec")
    return list(_pool.map(work, items))


def _forget_pool() -> None:
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)
