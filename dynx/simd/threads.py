"""Work in numbered parts, done by several threads at once.

The threads are started when they are first needed and shared by all callers. The caller takes part,
so that work is done even where no thread is free. Parts are handed out one after another as threads
become free; which thread does a part makes no difference to its result.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from functools import cache
from itertools import count
from operator import index
from typing import SupportsIndex

from dynx.errors import ArgumentError, shown

_LOCK = threading.Lock()
_pool: ThreadPoolExecutor | None = None


@cache
def cores() -> int:
    """Processors that this process may run on."""
    if hasattr(os, "process_cpu_count"):
        return int(os.process_cpu_count() or 1)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def checked_threads(threads: object) -> int:
    """A number of threads: that given, or as many as there are cores for None; else ArgumentError."""
    if threads is None:
        return cores()
    if isinstance(threads, bool) or not isinstance(threads, SupportsIndex) or index(threads) < 1:
        raise ArgumentError(f"threads is {shown(threads)}; wanted a whole number above 0, or None for all")
    return index(threads)


def run_parts(task: Callable[[int], object], parts: int, threads: int) -> None:
    """Call `task` with every number below `parts`, on at most `threads` threads, the caller's included.

    Returns when all are done; an exception of a part is raised then.
    """
    numbers = count()

    def take() -> None:
        for number in numbers:
            if number >= parts:
                return
            task(number)

    helpers = min(threads, parts) - 1
    if helpers < 1:
        take()
        return
    futures: list[Future[None]] = []
    # A thread that outlives the interpreter's main thread finds no others to ask.
    with suppress(RuntimeError):
        pool = _threads()
        while len(futures) < helpers:
            futures.append(pool.submit(take))
    try:
        take()
    finally:
        # One that has not started by now would find nothing left to do.
        started = [future for future in futures if not future.cancel()]
        wait(started)
    for future in started:
        future.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    with _LOCK:
        if _pool is None:
            _pool = ThreadPoolExecutor(max(cores() - 1, 1), thread_name_prefix="dynx")
        return _pool


def _forget_threads() -> None:
    """A forked child has none of its parent's threads, and perhaps a lock that one of them held."""
    global _pool, _LOCK
    _pool, _LOCK = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)
