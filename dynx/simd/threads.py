"""Parallel execution of numbered parts of a task in a shared pool of threads.

The threads start when they are first needed and are shared by all callers. The calling thread executes parts
too, so that the task progresses even if no other thread is free. Each thread takes the next part when it has
finished one; which thread executes a part does not affect its result.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from itertools import count
from operator import index
from typing import SupportsIndex

from dynx.errors import ArgumentError, shown
from dynx.simd.machine import core_count

_LOCK = threading.Lock()
_pool: ThreadPoolExecutor | None = None


def checked_threads(threads: object) -> int:
    """Return `threads`, or the number of cores for None; ArgumentError unless it is a positive integer."""
    if threads is None:
        return core_count()
    try:
        number = index(threads) if isinstance(threads, SupportsIndex) and threads is not True else 0
    except TypeError:
        number = 0
    if number < 1:
        raise ArgumentError(f"threads is {shown(threads)}; wanted a positive integer, or None for all cores")
    return number


def run_parts(task: Callable[[int], object], parts: int, threads: int) -> None:
    """Call `task` with every number below `parts`, on at most `threads` threads including the caller's.

    Returns when all parts are finished, and then raises the first exception of a part, if any.
    """
    numbers = count()

    def run_remaining() -> None:
        for number in numbers:
            if number >= parts:
                return
            task(number)

    helpers = min(threads, parts) - 1
    if helpers < 1:
        run_remaining()
        return
    futures: list[Future[None]] = []
    # While the interpreter shuts down the pool accepts no work.
    with suppress(RuntimeError):
        pool = _threads()
        while len(futures) < helpers:
            futures.append(pool.submit(run_remaining))
    try:
        run_remaining()
    finally:
        # A thread that has not started by now would find no part left.
        started = [future for future in futures if not future.cancel()]
        wait(started)
    for future in started:
        future.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    with _LOCK:
        if _pool is None:
            _pool = ThreadPoolExecutor(max(core_count() - 1, 1), thread_name_prefix="dynx")
        return _pool


def _reset_after_fork() -> None:
    """Replace pool and lock in a forked child: it has no threads of its parent, and the lock may be held."""
    global _pool, _LOCK
    _pool, _LOCK = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reset_after_fork)
