"""Motions between two states in closed form: cycloidal, polynomial, and time-optimal under limits.

The cycloidal motion has a sinusoidal acceleration that is 0 at both ends,

    s(t) = t/T - sin(2 pi t/T) / (2 pi),   0 <= t <= T

(Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, section 2.2.2); polynomials
are of degree three and five (Siciliano et al., Robotics, section 4.2.1).

In the time-optimal motions, from rest to rest, every coordinate is a multiple of one path parameter s(t) from
0 to 1, so the joints start together, stop together and stay on the line; each limit of s is the smallest over
the joints. The trapezoidal profile and the double S have closed forms (profiles as in Biagiotti and
Melchiorri, sections 3.2 and 3.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, TrajectoryError
from dynx.model import Model
from dynx.model.numbers import read_only
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import MAX_DURATION, MIN_DURATION, Trajectory, checked_duration
from dynx.trajectory.curve import Curve, PiecewisePolynomial, polynomial_from_phases, single_polynomial
from dynx.trajectory.displacement import Ends, checked_ends
from dynx.trajectory.motion_limits import (
    LIMIT_MARGIN,
    checked_limit,
    require_motion,
    scalar_limit,
    velocity_limits,
)


@checks_types
def trapezoidal(
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    acceleration: ArrayLike,
    velocity: ArrayLike | None = None,
    duration: float | None = None,
    model: Model | None = None,
) -> Trajectory:
    """Return a motion from rest at `q0` to rest at `q1` with a trapezoidal velocity profile.

    `velocity` and `acceleration` are limits, one number or (nv,); infinity means no limit. The default of
    `velocity` is the limit of the `model`. The motion is the fastest on the straight line, so some joint is
    at a limit at any time. If `duration` [s] is longer, the motion takes this time, and time is scaled
    uniformly. A robot with a floating base or ball joints needs its `model`: the base moves along one
    screw axis, and the child link of a ball joint turns about one axis.

    Raises ArgumentError for limits that are negative, or infinite for every moving joint; TrajectoryError for
    a limit of 0 of a joint that has to move, and for a duration that is too short.
    """
    ends = checked_ends(q0, q1, model)
    V = scalar_limit("velocity", velocity_limits(velocity, ends), ends)
    A = scalar_limit("acceleration", checked_limit("acceleration", acceleration, ends.nv), ends)
    if duration is None or ends.displacement.any():
        require_motion(ends)
        _require_finite("acceleration", A)
        rise = min(V / A, math.sqrt(1.0 / A))
        top_speed = A * rise
        spans, rates = (rise, max(0.0, 1.0 / top_speed - rise), rise), (A, 0.0, -A)
        return _trajectory_of_phases(ends, spans, rates, 2, duration)
    return _standstill(ends, duration)


@checks_types
def s_curve(
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    velocity: ArrayLike | None = None,
    duration: float | None = None,
    model: Model | None = None,
) -> Trajectory:
    """Return a motion as `trapezoidal` does, with limited jerk in addition (the double S, seven phases).

    `jerk` is a limit like the others. The acceleration is continuous and 0 at both ends.
    """
    ends = checked_ends(q0, q1, model)
    V = scalar_limit("velocity", velocity_limits(velocity, ends), ends)
    A = scalar_limit("acceleration", checked_limit("acceleration", acceleration, ends.nv), ends)
    J = scalar_limit("jerk", checked_limit("jerk", jerk, ends.nv), ends)
    if duration is None or ends.displacement.any():
        require_motion(ends)
        _require_finite("jerk", J)
        # Duration of a jerk phase, limited by the acceleration, the velocity or the distance.
        jerk_time = min(A / J, math.sqrt(V / J), (0.5 / J) ** (1.0 / 3.0))
        # Duration of constant acceleration, until the velocity limit or half the distance is reached.
        reached = V / (J * jerk_time) - jerk_time
        halfway = 0.5 * (math.sqrt(jerk_time * jerk_time + 4.0 / (J * jerk_time)) - 3.0 * jerk_time)
        constant_time = max(0.0, min(reached, halfway))
        top_speed = J * jerk_time * (jerk_time + constant_time)
        cruise_time = max(0.0, 1.0 / top_speed - (2.0 * jerk_time + constant_time))
        spans = (jerk_time, constant_time, jerk_time, cruise_time, jerk_time, constant_time, jerk_time)
        return _trajectory_of_phases(ends, spans, (J, 0.0, -J, 0.0, -J, 0.0, J), 3, duration)
    return _standstill(ends, duration)


def _trajectory_of_phases(
    ends: Ends, spans: tuple[float, ...], rates: tuple[float, ...], order: int, duration: float | None
) -> Trajectory:
    """Return the motion of these phases, uniformly slowed down to take `duration`; the derivative of
    `order` is `rates` in them."""
    shortest = sum(spans)
    if not MIN_DURATION <= shortest <= MAX_DURATION:
        raise TrajectoryError(
            f"within the limits the motion takes {shortest:g} s; "
            f"wanted between {MIN_DURATION:g} and {MAX_DURATION:g} s"
        )
    if duration is not None:
        T = checked_duration(duration)
        if T / shortest < 1.0 - LIMIT_MARGIN:
            raise TrajectoryError(
                f"duration is {T:g}; within the limits the motion takes at least {shortest:.9g} s"
            )
        factor = max(1.0, T / shortest)
        spans = tuple(span * factor for span in spans)
        rates = tuple(rate / factor**order for rate in rates)
    curve = polynomial_from_phases(spans, rates, order).along(ends.displacement)
    T = float(curve.breaks[-1]) if duration is None else T
    return _at_rest(ends, T, PiecewisePolynomial(np.append(curve.breaks[:-1], T), curve.coefficients))


def _at_rest(ends: Ends, T: float, curve: PiecewisePolynomial) -> Trajectory:
    """Return the motion. At both ends its velocity is exactly 0, its acceleration that of the end phase."""
    rest = np.zeros(ends.nv)
    acceleration = 2.0 * curve.coefficients[0, 2]
    if curve.coefficients.shape[1] == 4:
        return ends.rest_to_rest(T, curve)
    return ends.trajectory(T, curve, (rest, acceleration), (rest, -acceleration))


def _standstill(ends: Ends, duration: float) -> Trajectory:
    T = checked_duration(duration)
    return ends.rest_to_rest(T, single_polynomial(T, np.zeros(ends.nv)))


def _require_finite(name: str, bound: float) -> None:
    if bound == math.inf:
        raise ArgumentError(f"{name} is infinite for everything that moves; wanted a limit")


@checks_types
def cycloidal(q0: ArrayLike, q1: ArrayLike, duration: float, *, model: Model | None = None) -> Trajectory:
    """Return the cycloidal motion from rest at `q0` to rest at `q1` (nq,) in `duration` [s]:

        q = q0 + (q1 - q0) (t/T - sin(2 pi t/T) / (2 pi))

    The largest speed is 2 (q1 - q0) / T, at T/2. The largest acceleration is 2 pi (q1 - q0) / T^2, at T/4 and
    3T/4. For a robot with a floating base or ball joints, give its `model`. The base then moves along one
    screw axis, and v, a are in its axes. The child link of a ball joint turns about one axis. The end of the
    motion may have a quaternion of q1 with the opposite sign, which is the same orientation.

    Raises ArgumentError (ShapeError, DTypeError, NotFiniteError) for invalid arguments.
    """
    ends = checked_ends(q0, q1, model)
    T = checked_duration(duration)
    return ends.rest_to_rest(T, Cycloid(T, read_only(ends.displacement)))


@dataclass(frozen=True, eq=False)
class Cycloid(Curve):
    """`direction` (k,) times the cycloidal motion law over [0, duration]."""

    duration: float
    direction: Floats

    @property
    def knots(self) -> Floats:
        return np.array([0.0, self.duration])

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the motion law and its exact derivatives, times the direction."""
        T = self.duration
        part = t / T
        sine = np.sin(2.0 * np.pi * part)
        half = np.sin(np.pi * part)
        s = part - sine / (2.0 * np.pi)
        # 1 - cos(2 u) = 2 sin(u)^2, which does not cancel near rest.
        s_dot = 2.0 * half * half / T
        s_ddot = 2.0 * np.pi * sine / (T * T)
        return (
            s[:, None] * self.direction,
            s_dot[:, None] * self.direction,
            s_ddot[:, None] * self.direction,
        )


@checks_types
def cubic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float,
    *,
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
    model: Model | None = None,
) -> Trajectory:
    """Return the cubic from `q0` with velocity `v0` to `q1` with `v1` in `duration` [s]; v0, v1 default to 0.

    Of all motions between these states it has the smallest integral of a^2. Its acceleration jumps at the
    ends: from rest to rest it is 6 (q1 - q0) / T^2 there. A robot with a floating base or ball joints
    needs its `model`: the base moves along one screw axis, the child link of a ball joint turns about one
    axis, and both start and end at rest, so their entries of v0 and v1 must be 0.

    Raises ArgumentError (ShapeError, DTypeError, NotFiniteError) for invalid arguments.
    """
    ends = checked_ends(q0, q1, model)
    T = checked_duration(duration)
    d, begin, finish = ends.displacement, ends.velocity("v0", v0), ends.velocity("v1", v1)
    square = (3.0 * d / T - 2.0 * begin - finish) / T
    cube = (begin + finish - 2.0 * d / T) / (T * T)
    curve = single_polynomial(T, 0.0 * d, begin, square, cube)
    last = 2.0 * (2.0 * finish + begin - 3.0 * d / T) / T
    return ends.trajectory(T, curve, (begin, 2.0 * square), (finish, last))


@checks_types
def quintic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float,
    *,
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    a1: ArrayLike | None = None,
    model: Model | None = None,
) -> Trajectory:
    """Return the quintic from the state (`q0`, `v0`, `a0`) to (`q1`, `v1`, `a1`) in `duration` [s].

    v and a default to 0. Of all motions between these states it has the smallest integral of the squared
    jerk. A robot with a floating base or ball joints needs its `model`: the base moves along one screw axis,
    the child link of a ball joint turns about one axis, and both start and end at rest, so their entries of v
    and a must be 0.

    Raises ArgumentError (ShapeError, DTypeError, NotFiniteError) for invalid arguments.
    """
    ends = checked_ends(q0, q1, model)
    T = checked_duration(duration)
    d = ends.displacement
    v_start, v_end = ends.velocity("v0", v0), ends.velocity("v1", v1)
    a_start, a_end = ends.velocity("a0", a0), ends.velocity("a1", a1)
    # Differences of position, velocity and acceleration left at T, in units where T = 1.
    x = d - T * v_start - 0.5 * T * T * a_start
    v = T * (v_end - v_start - T * a_start)
    a = T * T * (a_end - a_start)
    curve = single_polynomial(
        T,
        0.0 * d,
        v_start,
        0.5 * a_start,
        (10.0 * x - 4.0 * v + 0.5 * a) / T**3,
        (-15.0 * x + 7.0 * v - a) / T**4,
        (6.0 * x - 3.0 * v + 0.5 * a) / T**5,
    )
    return ends.trajectory(T, curve, (v_start, a_start), (v_end, a_end))
