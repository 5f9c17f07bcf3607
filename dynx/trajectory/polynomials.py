"""Polynomials of degree three and five between two states (Siciliano et al., Robotics, section 4.2.1)."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.model import Model
from dynx.trajectory.base import Trajectory, checked_duration
from dynx.trajectory.curve import single_polynomial
from dynx.trajectory.displacement import checked_ends


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
    ends: from rest to rest it is 6 (q1 - q0) / T^2 there. A floating base needs the `model`, moves along one
    screw axis and must start and end at rest: v0[:6] and v1[:6] must be 0.

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
    jerk. A floating base needs the `model`, moves along one screw axis and must start and end at rest: the
    first six entries of v and a must be 0.

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
