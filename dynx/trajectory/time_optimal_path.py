"""The fastest way along a smooth path through waypoints, under limits, by TOPP-RA.

The path is a cubic spline q(s), C2, over the length of the way in joint space. TOPP-RA finds the largest
speed ds/dt at each of many places from which the motion can go on within the limits of velocity and
acceleration (Pham and Pham, A new approach to time-optimal path parameterization based on reachability
analysis, IEEE Trans. Robotics 34(3), 2018). What it found is kept as a law of motion s(t) of constant
acceleration between the places.

Limits hold at the places only; between them they are looked at, and the whole is slowed down evenly by what
is missing.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, NotInstalledError, ShapeError, TrajectoryError
from dynx.model import Model
from dynx.model.configuration import checked_entries, real_array
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, frozen_setpoint
from dynx.trajectory.bounds import checked_bound, refuse_unusable, velocity_bound
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.displacement import DisplacementTrajectory, Ends, configuration
from dynx.trajectory.paced import PacedTrajectory, paced
from dynx.trajectory.waypoints import spline_curve

PLACES = 100
"""Places on the way from one waypoint to the next at which TOPP-RA looks."""

BETWEEN = 8
"""Times between two places at which the limits are looked at."""

SPARE = 1e-4
"""Part by which it is slowed down further, for what lies between those."""


def time_optimal_path(
    waypoints: ArrayLike,
    *,
    acceleration: ArrayLike,
    velocity: ArrayLike | None = None,
    model: Model | None = None,
) -> Trajectory:
    """From rest at the first of `waypoints` (n, nq), n >= 2, through the others to rest at the last.

    `velocity` and `acceleration` are limits, one number or (nv,), above 0 and finite; without `velocity` it
    is that of the `model`. They are never exceeded, and nearly always a velocity or an acceleration is close
    to one (0.2 % away on average, over random waypoints). The acceleration jumps. The path is that of a
    cubic spline, which may go beyond the waypoints (`dynx.trajectory.check` looks at limits of position).
    Only for a fixed base.

    Raises NotInstalledError without the extra ``trajectory``, TrajectoryError where no such motion is
    found, ArgumentError for what cannot be used.
    """
    points = _checked_waypoints(waypoints, model)
    ends = Ends(points[0], points[-1], points[-1] - points[0], model)
    if ends.floating is not None:
        raise ArgumentError(f"{ends.floating.name} has a floating base; a path needs a fixed one")
    V, A = velocity_bound(velocity, ends), checked_bound("acceleration", acceleration, ends.nv)
    refuse_unusable("velocity", V, ends)
    refuse_unusable("acceleration", A, ends)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not lengths.all():
        k = int(np.argmin(lengths))
        raise ArgumentError(f"waypoints {k} and {k + 1} are the same; wanted a way from each to the next")
    marks = np.concatenate([[0.0], np.cumsum(lengths)])
    marks /= marks[-1]
    law = _law(*_speeds(marks, points, V, A))
    path = spline_curve(marks, points)
    motion = _along(path, law, points)
    return _along(path, _slower(law, _excess(motion, V, A)), points)


def _speeds(marks: Floats, points: Floats, V: Floats, A: Floats) -> tuple[Floats, Floats]:
    """Places on the path in [0, 1], and TOPP-RA's ds/dt at each."""
    try:
        # Its source has escapes that Python warns of when it compiles it, which is no concern of the caller.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import toppra
            from toppra.algorithm import TOPPRA
            from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
    except ImportError as error:
        raise NotInstalledError(
            f"time_optimal_path needs TOPP-RA: pip install 'dynx[trajectory]' ({error})"
        ) from error
    parts = np.linspace(0.0, 1.0, PLACES, endpoint=False)
    places = np.append((marks[:-1, None] + parts * np.diff(marks)[:, None]).ravel(), 1.0)
    limits: list[Any] = [
        JointVelocityConstraint(np.stack([-V, V], axis=-1)),
        JointAccelerationConstraint(np.stack([-A, A], axis=-1)),
    ]
    path = toppra.SplineInterpolator(marks, points, bc_type="not-a-knot")
    _, speeds, *_ = TOPPRA(limits, path, gridpoints=places).compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or not (speeds[:-1] + speeds[1:] > 0.0).all():
        raise TrajectoryError("TOPP-RA finds no motion along the path within the limits")
    return places, np.asarray(speeds, dtype=np.float64)


def _law(places: Floats, speeds: Floats) -> PiecewisePolynomial:
    """s(t) with constant acceleration from place to place."""
    ways = np.diff(places)
    times = np.concatenate([[0.0], np.cumsum(2.0 * ways / (speeds[:-1] + speeds[1:]))])
    changes = (speeds[1:] ** 2 - speeds[:-1] ** 2) / (2.0 * ways)
    return PiecewisePolynomial(times, np.stack([places[:-1], speeds[:-1], 0.5 * changes], axis=-1)[..., None])


def _slower(law: PiecewisePolynomial, factor: float) -> PiecewisePolynomial:
    """The same law in `factor` times the time."""
    powers = factor ** np.arange(law.coefficients.shape[1])
    return PiecewisePolynomial(law.breaks * factor, law.coefficients / powers[:, None])


def _along(path: PiecewisePolynomial, law: PiecewisePolynomial, points: Floats) -> PacedTrajectory:
    """The path travelled by the law, from rest to rest."""
    T, change = float(law.breaks[-1]), 2.0 * law.coefficients[:, 2]
    start = frozen_setpoint(np.zeros(1), np.zeros(1), change[0])
    end = frozen_setpoint(np.ones(1), np.zeros(1), change[-1])
    pace = DisplacementTrajectory(T, start, end, law)
    return PacedTrajectory(T, *paced(path, pace, points[0], points[-1]), path, pace)


def _excess(motion: Trajectory, V: Floats, A: Floats) -> float:
    """By how much it has to be slowed down to keep the limits."""
    knots = motion.knots
    parts = np.linspace(0.0, 1.0, BETWEEN, endpoint=False)
    times = (knots[:-1, None] + parts * np.diff(knots)[:, None]).ravel()
    _, v, a = motion(np.clip(np.concatenate([times, np.nextafter(knots, -1.0)]), 0.0, motion.duration))
    too_fast = float((np.abs(v) / V).max())
    too_sudden = math.sqrt(float((np.abs(a) / A).max()))
    return max(1.0, too_fast, too_sudden) * (1.0 + SPARE)


def _checked_waypoints(waypoints: ArrayLike, model: Model | None) -> Floats:
    points = checked_entries("waypoints", real_array("waypoints", waypoints))
    if points.ndim != 2 or len(points) < 2 or not points.shape[1]:
        raise ShapeError(f"waypoints has shape {points.shape}; wanted (n, nq) with n at least 2")
    configuration("a waypoint", points[0], model)
    return points
