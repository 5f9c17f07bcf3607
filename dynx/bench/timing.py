"""Times of several calls, interleaved so that other programs on the machine slow all of them equally."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Call = Callable[[], Any]
Clock = Callable[[], float]

MIN_TIMING_SECONDS = 1e-3
"""Shortest duration of one timing [s]; shorter calls are repeated."""


@dataclass(frozen=True)
class Times:
    """Seconds that one call took, one entry for each repetition."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median over the repetitions [s]."""
        return float(np.median(self.seconds))

    @property
    def least(self) -> float:
        """Least time [s], which other programs delayed the least."""
        return min(self.seconds)

    @property
    def quartiles(self) -> tuple[float, float]:
        """Lower and upper quartile over the repetitions [s]."""
        low, high = np.percentile(self.seconds, [25.0, 75.0])
        return float(low), float(high)

    @property
    def spread(self) -> float:
        """Interquartile range divided by the median."""
        low, high = self.quartiles
        return (high - low) / self.median if self.median > 0.0 else float("inf")

    def minus(self, other: Times) -> Times:
        """Return the difference of the times in each repetition; negative where noise exceeds it."""
        return Times(tuple(own - taken for own, taken in zip(self.seconds, other.seconds, strict=True)))

    def per(self, count: int) -> Times:
        """Return the times divided by `count`."""
        return Times(tuple(each / count for each in self.seconds))


def interleaved(
    calls: Sequence[Call],
    repetitions: int,
    clock: Clock = time.perf_counter,
    *,
    calls_per_timing: int | None = None,
    least_seconds: float = MIN_TIMING_SECONDS,
) -> list[Times]:
    """Time each call. Every repetition makes all calls, starting with a different one each time.

    `calls_per_timing` None repeats a call within a timing until that takes `least_seconds`, after trials
    that warm it up.
    """
    rounds = [calls_per_timing or _rounds(call, clock, least_seconds) for call in calls]
    found: list[list[float]] = [[] for _ in calls]
    for repetition in range(repetitions):
        for turn in range(len(calls)):
            number = (turn + repetition) % len(calls)
            found[number].append(_timed(calls[number], rounds[number], clock))
    return [Times(tuple(seconds)) for seconds in found]


def once(call: Call, clock: Clock = time.perf_counter) -> float:
    """Return the duration of one call [s]."""
    return _timed(call, 1, clock)


def _rounds(call: Call, clock: Clock, least_seconds: float) -> int:
    """Return the repetitions of the call within one timing. Determining it also warms up the call."""
    rounds = 1
    while True:
        taken = rounds * _timed(call, rounds, clock)
        if taken >= least_seconds:
            return rounds
        rounds = 2 * rounds if taken <= 0.0 else max(rounds + 1, int(rounds * least_seconds / taken) + 1)


def _timed(call: Call, rounds: int, clock: Clock) -> float:
    turns = range(rounds)
    begin = clock()
    for _ in turns:
        call()
    return (clock() - begin) / rounds
