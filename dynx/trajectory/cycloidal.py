"""Cycloidal motion from rest to rest, with a sinusoidal acceleration that is 0 at both ends.

    s(t) = t/T - sin(2 pi t/T) / (2 pi),   0 <= t <= T

(Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, section 2.2.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, checked_duration, read_only
from dynx.trajectory.curve import Curve
from dynx.trajectory.displacement import checked_ends


def cycloidal(q0: ArrayLike, q1: ArrayLike, duration: float, *, model: Model | None = None) -> Trajectory:
    """Return the cycloidal motion from rest at `q0` to rest at `q1` (nq,) in `duration` [s]:

        q = q0 + (q1 - q0) (t/T - sin(2 pi t/T) / (2 pi))

    The largest speed is 2 (q1 - q0) / T, at T/2; the largest acceleration 2 pi (q1 - q0) / T^2, at T/4 and
    3T/4. A robot with a floating base needs its `model`: the base moves along one screw axis, and v, a are in
    its axes. The quaternion of q1 may be returned with the opposite sign, which is the same orientation.

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
