"""A path and how it is travelled: q(t) = path(s(t))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.errors import ArgumentError, ShapeError
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory, frozen_setpoint
from dynx.trajectory.curve import Curve

_LOOKS = 1000
"""At how many times a law is looked at."""


@dataclass(frozen=True, eq=False, repr=False)
class PacedTrajectory(Trajectory):
    """`path`, a curve in s over [0, 1], travelled as `law`, a trajectory of one coordinate, says."""

    path: Curve
    law: Trajectory

    @property
    def knots(self) -> Floats:
        """The knots of the law; those of the path are C2."""
        return self.law.knots

    def inside(self, t: Floats) -> Setpoint:
        """q, q' ds/dt and q'' (ds/dt)^2 + q' d2s/dt2 (the chain rule)."""
        s, rate, change = self.law.inside(t)
        q, slope, bend = self.path(np.clip(s[:, 0], 0.0, 1.0))
        return Setpoint(q, slope * rate, bend * rate * rate + slope * change)


def paced(path: Curve, law: Trajectory, q0: Floats, q1: Floats) -> tuple[Setpoint, Setpoint]:
    """The setpoints at both ends of a path from q0 to q1 that is travelled by `law`."""
    _, slope, bend = path(np.array([0.0, 1.0]))
    return (
        frozen_setpoint(q0, slope[0] * law.start.v, bend[0] * law.start.v**2 + slope[0] * law.start.a),
        frozen_setpoint(q1, slope[1] * law.end.v, bend[1] * law.end.v**2 + slope[1] * law.end.a),
    )


def checked_law(law: Trajectory) -> Trajectory:
    """A trajectory of one coordinate that goes from 0 to 1 and stays between, or an error."""
    if not isinstance(law, Trajectory):
        raise ArgumentError(f"law is of type {type(law).__name__}; wanted a Trajectory from [0] to [1]")
    if (law.nq, law.nv) != (1, 1):
        raise ShapeError(f"law has nq {law.nq}; wanted a trajectory of one coordinate, from [0] to [1]")
    if law.start.q[0] != 0.0 or law.end.q[0] != 1.0:
        raise ArgumentError(f"law goes from {law.start.q[0]:g} to {law.end.q[0]:g}; wanted from 0 to 1")
    s = law(np.linspace(0.0, law.duration, _LOOKS)).q
    # What rounding makes of 1 is clipped; a law that leaves the path has no position there.
    if s.min() < -1e-12 or s.max() > 1.0 + 1e-12:
        raise ArgumentError(f"law goes from {s.min():g} to {s.max():g}; wanted within 0 and 1")
    return law
