"""Splines: waypoints, end conditions, smoothness."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.spatial.scalar import Floats
from dynx.trajectory import cubic, quintic, spline
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.displacement import DisplacementTrajectory
from dynx.trajectory.waypoints import End, Kind
from tests.examples import one_robot
from tests.trajectory.motions import hundredths, vectors

SPLINE_TOLERANCE = 1e-9
"""Relative error of derivatives from SciPy's banded solver, whose condition number is below 1e6."""


@st.composite
def routes(draw: st.DrawFn, *, closed: bool = False) -> tuple[Floats, Floats]:
    count = draw(st.integers(6, 9))
    steps = draw(st.lists(hundredths(0.3, 2.0), min_size=count - 1, max_size=count - 1))
    points = np.array([draw(vectors(2)) for _ in range(count)])
    if closed:
        points[-1] = points[0]
    return np.cumsum([0.0, *steps]), points


def derivatives(motion: object, order: int) -> tuple[Floats, Floats, float]:
    """Return a derivative at the start and end of every piece (m, 2), and its largest magnitude."""
    assert isinstance(motion, DisplacementTrajectory)
    assert isinstance(motion.curve, PiecewisePolynomial)
    s = np.diff(motion.curve.breaks)[:, None]
    c = motion.curve.coefficients
    first, last = np.zeros((2, *c[:, 0].shape))
    for p in reversed(range(order, c.shape[1])):
        factor = float(np.prod(np.arange(p, p - order, -1)))
        first, last = factor * c[:, p], last * s + factor * c[:, p]
    return first, last, float(max(np.abs(first).max(), np.abs(last).max(), 1.0))


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
@pytest.mark.parametrize("end", ["clamped", "natural", "periodic"])
def test_waypoints_are_passed_smoothly(kind: Kind, end: End) -> None:
    smooth_to = {"cubic": 2, "quintic": 4}[kind]

    @one_robot
    @given(routes(closed=end == "periodic"))
    def passes(route: tuple[Floats, Floats]) -> None:
        times, points = route
        motion = spline(times, points, kind=kind, end=end)
        np.testing.assert_allclose(motion(times).q, points, rtol=0.0, atol=8.0 * np.finfo(float).eps * 3.0)
        np.testing.assert_array_equal(motion.knots, times)
        for order in range(smooth_to + 1):
            first, last, size = derivatives(motion, order)
            assert (np.abs(last[:-1] - first[1:]) <= SPLINE_TOLERANCE * size).all(), order
            if end == "periodic":
                # Displacements start at 0, and a periodic spline returns to 0.
                assert (np.abs(last[-1] - first[0]) <= SPLINE_TOLERANCE * size).all(), order

    passes()


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_end_conditions(kind: Kind) -> None:
    zero_at_ends = {
        "clamped": {"cubic": (), "quintic": (2,)}[kind],
        "natural": {"cubic": (2,), "quintic": (2, 3)}[kind],
    }

    @one_robot
    @given(routes(), vectors(2), vectors(2))
    def holds(route: tuple[Floats, Floats], v0: Floats, v1: Floats) -> None:
        for end in ("clamped", "natural"):
            velocities = {"v0": v0, "v1": v1} if end == "clamped" else {}
            motion = spline(*route, kind=kind, end=end, **velocities)
            for order in zero_at_ends[end]:
                first, last, size = derivatives(motion, order)
                assert (np.abs(first[0]) <= SPLINE_TOLERANCE * size).all()
                assert (np.abs(last[-1]) <= SPLINE_TOLERANCE * size).all()
            if end == "clamped":
                first, last, size = derivatives(motion, 1)
                assert (np.abs(first[0] - v0) <= SPLINE_TOLERANCE * size).all()
                assert (np.abs(last[-1] - v1) <= SPLINE_TOLERANCE * size).all()
                np.testing.assert_array_equal(motion.start.v, v0)
                np.testing.assert_array_equal(motion.end.v, v1)

    holds()


@given(vectors(2), vectors(2), vectors(2), vectors(2), hundredths(0.5, 4.0), st.floats(0.0, 1.0))
def test_two_waypoints_are_a_polynomial(
    q0: Floats, q1: Floats, v0: Floats, v1: Floats, duration: float, part: float
) -> None:
    points, times = [q0, q1], [0.0, duration]
    pairs = (
        (spline(times, points, v0=v0, v1=v1), cubic(q0, q1, duration, v0=v0, v1=v1)),
        (spline(times, points, kind="quintic", v0=v0, v1=v1), quintic(q0, q1, duration, v0=v0, v1=v1)),
    )
    for one, other in pairs:
        for got, wanted in zip(one(part * duration), other(part * duration), strict=True):
            np.testing.assert_allclose(got, wanted, rtol=0.0, atol=SPLINE_TOLERANCE * 1e3)
