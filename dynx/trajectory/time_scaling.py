"""A path and its time scaling: q(t) = path(s(t)) (Lynch and Park, Modern Robotics, section 9.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.errors import ArgumentError, ShapeError
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory, read_only_setpoint
from dynx.trajectory.curve import Curve

_LAW_SAMPLES = 1000
"""Number of times at which a motion law is checked."""


@dataclass(frozen=True, eq=False, repr=False)
class TimeScaledTrajectory(Trajectory):
    """`path`, a curve in s over [0, 1], followed with the motion law s(t), a trajectory of one coordinate."""

    path: Curve
    law: Trajectory

    @property
    def knots(self) -> Floats:
        """The knots of the motion law; the path is C2 at its own knots."""
        return self.law.knots

    def inside(self, t: Floats) -> Setpoint:
        """Return q, q' ds/dt and q'' (ds/dt)^2 + q' d2s/dt2 (the chain rule)."""
        s, s_dot, s_ddot = self.law.inside(t)
        q, slope, curvature = self.path(np.clip(s[:, 0], 0.0, 1.0))
        return Setpoint(q, slope * s_dot, curvature * s_dot * s_dot + slope * s_ddot)


def end_setpoints(path: Curve, law: Trajectory, q0: Floats, q1: Floats) -> tuple[Setpoint, Setpoint]:
    """Return the setpoints at both ends of a path from q0 to q1 followed with the motion law `law`."""
    _, slope, curvature = path(np.array([0.0, 1.0]))
    return (
        read_only_setpoint(
            q0, slope[0] * law.start.v, curvature[0] * law.start.v**2 + slope[0] * law.start.a
        ),
        read_only_setpoint(q1, slope[1] * law.end.v, curvature[1] * law.end.v**2 + slope[1] * law.end.a),
    )


def checked_law(law: Trajectory) -> Trajectory:
    """Return `law`; raise an error unless it is a trajectory of one coordinate from 0 to 1, within [0, 1]."""
    if not isinstance(law, Trajectory):
        raise ArgumentError(f"law is of type {type(law).__name__}; wanted a Trajectory from [0] to [1]")
    if (law.nq, law.nv) != (1, 1):
        raise ShapeError(f"law has nq {law.nq}; wanted a trajectory of one coordinate, from [0] to [1]")
    if law.start.q[0] != 0.0 or law.end.q[0] != 1.0:
        raise ArgumentError(f"law goes from {law.start.q[0]:g} to {law.end.q[0]:g}; wanted from 0 to 1")
    s = law(np.linspace(0.0, law.duration, _LAW_SAMPLES)).q
    # Rounding errors are clipped later; a motion law that leaves [0, 1] has no position on the path.
    if s.min() < -1e-12 or s.max() > 1.0 + 1e-12:
        raise ArgumentError(f"law goes from {s.min():g} to {s.max():g}; wanted within 0 and 1")
    return law
