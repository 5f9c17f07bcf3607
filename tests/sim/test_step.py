"""Parts of a step that all executors share."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.sim.step import (
    MAX_SQUARED_SPEED,
    is_diverged,
    squared_speed,
    torque_sum,
    with_disturbances,
)
from dynx.steppers.clock import Clock


@given(st.integers(0, 40), st.integers(1, 7), st.integers(0, 9))
def test_control_steps(step: int, per: int, delay: int) -> None:
    clock = Clock(1e-3, 41, per, delay)
    control_steps = range(0, 41 + per, per)
    assert clock.is_control_step(step) == (step in control_steps)
    assert clock.next_control_step(step) == min(k for k in control_steps if k >= step)
    assert clock.control_number(step) == max(n for n, k in enumerate(control_steps) if k <= step)
    assert clock.is_control_step(np.arange(41)).tolist() == [k in control_steps for k in range(41)]
    assert clock.n_controls == 1 + clock.control_number(40)
    assert clock.measured_step(step) == max(0, step - delay)


@pytest.mark.parametrize(
    ("v", "diverged"),
    [
        ([0.6 * DIVERGENCE_SPEED, 0.7 * DIVERGENCE_SPEED], False),
        ([0.8 * DIVERGENCE_SPEED, -0.7 * DIVERGENCE_SPEED], True),
        ([1e300, 0.0], True),
        ([np.inf, 0.0], True),
        ([np.nan, 0.0], True),
        ([], False),
    ],
)
def test_divergence(v: list[float], diverged: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert is_diverged(np.array(v)) == diverged
    symbols = np.array([*v, 0.0], dtype=object)
    with np.errstate(over="ignore"):
        assert (not squared_speed(symbols) < MAX_SQUARED_SPEED) == diverged


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", range(3))
def test_a_torque_that_is_not_finite_shows_in_the_sum(bad: float, place: int) -> None:
    tau = np.array([1.0, -2.0, 3.0])
    assert torque_sum(tau) == 2.0
    tau[place] = bad
    assert not np.isfinite(torque_sum(tau))


def test_disturbances_are_added_to_a_torque() -> None:
    tau, J, wrench = np.array([1.0, 2.0]), np.arange(12.0).reshape(6, 2), np.arange(6.0)
    np.testing.assert_array_equal(with_disturbances(tau, None, ()), tau)
    found = with_disturbances(tau, np.array([0.5, 0.25]), [(J, wrench), (2.0 * J, wrench)])
    np.testing.assert_array_equal(found, tau - [0.5, 0.25] + 3.0 * J.T @ wrench)
