"""Splines through waypoints at given times, computed by SciPy and stored as piecewise polynomials."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.numbers import checked_entries, real_array
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, read_only_setpoint
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.displacement import DisplacementTrajectory

Kind = Literal["cubic", "quintic"]
End = Literal["clamped", "natural", "periodic"]


@checks_types
def spline(
    times: ArrayLike,
    waypoints: ArrayLike,
    *,
    kind: Kind = "cubic",
    end: End = "clamped",
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
) -> Trajectory:
    """Return a spline through `waypoints` (n, nq), n >= 2, at `times` (n,) [s] that ascend from 0.

    `kind` is ``"cubic"`` (continuous acceleration) or ``"quintic"`` (continuous snap). `end` is the condition
    at the first and the last waypoint:

    - ``"clamped"``: velocities `v0` and `v1` (nq,), 0 by default, and for a quintic acceleration 0
    - ``"natural"``: acceleration 0, and for a quintic jerk 0
    - ``"periodic"``: every derivative is equal at both, which must be the same waypoint; a cubic needs 3
      waypoints, a quintic 6

    Each coordinate has its own spline, so this is for a fixed base; for a floating base, use `concatenate`.
    (de Boor, A Practical Guide to Splines, chapters IV and XIII.)

    Raises ArgumentError (ShapeError, DTypeError, NotFiniteError) for invalid arguments.
    """
    points = checked_waypoints(waypoints)
    breaks = _checked_times(times, len(points))
    if kind not in ("cubic", "quintic"):
        raise ArgumentError(f"kind is {shown(kind)}; wanted 'cubic' or 'quintic'")
    if end not in ("clamped", "natural", "periodic"):
        raise ArgumentError(f"end is {shown(end)}; wanted 'clamped', 'natural' or 'periodic'")
    begin, finish = (_end_velocity(name, v, end, points.shape[1]) for name, v in (("v0", v0), ("v1", v1)))
    if end == "periodic":
        _require_periodic(points, kind)
    curve = _cubic(breaks, points, end, begin, finish)
    if kind == "quintic":
        curve = _quintic(breaks, points, end, begin, finish)
    return _trajectory_of_curve(curve, kind, end, points, begin, finish)


def spline_curve(breaks: Floats, points: Floats) -> PiecewisePolynomial:
    """Return the cubic spline through points (n, k) with not-a-knot end conditions."""
    from scipy.interpolate import CubicSpline

    return from_scipy(CubicSpline(breaks, points, bc_type="not-a-knot"))


def from_scipy(polynomial: Any) -> PiecewisePolynomial:
    """Convert SciPy's PPoly of vectors (k,), which lists the highest power first."""
    return PiecewisePolynomial(polynomial.x, np.transpose(polynomial.c[::-1], (1, 0, 2)))


def _cubic(breaks: Floats, points: Floats, end: End, v0: Floats, v1: Floats) -> PiecewisePolynomial:
    from scipy.interpolate import CubicSpline

    clamped: Any = ((1, v0), (1, v1))
    return from_scipy(CubicSpline(breaks, points, bc_type=clamped if end == "clamped" else end))


def _quintic(breaks: Floats, points: Floats, end: End, v0: Floats, v1: Floats) -> PiecewisePolynomial:
    from scipy.interpolate import make_interp_spline

    zero = np.zeros(points.shape[1])
    conditions: Any = "periodic"
    if end == "clamped":
        conditions = ([(1, v0), (2, zero)], [(1, v1), (2, zero)])
    elif end == "natural":
        conditions = ([(2, zero), (3, zero)], [(2, zero), (3, zero)])
    basis = make_interp_spline(breaks, points, k=5, bc_type=conditions)
    # The knots are the breaks; derivatives there are those of the following piece.
    taylor = [basis(breaks[:-1], nu=p) / math.factorial(p) for p in range(6)]
    return PiecewisePolynomial(breaks, np.stack(taylor, axis=1))


def _trajectory_of_curve(
    curve: PiecewisePolynomial, kind: Kind, end: End, points: Floats, v0: Floats, v1: Floats
) -> Trajectory:
    """Return the trajectory, with the values known exactly at its ends inserted without rounding."""
    duration = float(curve.breaks[-1])
    _, v, a = curve(np.array([0.0, duration]))
    if end == "clamped":
        v = np.stack([v0, v1])
    if end == "natural" or (end, kind) == ("clamped", "quintic"):
        a = np.zeros_like(a)
    if end == "periodic":
        v[1], a[1] = v[0], a[0]
    coefficients = np.array(curve.coefficients)
    coefficients[:, 0] = points[:-1] - points[0]
    return DisplacementTrajectory(
        duration,
        read_only_setpoint(points[0], v[0], a[0]),
        read_only_setpoint(points[-1], v[1], a[1]),
        PiecewisePolynomial(curve.breaks, coefficients),
    )


def checked_waypoints(waypoints: ArrayLike) -> Floats:
    """Return waypoints (n, nq), n >= 2; raise ShapeError, DTypeError or NotFiniteError for invalid ones."""
    points = checked_entries("waypoints", real_array("waypoints", waypoints))
    if points.ndim != 2 or len(points) < 2 or not points.shape[1]:
        raise ShapeError(f"waypoints has shape {points.shape}; wanted (n, nq) with n at least 2")
    return points


def _checked_times(times: ArrayLike, count: int) -> Floats:
    breaks = checked_entries("times", real_array("times", times))
    if breaks.shape != (count,):
        raise ShapeError(f"times has shape {breaks.shape}; wanted ({count},), one for each waypoint")
    if breaks[0] != 0.0:
        raise ArgumentError(f"times[0] is {breaks[0]:g}; wanted 0, where a trajectory begins")
    not_ascending = np.flatnonzero(np.diff(breaks) <= 0.0)
    if not_ascending.size:
        k = int(not_ascending[0]) + 1
        raise ArgumentError(
            f"times[{k}] is {breaks[k]:g} after {breaks[k - 1]:g}; wanted strictly ascending times"
        )
    return breaks


def _end_velocity(name: str, value: ArrayLike | None, end: End, nq: int) -> Floats:
    if value is None:
        return np.zeros(nq)
    if end != "clamped":
        raise ArgumentError(f"{name} is given, but the end is {shown(end)}; wanted end='clamped'")
    array = checked_entries(name, real_array(name, value))
    if array.shape != (nq,):
        raise ShapeError(f"{name} has shape {array.shape}; wanted ({nq},)")
    return array


def _require_periodic(points: Floats, kind: Kind) -> None:
    least = 3 if kind == "cubic" else 6
    if len(points) < least:
        raise ArgumentError(f"waypoints are {len(points)}; a periodic {kind} spline needs {least}")
    apart = np.flatnonzero(points[0] != points[-1])
    if apart.size:
        k = int(apart[0])
        raise ArgumentError(
            f"coordinate {k} is {points[0, k]:g} at the first waypoint and {points[-1, k]:g} at the last; "
            "a periodic spline needs them equal"
        )
