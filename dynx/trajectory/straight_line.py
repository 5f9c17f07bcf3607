"""Straight-line motions of a frame in space, followed by inverse kinematics.

The origin of the frame moves straight, p(s) = p0 + s (p1 - p0), while the frame rotates about one axis,
R(s) = R0 exp(s log(R0' R1)), which is Shoemake's slerp (Lynch and Park, Modern Robotics, section 9.2.1).
Configurations are solved for at evenly spaced s, each search starting at the previous solution, and are
interpolated by a cubic spline q(s), which is C2. Between the solutions the spline deviates from the line: the
deviation is measured by forward kinematics, and the spacing halved until it is within the bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.errors import ArgumentError, ShapeError, TrajectoryError, shown
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.configuration import checked_q
from dynx.model.elements import matrix_of_pair
from dynx.model.numbers import real_array
from dynx.model.targets import checked_targets
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, pose_error
from dynx.spatial.so3 import quat_exp, quat_from_rotation, quat_log, rotation_from_quat
from dynx.time_limit import TimeLimit
from dynx.trajectory.base import Trajectory
from dynx.trajectory.curve import PiecewisePolynomial, TimeScaledTrajectory, checked_law, end_setpoints
from dynx.trajectory.limit_check import open_backend
from dynx.trajectory.rest_to_rest import quintic
from dynx.trajectory.waypoints import spline_curve

MIN_INTERVALS, RELIABLE_INTERVALS, MAX_INTERVALS = 8, 256, 1024
"""Numbers of intervals between solutions: the initial one; the one from which a failure of inverse kinematics
means that the target is out of reach; the largest one tried.
"""

IK_TOLERANCE = 1e-10
"""Tolerance [m, rad] of each solution; in the acceleration, its error is divided by the squared interval."""

MIN_DEVIATION = 1e-9
"""Smallest deviation [m, rad] that may be requested: a few times the errors of the solutions."""

SAMPLES_PER_INTERVAL = 4
"""Number of points per interval at which the deviation is measured; a cubic deviates most near the middle."""


@dataclass(frozen=True, eq=False, repr=False)
class LineTrajectory(TimeScaledTrajectory):
    """A straight-line motion, with its measured deviation from the line."""

    deviation: float
    """Largest measured distance of the frame origin from its position on the line [m]."""
    rotation_deviation: float
    """Largest measured rotation angle from the orientation on the line [rad]; 0 if the rotation is free."""
    intervals: int
    """Number of pieces of the spline."""


@checks_types
def line(
    model: Model,
    frame: str,
    q0: ArrayLike,
    target: ArrayLike,
    duration: float | None = None,
    *,
    law: Trajectory | None = None,
    deviation: float = 1e-5,
    rotation_deviation: float = 1e-5,
    backend: str | Backend = DEFAULT_ENGINE,
    timeout: float | None = None,
) -> LineTrajectory:
    """Return a motion from `q0` (nq,) that moves `frame` on a straight line to the pose `target`.

    `target` is a pose T_world_target (4, 4), or a position (3,) [m], which leaves the rotation free. Each
    search of inverse kinematics starts at the previous configuration. So a redundant arm takes the nearest
    solution. Joints that do not move the frame stay at q0. The base must be fixed.

    The time law s(t) is the fraction of the line that the frame has passed at time t. By default it is a
    quintic from rest to rest in `duration` [s]. You can give any trajectory `law` of one coordinate from [0]
    to [1] instead, such as ``trapezoidal([0], [1], velocity=0.5, acceleration=2)``. The law
    ``cubic([0], [1], T, v0=[1 / T], v1=[1 / T])`` has constant speed.

    The frame deviates at most `deviation` [m] and `rotation_deviation` [rad] from the line at any time. The
    measured deviations are attributes of the trajectory. `Backend.track` follows other paths, given as poses.

    Raises TrajectoryError if dynx finds no configuration within limits near the previous one, or cannot keep
    the bounds on the deviation. The error states the fraction `at` (0 to 1) of the line. There the arm is
    near a singularity, or has to change its posture. Raises TrajectoryError, too, if dynx finds no motion
    within `timeout` [s], and ArgumentError for invalid arguments.
    """
    time_limit = TimeLimit(timeout)
    path = _StraightLine(model, frame, q0, target, backend)
    if law is not None and duration is None:
        motion_law = checked_law(law)
    elif law is None and duration is not None:
        motion_law = quintic([0.0], [1.0], duration)
    else:
        which = "neither duration nor law is given" if law is None else "duration and law are both given"
        raise ArgumentError(f"{which}; wanted either a duration or a law")
    for name, bound in (("deviation", deviation), ("rotation_deviation", rotation_deviation)):
        if not (isinstance(bound, int | float | np.number) and MIN_DEVIATION <= bound < np.inf):
            raise ArgumentError(f"{name} is {shown(bound)}; wanted a number, at least {MIN_DEVIATION:g}")
    with open_backend(backend, model) as engine:
        curve, n, off, angle = _refine(path, engine, deviation, rotation_deviation, time_limit)
    q1 = curve(np.array([1.0]))[0][0]
    start, end = end_setpoints(curve, motion_law, path.q0, q1)
    return LineTrajectory(motion_law.duration, start, end, curve, motion_law, off, angle, n)


def _refine(
    path: _StraightLine, engine: Backend, deviation: float, rotation_deviation: float, time_limit: TimeLimit
) -> tuple[PiecewisePolynomial, int, float, float]:
    """Return the spline within the bounds, its number of intervals, and its distance and angle errors."""
    n = MIN_INTERVALS
    while True:
        try:
            points = path.solve(engine, n, time_limit)
        except TrajectoryError:
            # With fewer intervals, the previous solution may be too far away as a start.
            if n >= RELIABLE_INTERVALS or time_limit.is_over():
                raise
            n *= 2
            continue
        curve = spline_curve(np.linspace(0.0, 1.0, n + 1), points)
        s, off, angle = path.deviations(engine, curve)
        excess = np.maximum(off / deviation, angle / rotation_deviation)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            return curve, n, float(off.max()), float(angle.max())
        n *= 2
        if n > MAX_INTERVALS:
            raise TrajectoryError(
                f"{shown(path.frame)} leaves the line by {off[worst]:.3g} m and {angle[worst]:.3g} rad at "
                f"{s[worst]:.4f} of the way; near a singularity or a change of posture no smooth "
                "joint motion follows it",
                at=float(s[worst]),
            )


class _StraightLine:
    """The straight line, and the configurations that follow it."""

    def __init__(
        self, model: Model, frame: str, q0: ArrayLike, target: ArrayLike, engine: str | Backend
    ) -> None:
        if model.floating:
            raise ArgumentError(f"{model.name} has a floating base; a line needs a fixed one")
        refuse_ball_joints(model, "a straight line")
        if isinstance(engine, Backend) and engine.model != model:
            raise ArgumentError(f"backend is one of {engine.model.name}, not of this model")
        model.frame_index(frame)
        self.model, self.frame = model, frame
        self.q0 = checked_q(model, q0, "q0")
        if self.q0.shape != (model.nq,):
            raise ShapeError(f"q0 has shape {self.q0.shape}; wanted ({model.nq},)")
        goal = real_array("target", matrix_of_pair(target, "target"))
        if goal.shape not in ((4, 4), (3,)):
            raise ShapeError(f"target has shape {goal.shape}; wanted a pose (4, 4) or a position (3,)")
        targets = checked_targets(goal)
        assert targets.positions is not None
        self._require_start_within_limits()
        self._target_position, self._has_rotation = targets.positions, targets.rotations is not None
        with open_backend(engine, model) as kinematics:
            T = kinematics.forward_kinematics(self.q0, frame)
        self._start_position, self._start_rotation = T[:3, 3], T[:3, :3]
        rotation = self._start_rotation if targets.rotations is None else targets.rotations
        self._rotation_vector = quat_log(quat_from_rotation(self._start_rotation.T @ rotation))

    def poses(self, s: Floats) -> Floats:
        """Return T_world_frame (n, 4, 4) on the line at s (n,)."""
        p = self._start_position + s[:, None] * (self._target_position - self._start_position)
        R = self._start_rotation @ rotation_from_quat(quat_exp(s[:, None] * self._rotation_vector))
        return homogeneous(R, p)

    def solve(self, engine: Backend, n: int, time_limit: TimeLimit) -> Floats:
        """Return configurations (n + 1, nq) at evenly spaced s, starting with q0."""
        fractions = np.linspace(0.0, 1.0, n + 1)
        found = [self.q0]
        for s, T in zip(fractions[1:].tolist(), self.poses(fractions[1:]), strict=True):
            result = engine.inverse_kinematics(
                T if self._has_rotation else T[:3, 3],
                self.frame,
                found[-1],
                position_tolerance=IK_TOLERANCE,
                rotation_tolerance=IK_TOLERANCE,
                max_restarts=0,
                timeout=time_limit.left(),
            )
            if time_limit.is_over():
                raise TrajectoryError(
                    f"the search for a motion of {shown(self.frame)} along the line was "
                    f"{time_limit.sentence}, at {s:.4f} of the way",
                    at=s,
                )
            if not result.success:
                x, y, z = T[:3, 3]
                raise TrajectoryError(
                    f"{shown(self.frame)} cannot follow the line beyond {s - 1.0 / n:.4f} of the way, before "
                    f"({x:.4f}, {y:.4f}, {z:.4f}) m: inverse kinematics is {result.message}",
                    at=s - 1.0 / n,
                )
            found.append(result.q)
        return np.array(found)

    def deviations(self, engine: Backend, curve: PiecewisePolynomial) -> tuple[Floats, Floats, Floats]:
        """Return s at and between the solutions, and the distance [m] and angle [rad] from the line."""
        n = len(curve.coefficients)
        s = np.linspace(0.0, 1.0, SAMPLES_PER_INTERVAL * n + 1)
        reached = engine.forward_kinematics(curve(s)[0], self.frame)
        off, angle = pose_error(self.poses(s), reached)
        angle = np.linalg.norm(angle, axis=-1) if self._has_rotation else np.zeros(len(s))
        return s, np.linalg.norm(off, axis=-1), angle

    def _require_start_within_limits(self) -> None:
        """Raise TrajectoryError if q0 is outside the limits, into which inverse kinematics would move it."""
        wrong = np.flatnonzero((self.q0 < self.model.lower) | (self.q0 > self.model.upper))
        if wrong.size:
            k = int(wrong[0])
            raise TrajectoryError(
                f"the line begins at {shown(self.model.joint_names[k])} = {self.q0[k]:g}, outside its limits "
                f"{self.model.lower[k]:g} to {self.model.upper[k]:g}",
                at=0.0,
            )
