"""Time limits divide work so that the time is kept, whatever a piece of it takes. The clock is the test's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import time_limit
from dynx.errors import ArgumentError
from dynx.time_limit import SHARE, UNLIMITED, TimeLimit, not_counted


class Clock:
    """A clock that only work moves."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@contextmanager
def own_clock() -> Iterator[Clock]:
    before, clock = time_limit.clock, Clock()
    time_limit.clock = clock
    try:
        yield clock
    finally:
        time_limit.clock = before


@given(
    st.integers(0, 800), st.integers(1, 16), st.floats(1e-3, 10.0), st.lists(st.floats(0.5, 2.0), min_size=1)
)
def test_pieces_follow_each_other_and_keep_the_time(
    count: int, least: int, timeout: float, costs: list[float]
) -> None:
    unit = 1e-4 * timeout
    with own_clock() as clock:
        limit, done = TimeLimit(timeout), 0
        for part in limit.pieces(count, least):
            assert part.start == done < part.stop <= count
            done = part.stop
            clock.now += sum(unit * costs[k % len(costs)] for k in range(part.start, part.stop))
        assert done == count or limit.is_over()
        # Tasks that take up to four times as long as those before fill at most that many shares.
        assert clock.now <= timeout * (1.0 + 4.0 * SHARE + 2e-4 * least)


def test_without_a_timeout_all_is_one_piece_and_no_time_is_over() -> None:
    assert list(UNLIMITED.pieces(7)) == [slice(0, 7)]
    assert not UNLIMITED.is_over()
    assert UNLIMITED.left() is None


def test_what_is_not_counted_takes_no_time_from_a_limit() -> None:
    with own_clock() as clock:
        limit = TimeLimit(1.0)
        with not_counted():
            clock.now += 100.0
            with not_counted():
                clock.now += 10.0
        assert limit.left() == pytest.approx(1.0)
        clock.now += 1.0
        assert limit.is_over()


@pytest.mark.parametrize(
    "timeout", [0, -1.0, math.nan, math.inf, True, "1", [1.0], np.ones(2), 10**400, 1j, {}]
)
def test_a_timeout_is_a_positive_number(timeout: Any) -> None:
    with pytest.raises(ArgumentError, match=r"timeout is .*; wanted a positive number of seconds, or None"):
        TimeLimit(timeout)
