"""Time limits of searches: what the option `timeout` [s] means.

A search asks between two pieces of its work whether its time is over, and returns the best found so far: it
takes longer by the piece at its end, such as a descent's step or the distance of a pair of bodies, and by no
more than a tenth where those are shorter. Time in which modules are imported, kernels compiled or loaded, and
shapes prepared does not count: it is spent once for a process, a robot or a scene, and is no search.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real

import numpy as np

from dynx.errors import ArgumentError, shown

clock = time.monotonic
"""Clock of all time limits [s]."""

SHARE = 0.02
"""Largest fraction of a timeout that one of several equal pieces of work takes, by those before."""

_MOST = 1e300
"""Bound on a timeout [s], above which there is no float."""

_preparation = threading.local()


@contextmanager
def not_counted() -> Iterator[None]:
    """Let no time limit of this thread count the time that the block takes, once if blocks are nested."""
    before, start = _uncounted(), clock()
    try:
        yield
    finally:
        _preparation.seconds = before + clock() - start


def _uncounted() -> float:
    seconds: float = getattr(_preparation, "seconds", 0.0)
    return seconds


class TimeLimit:
    """Time [s] that a search may take from now on, in this thread; None for any."""

    __slots__ = ("_end", "timeout")

    def __init__(self, timeout: float | None = None) -> None:
        """Raises ArgumentError for a timeout that is no positive, finite number."""
        if timeout is None:
            self.timeout = timeout
            return
        if (
            isinstance(timeout, bool | np.timedelta64)
            or not isinstance(timeout, Real)
            or not 0.0 < timeout < _MOST
        ):
            raise ArgumentError(f"timeout is {shown(timeout)}; wanted a positive number of seconds, or None")
        self.timeout = float(timeout)
        self._end = self._now() + self.timeout

    @staticmethod
    def _now() -> float:
        return clock() - _uncounted()

    def is_over(self) -> bool:
        """Return whether no time is left."""
        return self.timeout is not None and self._now() >= self._end

    def left(self) -> float | None:
        """Return the time that is left [s], a little above 0 if none is; None without a timeout."""
        return None if self.timeout is None else max(self._end - self._now(), 1e-9)

    def pieces(self, count: int, least: int = 1) -> Iterator[slice]:
        """Yield slices of `count` equal tasks until all are done or the time is over; at least one slice.

        A slice has `least` tasks, or as many more as take `SHARE` of the timeout by the time of those before.
        """
        if self.timeout is None:
            yield slice(0, count)
            return
        start, done, size = self._now(), 0, least
        while done < count:
            following = min(count, done + size)
            yield slice(done, following)
            done = following
            if self.is_over():
                return
            # Twice as many as before at most: the first tasks may be easier than the others.
            by_time = SHARE * self.timeout * done / max(self._now() - start, 1e-12)
            size = max(least, int(min(2.0 * size, by_time)))

    @property
    def sentence(self) -> str:
        """Clause that says that the time was over."""
        return f"stopped by timeout after {self.timeout:g} s"


UNLIMITED = TimeLimit()
"""Time limit that is never over."""
