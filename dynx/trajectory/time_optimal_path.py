"""Time-optimal motion along a smooth path through waypoints, under limits, by TOPP-RA.

The path is a cubic spline q(s), C2, parametrised by arc length in joint space. TOPP-RA finds the largest
speed ds/dt at each of many grid points from which the motion can continue within the limits of velocity and
acceleration (Pham and Pham, A new approach to time-optimal path parameterization based on reachability
analysis, IEEE Trans. Robotics 34(3), 2018). The result is a motion law s(t) of constant acceleration between
the grid points.

Limits of effort are linear in the same unknowns (`dynx.trajectory.path_effort`). TOPP-RA respects the limits
at the grid points only. They are checked in between, and the whole motion is slowed down uniformly by as much
as needed.
"""

from __future__ import annotations

import math
import warnings
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.errors import ArgumentError, NotInstalledError, TrajectoryError
from dynx.model import Model
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, read_only_setpoint
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.displacement import DisplacementTrajectory, Ends, configuration
from dynx.trajectory.limit_check import open_backend
from dynx.trajectory.motion_limits import checked_limit, require_positive_finite, velocity_limits
from dynx.trajectory.path_effort import EffortLimits, effort_limits, require_model
from dynx.trajectory.time_scaling import TimeScaledTrajectory, end_setpoints
from dynx.trajectory.waypoints import checked_waypoints, spline_curve

GRID_POINTS_PER_SEGMENT = 100
"""Grid points of TOPP-RA from one waypoint to the next."""

CHECKS_PER_INTERVAL = 8
"""Times between two grid points at which the limits are checked."""

DAMPING_PASSES = 4
"""Number of runs of TOPP-RA with viscous damping, each with the damping near the speeds of the motion before.

Damping is concave in the square of the speed, so that a tangent is nowhere below it: with the tangents at a
motion within the limits TOPP-RA finds no slower one where the effort acts against damping.
"""

MIN_DAMPED_SPEED = 0.05
"""Least speed, relative to the largest along the path, at whose tangent viscous damping is taken."""

STRETCH_MARGIN = 1e-4
"""Fraction by which the motion is slowed down further, for times between the checked ones."""


def time_optimal_path(
    waypoints: ArrayLike,
    *,
    acceleration: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    effort: bool | ArrayLike = False,
    joint_dynamics: bool = False,
    model: Model | None = None,
    backend: str | Backend = DEFAULT_ENGINE,
) -> Trajectory:
    """Return the fastest motion through `waypoints` (n, nq), n >= 2, from rest at the first to rest at the
    last.

    `velocity` and `acceleration` are limits, one number or (nv,), positive and finite; the default of
    `velocity` is the limit of the `model`. `effort` limits the torques of inverse dynamics by `backend`: True
    for the limits of the `model`, one number or (nv,) [N m or N], with damping, dry friction and armature of
    the description if `joint_dynamics` is True; without it, `acceleration` has to be given. Limits are never
    exceeded, and nearly always one is close to being reached (within 0.2 % on average for velocity and
    acceleration, over random waypoints). The acceleration jumps. The path is a cubic spline, which may
    overshoot the waypoints (`dynx.trajectory.check` checks position limits). Only for a fixed base.

    Raises NotInstalledError without the extra ``trajectory``, TrajectoryError if no such motion is found or a
    joint cannot bear gravity along the path, ArgumentError for invalid arguments and where nothing limits an
    acceleration.
    """
    points = checked_waypoints(waypoints)
    configuration("a waypoint", points[0], model)
    ends = Ends(points[0], points[-1], points[-1] - points[0], model)
    if ends.floating is not None:
        raise ArgumentError(f"{ends.floating.name} has a floating base; a path needs a fixed one")
    limited = effort is not False
    if acceleration is None and not limited:
        raise ArgumentError("neither acceleration nor effort is limited; wanted one of them")
    V = velocity_limits(velocity, ends)
    require_positive_finite("velocity", V, ends)
    if acceleration is None:
        A = np.full(ends.nv, np.inf)
    else:
        A = checked_limit("acceleration", acceleration, ends.nv)
        require_positive_finite("acceleration", A, ends)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not lengths.all():
        k = int(np.argmin(lengths))
        raise ArgumentError(f"waypoints {k} and {k + 1} are the same; wanted distinct successive waypoints")
    s_points = np.concatenate([[0.0], np.cumsum(lengths)])
    s_points /= s_points[-1]
    path = spline_curve(s_points, points)
    with open_backend(backend, require_model(model)) if limited else nullcontext() as engine:
        efforts = None if engine is None else effort_limits(effort, joint_dynamics, ends, engine)
        best, speeds = None, None
        for _ in range(DAMPING_PASSES if efforts is not None and efforts.is_viscous else 1):
            try:
                grid, speeds = _speeds(s_points, points, V, A, efforts, speeds)
            except TrajectoryError:
                # Away from their speeds the tangents exceed the damping, and may leave no motion.
                if best is None:
                    raise
                break
            law = _motion_law(grid, speeds)
            factor = _stretch_factor(_follow(path, law, points), V, A, efforts)
            law, speeds = _stretch(law, factor), speeds / factor
            best = law if best is None or law.breaks[-1] < best.breaks[-1] else best
        assert best is not None
        return _follow(path, best, points)


def _speeds(
    s_points: Floats,
    points: Floats,
    V: Floats,
    A: Floats,
    efforts: EffortLimits | None,
    damped_at: Floats | None,
) -> tuple[Floats, Floats]:
    """Return grid points s in [0, 1], and TOPP-RA's ds/dt at each; waypoint k is at `s_points[k]`.

    Viscous damping is that near the speeds `damped_at` of the grid points.
    """
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
    limits: list[Any] = [JointVelocityConstraint(np.stack([-V, V], axis=-1))]
    unlimited = not np.isfinite(A).all()
    if not unlimited:
        limits.append(JointAccelerationConstraint(np.stack([-A, A], axis=-1)))
    if efforts is not None and (unlimited or np.isfinite(efforts.limit).any()):
        limits.append(_effort_constraint(efforts, damped_at, unlimited))
    path = toppra.SplineInterpolator(s_points, points, bc_type="not-a-knot")
    _, speeds, *_ = TOPPRA(limits, path, gridpoints=grid).compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or not (speeds[:-1] + speeds[1:] > 0.0).all():
        raise TrajectoryError("TOPP-RA finds no motion along the path within the limits")
    return grid, np.asarray(speeds, dtype=np.float64)


def _effort_constraint(efforts: EffortLimits, damped_at: Floats | None, alone: bool) -> Any:
    """Return TOPP-RA's constraint on the torque along the path; `alone` if nothing else limits accelerations.

    It is linear in the square of ds/dt. Viscous damping, which is linear in ds/dt, is replaced by its tangent
    at the speeds `damped_at`, and left out without them.
    """
    from toppra.constraint import DiscretizationType, LinearConstraint
    from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate

    known = np.isfinite(efforts.limit)

    class EffortConstraint(LinearConstraint):  # type: ignore[misc]  # toppra has no types
        """Torque within its limits."""

        def __init__(self) -> None:
            super().__init__()
            self.discretization_type = DiscretizationType.Interpolation
            self.identical = True

        def get_dof(self) -> int:
            return len(efforts.limit)

        def compute_constraint_params(self, path: Any, gridpoints: Floats, *_: Any, **__: Any) -> Any:
            q, slope, curvature = (np.asarray(path(gridpoints, order)) for order in (0, 1, 2))
            torque = efforts.along(q, slope, curvature)
            # The motion ends at rest, where dry friction no longer helps to brake.
            torque.dry[-1] = 0.0
            efforts.require_hold(torque)
            if alone:
                efforts.require_dependence(torque)
            if damped_at is not None:
                speed = np.maximum(damped_at, MIN_DAMPED_SPEED * damped_at.max())[:, None]
                torque = torque._replace(
                    b=torque.b + 0.5 * torque.viscous / speed,
                    gravity=torque.gravity + 0.5 * torque.viscous * speed,
                )
            size = int(known.sum())
            F = np.concatenate([np.eye(size), -np.eye(size)])
            g = np.tile(efforts.limit[known], 2)
            a, b, c = (each[:, known] for each in (torque.a, torque.b, torque.dry + torque.gravity))
            return canlinear_colloc_to_interpolate(a, b, c, F, g, None, None, gridpoints, identical=True)

    return EffortConstraint()


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


def _stretch_factor(motion: Trajectory, V: Floats, A: Floats, efforts: EffortLimits | None) -> float:
    """Return the factor by which the motion must be slowed down to respect the limits."""
    knots = motion.knots
    parts = np.linspace(0.0, 1.0, CHECKS_PER_INTERVAL, endpoint=False)
    times = (knots[:-1, None] + parts * np.diff(knots)[:, None]).ravel()
    times = np.concatenate([times, np.nextafter(knots, -1.0), knots[-1:]])
    q, v, a = motion(np.clip(times, 0.0, motion.duration))
    too_fast = float((np.abs(v) / V).max())
    too_sudden = math.sqrt(float((np.abs(a) / A).max()))
    too_strong = 1.0 if efforts is None else efforts.slowdown(q, v, a)
    return max(1.0, too_fast, too_sudden, too_strong) * (1.0 + STRETCH_MARGIN)
