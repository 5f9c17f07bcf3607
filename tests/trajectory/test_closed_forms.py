"""Motion laws against their formulas, evaluated in 40 digits where that is simple."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.spatial.scalar import Floats
from dynx.trajectory import cubic, cycloidal, quintic, s_curve, trapezoidal
from tests.trajectory.motions import hundredths, vectors

EPS = float(np.finfo(np.float64).eps)
TUTORIAL = np.array([-1.5, -1.0, 1.0, -1.57, -1.57, -1.57])
parts = st.floats(0.0, 1.0)


@given(vectors(2), vectors(2), hundredths(0.1, 5.0), parts)
def test_the_cycloidal_motion_law(q0: Floats, q1: Floats, duration: float, part: float) -> None:
    """The motion law agrees to a few units in the last place of its largest value."""
    t = part * duration
    got = cycloidal(q0, q1, duration)(t)
    with mpmath.workdps(40):
        T, s = mpmath.mpf(duration), mpmath.mpf(t)
        phase = 2 * mpmath.pi * s / T
        fraction = float(s / T - mpmath.sin(phase) / (2 * mpmath.pi))
        s_dot, s_ddot = (1 - mpmath.cos(phase)) / T, 2 * mpmath.pi * mpmath.sin(phase) / T**2
    displacement = q1 - q0
    size = np.abs(q0).max() + np.abs(displacement).max()
    assert (np.abs(got.q - (q0 + displacement * fraction)) <= 8.0 * EPS * size).all()
    limit = 16.0 * EPS * np.abs(displacement) * 2.0 / duration
    assert (np.abs(got.v - displacement * float(s_dot)) <= limit).all()
    limit = 32.0 * EPS * np.abs(displacement) * 2.0 * math.pi / duration**2
    assert (np.abs(got.a - displacement * float(s_ddot)) <= limit).all()


def test_the_cycloid_of_the_tutorial() -> None:
    """At T/2 half the distance is covered at twice the mean speed; the acceleration peaks at T/4 and 3T/4."""
    motion = cycloidal(np.zeros(6), TUTORIAL, duration=2.0)
    q, v, a = motion([0.5, 1.0, 1.5])
    np.testing.assert_allclose(q[1], TUTORIAL / 2.0, rtol=4.0 * EPS)
    np.testing.assert_allclose(v[1], TUTORIAL, rtol=4.0 * EPS)
    np.testing.assert_allclose(a[0], 2.0 * math.pi * TUTORIAL / 4.0, rtol=4.0 * EPS)
    np.testing.assert_allclose(a[2], -a[0], rtol=4.0 * EPS)
    assert (motion(np.linspace(0.0, 2.0, 999)).v <= 0.0)[:, TUTORIAL < 0.0].all()


@given(vectors(2), vectors(2), vectors(2), vectors(2), hundredths(0.2, 5.0))
def test_a_cubic_has_its_ends(q0: Floats, q1: Floats, v0: Floats, v1: Floats, duration: float) -> None:
    """Evaluates the polynomial itself, not the stored end setpoints."""
    motion = cubic(q0, q1, duration, v0=v0, v1=v1)
    for end, time, q, v in ((motion.start, 0.0, q0, v0), (motion.end, duration, q1, v1)):
        np.testing.assert_array_equal(end.q, q)
        np.testing.assert_array_equal(end.v, v)
        inside = motion.inside(np.array([time]))
        size = 1.0 + max(np.abs(x).max() for x in (q0, q1, v0, v1))
        for got, wanted, order in zip(inside, end, (0, 1, 2), strict=True):
            assert (np.abs(got[0] - wanted) <= 256.0 * EPS * size / min(1.0, duration) ** order).all()


@given(vectors(6), hundredths(0.2, 5.0))
def test_a_quintic_has_its_ends(states: Floats, duration: float) -> None:
    q0, q1, v0, v1, a0, a1 = states[:, None]
    motion = quintic(q0, q1, duration, v0=v0, v1=v1, a0=a0, a1=a1)
    for end, time, state in ((motion.start, 0.0, (q0, v0, a0)), (motion.end, duration, (q1, v1, a1))):
        inside = motion.inside(np.array([time]))
        size = 60.0 * max(1.0, duration) ** 2 * (1.0 + np.abs(states).max())
        for got, stored, wanted, order in zip(inside, end, state, (0, 1, 2), strict=True):
            np.testing.assert_array_equal(stored, wanted)
            assert (np.abs(got[0] - wanted) <= 64.0 * EPS * size / min(1.0, duration) ** order).all()


def test_rest_to_rest_polynomials() -> None:
    """3 s^2 - 2 s^3 and 10 s^3 - 15 s^4 + 6 s^5."""
    s = np.linspace(0.0, 1.0, 33)
    third, fifth = cubic([0.0], [2.0], 4.0)(4.0 * s), quintic([0.0], [2.0], 4.0)(4.0 * s)
    np.testing.assert_allclose(third.q[:, 0], 2.0 * (3.0 * s**2 - 2.0 * s**3), atol=32.0 * EPS)
    np.testing.assert_allclose(fifth.q[:, 0], 2.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5), atol=64.0 * EPS)
    np.testing.assert_allclose(third.a[0], 12.0 / 16.0, rtol=4.0 * EPS)
    assert fifth.a[0] == fifth.a[-1] == 0.0


def test_a_trapezoid_in_closed_form() -> None:
    """10 rad at 2 rad/s and 4 rad/s^2: 0.5 s acceleration, 4.5 s constant velocity, 0.5 s deceleration."""
    motion = trapezoidal([0.0], [10.0], velocity=2.0, acceleration=4.0)
    assert motion.duration == pytest.approx(5.5, rel=1e-12)
    np.testing.assert_allclose(motion.knots, [0.0, 0.5, 5.0, 5.5], rtol=1e-12)
    q, v, a = motion([0.25, 0.5, 2.75, 5.25])
    np.testing.assert_allclose(q[:, 0], [0.125, 0.5, 5.0, 9.875], rtol=1e-12)
    np.testing.assert_allclose(v[:, 0], [1.0, 2.0, 2.0, 1.0], rtol=1e-12)
    np.testing.assert_allclose(a[:, 0], [4.0, 0.0, 0.0, -4.0], rtol=1e-12)


def test_a_short_distance_gives_a_triangular_profile() -> None:
    """If the velocity limit is not reached, the largest speed is sqrt(a d), at T/2."""
    motion = trapezoidal([0.0], [1.0], velocity=np.inf, acceleration=4.0)
    assert motion.duration == pytest.approx(1.0, rel=1e-12)
    assert motion(0.5).v[0] == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("velocity", "acceleration", "duration"),
    [
        # All seven phases: distance / v + v / a + a / j.
        (2.0, 4.0, 10.0 / 2.0 + 2.0 / 4.0 + 4.0 / 8.0),
        # The acceleration limit is not reached: distance / v + 2 sqrt(v / j).
        (2.0, 100.0, 10.0 / 2.0 + 2.0 * math.sqrt(2.0 / 8.0)),
        # Nor is the velocity limit: 4 (distance / 2 j)^(1/3).
        (100.0, 100.0, 4.0 * (10.0 / 16.0) ** (1.0 / 3.0)),
        (np.inf, np.inf, 4.0 * (10.0 / 16.0) ** (1.0 / 3.0)),
        # Only the acceleration limit is reached: a/j + sqrt((a/j)^2 + 4 distance / a).
        (100.0, 2.0, 2.0 / 8.0 + math.sqrt((2.0 / 8.0) ** 2 + 4.0 * 10.0 / 2.0)),
    ],
)
def test_the_durations_of_a_double_s(velocity: float, acceleration: float, duration: float) -> None:
    """Biagiotti and Melchiorri, section 3.4.2, with a jerk of 8 over a distance of 10."""
    motion = s_curve([0.0], [10.0], velocity=velocity, acceleration=acceleration, jerk=8.0)
    assert motion.duration == pytest.approx(duration, rel=1e-12)
    half = motion(0.5 * motion.duration)
    assert half.q[0] == pytest.approx(5.0, rel=1e-12)
    assert abs(half.a[0]) <= 1e-12 * 8.0
