"""Time-optimal motion along a smooth path through waypoints, under limits, by TOPP-RA.

The path is a cubic spline q(s), C2, parametrised by arc length in joint space. TOPP-RA finds the largest
speed ds/dt at each of many grid points from which the motion can continue within the limits of velocity and
acceleration (Pham and Pham, A new approach to time-optimal path parameterization based on reachability
analysis, IEEE Trans. Robotics 34(3), 2018). The result is a motion law s(t) of constant acceleration between
the grid points.

TOPP-RA respects the limits at the grid points only. They are checked in between, and the whole motion is
slowed down uniformly by as much as needed.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, NotInstalledError, TrajectoryError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, read_only_setpoint
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.displacement import DisplacementTrajectory, Ends, configuration
from dynx.trajectory.motion_limits import checked_limit, require_positive_finite, velocity_limits
from dynx.trajectory.time_scaling import TimeScaledTrajectory, end_setpoints
from dynx.trajectory.waypoints import checked_waypoints, spline_curve

GRID_POINTS_PER_SEGMENT = 100
"""Grid points of TOPP-RA from one waypoint to the next."""

CHECKS_PER_INTERVAL = 8
"""Times between two grid points at which the limits are checked."""

STRETCH_MARGIN = 1e-4
"""Fraction by which the motion is slowed down further, for times between the checked ones."""


def time_optimal_path(
    waypoints: ArrayLike,
    *,
    acceleration: ArrayLike,
    velocity: ArrayLike | None = None,
    model: Model | None = None,
) -> Trajectory:
    """Return the fastest motion through `waypoints` (n, nq), n >= 2, from rest at the first to rest at the
    last.

    `velocity` and `acceleration` are limits, one number or (nv,), positive and finite; the default of
    `velocity` is the limit of the `model`. They are never exceeded, and nearly always a velocity or an
    acceleration is close to its limit (within 0.2 % on average, over random waypoints). The acceleration
    jumps. The path is a cubic spline, which may overshoot the waypoints (`dynx.trajectory.check` checks
    position limits). Only for a fixed base.

    Raises NotInstalledError without the extra ``trajectory``, TrajectoryError if no such motion is found,
    ArgumentError for invalid arguments.
    """
    points = checked_waypoints(waypoints)
    configuration("a waypoint", points[0], model)
    ends = Ends(points[0], points[-1], points[-1] - points[0], model)
    if ends.floating is not None:
        raise ArgumentError(f"{ends.floating.name} has a floating base; a path needs a fixed one")
    V, A = velocity_limits(velocity, ends), checked_limit("acceleration", acceleration, ends.nv)
    require_positive_finite("velocity", V, ends)
    require_positive_finite("acceleration", A, ends)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not lengths.all():
        k = int(np.argmin(lengths))
        raise ArgumentError(f"waypoints {k} and {k + 1} are the same; wanted distinct successive waypoints")
    s_points = np.concatenate([[0.0], np.cumsum(lengths)])
    s_points /= s_points[-1]
    law = _motion_law(*_speeds(s_points, points, V, A))
    path = spline_curve(s_points, points)
    motion = _follow(path, law, points)
    return _follow(path, _stretch(law, _stretch_factor(motion, V, A)), points)


def _speeds(s_points: Floats, points: Floats, V: Floats, A: Floats) -> tuple[Floats, Floats]:
    """Return grid points s in [0, 1], and TOPP-RA's ds/dt at each; waypoint k is at `s_points[k]`."""
    try:
        # TOPP-RA's source has invalid escapes, of which Python warns when compiling it.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import toppra
            from toppra.algorithm import TOPPRA
            from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
    except ImportError as error:
        raise NotInstalledError(
            f"time_optimal_path needs TOPP-RA: pip install 'dynx[trajectory]' ({error})"
        ) from error
    parts = np.linspace(0.0, 1.0, GRID_POINTS_PER_SEGMENT, endpoint=False)
    grid = np.append((s_points[:-1, None] + parts * np.diff(s_points)[:, None]).ravel(), 1.0)
    limits: list[Any] = [
        JointVelocityConstraint(np.stack([-V, V], axis=-1)),
        JointAccelerationConstraint(np.stack([-A, A], axis=-1)),
    ]
    path = toppra.SplineInterpolator(s_points, points, bc_type="not-a-knot")
    _, speeds, *_ = TOPPRA(limits, path, gridpoints=grid).compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or not (speeds[:-1] + speeds[1:] > 0.0).all():
        raise TrajectoryError("TOPP-RA finds no motion along the path within the limits")
    return grid, np.asarray(speeds, dtype=np.float64)


def _motion_law(grid: Floats, speeds: Floats) -> PiecewisePolynomial:
    """Return s(t) with constant acceleration between grid points."""
    lengths = np.diff(grid)
    times = np.concatenate([[0.0], np.cumsum(2.0 * lengths / (speeds[:-1] + speeds[1:]))])
    accelerations = (speeds[1:] ** 2 - speeds[:-1] ** 2) / (2.0 * lengths)
    return PiecewisePolynomial(
        times, np.stack([grid[:-1], speeds[:-1], 0.5 * accelerations], axis=-1)[..., None]
    )


def _stretch(law: PiecewisePolynomial, factor: float) -> PiecewisePolynomial:
    """Return the motion law stretched to `factor` times its duration."""
    powers = factor ** np.arange(law.coefficients.shape[1])
    return PiecewisePolynomial(law.breaks * factor, law.coefficients / powers[:, None])


def _follow(path: PiecewisePolynomial, law: PiecewisePolynomial, points: Floats) -> TimeScaledTrajectory:
    """Return the motion that follows the path with the motion law, from rest to rest."""
    T, acceleration = float(law.breaks[-1]), 2.0 * law.coefficients[:, 2]
    start = read_only_setpoint(np.zeros(1), np.zeros(1), acceleration[0])
    end = read_only_setpoint(np.ones(1), np.zeros(1), acceleration[-1])
    time_scaling = DisplacementTrajectory(T, start, end, law)
    return TimeScaledTrajectory(
        T, *end_setpoints(path, time_scaling, points[0], points[-1]), path, time_scaling
    )


def _stretch_factor(motion: Trajectory, V: Floats, A: Floats) -> float:
    """Return the factor by which the motion must be slowed down to respect the limits."""
    knots = motion.knots
    parts = np.linspace(0.0, 1.0, CHECKS_PER_INTERVAL, endpoint=False)
    times = (knots[:-1, None] + parts * np.diff(knots)[:, None]).ravel()
    _, v, a = motion(np.clip(np.concatenate([times, np.nextafter(knots, -1.0)]), 0.0, motion.duration))
    too_fast = float((np.abs(v) / V).max())
    too_sudden = math.sqrt(float((np.abs(a) / A).max()))
    return max(1.0, too_fast, too_sudden) * (1.0 + STRETCH_MARGIN)
