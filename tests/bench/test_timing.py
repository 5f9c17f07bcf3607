"""Times measured by a simulated clock."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dynx.bench.timing import MIN_TIMING_SECONDS, Times, interleaved, once


class Clock:
    """A clock that only the timed calls advance."""

    def __init__(self) -> None:
        self.now = 0.0
        self.done: list[str] = []

    def __call__(self) -> float:
        return self.now

    def taking(self, seconds: float, name: str = "") -> Callable[[], None]:
        """Return a call of the given duration."""

        def call() -> None:
            self.now += seconds
            self.done.append(name)

        return call


def test_median_and_quartiles() -> None:
    times = Times((5.0, 1.0, 2.0, 4.0, 3.0))
    assert times.median == 3.0
    assert times.quartiles == (2.0, 4.0)
    assert times.spread == pytest.approx(2.0 / 3.0)


def test_times_of_one_sample() -> None:
    assert Times((8.0, 4.0)).per(4) == Times((2.0, 1.0))


def test_a_baseline_is_subtracted_in_each_repetition() -> None:
    # The machine was slow in the second repetition, in which both took longer.
    assert Times((3.0, 13.0)).minus(Times((1.0, 11.0))) == Times((2.0, 2.0))


def test_a_median_of_zero_has_no_relative_spread() -> None:
    assert Times((0.0, 0.0)).spread == float("inf")


def test_every_call_is_timed_in_every_repetition() -> None:
    clock = Clock()
    found = interleaved([clock.taking(1.0), clock.taking(0.25)], 3, clock)
    assert found == [Times((1.0,) * 3), Times((0.25,) * 3)]


def test_calls_rotate_with_another_one_first_each_time() -> None:
    clock = Clock()
    calls = [clock.taking(1.0, name) for name in "abc"]
    interleaved(calls, 3, clock)
    # Once each to find out how long it takes, then the repetitions.
    assert "".join(clock.done) == "abc" + "abc" + "bca" + "cab"


def test_a_short_call_is_repeated_and_its_time_is_that_of_one() -> None:
    clock = Clock()
    (times,) = interleaved([clock.taking(MIN_TIMING_SECONDS / 64.0)], 2, clock)
    assert times.seconds == pytest.approx((MIN_TIMING_SECONDS / 64.0,) * 2)
    assert len(clock.done) >= 2 * 64


def test_calls_are_repeated_until_a_coarse_clock_advances() -> None:
    clock, tick = Clock(), MIN_TIMING_SECONDS / 4.0

    def coarse() -> float:
        return tick * (clock() // tick)

    (times,) = interleaved([clock.taking(tick / 100.0)], 1, coarse)
    assert times.median == pytest.approx(tick / 100.0, rel=0.3)


def test_no_calls_have_no_times() -> None:
    assert interleaved([], 3) == []


def test_once() -> None:
    clock = Clock()
    assert once(clock.taking(2.0), clock) == 2.0
