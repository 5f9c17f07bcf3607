"""Times by a clock that is known."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dynx.bench.timing import LEAST_SECONDS, Times, interleaved, once


class Clock:
    """Stands still but for the calls that take time."""

    def __init__(self) -> None:
        self.now = 0.0
        self.done: list[str] = []

    def __call__(self) -> float:
        return self.now

    def taking(self, seconds: float, name: str = "") -> Callable[[], None]:
        """A call that takes so long."""

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


def test_a_baseline_is_taken_away_repetition_by_repetition() -> None:
    # The machine was slow in the second repetition, in which both took longer.
    assert Times((3.0, 13.0)).less(Times((1.0, 11.0))) == Times((2.0, 2.0))


def test_nothing_left_has_no_spread_that_means_anything() -> None:
    assert Times((0.0, 0.0)).spread == float("inf")


def test_every_call_is_timed_in_every_repetition() -> None:
    clock = Clock()
    found = interleaved([clock.taking(1.0), clock.taking(0.25)], 3, clock)
    assert found == [Times((1.0,) * 3), Times((0.25,) * 3)]


def test_calls_are_taken_in_turn_each_time_another_one_first() -> None:
    clock = Clock()
    calls = [clock.taking(1.0, name) for name in "abc"]
    interleaved(calls, 3, clock)
    # Once each to find out how long it takes, then the repetitions.
    assert "".join(clock.done) == "abc" + "abc" + "bca" + "cab"


def test_a_short_call_is_repeated_and_its_time_is_that_of_one() -> None:
    clock = Clock()
    (times,) = interleaved([clock.taking(LEAST_SECONDS / 64.0)], 2, clock)
    assert times.seconds == pytest.approx((LEAST_SECONDS / 64.0,) * 2)
    assert len(clock.done) >= 2 * 64


def test_a_clock_that_stands_still_meanwhile_is_outlasted() -> None:
    clock, tick = Clock(), LEAST_SECONDS / 4.0

    def coarse() -> float:
        return tick * (clock() // tick)

    (times,) = interleaved([clock.taking(tick / 100.0)], 1, coarse)
    assert times.median == pytest.approx(tick / 100.0, rel=0.3)


def test_no_calls_have_no_times() -> None:
    assert interleaved([], 3) == []


def test_once() -> None:
    clock = Clock()
    assert once(clock.taking(2.0), clock) == 2.0
