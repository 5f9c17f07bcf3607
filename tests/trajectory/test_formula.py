"""Motions by a formula, against the derivatives of the formula in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx import control, trajectory
from dynx.errors import ArgumentError, DTypeError, DynxError, NotFiniteError, ShapeError, TrajectoryError
from dynx.spatial.scalar import Floats
from tests.trajectory.motions import floating, hundredths, vectors

ERRORS = (1e-12, 1e-10, 1e-8)
"""Errors of q, v and a that docs/trajectories.md states, in the largest value of any coordinate."""


@settings(max_examples=25)
@given(vectors(2), vectors(2, 1.0), hundredths(1.0, 7.0), hundredths(0.1, 20.0))
def test_derivatives_are_those_of_the_formula(
    amplitude: Floats, phase: Floats, omega: float, duration: float
) -> None:
    w = omega * np.array([1.0, 0.5])
    motion = trajectory.from_function(lambda t: 3.0 + amplitude * np.sin(w * t + phase), duration)
    t = np.linspace(0.0, duration, 200)
    angle = np.outer(t, w) + phase
    wanted = (
        3.0 + amplitude * np.sin(angle),
        w * amplitude * np.cos(angle),
        -w * w * amplitude * np.sin(angle),
    )
    # The offset of 3 rad is in the rounding of every value, and h is the time in which the formula changes.
    size, h = 3.0 + np.abs(amplitude).max(), min(duration, 1.0 / omega)
    for k, (found, exact) in enumerate(zip(motion(t), wanted, strict=True)):
        assert np.abs(found - exact).max() <= ERRORS[k] * size / h**k


def test_a_constant_has_no_velocity_and_a_line_no_acceleration() -> None:
    motion = trajectory.from_function(lambda t: [3.0, 2.0 * t], 1e-3)
    q, v, a = motion(np.linspace(0.0, 1e-3, 11))
    assert not v[:, 0].any()
    np.testing.assert_allclose(v[:, 1], 2.0, rtol=1e-12)
    assert not a.any()
    np.testing.assert_allclose(q[:, 0], 3.0, rtol=1e-15)


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_a_floating_base_has_its_velocity_in_its_own_axes(seed: int) -> None:
    """Along a screw axis, velocity and acceleration are multiples of one twist (`displacement`)."""
    model = floating()
    rng = np.random.default_rng(seed)
    q0, twist = model.random(rng), rng.normal(size=model.nv)
    motion = trajectory.from_function(lambda t: model.integrate(q0, np.sin(t) * twist), 2.0, model=model)
    t = np.linspace(0.0, 2.0, 21)
    q, v, a = motion(t)
    size = 1.0 + np.abs(q).max() + np.abs(twist).max() ** 2
    np.testing.assert_allclose(v, np.outer(np.cos(t), twist), atol=ERRORS[1] * size)
    np.testing.assert_allclose(a, np.outer(-np.sin(t), twist), atol=ERRORS[2] * size)


@given(hundredths(0.1, 1.9))
def test_a_kink_or_a_jump_is_named_with_its_time(at: float) -> None:
    for formula in (lambda t: [abs(t - at)], lambda t: [float(t > at)], lambda t: [max(0.0, np.sin(t - at))]):
        with pytest.raises(TrajectoryError, match=r"t = ") as error:
            trajectory.from_function(formula, 2.0)
        assert error.value.at == pytest.approx(at / 2.0, abs=2.0**-12)


@pytest.mark.parametrize(
    ("formula", "kind", "words"),
    [
        (lambda: [0.0], DTypeError, "wanted a function"),
        (3.0, DTypeError, r"of type float; wanted Callable\[\[float\]"),
        (
            lambda t: np.zeros(2 if t < 1.0 else 3),
            ShapeError,
            r"f\(1\.\d+\) has shape \(3,\), and f\(0\) has \(2,\)",
        ),
        (lambda t: 1.0, ShapeError, r"f\(0\) has shape \(\); wanted \(nq,\)"),
        (lambda t: [np.log(t)] if t else [np.nan], NotFiniteError, r"f\(0\)\[0\] is nan"),
        (lambda t: ["a"], DTypeError, r"f\(0\) has dtype"),
        (lambda t: [np.sin(1e7 * t)], TrajectoryError, "oscillates too fast"),
    ],
)
def test_values_that_are_no_motion(formula: Any, kind: type[DynxError], words: str) -> None:
    with pytest.raises(kind, match=words):
        trajectory.from_function(formula, 2.0)


def test_a_model_checks_configurations() -> None:
    with pytest.raises(ShapeError, match=r"f\(0\) has shape"):
        trajectory.from_function(lambda t: [t], 1.0, model=dynx.load("planar_2r"))


def test_other_ways_to_write_a_formula_are_answered_with_this_one() -> None:
    class Sines(trajectory.Trajectory):
        def __call__(self, t: Any) -> Any:
            return np.sin(t)

    abstract: Any = Sines
    with pytest.raises(DTypeError, match=r"class Sines has no method inside.*from_function\(f, duration\)"):
        abstract(1.0, None, None)
    arm = dynx.load("planar_2r")
    reference: Any = lambda t: [0.0, t]  # noqa: E731
    with pytest.raises(ArgumentError, match=r"reference is .*from_function\(f, duration\)"):
        dynx.simulate(arm, control.PD(arm, kp=1.0, kd=1.0), reference, duration=0.1)
    motion = trajectory.from_function(reference, 0.1)
    assert dynx.simulate(arm, control.PD(arm, kp=1.0, kd=1.0), motion).t[-1] == pytest.approx(0.1)
