"""Threads for kernels that release the interpreter lock.

Work is always cut into the same shares, whatever the number of threads, so results do not depend on it.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")

SHARES = 4
"""Into so many `in_shares` cuts work, whatever the number of threads: results do not depend on that."""

_usual = 0
"""Threads of this process; 0: one for every core."""

_meanwhile: ContextVar[int] = ContextVar("threads", default=0)
"""Those of the run that is going on, of which there may be several at a time."""


def cores() -> int:
    """How many processors this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def use_workers(workers: int) -> None:
    """Use this many threads from now on; 0 is one for every core, as it is where nobody says."""
    global _usual
    _usual = workers


def threads() -> int:
    """How many threads work is done by."""
    return _meanwhile.get() or _usual or cores()


@contextmanager
def workers(number: int) -> Iterator[None]:
    """Use this many threads meanwhile, as `use_workers` does."""
    before = _meanwhile.set(number or cores())
    try:
        yield
    finally:
        _meanwhile.reset(before)


def in_shares(work: Callable[[int, int], T], n: int) -> list[T]:
    """`work(first, last)` for consecutive shares of `range(n)`; the results in order."""
    cuts = [n * k // SHARES for k in range(SHARES + 1)]
    return in_turn(lambda span: work(*span), list(zip(cuts[:-1], cuts[1:], strict=True)))


def in_turn(work: Callable[[S], T], items: Sequence[S]) -> list[T]:
    """`work(item)` for every one of some items; the results in order.

    The thread that asks takes part: others only help, and what they have not begun by then is done without
    them.
    """
    helpers = min(threads(), len(items)) - 1
    if helpers < 1:
        return [work(item) for item in items]
    results: dict[int, T] = {}
    left = iter(range(len(items)))

    def take_part() -> None:
        try:
            for k in left:
                results[k] = work(items[k])
        except BaseException:
            for _ in left:  # nobody begins another one
                pass
            raise

    helping = [_pool(helpers).submit(take_part) for _ in range(helpers)]
    try:
        take_part()
    finally:
        begun = [helper for helper in helping if not helper.cancel()]
        wait(begun)
    for helper in begun:
        helper.result()
    return [results[k] for k in range(len(items))]


@functools.cache
def _pool(n: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(n, thread_name_prefix="gcvec")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
