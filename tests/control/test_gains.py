"""Gains are looked at once, and wrong ones have an error each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.control import PD, PID, ComputedTorque, Impedance, OperationalSpace, Saturated
from dynx.control.gains import feedback_gains
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, GainError, LimitError, UnknownNameError
from dynx.model.loading import load
from dynx.spatial.scalar import clamp

ARM = load("ur5")
reals = st.floats(1e-3, 1e3)


@given(reals, st.floats(0.0, 5.0))
def test_natural_frequency_and_damping_are_those_of_the_error(w: float, zeta: float) -> None:
    """The roots of s^2 + kd s + kp have size w and, where they oscillate, real part -zeta w."""
    kp, kd = feedback_gains(2, None, None, w, zeta)
    np.testing.assert_array_equal(kp, kp[0])
    roots = np.roots([1.0, kd[0], kp[0]])
    if zeta < 0.99:
        np.testing.assert_allclose(np.abs(roots), w, rtol=1e-12)
        np.testing.assert_allclose(roots.real, -zeta * w, rtol=0.0, atol=1e-12 * w)


@pytest.mark.parametrize(
    ("gains", "says"),
    [
        ({"kp": -1.0, "kd": 1.0}, "kp is negative"),
        ({"kp": 1.0, "kd": np.nan}, "kd is not finite"),
        ({"kp": np.inf, "kd": 1.0}, "kp is not finite"),
        ({"kp": [1.0, 2.0], "kd": 1.0}, r"kp has shape \(2,\); wanted one number, or 6"),
        ({"kp": "stiff", "kd": 1.0}, "kp has dtype"),
        ({"kp": 1.0}, "kp and kd both"),
        ({}, "kp and kd both"),
        ({"kp": 1.0, "kd": 1.0, "natural_frequency": 1.0}, "twice"),
        ({"natural_frequency": -1.0}, "natural_frequency is negative"),
        ({"natural_frequency": 1.0, "damping_ratio": -1.0}, "damping_ratio is negative"),
    ],
)
def test_gains_that_are_none(gains: dict[str, Any], says: str) -> None:
    with pytest.raises(GainError, match=says):
        ComputedTorque(ARM, **gains)


def test_gains_cannot_be_changed_behind_a_law_s_back() -> None:
    gains = np.full(6, 10.0)
    law = PD(ARM, kp=gains, kd=1.0)
    gains[:] = 0.0
    assert law.kp.tolist() == [10.0] * 6
    with pytest.raises(ValueError, match="read-only"):
        law.kp[0] = 1.0


def test_other_arguments_of_laws() -> None:
    with pytest.raises(UnknownNameError, match="tool0"):
        OperationalSpace(ARM, "tool", natural_frequency=1.0)
    with pytest.raises(GainError, match=r"damping has shape \(6,\); wanted one number$"):
        OperationalSpace(ARM, "tool0", kp=1.0, kd=1.0, damping=np.ones(6))  # type: ignore[arg-type]
    with pytest.raises(GainError, match="linear then angular"):
        Impedance(ARM, "tool0", stiffness=np.zeros(3), damping=1.0)
    for name, value in (("control_dt", 0.0), ("tracking_time", -1.0)):
        times: dict[str, Any] = {"control_dt": 1e-3, name: value}
        with pytest.raises(ArgumentError, match=name):
            PID(ARM, kp=1.0, ki=1.0, kd=1.0, **times)


@given(st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6), st.lists(reals, min_size=6, max_size=6))
def test_clipping_keeps_what_is_inside_and_the_sign_of_the_rest(tau: list[float], limit: list[float]) -> None:
    cut = clamp(np.array(tau), np.array(limit))
    assert np.all(np.abs(cut) <= limit)
    inside = np.abs(tau) <= limit
    np.testing.assert_array_equal(cut[inside], np.array(tau)[inside])
    np.testing.assert_array_equal(cut[~inside], np.copysign(limit, tau)[~inside])


def test_limits() -> None:
    np.testing.assert_array_equal(checked_limit(ARM, None), ARM.effort_limit)
    np.testing.assert_array_equal(checked_limit(ARM, np.inf), np.full(6, np.inf))
    with pytest.raises(LimitError, match="'elbow_joint' of ur5 is 0"):
        checked_limit(ARM, [1.0, 1.0, 0.0, 1.0, 1.0, 1.0])
    for wrong in (-1.0, np.nan, [1.0, 2.0]):
        with pytest.raises(GainError, match="limit"):
            Saturated(PD(ARM, kp=1.0, kd=1.0), limit=wrong)
