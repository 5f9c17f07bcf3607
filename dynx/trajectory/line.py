"""Straight lines of a frame in space, followed by inverse kinematics.

The frame's origin goes straight, p(s) = p0 + s (p1 - p0), while its axes turn about one axis,
R(s) = R0 exp(s log(R0' R1)), which is Shoemake's slerp (Lynch and Park, Modern Robotics, section 9.2.1).
The configurations are solved for at evenly spaced s, each search beginning at the one before, and
joined by a cubic spline q(s), which is C2. The spline is off the line between: how far is measured by forward
kinematics, and the spacing halved until it is within the bounds.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, ShapeError, TrajectoryError, shown
from dynx.ik import checked_targets
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, pose_error
from dynx.spatial.so3 import quat_exp, quat_from_rotation, quat_log, rotation_from_quat
from dynx.trajectory.base import Trajectory
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.paced import PacedTrajectory, checked_law, paced
from dynx.trajectory.polynomials import quintic
from dynx.trajectory.waypoints import spline_curve

FEWEST, ENOUGH, MOST = 8, 256, 1024
"""Intervals between solutions: to begin with; at which a place that is not reached counts as out of reach;
to give up at."""

SOLVED = 1e-10
"""Errors [m, rad] of each solution: its noise is divided by the square of an interval in the acceleration."""

LEAST = 1e-9
"""Least deviation [m, rad] that can be asked for: some times more than the errors of the solutions."""

BETWEEN = 4
"""Measurements of the deviation in each interval; a cubic is furthest off halfway or near it."""


@dataclass(frozen=True, eq=False, repr=False)
class LineTrajectory(PacedTrajectory):
    """A straight line in space, with how well it is followed."""

    deviation: float
    """Largest distance of the frame's origin from its place on the line [m], as measured."""
    rotation_deviation: float
    """Largest angle of its axes from theirs [rad], as measured; 0 where the rotation is free."""
    intervals: int
    """Pieces of the spline."""


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
    backend: str | Backend = "pinocchio",
) -> LineTrajectory:
    """From `q0` (nq,) with `frame` on a straight line to the pose `target`, T_world_target (4, 4).

    A position (3,) [m] as `target` leaves the rotation free. The search at each place begins at the
    configuration before, so an arm with joints to spare takes the nearest.

    The law of motion along it is from rest to rest by a quintic in `duration` [s], or any trajectory
    `law` of one coordinate from [0] to [1], such as ``trapezoidal([0], [1], velocity=0.5, acceleration=2)``:
    its unit is the length of the line. The frame is at most `deviation` [m] and `rotation_deviation`
    [rad] from where it should be at each moment; what was measured is in the trajectory. Joints that do
    not move the frame stay at q0. Only for a fixed base.

    Raises TrajectoryError with `at`, the part of the way (0 to 1) from which on no configuration within
    limits is found next to the one before, or where the bounds are not met: there the arm is near a
    singularity, or has to change its posture. ArgumentError for what cannot be used.
    """
    path = _Line(model, frame, q0, target, backend)
    if (law is None) == (duration is None):
        raise ArgumentError("wanted either a duration or a law, one of them")
    pace = checked_law(law) if law is not None else quintic([0.0], [1.0], _given(duration))
    for name, bound in (("deviation", deviation), ("rotation_deviation", rotation_deviation)):
        if not (isinstance(bound, int | float | np.number) and LEAST <= bound < np.inf):
            raise ArgumentError(f"{name} is {shown(bound)}; wanted a number, at least {LEAST:g}")
    with path.opened() as engine:
        curve, n, off, turned = _refined(path, engine, deviation, rotation_deviation)
    q1 = curve(np.array([1.0]))[0][0]
    start, end = paced(curve, pace, path.q0, q1)
    return LineTrajectory(pace.duration, start, end, curve, pace, off, turned, n)


def _refined(
    path: _Line, engine: Backend, deviation: float, rotation_deviation: float
) -> tuple[PiecewisePolynomial, int, float, float]:
    """The spline within the bounds, its intervals, and its largest distance and angle from the line."""
    n = FEWEST
    while True:
        try:
            points = path.solved(engine, n)
        except TrajectoryError:
            # Further apart than that, the solution before may be too far away to begin at.
            if n >= ENOUGH:
                raise
            n *= 2
            continue
        curve = spline_curve(np.linspace(0.0, 1.0, n + 1), points)
        s, off, turned = path.deviations(engine, curve)
        excess = np.maximum(off / deviation, turned / rotation_deviation)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            return curve, n, float(off.max()), float(turned.max())
        n *= 2
        if n > MOST:
            raise TrajectoryError(
                f"{shown(path.frame)} leaves the line by {off[worst]:.3g} m and {turned[worst]:.3g} rad at "
                f"{s[worst]:.4f} of the way; near a singularity or a change of posture no smooth motion "
                "of the joints follows it",
                at=float(s[worst]),
            )


class _Line:
    """The straight line itself, and the configurations that follow it."""

    def __init__(
        self, model: Model, frame: str, q0: ArrayLike, target: ArrayLike, engine: str | Backend
    ) -> None:
        if not isinstance(model, Model):
            raise ArgumentError(f"model is of type {type(model).__name__}; wanted a Model")
        if model.floating:
            raise ArgumentError(f"{model.name} has a floating base; a line needs a fixed one")
        if isinstance(engine, Backend) and engine.model != model:
            raise ArgumentError(f"backend is one of {engine.model.name}, not of this model")
        model.frame_index(frame)
        self.model, self.frame = model, frame
        self.q0 = checked_q(model, q0, "q0")
        if self.q0.shape != (model.nq,):
            raise ShapeError(f"q0 has shape {self.q0.shape}; wanted ({model.nq},)")
        goal = checked_targets(target)
        if goal.batch:
            raise ShapeError(f"target has shape {np.shape(target)}; wanted a pose (4, 4) or a position (3,)")
        self._outside()
        self._engine = engine
        self._goal, self._turns = goal.positions, goal.rotations is not None
        with self.opened() as kinematics:
            T = kinematics.forward_kinematics(self.q0, frame)
        self._origin, self._axes = T[:3, 3], T[:3, :3]
        rotation = self._axes if goal.rotations is None else goal.rotations
        self._turn = quat_log(quat_from_rotation(self._axes.T @ rotation))

    def opened(self) -> AbstractContextManager[Backend]:
        """The backend: the caller's own stays open."""
        if isinstance(self._engine, Backend):
            return nullcontext(self._engine)
        return backend(self._engine, self.model)

    def poses(self, s: Floats) -> Floats:
        """T_world_frame (n, 4, 4) on the line at s (n,)."""
        p = self._origin + s[:, None] * (self._goal - self._origin)
        R = self._axes @ rotation_from_quat(quat_exp(s[:, None] * self._turn))
        return homogeneous(R, p)

    def solved(self, engine: Backend, n: int) -> Floats:
        """Configurations (n + 1, nq) at evenly spaced places, from q0 on."""
        places = np.linspace(0.0, 1.0, n + 1)
        found = [self.q0]
        for s, T in zip(places[1:].tolist(), self.poses(places[1:]), strict=True):
            result = engine.inverse_kinematics(
                T if self._turns else T[:3, 3],
                self.frame,
                found[-1],
                position_tolerance=SOLVED,
                rotation_tolerance=SOLVED,
                max_restarts=0,
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
        """Places between the solutions, with the distance [m] and the angle [rad] from the line there."""
        n = len(curve.coefficients)
        s = np.linspace(0.0, 1.0, BETWEEN * n + 1)
        reached = engine.forward_kinematics(curve(s)[0], self.frame)
        off, turned = pose_error(self.poses(s), reached)
        angle = np.linalg.norm(turned, axis=-1) if self._turns else np.zeros(len(s))
        return s, np.linalg.norm(off, axis=-1), angle

    def _outside(self) -> None:
        """Refuse a start outside the limits, to which inverse kinematics would move it."""
        wrong = np.flatnonzero((self.q0 < self.model.lower) | (self.q0 > self.model.upper))
        if wrong.size:
            k = int(wrong[0])
            raise TrajectoryError(
                f"the line begins at {shown(self.model.joint_names[k])} = {self.q0[k]:g}, outside its limits "
                f"{self.model.lower[k]:g} to {self.model.upper[k]:g}",
                at=0.0,
            )


def _given(duration: float | None) -> float:
    assert duration is not None
    return duration
