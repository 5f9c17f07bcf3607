"""Time-optimal motion along a smooth path through waypoints, under limits, by TOPP-RA.

The path is a cubic spline q(s), C2, parametrised by arc length in joint space. TOPP-RA finds the largest
speed ds/dt at each of many grid points from which the motion can continue within the limits of velocity and
acceleration (Pham and Pham, A new approach to time-optimal path parameterization based on reachability
analysis, IEEE Trans. Robotics 34(3), 2018). The result is a motion law s(t) of constant acceleration between
the grid points.

Limits of effort are linear in the same unknowns. TOPP-RA respects the limits at the grid points only. They
are checked in between, and the whole motion is slowed down uniformly until it respects them there too.

Along a path q(s) inverse dynamics is tau = a(s) s'' + b(s) s'^2 + d(s) s' + c(s): a and b from the inertia, d
from viscous damping, c from gravity, springs and dry friction (Bobrow, Dubowsky and Gibson, Time-optimal
control of robotic manipulators along specified paths, Int. J. Robotics Research 4(3), 1985).
"""

from __future__ import annotations

import math
import warnings
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.errors import ArgumentError, TrajectoryError, importing
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, read_only_setpoint
from dynx.trajectory.curve import PiecewisePolynomial, TimeScaledTrajectory, end_setpoints
from dynx.trajectory.displacement import DisplacementTrajectory, Ends, configuration
from dynx.trajectory.limit_check import open_backend
from dynx.trajectory.motion_limits import checked_limit, require_positive_finite, velocity_limits
from dynx.trajectory.waypoints import checked_waypoints, spline_curve

NEGLIGIBLE = 1e-12
"""Part of the largest torque of an acceleration below which that of another joint is rounding."""


class PathTorque(NamedTuple):
    """Coefficients (n, nv) of torque along a path [N m or N]: a s'' + b s'^2 + viscous s' + dry + gravity."""

    a: Floats
    b: Floats
    viscous: Floats
    dry: Floats
    gravity: Floats
    """Torque against gravity and springs."""


@dataclass(frozen=True)
class EffortLimits:
    """Limits of the torque of a robot along a path."""

    engine: Backend
    limit: Floats
    """Largest torque or force of each coordinate (nv,) [N m or N]; infinity means no limit."""
    joint_dynamics: bool
    """True if damping, dry friction, armature and springs of the robot description are included."""

    @property
    def is_viscous(self) -> bool:
        """True if damping of the description counts."""
        return self.joint_dynamics and any(joint.dynamics.damping for joint in self.engine.model.joints)

    def along(self, q: Floats, slope: Floats, curvature: Floats) -> PathTorque:
        """Return the torque along a path with these q, dq/ds and d2q/ds2 (n, nv)."""
        rest = np.zeros_like(slope)
        gravity = self.engine.inverse_dynamics(q, rest, rest)
        a = self.engine.inverse_dynamics(q, rest, slope) - gravity
        b = self.engine.inverse_dynamics(q, slope, curvature) - gravity
        if not self.joint_dynamics:
            return PathTorque(a, b, rest, rest, gravity)
        # Viscous torque is linear in the speed, and dry friction depends on its sign alone.
        springs = self._losses(q, rest, rest)
        once, twice = (self._losses(q, k * slope, rest) - springs for k in (1.0, 2.0))
        armature = [self._losses(q, rest, each) - springs for each in (slope, curvature)]
        held = gravity + springs
        return PathTorque(a + armature[0], b + armature[1], twice - once, 2.0 * once - twice, held)

    def _losses(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque (n, nv) of damping, dry friction, armature and springs."""
        whole = self.engine.inverse_dynamics(q, v, a, joint_dynamics=True)
        return np.asarray(whole - self.engine.inverse_dynamics(q, v, a))

    def require_hold(self, torque: PathTorque) -> None:
        """Raise TrajectoryError if a joint cannot bear gravity and dry friction at some place of the path."""
        constant = np.abs(torque.gravity + torque.dry)
        with np.errstate(invalid="ignore"):
            ratio = constant / self.limit
        place, k = np.unravel_index(int(np.argmax(np.nan_to_num(ratio))), ratio.shape)
        if not ratio[place, k] < 1.0:
            # As many digits as tell the need from the limit.
            needed, limit = constant[place, k], self.limit[k]
            digits = next((n for n in (4, 6, 10) if f"{needed:.{n}g}" != f"{limit:.{n}g}"), 6)
            raise TrajectoryError(
                f"the effort limit of {self.engine.model.joint_names[k]} is {limit:.{digits}g}, but gravity "
                f"and dry friction along the path need {needed:.{digits}g}: no motion is slow enough"
            )

    def require_dependence(self, torque: PathTorque) -> None:
        """Raise ArgumentError if no limited torque depends on the acceleration between two grid points."""
        known = np.isfinite(self.limit)
        magnitude = np.abs(torque.a)
        smallest = NEGLIGIBLE * magnitude.max(axis=1, initial=0.0)
        free = (magnitude[:, known] <= smallest[:, None]).all(axis=1)
        unbounded = np.flatnonzero(free[:-1] & free[1:])
        if unbounded.size:
            k = int(np.argmax(magnitude[unbounded[0]]))
            raise ArgumentError(
                f"the effort of {self.engine.model.joint_names[k]} is unlimited, and nothing else limits its "
                "acceleration along the path; wanted acceleration= as well"
            )

    def slowdown(self, q: Floats, v: Floats, a: Floats) -> float:
        """Return the least factor of the duration, at least 1, with which a motion keeps the limits at these
        states (n, nv).

        Raises TrajectoryError if no factor is enough.
        """
        # At 1/u times the duration v is u v and a is u^2 a: as a path with parameter u t.
        torque = self.along(q, v, a)
        # Gravity can be largest between the grid points of TOPP-RA.
        self.require_hold(torque)
        constant = torque.dry + torque.gravity
        with np.errstate(invalid="ignore", divide="ignore"):
            fractions = [
                _least_root(sign * torque.b, sign * torque.viscous, sign * constant - self.limit)
                for sign in (1.0, -1.0)
            ]
        return 1.0 / min(1.0, *(float(each.min(initial=np.inf)) for each in fractions))


def effort_limits(
    effort: bool | ArrayLike, joint_dynamics: bool, ends: Ends, engine: Backend
) -> EffortLimits:
    """Return checked limits: True for those of the model, one number, or (nv,).

    Raises ArgumentError without a model, and TrajectoryError for a limit of 0.
    """
    limit = engine.model.effort_limit if effort is True else checked_limit("effort", effort, ends.nv)
    stuck = np.flatnonzero(~(limit > 0.0))
    if stuck.size:
        raise TrajectoryError(
            f"the limit of effort of {ends.name(int(stuck[0]))} is 0, so that nothing holds or moves it"
        )
    return EffortLimits(engine, np.asarray(limit), joint_dynamics)


def require_model(model: Model | None) -> Model:
    """Raise ArgumentError for limits of effort without a model."""
    if model is None:
        raise ArgumentError("effort is limited for a robot; wanted its model= as well")
    return model


def _least_root(square: Floats, linear: Floats, constant: Floats) -> Floats:
    """Return the least u > 0 at which square u^2 + linear u + constant is 0, where it is negative at u = 0;
    infinity if there is none."""
    discriminant = linear * linear - 4.0 * square * constant
    root = np.sqrt(np.maximum(discriminant, 0.0))
    # The form without cancellation: both roots from the larger sum.
    half = -0.5 * (linear + np.copysign(root, linear))
    candidates = np.stack([half / square, constant / half])
    valid = np.isfinite(candidates) & (candidates > 0.0) & (discriminant >= 0.0)
    return np.asarray(np.where(valid, candidates, np.inf).min(axis=0))


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


@checks_types
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
    for the limits of the `model`, one number or (nv,) [N m or N]. If `joint_dynamics` is True, the torques
    include the joint dynamics of the description. Without `effort`, `acceleration` has to be given. Limits
    are never exceeded, and nearly always one is close to being reached (within 0.2 % on average for velocity
    and acceleration, over random waypoints). The acceleration jumps. The path is a cubic spline, which may
    overshoot the waypoints (`dynx.trajectory.check` checks position limits). Only for a fixed base.

    Raises NotInstalledError without the extra ``trajectory``, TrajectoryError if no such motion is found or a
    joint cannot bear gravity along the path, ArgumentError for invalid arguments and where nothing limits an
    acceleration.
    """
    points = checked_waypoints(waypoints)
    configuration("a waypoint", points[0], model)
    ends = Ends(points[0], points[-1], points[-1] - points[0], model)
    if model is not None and model.floating:
        raise ArgumentError(f"{model.name} has a floating base; a path needs a fixed one")
    if model is not None:
        refuse_ball_joints(model, "a path of waypoints")
    limited = effort is not False
    if acceleration is None and not limited:
        raise ArgumentError("acceleration is None and effort False; wanted a limit of one of them")
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
    needed = "time_optimal_path needs TOPP-RA: pip install 'dynx[trajectory]' ({error})"
    # TOPP-RA's source has invalid escapes, of which Python warns when compiling it.
    with importing(needed), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import toppra
        from toppra.algorithm import TOPPRA
        from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
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
