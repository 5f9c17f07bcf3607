"""Concatenated trajectories."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, ShapeError, TrajectoryError
from dynx.trajectory import Trajectory, concatenate, cubic, cycloidal
from tests.trajectory.motions import Motion, floating, within_limits


@given(st.lists(within_limits(), min_size=1, max_size=3), st.floats(0.0, 1.0, exclude_max=True))
def test_each_part_is_unchanged_during_its_time(drawn: list[Motion], part: float) -> None:
    """Each part starts where the previous one ends; the time since then is rounded."""
    parts: list[Trajectory] = []
    for motion in drawn:
        begin = parts[-1].end.q[0] if parts else 0.0
        displacement = motion.q1[0] - motion.q0[0]
        parts.append(cycloidal([begin], [begin + displacement], motion.trajectory.duration))
    whole = concatenate(*parts)
    assert whole.duration == sum(one.duration for one in parts)
    passed = 0.0
    for one in parts:
        time = part * one.duration
        slip = 4.0 * np.finfo(np.float64).eps * whole.duration
        got, wanted = whole(passed + time), one(time)
        displacement = np.abs(one.end.q - one.start.q)
        top_v, top_a = 2.0 * displacement / one.duration, 2.0 * np.pi * displacement / one.duration**2
        jerk = 2.0 * np.pi * top_a / one.duration
        size = 64.0 * np.finfo(np.float64).eps
        assert (np.abs(got.q - wanted.q) <= slip * top_v + size * (1.0 + np.abs(wanted.q))).all()
        assert (np.abs(got.v - wanted.v) <= slip * top_a + size * top_v).all()
        assert (np.abs(got.a - wanted.a) <= slip * jerk + size * top_a).all()
        passed += one.duration


def test_velocity_is_continuous_at_the_boundary() -> None:
    one = cubic([0.0], [1.0], 1.0, v1=[0.7])
    other = cubic([1.0], [3.0], 2.0, v0=[0.7])
    whole = concatenate(one, other)
    assert whole(1.0).v[0] == 0.7
    # At the boundary the acceleration of the later part applies.
    assert whole(1.0).a[0] == other(0.0).a[0] != one(1.0).a[0]
    np.testing.assert_allclose(whole.knots, [0.0, 1.0, 3.0])


def test_on_a_floating_base() -> None:
    model = floating()
    q = model.random(0, 3)
    first = cycloidal(q[0], q[1], 1.0, model=model)
    whole = concatenate(first, cycloidal(first.end.q, q[2], 1.0, model=model))
    h = 1e-5
    for t in (0.4, 1.6):
        rate = model.difference(whole(t - h).q, whole(t + h).q) / (2.0 * h)
        np.testing.assert_allclose(rate, whole(t).v, atol=1e-7)


def test_a_gap_is_refused() -> None:
    one = cycloidal([0.0, 0.0], [1.0, 2.0], 1.0)
    with pytest.raises(
        TrajectoryError, match=r"q\[1\] is 2 where trajectory 0 ends and 2.5 where trajectory 1"
    ):
        concatenate(one, cycloidal([1.0, 2.5], [0.0, 0.0], 1.0))
    with pytest.raises(TrajectoryError, match=r"v\[0\] is 0 where trajectory 0 ends and 0.3 where"):
        concatenate(one, cubic([1.0, 2.0], [0.0, 0.0], 1.0, v0=[0.3, 0.0]))
    with pytest.raises(ShapeError, match="nq 2, nv 2; trajectory 1 has nq 1"):
        concatenate(one, cycloidal([0.0], [1.0], 1.0))
    with pytest.raises(ArgumentError, match="at least one"):
        concatenate()
